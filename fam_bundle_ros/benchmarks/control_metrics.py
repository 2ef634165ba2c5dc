# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Figures of one run of the control benchmark, and comparison of runs of the same case."""

from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from fam_bundle_ros.benchmarks.control_trajectories import top_force
from fam_bundle_ros.benchmarks.least_air import least_air
from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.pneumatics import GAS_CONSTANT, POLYTROPIC, REFERENCE_TEMPERATURE
from fam_bundle_ros.plant import air_energy, liquid_energy, RigConfig
from fam_bundle_ros.simulation import Log, Trajectory

#: Window around a switch, s.
BEFORE, AFTER = 0.1, 0.4
#: A switch back while the reference moved by less than this (N, strain) is chatter.
CHATTER = {'force': 1.5, 'strain': 0.004}


def metrics(log: Log, plant: Bundle, rig: RigConfig) -> dict[str, Any]:
    """
    Return `row_of` with the energy used.

    Returns
    -------
    dict
        In addition: ``energy`` (J), ``efficiency``, ``liquid_energy`` (J). None if not defined.
    """
    row = row_of(log, plant, rig)
    energy = air_energy(row['air_mass'], rig.supply.pressure, rig.ambient_pressure)
    volume = plant.gas_volume(log.strain)
    return {**row, 'energy': energy, 'efficiency': row['work'] / energy if energy > 0.0 else None,
            'liquid_energy': liquid_energy(volume, log.pressure, rig.supply.pressure)}


def row_of(log: Log, plant: Any, rig: RigConfig) -> dict[str, Any]:
    """
    Return the figures of one run, SI units (errors in N for a force, in strain for a strain).

    Returns
    -------
    dict
        ``kind``, ``tracking_rms``, ``largest_error``, ``transition_rms``, ``dip_depth``,
        ``dip_length`` (s), ``switches``, ``shortest_dwell`` (s), ``chatter``, ``air_mass`` (kg,
        including the filling to the first pressures), ``work`` (J), ``time_saturated`` (s).
        None if not defined.
    """
    error, time = log.error, log.time
    dt = float(time[1] - time[0])
    switches = log.switches
    inside = near(time, switches)
    depth, length = _dip(log, switches)
    # The approach to the start is not part of the trajectory: the air of its pressures is
    # counted, not the air used on the way.
    air = float(log.air[-1] - log.air[0]) + held_air(
        plant, log.pressure[0], float(log.strain[0]), rig.chamber.tube_volume)
    return {
        'kind': log.kind,
        'tracking_rms': rms(error),
        'largest_error': float(np.max(np.abs(error))),
        'transition_rms': rms(error[inside]) if inside.any() else None,
        'dip_depth': depth,
        'dip_length': length,
        'switches': len(switches),
        'shortest_dwell': float(np.diff(time[switches]).min()) if len(switches) > 1 else None,
        'chatter': chatters(log),
        'air_mass': air,
        'work': float(np.maximum(np.diff(log.work), 0.0).sum()),
        'time_saturated': dt * int(np.count_nonzero(log.saturated != '')),
    }


def compared(log: Log, ours: Log, beside: Log) -> dict[str, Any]:
    """
    Return figures of a run relative to equal pressure on the same trajectory.

    Returns
    -------
    dict
        ``rms_ratio``, and ``error_there``: the largest error around the switches of *our*
        controller, None without switches.
    """
    inside = near(ours.time, ours.switches)
    return {'rms_ratio': rms(log.error) / rms(beside.error),
            'error_there': float(np.abs(log.error[inside]).max()) if inside.any() else None}


def held_air(plant: Any, pressure: np.ndarray, strain: float, tube_volume: float) -> float:
    """
    Return the air mass for filling vented units to gauge pressures (n,), Pa, in kg.

    ``tube_volume`` (m^3) is that of each motor unit.
    """
    model = plant.model(False)
    gauge = [max(float(p), 0.0) for p in pressure]
    volume = [tube_volume + model.volume(i, strain, gauge, 0.0, model.shape, model.parameters,
                                         model.tables) for i in range(plant.n)]
    return float(np.dot(gauge, volume)) / (POLYTROPIC * GAS_CONSTANT * REFERENCE_TEMPERATURE)


def least_air_of(log: Log, model: Bundle) -> float:
    """Return the least air, kg, that any allocation could use for the forces of a run."""
    # smoothed over 20 ms, as sensor noise must not drive the allocation
    count = max(1, round(0.02 / (log.time[1] - log.time[0]))) | 1
    force, strain = (uniform_filter1d(signal, count, mode='nearest')
                     for signal in (log.force, log.strain))
    return least_air(model, log.time, force, strain)


def one_unit_is_enough(trajectory: Trajectory, model: Bundle, plant: Any) -> bool:
    """Return whether the first unit alone can give all of a force trajectory."""
    if trajectory.kind != 'force':
        return False
    times = np.linspace(0.0, trajectory.duration, 400)
    most = max(trajectory.value(float(t)) for t in times)
    strains = ([trajectory.imposed(float(t)) for t in times[::10]] if trajectory.imposed
               else [trajectory.load.start(model.length).strain])
    return most <= min(top_force(strain, model, plant, units=1) for strain in strains)


def chatters(log: Log) -> bool:
    """Return whether a switch was reversed while the reference was nearly constant."""
    switches = log.switches
    direction = np.sign(np.diff(log.state))[switches - 1]
    for k in range(len(switches) - 1):
        between = log.reference[switches[k]:switches[k + 1] + 1]
        if direction[k] != direction[k + 1] and np.ptp(between) < CHATTER[log.kind]:
            # not chatter if the load moved in between
            moved = np.ptp(log.strain[switches[k]:switches[k + 1] + 1])
            return log.kind != 'strain' and bool(moved <= CHATTER['strain'])
    return False


def near(time: np.ndarray, switches: np.ndarray) -> np.ndarray:
    """Return which samples (T,) lie in the window of a switch."""
    inside = np.zeros(len(time), bool)
    for index in switches:
        inside |= (time >= time[index] - BEFORE) & (time <= time[index] + AFTER)
    return inside


def _dip(log, switches):
    """Return depth and length (s) of the deepest shortfall around a switch."""
    if len(switches) == 0:
        return None, None
    short = np.where(near(log.time, switches), log.error, 0.0)
    deepest = int(np.argmax(short))
    depth = float(short[deepest])
    below = short > 0.5 * depth
    start = deepest - int(np.argmin(below[deepest::-1])) if not below[:deepest + 1].all() else 0
    rest = below[deepest:]
    end = deepest + (int(np.argmin(rest)) if not rest.all() else len(rest))
    return depth, float((end - start - 1) * (log.time[1] - log.time[0]))
