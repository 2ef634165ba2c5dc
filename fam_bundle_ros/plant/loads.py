# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Loads of the bundle: a dynamometer, a mass with gravity and springs, a forearm.

A load is a frozen description and `LoadState` its state, so that one load can be used by many
rigs. The equations of motion are kernels (`fam_bundle_ros.kernels`) on one record for all kinds,
`LoadRecord`: positions change with the speeds (`drift`), speeds with the forces (`kick`).
``length`` is the bundle's rest length in m throughout; strain is positive when shorter.
"""

from abc import ABC
from dataclasses import dataclass, fields
import math
from typing import Any, ClassVar

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant.checks import require

GRAVITY = 9.80665
#: Strains that any load may reach.
_WIDEST = (-0.15, 0.5)
#: Kinds of loads, as `LoadRecord.kind` has them.
DYNAMOMETER, MASS_SPRING, SERIES_SPRING_MASS, ARM = range(4)


@dataclass
class LoadState:
    """Position and speed of a load."""

    #: 1 and 1/s.
    strain: float
    strain_rate: float = 0.0
    #: Target strain of a dynamometer, and the size of its strain rate, 1/s.
    target: float = 0.0
    speed: float = 0.0
    #: m and m/s: position and speed of the mass behind a series spring, signed as the contraction.
    place: float = 0.0
    place_rate: float = 0.0
    #: Accelerations of strain (1/s^2) and place (m/s^2) in the last kick.
    acceleration: float = 0.0
    place_acceleration: float = 0.0


@dataclass
class LoadRecord:
    """Parameters of any load for kernels; 0 where its kind has none."""

    kind: int
    #: Lower and upper end stop.
    low: float = 0.0
    high: float = 0.0
    mass: float = 0.0
    damping: float = 0.0
    gravity: float = 0.0
    stiffness_against: float = 0.0
    spring_rest: float = 0.0
    stiffness_series: float = 0.0
    fitting_mass: float = 0.0
    spring_damping: float = 0.0
    floor: float = 0.0
    moment_of_inertia: float = 0.0
    centre: float = 0.0
    moment_arm: float = 0.0
    rest_angle: float = 0.0


# --- kernels -----------------------------------------------------------------------------------

def drift(load: Any, motion: Any, dt: float, past: float) -> None:
    """
    Move the positions by ``dt`` at the present speeds, in place.

    A dynamometer moves towards its target; its rate is that of the actual motion. A mass that
    reaches an end stop or a floor stops there (`land`). ``past`` (s) is the part of ``dt`` that
    belongs to the last kick; the rest belongs to the next one.
    """
    if load.kind == DYNAMOMETER:
        most = motion.speed * dt
        step = max(-most, min(most, motion.target - motion.strain))
        motion.strain += step
        motion.strain_rate = step / dt
        return
    motion.strain += dt * motion.strain_rate
    if motion.strain < load.low:
        motion.strain_rate = land(motion.strain - load.low, motion.strain_rate,
                                  max(motion.acceleration, 0.0), dt, past)
        motion.strain = load.low
    elif motion.strain > load.high:
        motion.strain_rate = land(motion.strain - load.high, motion.strain_rate,
                                  min(motion.acceleration, 0.0), dt, past)
        motion.strain = load.high
    if load.kind == SERIES_SPRING_MASS:
        motion.place += dt * motion.place_rate
        if motion.place < load.floor:
            motion.place_rate = land(motion.place - load.floor, motion.place_rate,
                                     max(motion.place_acceleration, 0.0), dt, past)
            motion.place = load.floor


def land(beyond: float, speed: float, acceleration: float, dt: float, past: float) -> float:
    """
    Return the speed after an inelastic impact at a stop, which the drift passed by ``beyond``.

    Forces away from the stop act from the time of the impact on: the part of the last kick before
    it is lost in the impact, and the excess of the next kick is subtracted here. Without this
    correction the impact would be first order in ``dt``.

    Parameters
    ----------
    beyond, speed : float
        Distance beyond the stop, and speed: of the strain (1, 1/s) or of a mass (m, m/s).
    acceleration : float
        Away from the stop in the last kick, else 0.
    dt, past : float, s
        As for `drift`.
    """
    arrival = dt - min(beyond / speed, dt)
    return acceleration * (past - arrival)


def kick(load: Any, motion: Any, dt: float, force: float, length: float) -> tuple[float, float]:
    """
    Return (strain rate, speed of the mass behind a spring) after ``dt`` under a constant force.

    Implicit in the load's own damping (backward Euler), hence stable for any damping. The force,
    N, is that of the bundle, which has a length, m.
    """
    rate, place_rate = motion.strain_rate, motion.place_rate
    if load.kind == DYNAMOMETER:
        return rate, place_rate
    if load.kind == SERIES_SPRING_MASS:
        rate, place_rate = kick_through_spring(load, motion, dt, force, length)
    else:
        mass = inertia(load, length)
        rate = ((rate + dt * (force - holding_force(load, motion.strain, length)) / mass)
                / (1.0 + dt * drag(load, length) / mass))
    if motion.strain <= load.low:
        rate = max(rate, 0.0)
    elif motion.strain >= load.high:
        rate = min(rate, 0.0)
    return rate, place_rate


def kick_through_spring(load: Any, motion: Any, dt: float, force: float, length: float,
                        ) -> tuple[float, float]:
    """
    Return `kick` of a fitting (speed u) that pulls a mass (speed w) through a spring.

    m_f u' = F - S - c u, m w' = S - W - c w; S = k x + c_s (u - w) where the spring is stretched
    by x > 0 and S > 0, else 0 (a tendon goes slack); W the weight and the spring against.
    """
    near, far = dt / load.fitting_mass, dt / load.mass
    stretch = motion.strain * length - motion.place
    weight = load.mass * load.gravity + load.stiffness_against * motion.place
    u, w = motion.strain_rate * length + near * force, motion.place_rate - far * weight
    c, s = load.damping, load.spring_damping
    slack_u, slack_w = u / (1.0 + near * c), w / (1.0 + far * c)
    if stretch > 0.0:
        pull = load.stiffness_series * stretch
        u, w = u - near * pull, w + far * pull
        a, d = 1.0 + near * (c + s), 1.0 + far * (c + s)
        det = a * d - near * far * s * s
        u, w = (d * u + near * s * w) / det, (a * w + far * s * u) / det
        if motion.place <= load.floor and w < 0.0:
            w = 0.0
            u = (motion.strain_rate * length + near * (force - pull)) / a
        if pull + s * (u - w) > 0.0:
            return u / length, w
    if motion.place <= load.floor:
        slack_w = max(slack_w, 0.0)
    return slack_u / length, slack_w


def holding_force(load: Any, strain: float, length: float) -> float:
    """Return the bundle force, N, that holds the load at rest at a strain (nan: any)."""
    if load.kind == DYNAMOMETER:
        return math.nan
    weight = load.mass * load.gravity
    if load.kind == ARM:
        return (weight * load.centre * math.sin(load.rest_angle
                                                + strain * length / load.moment_arm)
                / load.moment_arm)
    if load.kind == MASS_SPRING:
        return weight + load.stiffness_against * (strain * length - load.spring_rest)
    on_support = load.stiffness_series * (strain * length - load.floor)
    lifted = (load.stiffness_series * (weight + load.stiffness_against * strain * length)
              / (load.stiffness_series + load.stiffness_against))
    return max(0.0, min(on_support, lifted))


def stiffness(load: Any, strain: float, length: float) -> float:
    """Return d(holding force)/d(strain), N."""
    if load.kind == DYNAMOMETER:
        return math.inf
    if load.kind == ARM:
        return (load.mass * load.gravity * load.centre * length / load.moment_arm ** 2
                * math.cos(load.rest_angle + strain * length / load.moment_arm))
    if load.kind == MASS_SPRING:
        return load.stiffness_against * length
    k, ground = load.stiffness_series, load.stiffness_against
    if k * (strain * length - load.floor) < load.mass * load.gravity + ground * load.floor:
        return k * length if strain * length > load.floor else 0.0
    return k * ground / (k + ground) * length


def inertia(load: Any, length: float) -> float:
    """Return force per strain acceleration, N s^2; fitting and mass move together."""
    if load.kind == DYNAMOMETER:
        return math.inf
    if load.kind == ARM:
        return load.moment_of_inertia * length / load.moment_arm ** 2
    return (load.mass + load.fitting_mass) * length


def drag(load: Any, length: float) -> float:
    """Return the load's own viscous force per strain rate, N s."""
    if load.kind == ARM:
        return load.damping * length / load.moment_arm ** 2
    return load.damping * length


def damping_rate(load: Any, length: float) -> float:
    """Return the decay rate of the bundle end's speed due to the load's damping, 1/s."""
    if load.kind == SERIES_SPRING_MASS:
        return (load.damping + load.spring_damping) / load.fitting_mass
    return drag(load, length) / inertia(load, length)


# --- descriptions ------------------------------------------------------------------------------

class Load(ABC):
    """Base class of the loads."""

    kind: ClassVar[int]
    stops: tuple[float, float]

    @property
    def record(self) -> LoadRecord:
        """The load's parameters for kernels."""
        own = {item.name: float(getattr(self, item.name)) for item in fields(LoadRecord)
               if hasattr(self, item.name) and item.name != 'kind'}
        return LoadRecord(self.kind, *map(float, self.stops), **own)

    def start(self, length: float) -> LoadState:
        """Return the initial state: at rest on the lower end stop."""
        return LoadState(self.stops[0])

    def holding_force(self, strain: float, length: float) -> float:
        """Return the bundle force, N, that holds the load at rest at a strain (nan: any)."""
        return holding_force(self.record, strain, length)

    def stiffness(self, strain: float, length: float) -> float:
        """Return d(holding force)/d(strain), N: stiffness of the load for a strain loop."""
        return stiffness(self.record, strain, length)

    def inertia(self, strain: float, length: float) -> float:
        """Return force per strain acceleration, N s^2: inertia of the load for a strain loop."""
        return inertia(self.record, length)

    def drag(self, length: float) -> float:
        """Return the load's own viscous force per strain rate, N s."""
        return drag(self.record, length)


@dataclass(frozen=True)
class Dynamometer(Load):
    """
    A test machine that imposes the strain, for any force.

    Parameters
    ----------
    strain : float
        Initial strain.
    speed : float, 1/s
        Strain rate used by `Rig.impose_strain` by default.
    """

    strain: float = 0.0
    speed: float = 1.0

    kind = DYNAMOMETER
    stops = _WIDEST

    def __post_init__(self):
        require(self, 'strain', least=_WIDEST[0], most=_WIDEST[1])
        require(self, 'speed', above=0.0)

    def start(self, length: float) -> LoadState:
        """Return the initial state: at rest at its strain."""
        return LoadState(self.strain, 0.0, self.strain, self.speed)

    def impose(self, motion: LoadState, strain: float, speed: float | None = None) -> None:
        """
        Set the target strain, to be reached at a strain rate of size ``speed`` (1/s).

        Raises
        ------
        InputError
            For a target outside -0.15..0.5 or a speed that is not a finite number.
        """
        speed = self.speed if speed is None else abs(speed)
        if not _WIDEST[0] <= strain <= _WIDEST[1]:
            raise InputError(f'imposed strain is {strain!r}; expected between -0.15 and 0.5')
        if not 0.0 <= speed < math.inf:
            raise InputError(f'imposed strain rate is {speed!r} 1/s; expected a finite number')
        motion.target, motion.speed = float(strain), float(speed)


@dataclass(frozen=True)
class MassSpring(Load):
    """
    A mass hanging from (or lying before) the bundle, with a spring against the pull.

    mass x'' = F - mass gravity - stiffness (x - rest) - damping x', x the contraction in m.

    Parameters
    ----------
    mass : float, kg
    stiffness_against : float, N/m
        Spring that resists the contraction; 0 for none.
    spring_rest : float, m
        Contraction at which that spring is unloaded.
    damping : float, N s/m
        Damping of the guide.
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

    kind = MASS_SPRING

    def __post_init__(self):
        require(self, 'mass', above=0.0)
        require(self, 'stiffness_against', 'damping', 'gravity', least=0.0)
        require(self, 'spring_rest')
        _check_stops(self)


@dataclass(frozen=True)
class SeriesSpringMass(Load):
    """
    A mass that the bundle pulls through a spring (a tendon, a compliant limb).

    The bundle's end fitting has its own mass: without it force and strain would be coupled by an
    algebraic equation.

    Parameters
    ----------
    mass : float, kg
    stiffness_series : float, N/m
    stiffness_against : float, N/m
        Spring between the mass and the ground; 0 for none.
    fitting_mass : float, kg
    damping : float, N s/m
        Damping of the guide of each of the two masses.
    spring_damping : float, N s/m
        Damping of the series spring.
    gravity : float, m/s^2
    stops : (float, float)
        Strains at the end stops of the fitting.
    floor : float, m
        Position of the mass, signed as the contraction, below which it rests on its support.
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

    kind = SERIES_SPRING_MASS

    def __post_init__(self):
        require(self, 'mass', 'stiffness_series', 'fitting_mass', above=0.0)
        require(self, 'stiffness_against', 'damping', 'spring_damping', 'gravity', least=0.0)
        require(self, 'floor')
        _check_stops(self)

    def start(self, length: float) -> LoadState:
        """Return the initial state: at rest on stop and floor."""
        return LoadState(self.stops[0], place=self.floor)


@dataclass(frozen=True)
class Arm(Load):
    """
    A forearm on a joint, driven by the bundle over a pulley.

    inertia a'' = F moment_arm - mass gravity centre sin(a) - damping a', with the angle a from
    hanging straight down: a = rest_angle + contraction/moment_arm.

    Parameters
    ----------
    moment_of_inertia : float, kg m^2
        About the joint, load in the hand included.
    mass : float, kg
        Mass of forearm and load.
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

    kind = ARM

    def __post_init__(self):
        require(self, 'moment_of_inertia', 'mass', 'centre', 'moment_arm', above=0.0)
        require(self, 'damping', 'gravity', least=0.0)
        require(self, 'rest_angle')
        _check_stops(self)

    def angle(self, strain: float, length: float) -> float:
        """Return the joint's angle from hanging straight down, rad."""
        return self.rest_angle + strain * length / self.moment_arm


def _check_stops(load: Load) -> None:
    low, high = load.stops
    if not _WIDEST[0] <= low < high <= _WIDEST[1]:
        raise InputError(f'{type(load).__name__}.stops is {load.stops!r}; '
                         'expected two strains that rise, between -0.15 and 0.5')
