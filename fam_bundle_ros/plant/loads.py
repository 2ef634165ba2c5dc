# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What the bundle pulls on: a dynamometer, a mass with gravity and springs, a forearm.

A load is a frozen description; its motion is a tuple of floats that starts with the bundle's
strain and strain rate (1, 1/s; positive when shorter), so that one load serves many rigs. The
integrator of the rig moves positions with the present speeds (`drift`) and then speeds with the
forces at the new positions (`kick`): symplectic, so that springs neither gain nor lose energy.
``length`` is the bundle's rest length in m throughout.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
import math

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant.checks import require

GRAVITY = 9.80665

#: Strain, strain rate, and what else the load needs.
Motion = tuple[float, ...]


class Load(ABC):
    """What every load answers."""

    @abstractmethod
    def start(self, length: float) -> Motion:
        """Return the motion at rest that the load begins with."""

    @abstractmethod
    def drift(self, motion: Motion, dt: float, length: float) -> Motion:
        """Return the motion with its positions moved by ``dt`` at the present speeds."""

    @abstractmethod
    def kick(self, motion: Motion, dt: float, force: float, length: float) -> Motion:
        """Return the motion with its speeds after ``dt`` under the bundle's ``force`` (N)."""

    @abstractmethod
    def holding_force(self, strain: float, length: float) -> float:
        """Return the bundle force, N, that holds the load still at a strain (nan: any)."""

    @abstractmethod
    def stiffness(self, strain: float, length: float) -> float:
        """Return d(holding force)/d(strain), N: what a strain loop sees of the load at rest."""

    @abstractmethod
    def inertia(self, strain: float, length: float) -> float:
        """Return force per strain acceleration, N s^2: what a strain loop sees in motion."""

    @abstractmethod
    def drag(self, length: float) -> float:
        """Return the load's own viscous force per strain rate, N s."""


@dataclass(frozen=True)
class Dynamometer(Load):
    """
    A test machine that imposes the strain, whatever the force.

    Parameters
    ----------
    strain : float
        Where it starts.
    speed : float, 1/s
        Largest strain rate, used where `Rig.impose_strain` names none.
    """

    strain: float = 0.0
    speed: float = 1.0

    def __post_init__(self):
        require(self, 'strain', least=-0.15, most=0.5)
        require(self, 'speed', above=0.0)

    def start(self, length: float) -> Motion:
        """Return (strain, strain rate, target, speed)."""
        return (self.strain, 0.0, self.strain, self.speed)

    def impose(self, motion: Motion, strain: float, speed: float | None = None) -> Motion:
        """
        Return the motion with a new target, to be reached at a strain rate of size ``speed``.

        Raises
        ------
        InputError
            For a target outside -0.15..0.5 or a speed that is not positive.
        """
        speed = self.speed if speed is None else abs(speed)
        if not -0.15 <= strain <= 0.5:
            raise InputError(f'imposed strain is {strain!r}; expected between -0.15 and 0.5')
        if not 0.0 <= speed < math.inf:
            raise InputError(f'imposed strain rate is {speed!r} 1/s; expected a finite number')
        return (motion[0], motion[1], float(strain), float(speed))

    def drift(self, motion: Motion, dt: float, length: float) -> Motion:
        """Move towards the target; the rate is what was really moved over the step."""
        strain, _, target, speed = motion
        step = max(-speed * dt, min(speed * dt, target - strain))
        return (strain + step, step / dt, target, speed)

    def kick(self, motion: Motion, dt: float, force: float, length: float) -> Motion:
        """Return the motion unchanged: the machine is stronger."""
        return motion

    def holding_force(self, strain: float, length: float) -> float:
        """Return nan: a test machine holds any force."""
        return math.nan

    def stiffness(self, strain: float, length: float) -> float:
        """Return infinity."""
        return math.inf

    def inertia(self, strain: float, length: float) -> float:
        """Return infinity."""
        return math.inf

    def drag(self, length: float) -> float:
        """Return 0: what the machine loses is its own affair."""
        return 0.0


class _OneBody(Load):
    """A load with one degree of freedom, described by forces along the bundle."""

    stops: tuple[float, float]

    def start(self, length: float) -> Motion:
        """Return (strain, strain rate): at rest on the lower end stop."""
        return (self.stops[0], 0.0)

    def drift(self, motion: Motion, dt: float, length: float) -> Motion:
        """Move, and come to rest at an end stop (which swallows the blow)."""
        strain, rate = motion[0] + dt * motion[1], motion[1]
        low, high = self.stops
        if strain <= low:
            strain, rate = low, max(rate, 0.0)
        elif strain >= high:
            strain, rate = high, min(rate, 0.0)
        return (strain, rate) + motion[2:]

    def kick(self, motion: Motion, dt: float, force: float, length: float) -> Motion:
        """Accelerate; the own damping is taken implicitly, so that any size of it is stable."""
        strain, rate = motion[0], motion[1]
        inertia = self.inertia(strain, length)
        rate = ((rate + dt * (force - self.holding_force(strain, length)) / inertia)
                / (1.0 + dt * self.drag(length) / inertia))
        return (strain, self._against_stop(strain, rate)) + motion[2:]

    def _against_stop(self, strain: float, rate: float) -> float:
        if strain <= self.stops[0]:
            return max(rate, 0.0)
        if strain >= self.stops[1]:
            return min(rate, 0.0)
        return rate


@dataclass(frozen=True)
class MassSpring(_OneBody):
    """
    A mass hanging from (or lying before) the bundle, with a spring against the pull.

    mass x'' = F - mass gravity - stiffness (x - rest) - damping x', x the contraction in m.

    Parameters
    ----------
    mass : float, kg
    stiffness_against : float, N/m
        Spring that resists the contraction; 0 for none.
    spring_rest : float, m
        Contraction at which that spring is free.
    damping : float, N s/m
        Of the guide.
    gravity : float, m/s^2
        0 for a mass that slides on a level track.
    stops : (float, float)
        Strains at the end stops; the mass starts on the lower one.
    """

    mass: float = 5.0
    stiffness_against: float = 0.0
    spring_rest: float = 0.0
    damping: float = 5.0
    gravity: float = GRAVITY
    stops: tuple[float, float] = (0.0, 0.3)

    def __post_init__(self):
        require(self, 'mass', above=0.0)
        require(self, 'stiffness_against', 'damping', 'gravity', least=0.0)
        require(self, 'spring_rest')
        _check_stops(self)

    def holding_force(self, strain: float, length: float) -> float:
        """Return weight and spring force at a strain, N."""
        return (self.mass * self.gravity
                + self.stiffness_against * (strain * length - self.spring_rest))

    def stiffness(self, strain: float, length: float) -> float:
        """Return the spring's stiffness per strain, N."""
        return self.stiffness_against * length

    def inertia(self, strain: float, length: float) -> float:
        """Return mass times length, N s^2."""
        return self.mass * length

    def drag(self, length: float) -> float:
        """Return the guide's damping times length, N s."""
        return self.damping * length


@dataclass(frozen=True)
class SeriesSpringMass(_OneBody):
    """
    A mass that the bundle pulls through a spring (a tendon, a compliant limb).

    The bundle's end fitting has a mass of its own: without it the spring would tie the force to
    the strain by an algebraic equation, which no real rig does.

    Parameters
    ----------
    mass : float, kg
    stiffness_series : float, N/m
    stiffness_against : float, N/m
        Spring between the mass and the ground; 0 for none.
    fitting_mass : float, kg
    damping : float, N s/m
        Of the guide of each of the two masses.
    spring_damping : float, N s/m
        Inside the series spring.
    gravity : float, m/s^2
    stops : (float, float)
        Strains at the end stops of the fitting.
    floor : float, m
        Position of the mass, counted like the contraction, below which it rests on its support.
    """

    mass: float = 5.0
    stiffness_series: float = 10e3
    stiffness_against: float = 0.0
    fitting_mass: float = 0.2
    damping: float = 5.0
    spring_damping: float = 10.0
    gravity: float = GRAVITY
    stops: tuple[float, float] = (0.0, 0.3)
    floor: float = 0.0

    def __post_init__(self):
        require(self, 'mass', 'stiffness_series', 'fitting_mass', above=0.0)
        require(self, 'stiffness_against', 'damping', 'spring_damping', 'gravity', least=0.0)
        require(self, 'floor')
        _check_stops(self)

    def start(self, length: float) -> Motion:
        """Return (strain, strain rate, mass position in m, mass speed in m/s): all at rest."""
        return (self.stops[0], 0.0, self.floor, 0.0)

    def drift(self, motion: Motion, dt: float, length: float) -> Motion:
        """Move the fitting and the mass."""
        strain, rate, place, speed = super().drift(motion, dt, length)
        place += dt * speed
        if place <= self.floor:
            place, speed = self.floor, max(speed, 0.0)
        return (strain, rate, place, speed)

    def kick(self, motion: Motion, dt: float, force: float, length: float) -> Motion:
        """Accelerate both masses; the spring pulls only (a tendon goes slack)."""
        strain, rate, place, speed = motion
        stretch = strain * length - place
        pull = self.stiffness_series * stretch
        pull = max(pull + self.spring_damping * (rate * length - speed), 0.0) if pull > 0 else 0.0
        rate = ((rate * length + dt * (force - pull) / self.fitting_mass)
                / (1.0 + dt * self.damping / self.fitting_mass)) / length
        load = self.mass * self.gravity + self.stiffness_against * place
        speed = ((speed + dt * (pull - load) / self.mass)
                 / (1.0 + dt * self.damping / self.mass))
        if place <= self.floor:
            speed = max(speed, 0.0)
        return (strain, self._against_stop(strain, rate), place, speed)

    def holding_force(self, strain: float, length: float) -> float:
        """Return the spring's pull with the mass at rest, on its support or in the air, N."""
        weight = self.mass * self.gravity
        on_support = self.stiffness_series * (strain * length - self.floor)
        lifted = self.stiffness_series * (
            weight + self.stiffness_against * strain * length
        ) / (self.stiffness_series + self.stiffness_against)
        return max(0.0, min(on_support, lifted))

    def stiffness(self, strain: float, length: float) -> float:
        """Return the stiffness of the two springs in series, N; of one while the mass rests."""
        k, ground = self.stiffness_series, self.stiffness_against
        weight = self.mass * self.gravity + ground * self.floor
        if k * (strain * length - self.floor) < weight:
            return k * length if strain * length > self.floor else 0.0
        return k * ground / (k + ground) * length

    def inertia(self, strain: float, length: float) -> float:
        """Return the inertia of fitting and mass moving together, N s^2."""
        return (self.mass + self.fitting_mass) * length

    def drag(self, length: float) -> float:
        """Return the guide's damping times length, N s."""
        return self.damping * length


@dataclass(frozen=True)
class Arm(_OneBody):
    """
    A forearm on a joint that the bundle turns over a pulley.

    inertia a'' = F moment_arm - mass gravity centre sin(a) - damping a', with the angle a from
    hanging straight down: a = rest_angle + contraction/moment_arm.

    Parameters
    ----------
    moment_of_inertia : float, kg m^2
        About the joint, load in the hand included.
    mass : float, kg
        Of forearm and load.
    centre : float, m
        Distance of the centre of mass from the joint.
    moment_arm : float, m
    rest_angle : float, rad
        Angle at zero strain.
    damping : float, N m s/rad
    gravity : float, m/s^2
    stops : (float, float)
        Strains at the joint's end stops.
    """

    moment_of_inertia: float = 0.06
    mass: float = 1.5
    centre: float = 0.18
    moment_arm: float = 0.03
    rest_angle: float = 0.35
    damping: float = 0.05
    gravity: float = GRAVITY
    stops: tuple[float, float] = (0.0, 0.3)

    def __post_init__(self):
        require(self, 'moment_of_inertia', 'mass', 'centre', 'moment_arm', above=0.0)
        require(self, 'damping', 'gravity', least=0.0)
        require(self, 'rest_angle')
        _check_stops(self)

    def angle(self, strain: float, length: float) -> float:
        """Return the joint's angle from hanging straight down, rad."""
        return self.rest_angle + strain * length / self.moment_arm

    def holding_force(self, strain: float, length: float) -> float:
        """Return the gravity torque over the moment arm, N."""
        torque = self.mass * self.gravity * self.centre * math.sin(self.angle(strain, length))
        return torque / self.moment_arm

    def stiffness(self, strain: float, length: float) -> float:
        """Return the change of the gravity torque's force with strain, N."""
        return (self.mass * self.gravity * self.centre * length / self.moment_arm ** 2
                * math.cos(self.angle(strain, length)))

    def inertia(self, strain: float, length: float) -> float:
        """Return the moment of inertia as felt along the bundle, N s^2."""
        return self.moment_of_inertia * length / self.moment_arm ** 2

    def drag(self, length: float) -> float:
        """Return the joint's damping as felt along the bundle, N s."""
        return self.damping * length / self.moment_arm ** 2


def _check_stops(load: _OneBody) -> None:
    low, high = load.stops
    if not -0.15 <= low < high <= 0.5:
        raise InputError(f'{type(load).__name__}.stops is {load.stops!r}; '
                         'expected two strains that rise, between -0.15 and 0.5')
