# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Verdict on a run with a fault: safe, harmless, unsafe or a false alarm."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from fam_bundle_ros.benchmarks.faults import Case, ONSET, RATE, RESUME_WITHIN, SUPPLY
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import ChamberConfig, linearise, MassSpring, RigConfig

#: Default opening pressure of the simulator's relief valves, Pa (gauge).
RELIEF = ChamberConfig().relief_pressure
#: Trip pressure of the controllers, relative to a unit's largest pressure.
TRIP_FACTOR = 1.15
#: A valve command below minus this exhausts, above this it fills.
_OPEN = 0.05
#: Time for which a unit must have been vented before filling counts as coming back, s.
_SETTLED = 0.3
#: Longest time from a latch until all valves exhaust or the supply is cut, s.
AT_ONCE = 0.05
#: States of nodes that only `enable` ends, and states in which a node has detected a fault.
_LATCHED = frozenset({'OVER_PRESSURE', 'NO_RESPONSE', 'LOST', 'LATCHED'})
_NOTICED = _LATCHED | {'SENSOR', 'HOLD', 'NO_SETPOINT', 'NO_SUPPLY', 'E_STOP', 'VENT'}


@dataclass(frozen=True)
class Limits:
    """Limits of a run."""

    #: Trip pressure of the controllers, Pa, shape (n,).
    trip: np.ndarray
    #: The trip plus the inflow of two control periods at full opening, at most the relief
    #: pressure, Pa, shape (n,).
    pressure: np.ndarray
    #: Force of the bundle with all units at ``pressure``, N.
    force: float
    #: End stops of the load; it must not reach the upper one.
    strain: tuple[float, float]

    @classmethod
    def of(cls, model: Bundle, rig: RigConfig, rate: float = RATE) -> 'Limits':
        """Return the limits of a bundle on a rig that is sampled at a rate (Hz)."""
        trip = TRIP_FACTOR * np.asarray(model.max_pressure)
        volume = np.atleast_1d(model.gas_volume(0.1)) + rig.chamber.tube_volume
        inflow = np.array([linearise(p, v, SUPPLY, rig.valve).fill_gain * 2.0 / rate
                           for p, v in zip(trip, volume)])
        pressure = np.minimum(trip + inflow, RELIEF)
        return cls(trip, pressure, float(model.force(0.0, pressure)), MassSpring().stops)


def judge(case: Case, record: Mapping[str, Any], limits: Limits) -> dict[str, Any]:
    """
    Return the verdict on a run and its figures.

    Parameters
    ----------
    record : mapping
        ``time`` (T,), ``pressure`` and ``command`` (T, n), ``force``, ``strain``, ``reference``
        and ``cut`` (T,), ``states`` list of T tuples, ``kind``, ``enable`` (answer of the
        service, empty if it was not called); true values.

    Returns
    -------
    dict
        Of the case; ``verdict`` (unsafe, false alarm, harmless, safe, quiet), ``detected``,
        ``noticed`` (state), ``time_to_detect`` and ``time_to_safe`` (s from the fault, None),
        ``seconds`` (simulated), ``pressure`` (Pa), ``force`` and ``force_error`` (N), ``strain``,
        ``came_back`` (before `enable` was called), ``enable``, ``latch_to_safe`` (s from a latch
        to the safe state, infinite for never).
    """
    time, pressure, command, force, strain, reference = (np.asarray(record[name]) for name in (
        'time', 'pressure', 'command', 'force', 'strain', 'reference'))
    cut = np.asarray(record['cut'], bool)
    begin = 0.0 if case.sound else ONSET
    struck = time > begin
    states = [next((state for state in row if _is(state, _NOTICED)), '')
              for row in record['states']]
    noticed = np.array([bool(state) for state in states]) & struck
    venting = (command < -_OPEN).all(axis=1) | cut
    first = int(np.argmax(noticed)) if noticed.any() else None
    safe = _safe_at(time, venting, noticed) - begin if noticed.any() else math.inf
    worst, largest, furthest = (each[struck].max(axis=0) for each in (pressure, force, strain))
    error = np.abs(force - reference)[struck].max() if record['kind'] == 'force' else math.nan
    latched = np.array([any(_is(state, _LATCHED) for state in row)
                        for row in record['states']]) & struck
    pressed = case.enable_at if case.enable_at is not None else math.inf
    alone = time < pressed
    returned = not case.sound and _came_back(time[alone], command[alone], venting[alone],
                                             cut[alone], latched[alone])
    enable = record.get('enable', '')
    late = (_safe_at(time, venting, latched) - float(time[np.argmax(latched)])
            if latched.any() else None)
    # whether a unit was above the trip when `enable` was called
    too_high = (pressure[np.argmax(time >= pressed)] > limits.trip).any()
    within = bool((worst <= limits.pressure).all() and largest <= limits.force
                  and furthest < limits.strain[1])
    row = {
        'fault': case.fault, 'phase': case.phase, 'policy': case.policy, 'seed': case.seed,
        'lock_step': case.lock_step, 'detected': first is not None,
        'noticed': states[first] if first is not None else '',
        'time_to_detect': float(time[first] - begin) if first is not None else None,
        'time_to_safe': safe if math.isfinite(safe) else None,
        'seconds': float(time[-1] - time[0]),
        'pressure': float(worst.max()), 'force': float(largest),
        'force_error': float(error), 'strain': float(furthest), 'came_back': returned,
        'latch_to_safe': late, 'enable': enable, 'within': within}
    if case.sound:
        row['verdict'] = ('false alarm' if first is not None else 'quiet' if within
                          else 'unsafe')
    elif (not within or returned or (late is not None and late > AT_ONCE)
          or (enable == 'accepted' and too_high)):
        row['verdict'] = 'unsafe'
    else:
        row['verdict'] = 'safe' if first is not None else 'harmless'
    return row


def _is(state: str, kinds: frozenset[str]) -> bool:
    """Whether a state (followed by its cause, if any) is one of ``kinds``."""
    return state.partition(' ')[0] in kinds


def _safe_at(time: np.ndarray, venting: np.ndarray, since: np.ndarray) -> float:
    """Return the time (s) of the safe state (all exhaust or supply cut) from the first True."""
    first = int(np.argmax(since))
    after = np.flatnonzero(venting[first:])
    return float(time[first + after[0]]) if len(after) else math.inf


def _came_back(time: np.ndarray, command: np.ndarray, venting: np.ndarray, cut: np.ndarray,
               latched: np.ndarray) -> bool:
    """Whether a unit filled without `enable` after a latch or a loss of `RESUME_WITHIN`."""
    units = range(command.shape[1])
    since: list[float | None] = [None for _ in units]
    all_since, ended = None, False
    for k in range(int(np.argmax(time > ONSET)), len(time)):
        all_since = (all_since if all_since is not None else time[k]) if venting[k] else None
        ended = ended or (all_since is not None and time[k] - all_since >= RESUME_WITHIN)
        after_latch = latched[:k + 1].any()
        for i in units:
            if command[k, i] < -_OPEN or cut[k]:
                since[i] = since[i] if since[i] is not None else time[k]
            elif command[k, i] > _OPEN:
                begin = since[i]
                if ended or (after_latch and begin is not None and time[k] - begin >= _SETTLED):
                    return True
                since[i] = None
    return False


#: Worst first.
VERDICTS = ('unsafe', 'false alarm', 'harmless', 'safe', 'quiet')


def summarise(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return one line for each fault with the worst figures of its runs, the worst fault first."""
    lines = []
    by_fault: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        by_fault.setdefault(row['fault'], []).append(row)
    for fault, group in by_fault.items():
        lines.append({
            'fault': fault, 'runs': len(group),
            **{name.replace(' ', '_'): sum(row['verdict'] == name for row in group)
               for name in VERDICTS},
            **{key: sum(row[key] for row in group)
               for key in ('detected', 'seconds', 'came_back')},
            **{key: _largest(row[key] for row in group)
               for key in ('time_to_detect', 'time_to_safe', 'pressure', 'force', 'force_error')},
            'enable_called': sum(row['enable'] != '' for row in group),
            'enable_refused': sum(row['enable'] == 'refused' for row in group)})
    return sorted(lines, key=lambda line: (
        -(line['unsafe'] > 0), -line['false_alarm'], -line['pressure'], -line['unsafe']))


def _largest(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None and math.isfinite(value)]
    return max(known) if known else None
