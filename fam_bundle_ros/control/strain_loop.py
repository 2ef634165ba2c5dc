# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The strain loop: from a reference and the readings to the force that moves the load.

Part of the outer loops (`outer_loop`), with their settings and memory. Kernels.
"""

import math
from typing import Any

from scipy.constants import g

from fam_bundle_ros.control.friction import turn_round
from fam_bundle_ros.control.load_estimate import law_doubt, learn_load, load_law, STEP
from fam_bundle_ros.control.observer import learn_noise, low_pass, noise_of, quick_of
from fam_bundle_ros.control.outer import command_lag, LoadModel, OuterConfig
from fam_bundle_ros.control.saturation import integrate_error, unwind
from fam_bundle_ros.control.strain_gains import DAMPED, RATE_LAG, strain_gains, StrainGains

#: s: design sample time of the strain loop.
_PERIOD = 4e-3
#: Weight of the load where none is known, as a share of the largest force.
_USUAL_WEIGHT = 0.07
#: s: filter of the acceleration of a reference.
_BEND_TIME = 0.01
#: Half-width of the strain correction's backlash, in standard deviations of its noise.
_QUIET = 2.0
#: While friction holds the strain, the integral adds the force for its error in this many lags:
#: the excess force at release then corresponds to half of the error.
_LAGS = 2.0
#: Factor by which an identified damping may be too large: gains are computed for a smaller one.
_DOUBT = 2.0


def usual_inertia(bundle: Any) -> float:
    """Return the inertia of a usual load of a bundle, N s^2."""
    return _USUAL_WEIGHT * bundle.largest_force / g * bundle.length


def default_strain_gains(config: OuterConfig, load: LoadModel, stiffness: float, usual: float,
                         ratio: float = 0.0) -> StrainGains:
    """
    Return the gains of the strain loop at a stiffness (N): those set, the others computed.

    ``usual`` is the inertia where that of the load is not known, N s^2; ``ratio`` the least
    damping ratio.
    """
    lag, inertia = command_lag(config, _PERIOD) + _PERIOD, load.inertia or usual
    damping = max(load.damping, 2.0 * ratio * math.sqrt(stiffness * inertia))
    found = strain_gains(stiffness, inertia, damping, lag)
    given = (config.strain_gain, config.strain_integral, config.strain_damping)
    return StrainGains(*(worked if value is None else value for value, worked in zip(
        given, (found.gain, found.integral, found.damping))))


def strain_loop(settings: Any, state: Any, measurement: Any, value: float, rate: float,
                saturated: int, excess: float, dt: float) -> tuple[float, float]:
    """
    Return feed-forward and correction of the strain loop, N; set the target strain and its rate.

    The load's inverse dynamics plus PID on the strain (computed torque: Siciliano et al. 2009,
    Robotics, ch. 8); the correction passes a backlash as wide as its noise.

    Parameters
    ----------
    settings, state : OuterSettings, OuterState
    measurement : record with force (N), strain, strain_rate (1/s), pressure (n,) (Pa)
    value, rate : float, and 1/s
        Strain reference and its rate.
    saturated, excess : int, float
        Saturation of the last command; last demand minus the force of these pressures, N.
    dt : float, s
    """
    known, correction = 0.0, 0.0
    strain, target = measurement.strain, state.target
    behind = settings.reading_share * settings.delay
    if settings.feed_forward:
        ahead = value + (command_lag(settings, dt) - behind) * rate
        state.bend += low_pass(dt, _BEND_TIME) * ((rate - state.rate) / dt - state.bend)
        state.rate = rate
        known = (holding_force(settings, ahead) + settings.load_damping * rate
                 + settings.load_inertia * state.bend)
        if settings.feedback and not settings.load_known:
            known += unknown_load(settings, state, measurement, ahead, rate, dt)
        target.strain = state.aim = next_aim(state.aim, ahead, strain, settings.strain_reach)
        target.strain_rate = rate
    if settings.feedback:
        # PID replaces the observer here: with both, fast errors would be corrected twice.
        error = value - behind * rate - strain
        stiffness = present_stiffness(settings, measurement.pressure)
        heavier, drag, inertia = 1.0, 0.0, settings.usual_inertia
        if not settings.load_known and state.load.known:
            stiffness += state.load.value[0]
            drag, inertia = state.load.value[1] / _DOUBT, state.load.inertia
            if settings.worked_out:
                heavier = inertia / settings.usual_inertia
        # At equal stiffness over inertia, gains are proportional to the inertia.
        alike = max(stiffness / heavier, settings.stiffnesses[0])
        ratio = 0.5 * drag / math.sqrt(heavier * alike * inertia)
        gain = heavier * gain_at(settings, settings.strain_gain, alike, ratio)
        integral = heavier * gain_at(settings, settings.strain_integral, alike, ratio)
        damping = heavier * gain_at(settings, settings.strain_damping, alike, ratio)
        if integral > 0.0:
            # Delay after which a release of friction is detected.
            lag = command_lag(settings, dt) + dt + RATE_LAG
            due, quick = rate, stiffness / (_LAGS * lag)
            searching = not settings.load_known and not state.load.known
            if searching:
                # The holding force is unknown, the load may rest on a stop: search for it, at
                # least as fast as the stiffness that holds a usual load allows.
                due += integral / max(stiffness, settings.stiffnesses[0]) * error
                quick = max(stiffness, _USUAL_WEIGHT * settings.most_stiffness) / lag
            quick = max(quick, integral)
            integral += held_back(error, due, measurement.strain_rate) * (quick - integral)
            unwind(state, error, excess, saturated)
            left = error
            if settings.feed_forward and rate == 0.0 and abs(error) > settings.strain_reach:
                # On the way to a step of the reference, which pressures do not reach at once.
                left = error_left(error, _LAGS * lag * measurement.strain_rate)
            if searching:
                # A search for a far reference would lift a weight with too much force.
                left = min(max(left, -settings.strain_reach), settings.strain_reach)
            integrate_error(state, integral * left * dt, saturated)
            # At a reversal of the reference, compensate for the change of friction.
            state.integral -= turn_round(state.friction, rate, quick_of(state.observer), state.lag,
                                         dt)
        # The observer's slow part would be a second integral, which hunts against friction.
        wanted = state.integral + gain * error + damping * (rate - measurement.strain_rate)
        learn_noise(state.wanted, wanted, settings.still, dt)
        state.noise = noise_of(state.wanted)
        still = max(settings.still, _QUIET * state.noise)
        state.kept = min(max(state.kept, wanted - still), wanted + still)
        correction = state.kept
    return known, correction


def unknown_load(settings: Any, state: Any, measurement: Any, ahead: float, rate: float, dt: float,
                 ) -> float:
    """
    Return the feed-forward force for an unknown load, N: 0 until the load is identified.

    It is when the doubt of the force for the reference moves the strain by less than its present
    error. At that moment the integral, which held the load until then, is reduced by the same
    force.

    Parameters
    ----------
    settings, state, measurement
        As for `strain_loop`.
    ahead, rate : float, and 1/s
        Reference strain, advanced by the delays; its rate.
    dt : float, s
    """
    load, known = state.load, state.load.known
    learn_load(load, measurement.strain, measurement.force, settings.most_stiffness,
               settings.usual_inertia, settings.filter_time, dt)
    if not known:
        stiffness = load.value[0] + present_stiffness(settings, measurement.pressure)
        missing = (max(abs(ahead - measurement.strain), STEP)
                   * max(stiffness, settings.stiffnesses[0]))
        load.known = load.places > 0 and law_doubt(load, ahead, rate, state.bend) < missing
    if not load.known:
        return 0.0
    if not known:
        state.integral -= load.offset + load_law(load, load.strains[2], load.rate, load.bend)
    return load.offset + load_law(load, ahead, rate, state.bend)


def error_left(error: float, coming: float) -> float:
    """
    Return what is left of an error that the strain reduces by ``coming`` before a response.

    An integral of the rest does not overshoot after a step of the reference.

    Examples
    --------
    >>> [round(error_left(0.05, coming), 3) for coming in (0.03, 0.06, -0.03)]
    [0.02, 0.0, 0.05]
    """
    if error > 0.0:
        return max(error - max(coming, 0.0), 0.0)
    return min(error - min(coming, 0.0), 0.0)


def next_aim(last: float, ahead: float, strain: float, reach: float) -> float:
    """
    Return the strain for which pressures are computed: the reference, within reach of the strain.

    It follows a strain that approaches the reference, and stays where a load drives the strain
    away: at pressures for a strain that retreats, the muscles would yield without any stiffness.

    Parameters
    ----------
    last : float
        The strain of the tick before.
    ahead, strain, reach : float
        Reference; measured strain; largest distance of the result from it.

    Examples
    --------
    >>> [next_aim(0.1, 0.1, strain, 0.03) for strain in (0.1, 0.05)]
    [0.1, 0.1]
    >>> [round(next_aim(0.05, 0.1, strain, 0.03), 2) for strain in (0.05, 0.06)]
    [0.08, 0.09]
    """
    if ahead > strain:
        return min(max(strain + reach, last), ahead)
    return max(min(strain - reach, last), ahead)


def held_back(error: float, rate: float, seen: float) -> float:
    """
    Return the share of the reference's rate that a strain held by friction does not follow.

    While friction holds the strain the loop has no dynamics of its own: its integral may be as
    fast as a release can be detected.

    Parameters
    ----------
    error : float
        Reference minus strain.
    rate, seen : float, 1/s
        Rate of the reference; measured strain rate.

    Examples
    --------
    >>> held_back(0.01, 0.1, 0.0), held_back(0.01, 0.1, 0.1), held_back(-0.01, 0.1, 0.0)
    (1.0, 0.0, 0.0)
    """
    return 1.0 - min(max(seen / rate, 0.0), 1.0) if error * rate > 0.0 else 0.0


def present_stiffness(settings: Any, pressure: Any) -> float:
    """Return -dF/de of muscles and load at pressures (n,) in Pa, by the model, N."""
    total = settings.load_stiffness
    for i in range(len(pressure)):
        total += unit_stiffness_at(settings, i, pressure[i])
    return total


def unit_stiffness_at(settings: Any, unit: int, pressure: float) -> float:
    """Return -dF/de of one motor unit at a pressure (Pa) and a medium strain, N."""
    p = max(pressure, 0.0)
    return (settings.stiffness_slope[unit] + settings.stiffness_bend[unit] * p) * p


def gain_at(settings: Any, values: Any, stiffness: float, ratio: float) -> float:
    """Return a gain at a stiffness (N) and a damping ratio; ``values`` (2, m)."""
    little = at_stiffness(settings, values[0], stiffness)
    much = at_stiffness(settings, values[1], stiffness)
    return little + min(ratio / DAMPED, 1.0) * (much - little)


def at_stiffness(settings: Any, values: Any, stiffness: float) -> float:
    """Return a gain at a stiffness (N), linear between those of the table."""
    table, last = settings.stiffnesses, len(values) - 1
    if stiffness <= table[0]:
        return values[0]
    for k in range(1, last + 1):
        if stiffness < table[k]:
            share = (stiffness - table[k - 1]) / (table[k] - table[k - 1])
            return values[k - 1] + share * (values[k] - values[k - 1])
    return values[last]


def holding_force(settings: Any, strain: float) -> float:
    """Return the force that holds the load at a strain, N; linear between points of its table."""
    strains, forces, last = settings.load_strains, settings.load_forces, settings.load_points - 1
    if last < 0:
        return settings.load_force + settings.load_stiffness * strain
    if strain <= strains[0]:
        return forces[0]
    for k in range(1, last + 1):
        if strain < strains[k]:
            slope = (forces[k] - forces[k - 1]) / (strains[k] - strains[k - 1])
            return slope * (strain - strains[k - 1]) + forces[k - 1]
    return forces[last]
