# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The demand that the state machine sees: force, rates, uncertainty. Kernels."""

from typing import Any

from fam_bundle_ros.control.adaptation import GAUGE_SHARE, lag_of
from fam_bundle_ros.control.crossing import doubt_of
from fam_bundle_ros.control.curves import top_at
from fam_bundle_ros.control.heading import follow_heading, heading_now, rest_at
from fam_bundle_ros.control.jump import is_climbing, is_recent
from fam_bundle_ros.control.outer_loop import FORCE, STRAIN, uncertainties
from fam_bundle_ros.control.spread import reserve
from fam_bundle_ros.control.transition import patience

#: rad/s: bandwidth of the rate filters; s: time step for the rate of the force limits.
_BRISK, _AHEAD = 80.0, 0.01


def set_demand(settings: Any, model: Any, state: Any, kind: int, rate: float, dt: float) -> None:
    """Compute the state machine's input: demand, and its rates relative to the force limits."""
    wanted, limits, top = state.wanted, state.limits, state.table.top
    target = state.outer.target
    # A measured strain is noisy, a reference strain is not.
    clean = kind == STRAIN and settings.outer.feed_forward
    asked = target.feed_forward
    if kind == FORCE and settings.outer.feed_forward:
        # Subtract the part due to the learnt lag: its adaptation is not a change of demand.
        learnt = lag_of(state.adaptation) - settings.outer.line_lag + state.adaptation.lead
        asked -= (1.0 - GAUGE_SHARE) * learnt * rate
    jump = abs(asked - wanted.value[0])
    if clean:
        for k in range(len(top)):
            jump = max(jump, abs(top[k] - limits.value[k]))
    # A step has no rate, however small it is.
    if kind != state.heading_kind or (
            rate == 0.0 and (jump > settings.step or state.jump.still == 0.0)):
        state.heading_kind = kind
        rest_at(wanted, 0, asked)
        for k in range(len(top)):
            rest_at(limits, k, top[k])
    else:
        follow_heading(wanted, 0, asked, dt, _BRISK)
        for k in range(len(top)):
            follow_heading(limits, k, top[k], dt, _BRISK)
    k = min(state.machine.state, len(top) - 2)
    demand = state.demand
    speed, acceleration, jerk = heading_now(wanted, 0, _BRISK)
    limit_speed, limit_acceleration, limit_jerk = 0.0, 0.0, 0.0
    moved = state.table.moment.strain_rate
    if clean:
        limit_speed, limit_acceleration, limit_jerk = heading_now(limits, k, _BRISK)
    elif moved != 0.0:
        # Differences of the limits would contain noise and adaptation: use slope and strain rate.
        ahead = state.table.moment.strain + moved * _AHEAD
        limit_speed = (top_at(state.table, model, k, ahead) - top[k]) / _AHEAD
        limit_acceleration = limit_speed * state.rate.slope / moved
    demand.force, demand.rate = target.force, speed - limit_speed
    demand.feedback = target.force - target.feed_forward
    demand.acceleration, demand.jerk = acceleration - limit_acceleration, jerk - limit_jerk
    demand.uncertainty, demand.more_below = uncertainties(settings.outer, state.outer)
    doubt = doubt_of(state)
    demand.patience = patience(settings, state, doubt, dt)
    demand.doubt = doubt if state.crossings.count > 0 else 0.0
    demand.spare = reserve(state, target.force, state.table.order[0])
    demand.stepping = 1 if state.jump.again > 0 and is_recent(settings, state.jump) else 0
    climbing = is_climbing(settings, state.jump)
    demand.step = state.jump.rise if climbing else 0.0
    demand.climb = state.jump.climb if climbing else 0.0
    demand.own_rate = wanted.rate[0]
    demand.smooth_rate = demand.own_rate - (limits.rate[k] if clean else limit_speed)
