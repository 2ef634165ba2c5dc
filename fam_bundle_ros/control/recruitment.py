# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which motor units are on: the state machine over RS0..RSn.

Between RSk and RSk+1 lies an overlap: demands that both can give. The machine climbs at the last
moment at which the next unit's push-back can still be made up for, and only when the demand is
heading beyond the present state; it goes back when the demand has come to rest below the overlap.
How the unit is then moved is the business of `crossing`.
"""

from dataclasses import dataclass
import math

import numpy as np

from fam_bundle_ros.control.allocation import Curves
from fam_bundle_ros.control.crossing import crossing_time
from fam_bundle_ros.errors import InputError

#: s: by so much a demand that rises may be ahead of its reference; it falls back when it stops.
_LEAD = 0.01
POLICIES = ('neglect', 'hysteresis', 'reversal_aware')


@dataclass(frozen=True)
class SwitchingConfig:
    """
    When to recruit and to release.

    Parameters
    ----------
    policy : str
        ``neglect`` compares the demand with the ideal model's limits, no more; ``hysteresis``
        knows the resistive forces and keeps a band; ``reversal_aware`` (default) besides crosses
        the falling branch with compensation and looks where the demand is heading.
    dwell : float, s
        Least time between a switch and the opposite one.
    margin, hysteresis : float, N, optional
        By hand; worked out from model, error and noise otherwise.
    rest_time : float, s
        The demand counts as at rest, and a unit that it does not need is released, after this.
    absence_time : float, s
        A unit that moving demands have not needed for so long is released too: refilling it for
        every cycle of a fast demand would cost more air than keeping it.
    worth : float
        While the demand moves, a unit is released at once where the pressure that it holds at
        least is below this share of the most since it was recruited: to fill it again from there
        costs (nearly) nothing.
    rest_rate : float, 1/s
        Demands that change by less than this share of the bundle's range per second are at rest.
    horizon : float, s
        How far ahead a rising demand is followed.
    crossing_rate : float, Pa/s
        Largest pressure rate of any unit while one is crossed: what valve and supply surely do.
    """

    policy: str = 'reversal_aware'
    dwell: float = 0.25
    margin: float | None = None
    hysteresis: float | None = None
    rest_time: float = 0.75
    absence_time: float = 10.0
    worth: float = 0.3
    rest_rate: float = 0.03
    horizon: float = 3.0
    crossing_rate: float = 2e6

    def __post_init__(self):
        """Refuse what cannot be meant."""
        if self.policy not in POLICIES:
            raise InputError(f"policy is '{self.policy}'; expected one of {', '.join(POLICIES)}")
        for name in ('dwell', 'rest_time', 'absence_time', 'rest_rate', 'horizon'):
            if not getattr(self, name) >= 0.0:
                raise InputError(f'{name} is {getattr(self, name)}; expected 0 or more')
        for name in ('margin', 'hysteresis'):
            value = getattr(self, name)
            if value is not None and not value >= 0.0:
                raise InputError(f'{name} is {value}; expected 0 or more, in N')
        if not self.crossing_rate > 0.0:
            raise InputError(f'crossing_rate is {self.crossing_rate}; expected more than 0')


@dataclass(frozen=True)
class Demand:
    """
    What is asked of the bundle, as the state machine sees it.

    Attributes
    ----------
    force : float, N
    rate : float, N/s
        Of the demand against what the present state can give: it counts that the strain moves.
    acceleration, jerk : float, N/s^2 and N/s^3
    uncertainty : float, N
        Three standard deviations of the noise in the demand, plus the model's error.
    """

    force: float
    rate: float = 0.0
    acceleration: float = 0.0
    jerk: float = 0.0
    uncertainty: float = 0.0

    def rise(self, horizon: float) -> float:
        """
        Return how much further the demand will rise within a horizon (s), N.

        A demand that slows down is followed to its turning point, one that does not along its
        slope.

        Examples
        --------
        >>> Demand(20.0, rate=10.0).rise(3.0)
        30.0
        >>> Demand(20.0, rate=10.0, acceleration=-50.0).rise(3.0)
        1.0
        """
        rate, slowing, jerk = self.rate, min(self.acceleration, 0.0), min(self.jerk, 0.0)
        # rate + slowing t + jerk t^2/2 = 0, in the form that also holds for no jerk at all.
        root = math.sqrt(slowing * slowing - 2.0 * jerk * rate) - slowing
        turn = min(2.0 * rate / root, horizon) if root > 0.0 else horizon
        return turn * (rate + turn * (slowing / 2.0 + turn * jerk / 6.0))


@dataclass(frozen=True)
class Margins:
    """
    Forces at which the machine would switch now, N; nan where there is no such state.

    Attributes
    ----------
    recruit, release : float
    limit : float
        Largest force of the present state.
    width : float
        Of the overlap with the next state, which ends at ``limit``.
    uncertainty : float
    """

    recruit: float = math.nan
    release: float = math.nan
    limit: float = math.nan
    width: float = math.nan
    uncertainty: float = 0.0


class RecruitmentMachine:
    """
    State machine over RS0..RSn.

    Parameters
    ----------
    units : int
    config : SwitchingConfig
    names : sequence of str, optional
        Of the motor units in their order of recruitment, for the explanations.
    """

    def __init__(self, units: int, config: SwitchingConfig = SwitchingConfig(), names=None):
        self.config = config
        self.units = units
        self._names = list(names or (f'MU{i + 1}' for i in range(units)))
        self.margins = Margins()
        self.reset()

    def reset(self, state: int = 0) -> None:
        """Start in a state, free to switch at once."""
        self.state = state
        self._since = math.inf
        #: Of the last switch: +1, -1, or 0 before the first.
        self.direction = 0
        self._calm = 0.0
        self._absent = 0.0
        # Of each unit: the most of what it must hold at least since it was recruited, Pa.
        self._reserve = [0.0] * self.units
        # How far below the release level the demand was when the last unit was recruited ahead of
        # need, N: a demand that then stops, and never fell, releases nothing.
        self._ahead = 0.0
        # Of each unit: has a demand needed it since it was recruited?
        self._needed = [True] * self.units
        # A unit was recruited for a demand that then turned back: look ahead no more.
        self._wary = False

    def update(self, dt: float, curves: Curves, demand: Demand) -> str:
        """
        Advance one tick; `state` is then the state to be in.

        Parameters
        ----------
        dt : float, s
        curves : Curves
            Of this tick.
        demand : Demand

        Returns
        -------
        str
            Why it switched, in words; empty when it did not.
        """
        self._since += dt
        state, top, crossing = self.state, curves.top, curves.crossing
        neglect = self.config.policy == 'neglect'
        margin, band = self._widths(curves, demand)
        recruit = math.nan
        if state < self.units:
            # Off is no state to be saturated in; beyond a working state the demand must be sure.
            recruit = top[state] + (margin if state else -margin)
        release = self._release_level(curves, state, margin, band) - self._ahead
        width = float(top[state] - crossing[state]) if state < self.units else math.nan
        self.margins = Margins(float(recruit), float(release), float(top[state]), width,
                               demand.uncertainty)
        self._watch(dt, curves, demand, release)

        if state < self.units and (neglect or self._may(+1)):
            reason = self._reason_up(curves, demand, recruit)
            if reason:
                least = demand.force - band - min(_LEAD * max(demand.rate, 0.0), width)
                self._ahead = max(self._release_level(curves, state + 1, margin, band) - least,
                                  0.0)
                return self._switch(+1, f'recruit {self._names[state]}: {reason}')
        if state > 0 and demand.force < release and (neglect or self._may(-1)):
            reason = self._reason_down(curves, demand, release)
            if reason:
                self._ahead = 0.0
                return self._switch(-1, f'release {self._names[state - 1]}: {reason}')
        return ''

    def _widths(self, curves, demand):
        """Return margin and hysteresis band, N: by hand, or from uncertainty and overlap."""
        config = self.config
        if config.policy == 'neglect':
            return 0.0, 0.0
        margin = demand.uncertainty if config.margin is None else config.margin
        band = max(2.0 * margin, 0.5) if config.hysteresis is None else config.hysteresis
        return margin, band

    def _release_level(self, curves, state, margin, band):
        """Return the demand below which the last unit may be released, N."""
        if state == 0:
            return math.nan
        if self.config.policy == 'neglect':
            return curves.top[state - 1]
        if self.config.policy == 'hysteresis':
            dip = max(float(curves.dip[curves.order[state - 1]]), 0.0)
            return curves.top[state - 1] - margin - max(band, dip)
        return curves.crossing[state - 1] - margin - band

    def _watch(self, dt, curves, demand, release):
        """Count how long the demand has been below the release level, and at rest there."""
        below = self.state > 0 and demand.force < release
        span = float(curves.top[-1] - curves.top[0])
        resting = abs(demand.rate) < self.config.rest_rate * span
        for k in range(self.state):
            self._reserve[k] = max(self._reserve[k],
                                   float(curves.bottom_pressure[curves.order[k]]))
            self._needed[k] |= bool(demand.force > curves.top[k] - 0.1)
        self._absent = self._absent + dt if below else 0.0
        self._calm = self._calm + dt if below and resting else 0.0

    def _may(self, direction):
        return self._since >= self.config.dwell or direction == self.direction

    def _reason_up(self, curves, demand, recruit):
        state = self.state
        # A unit that cannot add force at this strain is no help.
        if curves.top[state + 1] - curves.top[state] < max(0.1, demand.uncertainty):
            return ''
        limit, force = curves.top[state], demand.force
        if force > recruit and state == 0:
            return f'demand {force:.1f} N above {recruit:.1f} N; at rest there are {limit:.1f} N'
        if force > recruit:
            return (f"demand {force:.1f} N above RS{state}'s {limit:.1f} N by more than "
                    f'{recruit - limit:.1f} N')
        if (self.config.policy != 'reversal_aware' or state == 0 or demand.rate <= 0.0
                or self._wary):
            return ''
        ahead = force + demand.rate * crossing_time(
            curves, curves.order[state], demand.rate, self.config.crossing_rate)
        if ahead < curves.crossing[state] - 0.1 * (limit - curves.crossing[state]):
            return ''
        if force + demand.rise(self.config.horizon) <= recruit:
            return ''
        return (f"demand {force:.1f} N rising by {demand.rate:.1f} N/s towards RS{state}'s "
                f'{limit:.1f} N; above {curves.crossing[state]:.1f} N its push-back of '
                f'{limit - curves.crossing[state]:.1f} N could not be made up for')

    def _reason_down(self, curves, demand, release):
        state, force = self.state, demand.force
        below = f'demand {force:.1f} N below {release:.1f} N'
        if self.config.policy != 'reversal_aware':
            return below
        if demand.rate > self.config.rest_rate * float(curves.top[-1] - curves.top[0]):
            return ''
        if force < curves.floor[state]:
            return f'demand {force:.1f} N below the {curves.floor[state]:.1f} N that RS{state} can'
        if self._calm >= self.config.rest_time:
            return f'{below} and at rest for {self._calm:.1f} s'
        if self._absent >= self.config.absence_time:
            return f'{below} for {self._absent:.1f} s'
        if demand.rate < 0.0 and not self._needed[state - 1]:
            return f'{below} and turned back before it was needed'
        held = float(curves.bottom_pressure[curves.order[state - 1]])
        if demand.rate < 0.0 and held < self.config.worth * self._reserve[state - 1]:
            return f'{below}, and only {held / 1e3:.0f} kPa to fill again from here'
        return ''

    def _switch(self, direction, text):
        # What was recruited in vain is not recruited ahead of need again; need clears this.
        self._wary = direction < 0 and not self._needed[self.state - 1]
        if direction > 0:
            self._needed[self.state], self._reserve[self.state] = False, 0.0
        self.state += direction
        self._since = 0.0
        self._calm = self._absent = 0.0
        self.direction = direction
        return text


class Heading:
    """
    Rate, acceleration and jerk of signals by a critically damped third-order filter.

    Three first-order lags in a row, solved exactly for a signal that is straight between two
    samples: neither long nor uneven sample times disturb it, and a ramp shows its rate alone.

    Parameters
    ----------
    start : ndarray
    """

    def __init__(self, start: np.ndarray):
        self.reset(start)

    def reset(self, value: np.ndarray) -> None:
        """Begin at rest."""
        self.value = np.array(value, float)
        self._slope = np.zeros_like(self.value)
        # On a ramp each lag is behind the one before by the same. How far they are off from that:
        self._off = [self._slope] * 3
        self.rate = self.acceleration = self.jerk = self._slope

    def update(self, value: np.ndarray, dt: float, bandwidth: float) -> None:
        """Advance by one sample; ``bandwidth`` in rad/s."""
        w, x = bandwidth, bandwidth * dt
        slope = (value - self.value) / dt
        bend = (slope - self._slope) / w
        first, second, third = (off + k * bend for k, off in enumerate(self._off, 1))
        fade = math.exp(-x)
        first, second, third = self._off = [
            fade * first, fade * (second + x * first),
            fade * (third + x * (second + 0.5 * x * first))]
        self.value, self._slope = value, slope
        self.rate = slope + w * (second - third)
        self.acceleration = w ** 2 * (first - 2.0 * second + third)
        self.jerk = w ** 3 * (3.0 * second - 3.0 * first - third)

    def now(self, bandwidth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rate, acceleration and jerk with the filter's own delay made up for."""
        lag = 3.0 / bandwidth
        return (self.rate + lag * (self.acceleration + 0.5 * lag * self.jerk),
                self.acceleration + lag * self.jerk, self.jerk)
