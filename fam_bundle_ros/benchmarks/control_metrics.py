# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Figures of one run of the control benchmark, and the summary over all of them."""

from typing import Any

import numpy as np

from fam_bundle_ros.benchmarks.least_air import filling_air, least_air
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import air_energy, liquid_energy, RigConfig
from fam_bundle_ros.simulation import Log

#: Window around a switch, s.
BEFORE, AFTER = 0.1, 0.4
#: A switch back while the reference moved by less than this is chatter, N; strain beside it.
CHATTER = {'force': 1.5, 'strain': 0.004}
#: Trajectories on which transitions are compared: forces through the whole overlap.
CROSSINGS = ('ramp', 'crossing_sine')
#: What `reversal_aware` is to reach: figure, words, target, whether it is the most or the least.
TARGETS = (
    ('dip_ratio', 'transition dip over that of neglect', 0.10, True),
    ('transition_rms_ratio', 'tracking rms in the transition, over that of neglect', 1 / 3, True),
    ('air_over_least', 'air over the least that any allocation could use', 1.10, True),
    ('air_saving', 'saving of air against all on', 0.0, False),
    ('tracking_ratio_all_on', 'tracking rms over that of all on', 1.1, True),
    ('chatter_runs', 'runs with chatter', 0.0, True),
)



def metrics(log: Log, plant: Bundle, rig: RigConfig, search: bool) -> dict[str, Any]:
    """
    Return the figures of one run, SI units (errors in N for a force, in strain for a strain).

    Parameters
    ----------
    log : Log
    plant : Bundle
    rig : RigConfig
    search : bool
        Work out the least air that any allocation could use.

    Returns
    -------
    dict
        ``kind``, ``tracking_rms``, ``largest_error``, ``transition_rms``, ``dip_depth``,
        ``dip_length`` (s), ``switches``, ``shortest_dwell`` (s), ``chatter``, ``air_mass`` (kg,
        what filling the first pressures takes included), ``work`` (J), ``energy`` (J),
        ``efficiency``, ``liquid_energy`` (J), ``time_saturated`` (s), ``air_least`` (kg) and
        ``air_over_least``. None where there is nothing to say.
    """
    error, time = log.error, log.time
    dt = float(time[1] - time[0])
    switches = log.switches
    inside = _near(time, switches)
    depth, length = _dip(log, switches)
    tube = rig.chamber.tube_volume
    # How the start was taken up is no part of the trajectory: its pressures are counted, not
    # the way to them.
    air = float(log.air[-1] - log.air[0]) + filling_air(
        plant, log.pressure[0], float(log.strain[0]), tube)
    energy = air_energy(air, rig.supply.pressure, rig.ambient_pressure)
    work = float(np.maximum(np.diff(log.work), 0.0).sum())
    volume = plant.gas_volume(log.strain)
    row: dict[str, Any] = {
        'kind': log.kind,
        'tracking_rms': _rms(error),
        'largest_error': float(np.max(np.abs(error))),
        'transition_rms': _rms(error[inside]) if inside.any() else None,
        'dip_depth': depth,
        'dip_length': length,
        'switches': len(switches),
        'shortest_dwell': float(np.diff(time[switches]).min()) if len(switches) > 1 else None,
        'chatter': chatters(log),
        'air_mass': air,
        'work': work,
        'energy': energy,
        'efficiency': work / energy if energy > 0.0 else None,
        'liquid_energy': liquid_energy(volume, log.pressure, rig.supply.pressure),
        'time_saturated': dt * int(np.count_nonzero(log.saturated != '')),
        'air_least': None,
        'air_over_least': None,
    }
    if search:
        least = least_air(plant, time, _smooth(log.force, dt), _smooth(log.strain, dt), tube)
        row['air_least'] = least
        row['air_over_least'] = row['air_mass'] / least
    return row


def chatters(log: Log) -> bool:
    """Return whether a switch was taken back while the reference stood (nearly) still."""
    switches = log.switches
    direction = np.sign(np.diff(log.state))[switches - 1]
    for k in range(len(switches) - 1):
        between = log.reference[switches[k]:switches[k + 1] + 1]
        if direction[k] != direction[k + 1] and np.ptp(between) < CHATTER[log.kind]:
            return True
    return False


def summarise(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """
    Return what ``reversal_aware`` reaches, against the others on the nominal plant.

    Returns
    -------
    dict
        ``dip_ratio`` and ``transition_rms_ratio`` (worst of the crossing trajectories, against
        ``neglect``), ``air_over_least`` (worst trajectory), ``air_saving`` (least over the
        trajectories, share of ``all_on``'s air), ``tracking_ratio_all_on`` (worst),
        ``chatter_runs`` (of all plants); the same by trajectory under ``by_trajectory``, and
        ``neglect_chatter_runs``. Values are None where the runs for them were left out.
        ``not_reached``: by trajectory, one sentence per figure that misses its target.
    """
    by = {(r['policy'], r['scheme'], r['trajectory'], r['plant']): r for r in rows}
    trajectories = list(dict.fromkeys(r['trajectory'] for r in rows))
    table: dict[str, dict[str, Any]] = {}
    for name in trajectories:
        ours = by.get(('reversal_aware', 'orderly', name, 'nominal'))
        neglect = by.get(('neglect', 'orderly', name, 'nominal'))
        all_on = by.get(('reversal_aware', 'all_on', name, 'nominal'))
        if ours is None:
            continue
        entry: dict[str, Any] = {'air_over_least': ours['air_over_least']}
        if neglect and name in CROSSINGS:
            entry['dip_ratio'] = _ratio(ours['dip_depth'], neglect['dip_depth'])
            entry['transition_rms_ratio'] = _ratio(ours['transition_rms'],
                                                   neglect['transition_rms'])
        if all_on:
            entry['air_saving'] = 1.0 - ours['air_mass'] / all_on['air_mass']
            # What the least that any allocation needs would save: a bound, not a target.
            entry['air_saving_bound'] = 1.0 - ours['air_least'] / all_on['air_mass']
            liquid = _ratio(ours['liquid_energy'], all_on['liquid_energy'])
            # At a constant strain no volume changes, and a liquid would not be drawn at all.
            entry['liquid_saving'] = None if liquid is None else 1.0 - liquid
            entry['tracking_ratio_all_on'] = ours['tracking_rms'] / all_on['tracking_rms']
        table[name] = entry
    return {
        'dip_ratio': _worst(table, 'dip_ratio', max),
        'transition_rms_ratio': _worst(table, 'transition_rms_ratio', max),
        'air_over_least': _worst(table, 'air_over_least', max),
        'air_saving': _worst(table, 'air_saving', min),
        'tracking_ratio_all_on': _worst(table, 'tracking_ratio_all_on', max),
        'chatter_runs': sum(r['chatter'] for r in rows if r['policy'] == 'reversal_aware'),
        'neglect_chatter_runs': sum(r['chatter'] for r in rows if r['policy'] == 'neglect'),
        'by_trajectory': table,
        'not_reached': _not_reached(table),
    }


def reaches(found: float, target: float, at_most: bool) -> bool:
    """Return whether a figure reaches its target; the least is to be above it."""
    return found <= target if at_most else found > target


def _not_reached(table):
    """Return which targets are missed, by how much, and why where no allocation could reach it."""
    said: dict[str, list[str]] = {}
    for name, entry in table.items():
        for figure, words, target, at_most in TARGETS:
            found = entry.get(figure)
            if found is None or reaches(found, target, at_most):
                continue
            why = ''
            if figure == 'air_saving' and entry['air_saving_bound'] < 0.02:
                why = ('; the least air that any allocation needs for these forces would save '
                       f"{100 * entry['air_saving_bound']:.1f} %: at a constant strain every one "
                       'needs the same sum of pressures at the peak')
            said.setdefault(name, []).append(f'{words} {found:.3f} against {target:.3f}{why}')
    return said


def _rms(error):
    return float(np.sqrt(np.mean(error ** 2)))


def _ratio(ours, other):
    return None if ours is None or not other else ours / other


def _worst(table, key, choose):
    values = [entry[key] for entry in table.values() if entry.get(key) is not None]
    return choose(values) if values else None


def _near(time, switches):
    """Return which samples (T,) lie in the window of a switch."""
    inside = np.zeros(len(time), bool)
    for index in switches:
        inside |= (time >= time[index] - BEFORE) & (time <= time[index] + AFTER)
    return inside


def _dip(log, switches):
    """Return depth and length (s) of the deepest shortfall around a switch."""
    if len(switches) == 0:
        return None, None
    short = np.where(_near(log.time, switches), log.error, 0.0)
    deepest = int(np.argmax(short))
    depth = float(short[deepest])
    below = short > 0.5 * depth
    start = deepest - int(np.argmin(below[deepest::-1])) if not below[:deepest + 1].all() else 0
    rest = below[deepest:]
    end = deepest + (int(np.argmin(rest)) if not rest.all() else len(rest))
    return depth, float((end - start - 1) * (log.time[1] - log.time[0]))


def _smooth(signal, dt, width=0.02):
    """Return a signal without what is faster than ``width``: sensor noise drives no allocation."""
    count = max(1, round(width / dt)) | 1
    padded = np.pad(signal, count // 2, mode='edge')
    return np.convolve(padded, np.full(count, 1.0 / count), mode='valid')
