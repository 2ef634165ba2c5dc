# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Outer loops: a force or strain reference and the readings -> the force that the model shall give.

Feed-forward says what the model knows, feedback corrects the rest; each works alone too. The bias
estimate is the slow mean of measured minus model force at the pressures that are there: it needs
no anti-windup, since a demand out of reach does not change what it sees.
"""

from dataclasses import dataclass
import math

import numpy as np

from fam_bundle_ros.control.signals import Measurement, Reference
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle

#: Damping that the strain loop adds, of critical.
_DAMPING_RATIO = 0.5
#: Inertia reckoned with where none is known, N s^2: about 2.5 kg on a muscle of 127 mm.
_USUAL_INERTIA = 0.3


@dataclass(frozen=True)
class LoadModel:
    """
    What is known of the load on the bundle, for strain references; zeros where nothing is.

    Parameters
    ----------
    force : float, N
        That holds the load at zero strain.
    stiffness : float, N
        Change of it per unit of strain.
    table : tuple of (strain, force), optional
        Holding force over rising strain, instead of the two numbers above.
    inertia : float, N s^2
        Force per strain acceleration.
    damping : float, N s
        Force per strain rate.
    """

    force: float = 0.0
    stiffness: float = 0.0
    inertia: float = 0.0
    damping: float = 0.0
    table: tuple[tuple[float, float], ...] = ()

    @property
    def known(self) -> bool:
        """Return whether anything is known."""
        return self != LoadModel()

    def holding_force(self, strain: float) -> float:
        """Return the force that holds the load at a strain, N."""
        if self.table:
            strains, forces = zip(*self.table)
            return float(np.interp(strain, strains, forces))
        return self.force + self.stiffness * strain


@dataclass(frozen=True)
class OuterConfig:
    """
    Gains of the outer loops.

    Parameters
    ----------
    feed_forward : bool
        The model's own inverse: demand = reference (force), load model (strain).
    feedback : bool
        Bias estimate and the gains below.
    bias_time : float, s
        Of the bias estimate.
    force_gain : float
        On the force error.
    force_integral : float, 1/s
        On the force error, without feed-forward (with it, the bias estimate does this).
    strain_gain : float, N
        Per unit of strain error.
    strain_integral : float, N/s
    strain_damping : float, N s, optional
        On the error of the strain rate; by default what damps the load's inertia on the muscles'
        stiffness by a ratio of 0.5.
    still : float, N
        Corrections of a strain loop change only by more than this, or by more than the noise
        that is found in them, up to three times this: no air for sensor noise.
    filter_time : float, s
        Of the force reading.
    strain_reach : float
        Pressures are worked out for the reference strain where it is no further away than this:
        the muscles' own stiffness then pulls towards it.
    lead_time : float, s
        How long the pressures take to follow: feed-forward asks for where a reference that says
        its rate will be by then.
    fade_time : float, s
        Over which a force taken over on enabling fades into the demand; with a strain reference
        and a load of which nothing is known it goes on in the integral instead.
    """

    feed_forward: bool = True
    feedback: bool = True
    bias_time: float = 0.5
    force_gain: float = 0.0
    force_integral: float = 12.0
    strain_gain: float = 400.0
    strain_integral: float = 2000.0
    strain_damping: float | None = None
    still: float = 0.2
    filter_time: float = 0.02
    strain_reach: float = 0.03
    lead_time: float = 0.0055
    fade_time: float = 0.2

    def __post_init__(self):
        """Refuse what cannot be meant."""
        if not (self.feed_forward or self.feedback):
            raise InputError('feed_forward and feedback are both off; expected one at least')
        for name in ('bias_time', 'filter_time', 'fade_time'):
            if not getattr(self, name) > 0.0:
                raise InputError(f'{name} is {getattr(self, name)}; expected more than 0 s')
        for name in ('force_gain', 'force_integral', 'strain_gain', 'strain_integral',
                     'strain_damping', 'strain_reach', 'still', 'lead_time'):
            value = getattr(self, name)
            if value is not None and not value >= 0.0:
                raise InputError(f'{name} is {value}; expected 0 or more')


@dataclass(frozen=True)
class Target:
    """
    What is to be allocated.

    Attributes
    ----------
    force : float, N
        Reference, feedback and bias together.
    feed_forward : float, N
        The part that is free of noise.
    moving : bool
        The reference says a rate: a change of ``feed_forward`` is no step.
    strain, strain_rate : float, and 1/s
        For which the pressures are to be worked out.
    """

    force: float
    feed_forward: float
    moving: bool
    strain: float
    strain_rate: float


class OuterLoop:
    """
    Force and strain loop of one bundle.

    Parameters
    ----------
    bundle : Bundle
        For the error of its fit, which enters the uncertainty.
    config : OuterConfig
    load : LoadModel
    """

    def __init__(self, bundle: Bundle, config: OuterConfig = OuterConfig(),
                 load: LoadModel = LoadModel()):
        self.config = config
        self.load = load
        self._model_error = bundle.error
        self._damping = config.strain_damping
        if self._damping is None:
            inertia = load.inertia or _USUAL_INERTIA
            self._damping = 2.0 * _DAMPING_RATIO * math.sqrt(_stiffness(bundle) * inertia)
        self.reset()

    def reset(self) -> None:
        """Forget what was learnt."""
        #: Measured minus model force, slowly, N.
        self.bias = 0.0
        self._integral = self._kept = 0.0
        self._filtered = 0.0
        self._started = False
        self._take_over: float | None = None
        self._fade = self._demand = 0.0
        self._correction = (0.0, 0.0)
        self._jitter = (0.0, 0.0)
        self._reference_rate = (0.0, 0.0)
        self._kind = ''

    @property
    def uncertainty(self) -> float:
        """
        Return how far off the demand may be, N: the margins of the state machine.

        Three standard deviations of the correction, the error of the model's fit, and a tenth of
        the bias: it was learnt at other pressures than those at which a unit is switched.
        """
        return (3.0 * math.sqrt(self._correction[1]) + self._model_error
                + 0.1 * abs(self.bias) + 0.1)

    def take_over(self, measurement: Measurement) -> None:
        """Start from the force that is there: the demand fades from it into the reference."""
        self._take_over = measurement.force

    def update(self, dt: float, measurement: Measurement, model_force: float,
               reference: Reference, settled: bool, saturated: str) -> Target:
        """
        Return what is to be allocated in this tick.

        Parameters
        ----------
        dt : float, s
        measurement, reference : Measurement, Reference
        model_force : float, N
            Of the model at the measured strain and pressures.
        settled : bool
            No unit is being crossed: the bias may learn.
        saturated : str
            Of the last command: integrals stop in that direction.
        """
        config = self.config
        force = measurement.force
        share = 1.0 - math.exp(-dt / config.filter_time) if self._started else 1.0
        self._started = True
        self._filtered += share * (force - self._filtered)
        if config.feedback and settled:
            gain = 1.0 - math.exp(-dt / config.bias_time)
            self.bias += gain * (force - model_force - self.bias)
        switched = reference.kind != self._kind
        if switched:
            self._kind = reference.kind
            self._reference_rate = (reference.rate, 0.0)
            self._integral = 0.0
        loop = self._force_loop if reference.kind == 'force' else self._strain_loop
        known, correction, strain, rate = loop(dt, measurement, reference, saturated)
        held = self._demand
        if self._take_over is not None:
            if config.feedback:
                self.bias = force - model_force
                correction -= self.bias
            held = self._take_over - self.bias
            self._fade = self._take_over - known
            self._take_over = None
        if switched and reference.kind == 'strain' and config.feedback and not self.load.known:
            # Only the force that is there says what holds the load: the integral goes on from it.
            self._fade = 0.0
            self._integral += held - known - correction
            self._kept = correction = held - known
            self._correction = (correction, self._correction[1])
        self._learn_noise(dt, correction)
        self._fade *= math.exp(-dt / config.fade_time)
        self._demand = known + self._fade + correction
        moving = reference.rate != 0.0
        return Target(self._demand, known + self._fade, moving, strain, rate)

    def _force_loop(self, dt, measurement, reference, saturated):
        config = self.config
        error = reference.value - self._filtered
        ahead = reference.value + config.lead_time * reference.rate
        known = ahead if config.feed_forward else 0.0
        correction = 0.0
        if config.feedback:
            correction = config.force_gain * error
            if config.feed_forward:
                correction -= self.bias
            else:
                self._integrate(config.force_integral * error * dt, saturated)
                known = self._integral
        return known, correction, measurement.strain, measurement.strain_rate

    def _strain_loop(self, dt, measurement, reference, saturated):
        config, load = self.config, self.load
        error = reference.value - measurement.strain
        rate_error = reference.rate - measurement.strain_rate
        known, strain, rate = 0.0, measurement.strain, measurement.strain_rate
        if config.feed_forward:
            ahead = reference.value + config.lead_time * reference.rate
            known = (load.holding_force(ahead) + load.damping * reference.rate
                     + load.inertia * self._acceleration(dt, reference.rate))
            reach = config.strain_reach
            strain = min(max(ahead, strain - reach), strain + reach)
            rate = reference.rate
        correction = 0.0
        if config.feedback:
            self._integrate(config.strain_integral * error * dt, saturated)
            wanted = (self._integral + config.strain_gain * error + self._damping * rate_error
                      - self.bias)
            still = self._quiet_band(dt, wanted)
            self._kept = min(max(self._kept, wanted - still), wanted + still)
            correction = self._kept
        return known, correction, strain, rate

    def _quiet_band(self, dt, wanted):
        """Return two standard deviations of what changes from tick to tick, within limits, N."""
        change, variance = wanted - self._jitter[0], self._jitter[1]
        variance += (1.0 - math.exp(-dt)) * (0.5 * change * change - variance)
        self._jitter = (wanted, variance)
        still = self.config.still
        return min(max(2.0 * math.sqrt(variance), still), 3.0 * still)

    def _acceleration(self, dt, rate):
        """Return the rate's own rate, filtered: references carry none."""
        last, slope = self._reference_rate
        slope += (1.0 - math.exp(-dt / 0.01)) * ((rate - last) / dt - slope)
        self._reference_rate = (rate, slope)
        return slope

    def _integrate(self, step, saturated):
        """Integrate unless that would push further into a limit."""
        if not ((saturated == 'high' and step > 0.0) or (saturated == 'low' and step < 0.0)):
            self._integral += step

    def _learn_noise(self, dt, correction):
        """Follow mean and variance of the correction over about a second."""
        mean, variance = self._correction
        gain = 1.0 - math.exp(-dt)
        difference = correction - mean
        self._correction = (mean + gain * difference,
                            (1.0 - gain) * (variance + gain * difference * difference))


def _stiffness(bundle):
    """Return -dF/de in N, all units at half of their largest pressure, at a middling strain."""
    half = 0.5 * bundle.max_pressure
    return max(float(bundle.force(0.09, half) - bundle.force(0.11, half)) / 0.02, 0.0)
