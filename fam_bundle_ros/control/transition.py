# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Transitions: start the crossings of units that the state machine has switched."""

from typing import Any

from fam_bundle_ros.control.crossing import begin_crossing, crossing_pace, hand_over_time
from fam_bundle_ros.control.curves import force_at, line_at, on_line
from fam_bundle_ros.control.jump import TOLERANCE
from fam_bundle_ros.control.observer import quick_noise, shift
from fam_bundle_ros.control.outer_loop import STRAIN
from fam_bundle_ros.control.reasons import BEYOND, UNREACHABLE
from fam_bundle_ros.control.switching import REVERSAL_AWARE, switch_step


def patience(settings: Any, state: Any, doubt: float, dt: float) -> float:
    """
    Return the duration of a crossing when there is time, s.

    At most the look-ahead horizon; 0, as fast as usual, in a strain loop, which has no observer,
    and without feedback.
    """
    outer = state.outer
    noise = quick_noise(outer.observer, outer.lag, dt)
    time = hand_over_time(doubt, max(noise, TOLERANCE), outer.lag)
    follows = settings.outer.feedback and outer.kind != STRAIN
    return min(time, settings.switching.horizon) if follows else 0.0


def switch_units(settings: Any, state: Any, dt: float, command: Any) -> None:
    """
    Advance the state machine and start the crossings of the units that it switched.

    For a demand beyond the limit all units needed start in one tick: each has its own valve.
    """
    machine = state.machine
    for _ in range(len(state.table.order)):
        before = machine.state
        switch_step(settings.switching, machine, state.table, state.demand, dt, command.reason)
        if machine.state == before:
            return
        if settings.switching.policy == REVERSAL_AWARE:
            if machine.state < before:
                leave_line(state, state.table.order[machine.state], command.pressure)
            send_unit(settings, state, command)
        if command.reason.why != BEYOND:
            return
        dt = 0.0


def leave_line(state: Any, unit: int, pressure: Any) -> None:
    """
    Return a lowered unit from its line to the model's curve, without a bump.

    The difference of the two forces (see `curves.line_at`) is added to the bias.
    """
    table, outer = state.table, state.outer
    if not on_line(table, unit, pressure[unit]):
        return
    table.lowered[unit] = 0
    jump = force_at(table, unit, pressure[unit]) - line_at(table, unit, pressure[unit])
    state.adaptation.believed += jump
    shift(outer.observer, -jump)
    outer.demand += jump
    outer.target.force += jump
    state.demand.force += jump
    state.demand.feedback += jump


def send_unit(settings: Any, state: Any, command: Any) -> None:
    """Start the crossing of the unit that was switched."""
    now, up = state.machine.state, state.machine.direction > 0
    # No other unit is active, so the crossing is not compensated.
    if now == (1 if up else 0):
        return
    unit = state.table.order[now - 1 if up else now]
    why = command.reason.why
    # A demand that is out of reach is urgent, unless it did not rise since the unit's release.
    back = up and state.machine.back
    urgent = (why == BEYOND and not back) or why == UNREACHABLE
    patient = 0.0 if urgent else state.demand.patience
    pressure = command.pressure[unit]
    distance = state.table.bottom_pressure[unit] if up else pressure
    pace = crossing_pace(distance, settings.switching.crossing_rate, patient)
    begin_crossing(state.crossings, unit, up, pressure, pace, not back)
