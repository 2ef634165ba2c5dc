# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Pressure control of one motor unit: setpoint and reading in, valve command out.

The error asks for a pressure rate in Pa/s; the chamber model turns the rate into a flow and the
valve model the flow into a command. So gains do not depend on volume, pressure or supply (gain
scheduling), moving setpoints and moving muscles are met by feed-forward, and what is left to
feedback is small. A setpoint of 0 means open to exhaust, whatever the sensor shows. Knows nothing
of recruitment or ROS. Pressures are gauge.
"""

from dataclasses import dataclass, field
import math

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import ATMOSPHERE, flow_for, pressure_rate, ValveFlow

#: Time in which a command that was taken over on switching on fades, s.
_CARRY_TIME = 0.01
#: Pa: on the way to a setpoint of 0, a followed setpoint below it has arrived.
_EMPTY = 1e3
#: Share of the valve's rate that leaks and slow errors may take. Feedback that asks for more and
#: is not answered has met a fault, which the integral must not learn.
_SLOW_SHARE = 0.05
#: Named as control_toolbox names them.
ANTI_WINDUP = ('none', 'back_calculation', 'conditional_integration')


@dataclass(frozen=True)
class PidGains:
    """
    Gains from pressure error to pressure rate.

    Parameters
    ----------
    p : float, 1/s
    i : float, 1/s^2
    d : float, dimensionless
        Acts on the measured pressure rate, never on the setpoint.
    """

    p: float = 110.0
    i: float = 1500.0
    d: float = 0.02

    def __post_init__(self):
        """Refuse gains that cannot be meant."""
        for name in ('p', 'i', 'd'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f'gain {name} is {value}; expected a finite number, 0 or more')


@dataclass(frozen=True)
class PidConfig:
    """
    What the pressure loop knows of its valve and chamber, and its limits.

    Parameters
    ----------
    valve : ValveFlow
    anti_windup : str
        ``none``, ``back_calculation`` (the integral follows the command that was possible) or
        ``conditional_integration`` (it stops while it would push further into the limit). But
        with ``none`` it also stops at a small share of the valve's rate, in case the pressure
        does not answer.
    tracking_time : float, s
        Of the back calculation.
    volume : float, m^3
        Gas volume with tubing, where `PressurePid.update` is not told the present one.
    supply : float, Pa (gauge)
        Where `PressurePid.update` is not told.
    ambient : float, Pa (absolute)
    setpoint_rate : float, Pa/s
        Largest rate at which the setpoint is followed; the valve's own limit applies besides.
    setpoint_bandwidth : float, 1/s
        How fast the followed setpoint closes in on the one asked for.
    flow_lag : float, s
        From command to flow: spool and transport (half a sample comes on top). The followed
        setpoint is delayed by it before feedback compares, else feedback would fight its own
        feed-forward.
    quiet_error : float, Pa
        Errors below this size are left alone: no air is spent on sensor noise, and the valve
        stays shut at rest. About three standard deviations of the filtered reading.
    filter_time : float, s
        Of the reading, before the derivative and the quiet band.
    feed_forward, dead_band_compensation : bool
    """

    valve: ValveFlow = field(default_factory=ValveFlow)
    anti_windup: str = 'back_calculation'
    tracking_time: float = 0.02
    volume: float = 20e-6
    supply: float = 600e3
    ambient: float = ATMOSPHERE
    setpoint_rate: float = 50e6
    setpoint_bandwidth: float = 500.0
    flow_lag: float = 3.0e-3
    quiet_error: float = 500.0
    filter_time: float = 4e-3
    feed_forward: bool = True
    dead_band_compensation: bool = True

    def __post_init__(self):
        """Refuse what cannot be meant."""
        if self.anti_windup not in ANTI_WINDUP:
            raise InputError(f"anti_windup is '{self.anti_windup}'; expected one of "
                             f"{', '.join(ANTI_WINDUP)}")
        for name in ('tracking_time', 'volume', 'supply', 'ambient', 'setpoint_rate',
                     'setpoint_bandwidth'):
            if not getattr(self, name) > 0.0:
                raise InputError(f'{name} is {getattr(self, name)}; expected more than 0')
        for name in ('flow_lag', 'quiet_error', 'filter_time'):
            if not getattr(self, name) >= 0.0:
                raise InputError(f'{name} is {getattr(self, name)}; expected 0 or more')


@dataclass(frozen=True)
class PidDiagnostics:
    """
    What the loop did in the last update: Pa, Pa/s, -1..1.

    ``expected_rate`` is what the pressure does by the models of valve and chamber.
    """

    error: float = 0.0
    followed_setpoint: float = 0.0
    wanted_rate: float = 0.0
    expected_rate: float = 0.0
    integral: float = 0.0
    command: float = 0.0
    saturated: bool = False
    at_rest: bool = True


class PressurePid:
    """
    PID with feed-forward for the pressure of one motor unit.

    Parameters
    ----------
    gains : PidGains
        See `fam_bundle_ros.control.tuning.tune`.
    config : PidConfig

    Examples
    --------
    >>> pid = PressurePid()
    >>> pid.update(setpoint=100e3, pressure=100e3, dt=2e-3)
    0.0
    >>> pid.update(setpoint=300e3, pressure=100e3, dt=2e-3) > 0.5
    True
    """

    def __init__(self, gains: PidGains = PidGains(), config: PidConfig = PidConfig()):
        self.gains = gains
        self.config = config
        self.diagnostics = PidDiagnostics()
        self.reset()

    def reset(self, command: float = 0.0) -> None:
        """
        Forget the past and go on from a valve command, so that switching on makes no bump.

        The setpoint is then approached from the pressure of the next reading.
        """
        self._command = min(max(command, -1.0), 1.0)
        self._integral = 0.0
        #: Pressure rate of the command that was taken over; it fades.
        self._carried = 0.0
        self._followed = math.nan
        self._delayed = 0.0
        self._filtered = self._quiet = 0.0
        self._measured_rate = 0.0

    def update(self, setpoint: float, pressure: float, dt: float, supply: float | None = None,
               volume: float | None = None, volume_rate: float = 0.0) -> float:
        """
        Return the valve command, -1 exhaust .. 0 closed .. 1 fill.

        Parameters
        ----------
        setpoint, pressure : float, Pa (gauge)
            A setpoint of 0 or less ends in full exhaust.
        dt : float, s
            Since the update before; 0 or less (a clock that jumped) gives the last command.
        supply : float, Pa (gauge), optional
        volume : float, m^3, optional
            Gas volume of the motor unit with its tubing, now.
        volume_rate : float, m^3/s

        Notes
        -----
        A setpoint or any reading that is not finite, or a volume of 0, shuts the valve; what
        then has to happen (hold, vent) is the caller's decision.
        """
        volume = self.config.volume if volume is None else volume
        supply = self.config.supply if supply is None else supply
        # A sum is finite only when every term is.
        if not (math.isfinite(setpoint + pressure + supply + volume + volume_rate)
                and volume > 0.0):
            self.reset()
            self.diagnostics = PidDiagnostics()
            return 0.0
        if not dt > 0.0:
            return self._command
        config, gains = self.config, self.gains
        absolute = pressure + config.ambient
        source = supply + config.ambient
        filling = config.valve.flow(1.0, absolute, source, config.ambient)
        venting = config.valve.flow(-1.0, absolute, source, config.ambient)
        fastest = pressure_rate(absolute, volume, volume_rate, filling)
        slowest = pressure_rate(absolute, volume, volume_rate, venting)
        if math.isnan(self._followed):
            self._start(pressure, absolute, volume, volume_rate, source)

        rate = self._follow(setpoint, pressure, dt, fastest, slowest)
        error = self._error(pressure, dt)
        if setpoint <= 0.0 and self._followed <= _EMPTY:
            return self._exhaust(setpoint - pressure, slowest)
        feedback = (gains.p * error - gains.d * self._measured_rate + self._integral
                    + self._carried)
        self._carried *= math.exp(-dt / _CARRY_TIME)
        if config.feed_forward:
            feedback += gains.d * rate
        wanted = feedback + (rate if config.feed_forward else 0.0)
        # What the muscle's motion does to the pressure with the valve shut.
        drift = pressure_rate(absolute, volume, volume_rate, 0.0)
        still = 0.2 * gains.p * config.quiet_error
        at_rest = error == 0.0 and abs(rate - drift) + abs(self._carried) < still
        if at_rest:
            opening, possible = 0.0, 0.0
        else:
            flow = flow_for(absolute, volume, volume_rate if config.feed_forward else 0.0, wanted)
            limit = filling if flow >= 0.0 else -venting
            opening = min(max(flow / max(limit, 1e-12), -1.0), 1.0)
            possible = min(max(wanted, slowest), fastest)
        self._integrate(error, rate, possible - wanted, dt, at_rest,
                        _SLOW_SHARE * min(slowest, 0.0), _SLOW_SHARE * max(fastest, 0.0))
        self._command = (config.valve.command(opening) if config.dead_band_compensation
                         else opening)
        self.diagnostics = PidDiagnostics(
            error=setpoint - pressure, followed_setpoint=self._followed, wanted_rate=wanted,
            expected_rate=possible, integral=self._integral, command=self._command,
            saturated=abs(wanted - possible) > 1e-6 * abs(wanted) and not at_rest,
            at_rest=at_rest)
        return self._command

    def _start(self, pressure, absolute, volume, volume_rate, source):
        """Begin at the pressure as it is, with the rate that continues the last command."""
        self._followed = self._delayed = self._filtered = pressure
        self._measured_rate = self._quiet = 0.0
        opening = self.config.valve.opening(self._command)
        if opening != 0.0:
            flow = self.config.valve.flow(opening, absolute, source, self.config.ambient)
            self._carried = pressure_rate(absolute, volume, volume_rate, flow)

    def _exhaust(self, error, slowest):
        """Open to exhaust for good: a reading that is wrong must not shut the air in."""
        self._integral = self._carried = 0.0
        self._command = -1.0
        self.diagnostics = PidDiagnostics(
            error=error, followed_setpoint=self._followed, wanted_rate=slowest,
            expected_rate=slowest, command=-1.0, at_rest=False)
        return self._command

    def _follow(self, setpoint, pressure, dt, fastest, slowest):
        """Move the followed setpoint within valve and rate limits; return its rate."""
        config = self.config
        # At most half of the distance per sample: the filter must not ring at low rates.
        bandwidth = min(config.setpoint_bandwidth, 0.7 / dt)
        upper = min(0.97 * max(fastest, 0.0), config.setpoint_rate)
        lower = max(0.97 * min(slowest, 0.0), -config.setpoint_rate)
        # Above both setpoint and reading there is no air that the valve would have to let out.
        lower = min(lower, (max(setpoint, pressure) - self._followed) * bandwidth)
        rate = min(max((setpoint - self._followed) * bandwidth, lower), upper)
        self._followed += rate * dt
        lag = config.flow_lag + 0.5 * dt
        self._delayed += (self._followed - self._delayed) * (1.0 - math.exp(-dt / lag))
        return rate

    def _error(self, pressure, dt):
        """Filter the reading and the error; return the error beyond the quiet band."""
        config = self.config
        share = 1.0 - math.exp(-dt / config.filter_time) if config.filter_time > 0.0 else 1.0
        change = (pressure - self._filtered) * share
        self._filtered += change
        self._measured_rate = change / dt
        error = self._delayed - pressure
        self._quiet += (error - self._quiet) * share
        # Large errors unfiltered (no lag in the loop), small ones filtered (no noise).
        if max(abs(error), abs(self._quiet)) < 4.0 * config.quiet_error:
            error = self._quiet
        return math.copysign(max(abs(error) - config.quiet_error, 0.0), error)

    def _integrate(self, error, rate, excess, dt, at_rest, low, high):
        """Advance the integral, with the anti-windup that was chosen."""
        config = self.config
        if at_rest:
            # Nothing to correct: what was learnt on the move must not creep at rest.
            self._integral *= math.exp(-dt / 0.1)
            return
        if abs(rate) > 4.0 * self.gains.p * config.quiet_error:
            # The integral learns leaks and slow errors, not what the flow model misses in a step.
            return
        step = self.gains.i * error * dt
        if config.anti_windup == 'none':
            self._integral += step
            return
        feedback = self.gains.p * error + self._integral
        if feedback * error > 0.0 and not low <= feedback <= high:
            step = 0.0
        if config.anti_windup == 'back_calculation':
            step += excess * dt / config.tracking_time
        elif excess * error < 0.0:
            step = 0.0
        self._integral = min(max(self._integral + step, low), high)
