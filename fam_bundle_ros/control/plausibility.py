# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Check of a pressure reading against the air that the valve lets in.

Valve and commands bound the possible pressure (ISO 6358). A reading outside the bounds by more
than the margin between largest pressure and trip could hide a pressure above the trip. Slow
changes may come from leaks, temperature or an inexact dead band: they are checked by the force
(`agreement`), and a reading that stays the same by a pulse of exhaust (`response`). Nothing here
depends on the setpoint. Above the largest pressure, an unexplained
rise is extrapolated to the time at which the valve can react: what would be above the trip by
then is a fault now. Pressures are gauge; independent of ROS.
"""

from collections import deque
from dataclasses import dataclass
import math

from fam_bundle_ros.control.response import ResponseWatch
from fam_bundle_ros.control.safety import (
    FROZEN,
    kilopascals,
    NO_RESPONSE,
    UNEXPLAINED_PRESSURE,
)
from fam_bundle_ros.control.valve_learning import CONDUCTANCE_DOUBT, dead_band_doubt
from fam_bundle_ros.model.pneumatics import (
    ATMOSPHERE,
    POLYTROPIC,
    pressure_rate,
    valve_command,
    valve_flow,
    valve_opening,
    ValveFlow,
)

#: Least and largest true rate over the model's rate: uncertainty of the conductance, and air
#: anywhere between isothermal (1) and adiabatic (1.4) where the model takes POLYTROPIC.
LEAST, MOST = ((1.0 - CONDUCTANCE_DOUBT) / POLYTROPIC,
               (1.0 + CONDUCTANCE_DOUBT) * 1.4 / POLYTROPIC)
#: s: shortest time constant of leaks and temperature.
_SLOW = 1.0
#: Air let in by a trial, as a share of the largest pressure; with one sample more it is a quarter
#: of a fill where the valve is fast. A rig that reads commands by its own clock may miss one, so a
#: second trial has to fail as well: together they are half a fill.
_TRIAL = 0.125
#: Consecutive readings outside the bounds that show a fault: a single one may be a spike.
_CONFIRM = 2
#: Number of delays from command to reading that are tried, from 0 to the longest.
_DELAYS = 6
#: s: longest filling of a trial; a slower one is not evaluated.
_TRIAL_TIME = 0.3
#: Words for a sensor that responds, but too little.
_RESPONDS = ('; it responds: conductance or gas volume may be wrong (repeat check-rig --active '
             'with this model)')
#: s: time for a sensor on trial to respond; the valve is shut meanwhile.
_PATIENCE = 0.1
#: s without a command after which a driver may have vented by itself (docs/how_to/driver.md: 0.1).
_WATCHDOG = 0.05
#: s: time at the start with a limited exhaust; longer than the lag and the confirming samples.
_GENTLE_TIME = 0.1
#: Largest exhaust command meanwhile: a reversed valve then lets in a tenth of its full flow.
GENTLE = 0.15
#: s: shortest interval of evaluated readings; those in between are skipped.
_INTERVAL = 3.5e-3
#: Length of the history of commands.
_PLACES = 256


@dataclass(frozen=True)
class InflowConfig:
    """
    Pneumatic data of a motor unit.

    Parameters
    ----------
    valve : ValveFlow
    supply : float, Pa (gauge)
        Value of the parameter; a reading is used where it is higher.
    max_pressure, margin : float, Pa
        Largest pressure; reading error that is tolerated: trip minus largest pressure.
    lag : float, s
        Longest time from a reading to the reading that shows the effect of its command.
    period : float, s
        Interval of readings. In a longer gap the valve may have acted for only this time.
    noise : float, Pa
        Largest difference of two readings due to noise.
    ambient : float, Pa (absolute)
    """

    valve: ValveFlow
    supply: float
    max_pressure: float
    margin: float
    lag: float
    period: float
    noise: float
    ambient: float = ATMOSPHERE


class InflowWatch:
    """
    Check of a pressure reading against the air that the valve can have let in or out.

    After `begin` a sensor is on trial: at most an eighth of a fill, and a sample more, is let in
    before the reading has responded (`holding`); a trial that fails is repeated once. From then
    on bounds follow the reading: the lowest and the highest pressure that valve, supply and
    motion allow, for any delay from command to reading. A reading that stays the same while air
    is let in is tested by pulses of exhaust (`ResponseWatch`).

    Parameters
    ----------
    name : str
        For the messages.
    config : InflowConfig

    Attributes
    ----------
    holding : bool
        The valve has to stay shut until the sensor has responded.
    gentle : bool
        The exhaust may only be opened a little at first: a reversed valve would fill.
    trusted : bool
        The sensor has responded to more air than the errors of the valve can explain.

    Examples
    --------
    >>> watch = InflowWatch('mu1', InflowConfig(ValveFlow(), 600e3, 345e3, 52e3, 0.02, 5e-3,
    ...                                         3e3))
    >>> for k in range(60):
    ...     cause, text = watch.see(k * 5e-3, 0.0, 20e-6)
    ...     watch.commanded(0.0 if watch.holding else 1.0)
    ...     if cause:
    ...         break
    >>> print(text)
    mu1 shows 0 kPa after air for 82 kPa was let in, a second time; expected 45 kPa or more
    """

    def __init__(self, name: str, config: InflowConfig):
        self.name = name
        self._response = ResponseWatch(
            config.noise, config.max_pressure + config.margin, MOST, config.lag, _PATIENCE, _SLOW)
        self.change(config)
        self.begin()

    def change(self, config: InflowConfig) -> None:
        """Replace the settings."""
        self.config, valve = config, config.valve
        self._response.lag, self._response.noise = config.lag, config.noise
        doubt = dead_band_doubt(valve.dead_band)
        self._wide, self._narrow = (
            ValveFlow(valve.conductance, valve.critical_ratio, band)
            for band in (max(valve.dead_band - doubt, 0.0), valve.dead_band + doubt))

    def begin(self) -> None:
        """Reset: the sensor is on trial again."""
        self.holding = self.trusted = self._failed = False
        self._commands: deque[tuple[float, float]] = deque(maxlen=_PLACES)
        self._time: float | None = None
        #: s; a gap between readings counts as one period: a stalled rig executes no commands.
        self._clock = 0.0
        #: s; until then a driver that got no commands may still exhaust.
        self._exhausts_until = 0.0
        self.be_gentle()
        self._before = 0.0
        self._volume: float | tuple[float, float] = math.nan
        #: Lowest and highest possible reading, Pa, for each delay.
        self._bottom, self._top = [0.0] * _DELAYS, [0.0] * _DELAYS
        self._spacing = self.config.lag / (_DELAYS - 1)
        self._below = self._above = 0
        #: Pa: the largest rise since the reading before that the valve allows.
        self._rise = 0.0
        #: Pa/s: rate of the last command, by the loop's own models.
        self._expected = 0.0
        self._response.begin()
        self._begin_trial()

    def be_gentle(self) -> None:
        """Count the time of limited exhausts from now: before, the valve was shut."""
        self.gentle, self._gentle_until = True, self._clock + _GENTLE_TIME

    @property
    def forced(self) -> float | None:
        """Command that takes the place of the loop's; None for none."""
        if self._response.pulse:
            return self._pulse
        return 0.0 if self.holding or self._response.testing else None

    def _begin_trial(self) -> None:
        self.holding = False
        #: Pressure at the start of the trial; rise since then, by the model and at the least.
        self._start: float | None = None
        self._let_in = self._surely = 0.0
        self._held_since = self._trial_since = 0.0

    def commanded(self, command: float, expected: float = 0.0) -> None:
        """
        Record the command computed from the last reading.

        ``expected`` is the pressure rate (Pa/s) by the loop's models, which learn the valve.
        """
        self._commands.append((self._clock, command))
        self._expected = expected

    def see(self, time: float, pressure: float, volume: float | tuple[float, float],
            supply: float = math.nan, gap: float = 0.0) -> tuple[str, str]:
        """
        Check a reading; return cause and reason if it is impossible, else two empty strings.

        Parameters
        ----------
        time : float, s
            Of the reading.
        pressure : float, Pa (gauge)
        volume : float or (float, float), m^3
            Gas volume with tubing; least and largest if it is not known.
        supply : float, Pa (gauge)
            Reading; nan without a sensor.
        gap : float, s
            Time between the arrivals of this reading and the one before. A stall of the rig or the
            computer delays commands while the stamps stay regular.
        """
        if not math.isfinite(pressure):
            return '', ''
        if self._time is None or not time > self._time:
            if self._time is None or time < self._time:
                self.begin()
                self._bottom, self._top = [pressure] * _DELAYS, [pressure] * _DELAYS
                self._before, self._volume = pressure, volume
                self._time = time
            return '', ''
        dt = time - self._time
        if dt < _INTERVAL:
            return '', ''
        self._time = time
        surely = min(dt, max(self.config.period, _INTERVAL))
        self._clock += surely
        self.gentle = self._clock < self._gentle_until
        small, large = volume if isinstance(volume, tuple) else (volume, volume)
        # m^3, by which the muscle's motion has changed the volume.
        swept = (volume - self._volume if isinstance(volume, float)
                 and isinstance(self._volume, float) else 0.0)
        self._volume = volume
        source = max(self.config.supply, supply if math.isfinite(supply) else 0.0)
        while len(self._commands) > 1 and (
                self._commands[1][0] <= self._clock - surely - self.config.lag):
            self._commands.popleft()
        held_up = max(dt, gap) > _WATCHDOG
        if held_up:
            # Readings of the pause may follow; the command after it acts with the usual delay.
            self._exhausts_until = self._clock + max(dt, gap) + self.config.lag
        self._bounds(dt, surely, pressure, small, large, swept, source,
                     self._clock <= self._exhausts_until)
        if held_up:
            self._begin_trial()
        trial = '' if self.trusted else self._judge_trial(surely, pressure, small, swept, source)
        heading = self._heading(dt, pressure)
        self._before = pressure
        silent = self._judge_response(dt, pressure, small, large, swept, source, held_up)
        if silent:
            return FROZEN, silent
        if trial:
            return NO_RESPONSE, trial
        if self._below >= _CONFIRM:
            return NO_RESPONSE, (
                f'{self.name} shows {kilopascals(pressure)}; supply, valve commands and volume '
                f'(by the strain) give {kilopascals(min(self._bottom))} or more')
        trip = self.config.max_pressure + self.config.margin
        if heading > trip:
            return UNEXPLAINED_PRESSURE, (
                f'{self.name} shows {kilopascals(pressure)} and rises to {kilopascals(heading)}, '
                f'above {kilopascals(trip)}, before the valve can react; commands give '
                f'{kilopascals(max(self._top))} at most')
        # No setpoint is above the largest pressure: no confirmation is needed.
        if self._above >= (1 if pressure > self.config.max_pressure else _CONFIRM):
            return UNEXPLAINED_PRESSURE, (
                f'{self.name} shows {kilopascals(pressure)}; supply, valve commands and volume '
                f'(by the strain) give {kilopascals(max(self._top))} at most')
        return '', ''

    def _range_of_commands(self, surely: float, delay: float) -> tuple[float, float]:
        """Return least and largest command in effect since the reading before, for a delay (s)."""
        oldest, newest = self._clock - surely - delay, self._clock - delay
        low = high = -1.0
        for when, command in self._commands:
            if when <= oldest:
                low = high = command
            elif when < newest:
                low, high = min(low, command), max(high, command)
            else:
                break
        return low, high

    def _rate(self, command: float, pressure: float, volume: float, source: float, highest: bool
              ) -> float:
        """Return the highest or lowest pressure rate that a command can cause, Pa/s."""
        config = self.config
        # A narrower dead band means a wider opening.
        wide = (command > 0.0) == highest
        valve = self._wide if wide else self._narrow
        opening = valve_opening(valve, command)
        if opening == 0.0:
            return 0.0
        absolute = max(pressure, 0.0) + config.ambient
        flow = valve_flow(config.valve, opening, absolute, source + config.ambient,
                          config.ambient)
        return pressure_rate(absolute, volume, 0.0, (MOST if wide else LEAST) * flow)

    def _nominal(self, command: float, pressure: float, volume: float, source: float) -> float:
        """Return the pressure rate of a command by the valve's data, Pa/s."""
        valve, ambient = self.config.valve, self.config.ambient
        absolute = max(pressure, 0.0) + ambient
        return pressure_rate(absolute, volume, 0.0, valve_flow(
            valve, valve_opening(valve, command), absolute, source + ambient, ambient))

    def _motion(self, pressure: float, volume: float, swept: float, highest: bool) -> float:
        """Return the highest or lowest pressure change (Pa) by a volume change ``swept`` (m^3)."""
        exponent = 1.4 if (swept < 0.0) == highest else 1.0
        return -exponent * (max(pressure, 0.0) + self.config.ambient) * swept / volume

    def _bounds(self, dt: float, surely: float, pressure: float, small: float, large: float,
                swept: float, source: float, may_exhaust: bool) -> None:
        """
        Advance the bounds, let them decay to the reading, and count readings outside.

        Flow that must occur counts for ``surely`` (s), flow that may occur for ``dt`` (s).
        """
        config = self.config
        share = -math.expm1(-dt / _SLOW)
        # Limited by the reading before as well, so that a spike moves no bound.
        least, most = sorted((pressure, self._before))
        same, moved = None, (0.0, 0.0)
        self._rise = 0.0
        for k in range(_DELAYS):
            low, high = self._range_of_commands(surely, k * self._spacing)
            if may_exhaust:
                low = -1.0
            bottom, top = self._bottom[k], self._top[k]
            # At rest all delays give the same bounds.
            if same != (low, high, bottom, top):
                same = low, high, bottom, top
                # The smaller volume fills and vents faster.
                least_rate = self._rate(low, bottom, large if low > 0.0 else small, source, False)
                most_rate = self._rate(high, top, small if high > 0.0 else large, source, True)
                bottom += (least_rate * (surely if least_rate > 0.0 else dt)
                           + self._motion(bottom, small, swept, False))
                rise = (most_rate * (surely if most_rate < 0.0 else dt)
                        + self._motion(top, small, swept, True))
                self._rise = max(self._rise, rise)
                top += rise
                bottom += (pressure - bottom) * share
                top += (pressure - top) * share
                # A valve fills to the supply and vents to ambient at most.
                moved = (max(min(bottom, max(source, pressure)), least),
                         min(max(top, 0.0), most))
            self._bottom[k], self._top[k] = moved
        limit = config.margin + config.noise
        self._below = self._below + 1 if pressure < min(self._bottom) - limit else 0
        self._above = self._above + 1 if pressure > max(self._top) + limit else 0

    def _heading(self, dt: float, pressure: float) -> float:
        """
        Return the pressure that an unexplained rise reaches before the valve can react, Pa.

        The rise of the last ``dt`` (s) is extrapolated over the longest lag. An explained rise is
        not extrapolated; 0 up to the largest pressure, where setpoints may lead.
        """
        config = self.config
        if pressure <= config.max_pressure:
            return 0.0
        # Rise beyond the bounds and beyond the reading before, which may have been a spike.
        beyond = min(pressure - max(self._top), pressure - self._before - self._rise)
        return pressure + max(beyond - config.noise, 0.0) * config.lag / dt

    def _judge_trial(self, dt: float, pressure: float, volume: float, swept: float, source: float
                     ) -> str:
        """Return the fault of a sensor on trial as text, empty if there is none."""
        config = self.config
        command = self._commands[-1][1] if self._commands else -1.0
        if command < 0.0:
            self._begin_trial()
            return ''
        if self._start is None:
            if command == 0.0:
                return ''
            self._start, self._held_since = min(pressure, self._before), self._clock
            self._trial_since = self._clock
        # Motion moves the pressure while the valve is shut, too.
        self._surely += (dt * self._rate(command, pressure, volume, source, False)
                         + self._motion(pressure, volume, swept, False))
        if command > 0.0:
            self._let_in += dt * self._nominal(command, pressure, volume, source)
            self._held_since = self._clock
        self.holding = self.holding or self._let_in >= _TRIAL * config.max_pressure
        if not self.holding:
            if self._clock - self._trial_since > _TRIAL_TIME:
                # So slow a filling cannot be judged: leaks, dead band.
                self._begin_trial()
            return ''
        rise = pressure - self._start
        expected = self._surely - config.noise
        if rise >= expected:
            # Trusted if the certain rise exceeds half of the nominal one, else on trial again.
            self.trusted, self._failed = self._surely > 0.5 * self._let_in, False
            self._begin_trial()
        elif self._clock - self._held_since >= max(config.lag, _PATIENCE):
            if self._failed:
                return (f'{self.name} shows {kilopascals(pressure)} after air for '
                        f'{kilopascals(self._let_in)} was let in, a second time; expected '
                        f'{kilopascals(self._start + expected)} or more'
                        + (_RESPONDS if rise > config.noise else ''))
            self._failed = True
            self._begin_trial()
        return ''

    def _judge_response(self, dt: float, pressure: float, small: float, large: float,
                        swept: float, source: float, held_up: bool) -> str:
        """Return the fault of a reading that stays the same as text, empty if there is none."""
        config, response = self.config, self._response
        command = self._commands[-1][1] if self._commands else -1.0
        rate = self._nominal(command, pressure, small, source)
        if command > 0.0:
            # From a reading that does not respond the loop learns a dead band that is too wide.
            rate = self._expected + response.doubt * max(rate - self._expected, 0.0)
        absolute = max(pressure, 0.0) + config.ambient
        rise = min(dt, _WATCHDOG) * rate - POLYTROPIC * absolute * swept / small
        if response.see(self._clock, pressure, rise, held_up):
            return (f'{self.name} shows {kilopascals(pressure)} whether air is let in, enough for '
                    f'up to {kilopascals(response.suspected)}, or out: a plugged port, the end of '
                    "the sensor's range, or a valve that sticks")
        if response.pulse:
            # In one interval it lowers the reading by more than noise explains, with any valve.
            fall = 2.0 * config.noise / max(config.period, _INTERVAL)
            full = LEAST * self._nominal(-1.0, pressure, large, source)
            self._pulse = valve_command(self._narrow, max(fall / min(full, -1.0), -1.0))
        return ''
