# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
One motor unit of a rig, probed with air at low pressure: the steps of `check-rig --active`.

Which reading rises at which command, how fast, up to what; whether the unit is tight, and empties
when commands stop. A failure is reported as a finding, and the unit is emptied.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fam_bundle_ros.control.plausibility import GENTLE
from fam_bundle_ros.control.rig_fit import fit_valve, ValveFit
from fam_bundle_ros.control.safety import WatchConfig
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.nodes.rig_check import Finding
from fam_bundle_ros.nodes.rig_hand import Channel, Session
from fam_bundle_ros.plant.faults import UNITS

#: A reading has risen by more than these multiples of supply and noise standard deviation.
_RISE, _RISE_NOISE = 0.04, 6.0
#: Tolerated relative difference of a full reading from the supply.
_SCALE = 0.15
#: Staircase of commands: absolute and relative step, duration of a step (s), last command.
_STAIR, _STAIR_SHARE, _STAIR_TIME, _STAIR_TOP = 0.01, 0.1, 0.04, 0.6
#: Commands of the pulses above the first that moved air; longest pulse and pause after it, s.
_BEYOND = (0.02, 0.04, 0.08, 0.16)
_STROKE, _REST = 0.12, 0.06
#: Shares of the supply between which pulses go.
_LOW, _HIGH = 0.25, 0.65
#: Tolerated residual of the valve law, as a share of the supply.
_MISFIT = 0.03
#: Time for which a shut valve is observed, s; share of the pressure per second that is a leak.
_HOLD, _LEAK = 0.2, 1.0
#: Duration of silent commands, and largest accepted delay of the driver's venting, s (0.1 in
#: docs/how_to/driver.md); the same for supply_enable (0.5).
_MUTE, _MUTE_MOST, _PERMISSION_MUTE, _PERMISSION_MOST = 0.6, 0.25, 1.2, 0.8
#: Factors of likely unit errors of a driver.
_FACTORS = {**{factor: unit for unit, factor in UNITS['pressure'].items()}, 0.5: 'half of it',
            2.0: 'twice it'}
#: Times for the supply to rise, a full motor unit to settle, and to empty, s.
COME_UP, _FILL, _EMPTY = 0.4, 1.0, 2.0


@dataclass
class Probe:
    """Result of `check-rig --active`."""

    findings: list[Finding] = field(default_factory=list)
    #: Measured parameters of the controllers; empty if a check failed.
    parameters: dict[str, Any] = field(default_factory=dict)

    def say(self, ok: bool, what: str, detail: str, note: bool = False) -> None:
        """Add a finding."""
        self.findings.append(Finding(ok, what, detail, note))


class UnitProbe:
    """
    The steps on motor units, one at a time; ``result`` receives the findings.

    The supply is in Pa (gauge), the tube volume in m^3.
    """

    def __init__(self, session: Session, result: Probe, bundle: Bundle, supply: float,
                 tube_volume: float):
        self._session, self._hand, self._result = session, session.hand, result
        self._bundle, self._supply = bundle, supply
        self._tube = tube_volume
        self._units = range(bundle.n)
        #: Motor units (from 0) that hold air for a known reason.
        self.left_out: set[int] = set()
        #: Share of the pressure that each shut motor unit loses in a second.
        self.loss: dict[int, float] = {}

    def rise(self, channel: Channel) -> float:
        """Return the threshold above which a pressure has risen, Pa."""
        return max(_RISE * self._supply, _RISE_NOISE * channel.noise)

    def risen(self) -> list[int]:
        """Return which pressures have risen."""
        return [i for i in self._units if i not in self.left_out
                and self._hand.pressure[i].level(3) > self.rise(self._hand.pressure[i])]

    def _tell(self, unit: int, command: float | None) -> None:
        """Give a command to one valve; all others stay shut."""
        self._hand.command = [0.0] * len(self._units)
        self._hand.command[unit] = command

    def exhaust_does_not_fill(self, unit: int) -> bool:
        """Open an exhaust a little: a reversed valve fills."""
        self._tell(unit, -GENTLE)
        self._session.wait(0.08, lambda: bool(self.risen()))
        self._tell(unit, 0.0)
        self._session.wait(0.06)
        risen = self.risen()
        if not risen:
            return True
        self._result.say(False, f'mu{unit + 1} valve', f'reversed: commanded to exhaust, it fills '
                         f'{self._named(risen)}')
        self._dump()
        return False

    def _named(self, units: list[int]) -> str:
        return ' and '.join(f'mu{i + 1}' for i in units)

    def _dump(self) -> None:
        """Empty all units through the supply, for valves of either sign, then open it again."""
        self._hand.permit(False)
        self._hand.command = [0.0] * len(self._units)
        emptied = self._session.wait(_EMPTY, lambda: not self.risen())
        if not emptied:
            self._hand.vent(f'{self._named(self.risen())} does not empty with supply_enable '
                            'false')
        self._hand.permit(True)
        self._session.wait(COME_UP)

    def probe(self, unit: int) -> ValveFit | None:
        """Take all steps on a motor unit; return its valve, None where a step failed."""
        name, channel = f'mu{unit + 1}', self._hand.pressure[unit]
        first = self._first_air(unit)
        if first is None:
            return None
        start = len(channel.rows)
        blocks = self._pulses(unit, first)
        pulses = channel.since(start)
        full = self._fill(unit, first)
        if full is None:
            return None
        self._answers_silence(unit)
        self._tell(unit, -1.0)
        if not self._session.wait(_EMPTY, lambda: channel.level(3) < self.rise(channel)):
            self._hand.vent(f'{name} does not empty')
        fit = fit_valve(pulses[:, 1], pulses[:, 2] - channel.zero, pulses[:, 3],
                        self._volumes(unit, pulses[:, 1]), full, blocks=blocks)
        ok = fit.misfit < _MISFIT * self._supply + 3.0 * channel.noise
        self._result.say(ok, f'{name} valve', f'conductance {fit.conductance:.3g} m^3/(s Pa), '
                         f'dead band {fit.dead_band:.3f}, acts {1e3 * fit.delay:.1f} ms after the '
                         'reading it answers; the law of such a valve leaves '
                         f'{fit.misfit / 1e3:.2f} kPa')
        return fit

    def gas(self, unit: int) -> float:
        """Return the gas volume of the unit's muscles at the measured strain, m^3."""
        strain = self._hand.strain
        shown = float(strain.rows[-1][2]) if strain.rows else 0.0
        return float(self._bundle.gas_volume(shown if np.isfinite(shown) else 0.0)[unit])

    def _volumes(self, unit: int, times: np.ndarray) -> np.ndarray:
        """Return the unit's volume (m^3) at stamps (s), by the strain that was measured then."""
        rows = self._hand.strain.since(0)
        rows = rows[np.isfinite(rows[:, 2])]
        strain = np.interp(times, rows[:, 1], rows[:, 2]) if len(rows) else np.zeros(len(times))
        return np.asarray(self._bundle.gas_volume(strain)[:, unit] + self._tube)

    def _first_air(self, unit: int) -> float | None:
        """Increase the command until a pressure rises; return it, None if none rises."""
        command, name = 0.0, f'mu{unit + 1}'
        while not (risen := self.risen()) and command < _STAIR_TOP:
            command += max(_STAIR, _STAIR_SHARE * command)
            self._tell(unit, command)
            self._session.wait(_STAIR_TIME, lambda: bool(self.risen()))
        self._tell(unit, 0.0)
        self._session.wait(_REST)
        if risen == [unit]:
            return command
        if risen:
            self._result.say(False, f'{name} valve', f'commanded to fill, {self._named(risen)} '
                             'rises: valves or pressure channels are exchanged')
        else:
            self._result.say(False, f'{name} valve', f'commanded to fill by {command:.2f}, no '
                             f'pressure rises by {self.rise(self._hand.pressure[unit]):.0f} of '
                             'what comes: valve, hose, supply_enable, or the unit of the pressure')
        self._dump()
        return None

    def _pulses(self, unit: int, first: float) -> list[int]:
        """Fill and exhaust at several openings; return the rows at which each begins."""
        channel, blocks = self._hand.pressure[unit], []
        start = len(channel.rows)
        for beyond in _BEYOND:
            for side, reached in ((1.0, lambda: channel.last > _HIGH * self._supply),
                                  (-1.0, lambda: channel.last < _LOW * self._supply)):
                blocks.append(len(channel.rows) - start)
                self._tell(unit, side * min(first + beyond, 1.0))
                self._session.wait(_STROKE, reached)
                self._tell(unit, 0.0)
                self._session.wait(_REST)
        return blocks[1:]

    def _fill(self, unit: int, first: float) -> float | None:
        """Fill to the supply; check the scale of the pressure and the signs of the load."""
        hand, name, channel = self._hand, f'mu{unit + 1}', self._hand.pressure[unit]
        before = tuple(c.level() if c.rows else np.nan for c in (hand.force, hand.strain))
        self._tell(unit, min(first + 0.3, 1.0))

        def settled() -> bool:
            values = [row[2] for row in channel.rows[-40:]]
            return bool(abs(np.mean(values[:20]) - np.mean(values[20:]))
                        < 0.005 * self._supply)
        self._session.wait(0.3)
        self._session.wait(_FILL, settled)
        full = channel.level(20)
        self._judge_load(unit, before[0], before[1], full)
        ratio = full / self._supply
        if abs(ratio - 1.0) <= _SCALE:
            self._result.say(True, f'{name} scale', f'{full / 1e3:.1f} kPa at a supply of '
                             f'{self._supply / 1e3:.0f} kPa')
            return full
        near = min(_FACTORS, key=lambda factor: abs(np.log(abs(ratio) / factor)))
        guess = (f': as if it were {_FACTORS[near]}' if abs(ratio / near - 1.0) < _SCALE else
                 ': a wrong scale, or a large leak' if ratio < 1.0 else '')
        self._result.say(False, f'{name} scale', f'shows {full / 1e3:.3g} kPa at a supply of '
                         f'{self._supply / 1e3:.0f} kPa{guess}')
        self._answers_silence(unit)
        self._dump()
        return None

    def _judge_load(self, unit: int, force: float, strain: float, full: float) -> None:
        """Compare the changes of force and strain with those of a muscle that fills."""
        hand, name = self._hand, f'mu{unit + 1}'
        if not (hand.force.rows and hand.strain.rows):
            return
        pulled, moved = hand.force.level() - force, hand.strain.level() - strain
        shortened = moved > max(5.0 * hand.strain.noise, 2e-3)
        if moved < -max(5.0 * hand.strain.noise, 2e-3):
            self._result.say(False, f'{name} strain', f'changed by {moved:.3f} when it filled; '
                             'expected more, positive when shorter')
        if shortened:
            self._result.say(True, f'{name} strain', f'changed by {moved:.3f} when it filled')
        pressure = np.zeros(len(self._units))
        at = hand.strain.level() + hand.strain.zero
        rest = float(self._bundle.force(at, pressure))
        pressure[unit] = full
        expected = float(self._bundle.force(at, pressure)) - rest
        least = max(5.0 * hand.force.noise, 0.3 * expected)
        text = f'changed by {pulled:.2f} N when it filled; the model says {expected:.1f} N'
        if pulled < -5.0 * hand.force.noise - 1.0:
            self._result.say(False, f'{name} force', f'{text}: expected tension positive')
        elif not shortened and expected > 10.0 * hand.force.noise and pulled < least:
            self._result.say(False, f'{name} force', f'{text}: is it N, and does it pull?')
        else:
            self._result.say(True, f'{name} force', text)

    def _answers_silence(self, unit: int) -> None:
        """Send no commands to one valve: the driver must exhaust it."""
        channel, name = self._hand.pressure[unit], f'mu{unit + 1}'
        self._tell(unit, 0.0)
        self._session.wait(_REST)
        start, full = len(channel.rows), channel.level(5)
        self._session.wait(_HOLD)
        before, full = full, channel.level(5)
        times = channel.since(start - 1)[:, 1]
        span = float(times[-1] - times[0])
        gap = max(float(np.max(np.diff(times), initial=0.0)), _HOLD - span)
        if gap > WatchConfig.timeout:
            self.loss[unit] = np.inf
            self._result.say(False, f'{name} tightness', f'not known: no reading for {gap:.2f} s, '
                             'which the driver takes as no command, and exhausts')
        else:
            loss = self.loss[unit] = max(1.0 - full / before, 0.0) / span
            self._result.say(loss < _LEAK, f'{name} tightness', f'loses {loss:.0%} of its '
                             'pressure in a second while its valve is shut' + (
                                 '' if loss < _LEAK else f'; expected less than {_LEAK:.0%}'))
        self._tell(unit, None)
        fell, took = self._falls(channel, full, _MUTE)
        ok = fell and took < _MUTE_MOST
        self._result.say(ok, f'{name} watchdog', (
            f'exhausts {took:.2f} s after its last command' if fell else
            f'stays at {channel.level() / 1e3:.1f} kPa for {_MUTE:g} s without commands')
            + ('' if ok else '; expected to exhaust after 0.1 s (docs/how_to/driver.md)'))

    def answers_silent_permission(self, unit: int, fit: ValveFit) -> None:
        """Shut a full motor unit; it must empty when supply_enable falls silent."""
        hand, channel = self._hand, self._hand.pressure[unit]
        self._tell(unit, min(0.3 + fit.dead_band, 1.0))
        self._session.wait(0.3, lambda: channel.last > 0.5 * self._supply)
        self._tell(unit, 0.0)
        self._session.wait(0.1)
        hand.permission = None
        fell, took = self._falls(channel, channel.level(), _PERMISSION_MUTE)
        ok = fell and took < _PERMISSION_MOST
        self._result.say(ok, 'supply_enable', (
            f'exhausts {took:.2f} s after its last message' if fell else
            f'mu{unit + 1} stays at {channel.level() / 1e3:.1f} kPa for {_PERMISSION_MUTE:g} s '
            'without it')
            + ('' if ok else '; expected to shut and exhaust after 0.5 s (docs/how_to/driver.md)'))

    def _falls(self, channel: Channel, full: float, patience: float) -> tuple[bool, float]:
        """Wait until a pressure falls, from ``full`` (Pa); return whether it did, and when, s."""
        begin = len(channel.rows)
        fell = self._session.wait(patience, lambda: channel.last < 0.7 * full)
        rows = channel.since(begin)
        return fell, rows[-1, 1] - rows[0, 1] if len(rows) else 0.0
