# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Two schemes without a model, for comparison: one pressure for all units, and orderly switching.

Both are a PI controller on the error of force or strain. ``equal_pressure`` applies its output to
all motor units (a single equivalent motor unit). ``threshold`` fills them in turn (orderly
recruitment after Jenkins, Chapman, Bryant 2016, Smart Mater. Struct. 25, 125016): when a unit has
reached its limit and the error is positive, the next one starts; when it is empty and the error is
negative, the one before continues; a dwell time prevents chattering. Kernels.
"""

from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from fam_bundle_ros.control.observer import low_pass
from fam_bundle_ros.control.outer_loop import STRAIN
from fam_bundle_ros.control.reasons import EMPTY, FULL
from fam_bundle_ros.control.saturation import FREE, HIGH, LOW
from fam_bundle_ros.errors import InputError

#: Pa: a unit this close to its limit is full, this close to ambient empty.
_END = 500.0
#: Contraction at which the force range is taken; a muscle reaches about twice that.
_STRAIN = 0.1


@dataclass(frozen=True)
class BaselineConfig:
    """
    Gains of the schemes ``equal_pressure`` and ``threshold``.

    The error is relative to the force range of all motor units from empty to full (to 0.2 for a
    strain), the output relative to their largest pressure: gains apply to bundles of any size.

    Parameters
    ----------
    force_gain : float
    force_integral : float, 1/s
    strain_gain : float
    strain_integral : float, 1/s
    filter_time : float, s
        Low-pass filter of the reading.
    dwell : float, s
        Least time between two switches of ``threshold``.
    """

    force_gain: float = 0.3
    force_integral: float = 10.0
    strain_gain: float = 0.1
    strain_integral: float = 2.0
    filter_time: float = 0.005
    dwell: float = 0.25

    def __post_init__(self):
        """Check the ranges of the gains."""
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f'baseline {name} is {value}; expected a finite number, 0 or '
                                 'more')


@dataclass
class BaselineSettings:
    """`BaselineConfig` as kernels take it; ranges of force (N) and strain."""

    force_gain: float
    force_integral: float
    strain_gain: float
    strain_integral: float
    filter_time: float
    dwell: float
    force_range: float
    strain_range: float
    #: Share of each unit in the force range, (n,).
    share: list


@dataclass
class BaselineState:
    """
    Memory of the two schemes.

    Attributes
    ----------
    reading : float, N or 1
        Force or strain (by ``kind``, -1 for none yet), filtered.
    integral : float
        Integral, relative to the largest pressure: for all units, or for the one being filled.
    state : int
        k of RSk: number of active units.
    since : float, s
        Time since the last switch.
    """

    reading: float = 0.0
    integral: float = 0.0
    kind: int = -1
    state: int = 0
    since: float = math.inf


def baseline_settings(config: BaselineConfig, bundle: Any, limit: Any) -> BaselineSettings:
    """
    Return the record that `baseline_step` takes.

    Parameters
    ----------
    config : BaselineConfig
    bundle : Bundle
        Gives only data of a data sheet: force at full pressure and medium contraction.
    limit : ndarray (n,), Pa (gauge)
    """
    force = bundle.unit_forces(_STRAIN, limit) - bundle.unit_forces(_STRAIN, 0.0 * limit)
    force = np.maximum(force, 1.0)
    return BaselineSettings(**vars(config), force_range=float(force.sum()),
                            strain_range=2.0 * _STRAIN, share=(force / force.sum()).tolist())


def forget_baseline(state: Any) -> None:
    """Reset to vented."""
    state.reading = state.integral = 0.0
    state.kind, state.state, state.since = -1, 0, math.inf


def begin_baseline(settings: Any, state: Any, equal: bool, order: Any, limits: Any, pressure: Any
                   ) -> None:
    """
    Start the integral from present pressures (n,), Pa; equal ones for about the same force.

    The other arguments are those of `baseline_step`.
    """
    for k in range(len(limits)):
        unit = order[k]
        if equal:
            state.integral += settings.share[unit] * pressure[unit] / highest(limits)
        elif pressure[unit] > _END:
            state.state, state.integral = k + 1, pressure[unit] / limits[unit]


def baseline_step(settings: Any, state: Any, equal: bool, order: Any, limits: Any, still: float,
                  measurement: Any, kind: int, value: float, dt: float, command: Any) -> None:
    """
    Advance one of the two schemes by a tick.

    Parameters
    ----------
    settings, state : BaselineSettings, BaselineState
    equal : bool
        One pressure for all units, else units in turn.
    order : vector (n,) of int
    limits : vector (n,), Pa (gauge)
    still : float, Pa
        Half-width of the backlash of the pressures.
    measurement, kind, value, dt, command
        As for `recruitment_loop.recruitment_step`.
    """
    is_strain = kind == STRAIN
    reading = measurement.strain if is_strain else measurement.force
    share = 1.0
    if state.kind == kind and settings.filter_time > 0.0:
        share = low_pass(dt, settings.filter_time)
    state.kind, state.reading = kind, state.reading + share * (reading - state.reading)
    error = (value - state.reading) / (settings.strain_range if is_strain
                                       else settings.force_range)
    gain = settings.strain_gain if is_strain else settings.force_gain
    step = (settings.strain_integral if is_strain else settings.force_integral) * error * dt
    before = state.state
    if equal:
        answer = pi_answer(state, gain * error, step)
        state.state = len(limits) if answer > 0.0 else 0
        for i in range(len(limits)):
            play(command, i, min(answer * highest(limits), limits[i]), limits[i], still)
    else:
        answer = in_turn(settings, state, order, limits, gain * error, step, dt)
        for k in range(len(limits)):
            full = 1.0 if k < state.state - 1 else answer if k == state.state - 1 else 0.0
            play(command, order[k], full * limits[order[k]], limits[order[k]], still)
    command.state, command.demand = state.state, value
    if before != state.state and not equal:
        command.reason.why, command.reason.state = FULL if state.state > before else EMPTY, before
    write_state(state, order, limits, answer, error, command)


def highest(values: Any) -> float:
    """Return the largest of a vector."""
    most = values[0]
    for i in range(len(values)):
        most = max(most, values[i])
    return most


def pi_answer(state: Any, proportional: float, step: float) -> float:
    """Return the output of a PI controller, 0..1; anti-windup at both limits."""
    answer = proportional + state.integral
    if not ((answer >= 1.0 and step > 0.0) or (answer <= 0.0 and step < 0.0)):
        state.integral += step
    return min(max(proportional + state.integral, 0.0), 1.0)


def in_turn(settings: Any, state: Any, order: Any, limits: Any, proportional: float, step: float,
            dt: float) -> float:
    """
    Switch if needed; return the output for the unit that is being filled, 0..1.

    Parameters
    ----------
    settings, state : BaselineSettings, BaselineState
    order, limits : vector (n,) of int, and of Pa (gauge)
    proportional, step : float
        Proportional part for all units, and change of the integral, in largest pressures.
    dt : float, s
    """
    n = len(limits)
    if state.state == 0 and step > 0.0:
        state.state, state.integral, state.since = 1, 0.0, math.inf
    state.since += dt
    if state.state == 0:
        return 0.0
    # One unit acts instead of all: scale by its smaller share of the force.
    share = settings.share[order[state.state - 1]]
    proportional, step = proportional / share, step / share
    answer = pi_answer(state, proportional, step)
    size = limits[order[state.state - 1]]
    if state.since > settings.dwell:
        if answer * size >= size - _END and step > 0.0 and state.state < n:
            state.state, state.since = state.state + 1, 0.0
            state.integral, answer = 0.0, 0.0
        elif answer * size <= _END and step < 0.0 and state.state > 1:
            state.state, state.since = state.state - 1, 0.0
            state.integral, answer = 1.0, 1.0
    return answer


def play(command: Any, unit: int, pressure: float, limit: float, still: float) -> None:
    """Write a pressure (Pa) behind a backlash of ``still``; 0 and the limit are exact."""
    if 0.0 < pressure < limit:
        pressure = max(min(max(command.pressure[unit], pressure - still), pressure + still), 0.0)
    command.pressure[unit] = pressure


def write_state(state: Any, order: Any, limits: Any, answer: float, error: float, command: Any
                ) -> None:
    """Write the active units, and whether the demand is out of reach."""
    n, total = len(limits), 0.0
    for k in range(n):
        total += command.pressure[order[k]]
        command.active[order[k]] = 1 if k < state.state else 0
    for i in range(n):
        command.share[i] = command.pressure[i] / total if total > 0.0 else 0.0
    last = state.state == n
    command.saturated = (HIGH if last and answer >= 1.0 and error > 0.0
                         else LOW if state.state <= 1 and answer <= 0.0 and error < 0.0 else FREE)
    margins = command.margins
    margins.recruit = margins.release = margins.limit = margins.width = math.nan
    margins.uncertainty = 0.0
