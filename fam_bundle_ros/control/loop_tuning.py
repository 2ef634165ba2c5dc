# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Margins and step responses of the force and strain loops, over the error of the model.

Near an operating point the bundle's force changes 1 + e times as much as the model's. The observer
compares the force with the model at the measured pressures, so that its loop gain is e; that of
the gain on the force error is 1 + e. python-control (the extra ``control``) gives the margins.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
import math
from typing import Any

import numpy as np

from fam_bundle_ros.control.outer import command_lag, default_force_gain, LoadModel, OuterConfig
from fam_bundle_ros.control.pid import PidConfig, PidGains, PressurePid
from fam_bundle_ros.control.strain_gains import drag_of, GAIN_ERRORS, RATE_LAG, stiffness_grid
from fam_bundle_ros.control.strain_loop import default_strain_gains
from fam_bundle_ros.control.tuning import python_control
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.pneumatics import pressure_rate

#: Settling band: 5 % of the step.
_BAND = 0.05
#: Duration of a simulated step response in lags of the loop, and steps per lag.
_LAGS, _FINE = 60, 100


@dataclass(frozen=True)
class LoopPoint:
    """
    A loop at one error of the model.

    Attributes
    ----------
    gain_error : float
        Change of the bundle's force over that of the model, minus 1.
    gain_margin_db, phase_margin_deg, crossover_hz : float
        The smallest; below 0 where the loop is unstable. Infinite margins and no crossover (nan)
        where the loop never reaches a gain of 1.
    delay_margin : float, s
        Additional dead time up to which the loop is stable.
    overshoot : float
        Overshoot after a step of the reference, relative.
    settling : float, s
        Settling time to 5 %.
    stiffness : float
        Stiffness of muscles and load over the middle one; 1 where it has no effect.
    """

    gain_error: float
    gain_margin_db: float
    phase_margin_deg: float
    crossover_hz: float
    delay_margin: float
    overshoot: float
    settling: float
    stiffness: float = 1.0


@dataclass(frozen=True)
class PressureStep:
    """Overshoot (relative) and settling (s) of a pressure step, at a volume and an error of it."""

    volume: float
    gain_error: float
    overshoot: float
    settling: float


@dataclass(frozen=True)
class LoopResult:
    """
    Settings of a loop and its margins; see `tune_force` and `tune_strain`.

    Attributes
    ----------
    settings : dict
        Computed settings, by parameter name.
    lag : float, s
        Lag of the loop: dead time, pressures and sample.
    points : tuple of LoopPoint
    """

    settings: dict[str, float]
    lag: float
    points: tuple[LoopPoint, ...]

    def rows(self) -> list[dict[str, Any]]:
        """Return one dict per point, for tables and JSON."""
        return [asdict(point) for point in self.points]


def tune_force(config: OuterConfig = OuterConfig(), sample_period: float = 4e-3,
               lag: float = 0.0) -> LoopResult:
    """
    Return margins and step responses of the force loop, with an observer weight of 1.

    Parameters
    ----------
    config : OuterConfig
        Its ``delay``, ``gain_error`` and gains.
    sample_period : float, s
        Sample time of the recruitment controller.
    lag : float, s
        Lag of the force behind the pressures, learnt or known.
    """
    ct = python_control()
    _check(sample_period, lag)
    whole = command_lag(config, sample_period) + sample_period + lag
    observer = whole if config.bias_time is None else config.bias_time
    gain = config.force_gain
    gain = default_force_gain(config.gain_error) if gain is None else gain
    dead = ct.tf(*ct.pade(whole, 4))
    quick, error = ct.tf([1.0], [observer, 1.0]), ct.tf([1.0], [whole, 1.0])

    def point(e):
        loop = dead * (e * quick + gain * (1.0 + e) * error)
        return _point(ct, loop, e, _force_step(whole, observer, gain, e))
    span = config.gain_error
    return LoopResult({'bias_time': observer, 'force_gain': gain}, whole,
                      tuple(point(e) for e in (-span, -0.5 * span, 0.0, 0.5 * span, span)))


def tune_strain(bundle: Bundle, load: LoadModel, config: OuterConfig = OuterConfig(),
                sample_period: float = 4e-3) -> LoopResult:
    """
    Return margins and step responses of the strain loop on a load.

    The load is a mass on the stiffness of the muscles and its own; the loop is cut at the strain.

    Parameters
    ----------
    bundle : Bundle
    load : LoadModel
        Its ``inertia`` (more than 0), ``stiffness`` and ``damping``.
    config : OuterConfig
    sample_period : float, s

    Returns
    -------
    LoopResult
        At the stiffnesses for which gains are computed (`stiffness_grid`), with their gains and
        errors of the force's change of 30 %. The damping ratio is at least 1 %. The settings are
        those at the middle stiffness.
    """
    ct = python_control()
    _check(sample_period, 0.0)
    if not load.inertia > 0.0:
        raise InputError('the inertia of the load is 0; expected more than 0 N s^2 for the '
                         'strain loop')
    whole = command_lag(config, sample_period) + sample_period
    dead = ct.tf(*ct.pade(whole, 4))
    stiffnesses = stiffness_grid(bundle, load.stiffness)
    gains = [default_strain_gains(config, load, each, load.inertia) for each in stiffnesses]
    middle, points = len(gains) // 2, []
    for stiffness, own in zip(stiffnesses, gains):
        control = ct.tf([own.gain, own.integral], [1.0, 0.0]) + ct.tf(
            [own.damping, 0.0], [RATE_LAG, 1.0])
        for e in GAIN_ERRORS:
            drag = float(drag_of(stiffness, load.inertia, load.damping))
            plant = ct.tf([1.0 + e], [load.inertia, drag, stiffness])
            loop = control * dead * plant
            step = _strain_step(ct, control, dead, plant)
            points.append(replace(_point(ct, loop, e, step),
                                  stiffness=stiffness / stiffnesses[middle]))
    best = gains[middle]
    return LoopResult({'strain_gain': best.gain, 'strain_integral': best.integral,
                       'strain_damping': best.damping}, whole, tuple(points))


def pressure_steps(gains: PidGains, config: PidConfig, sample_period: float,
                   transport_delay: float, volumes: Sequence[float] = (11e-6, 16e-6, 24e-6),
                   gain_errors: Sequence[float] = (-0.2, 0.0, 0.2), low: float = 100e3,
                   high: float = 200e3) -> list[PressureStep]:
    """
    Return overshoot and settling of the pressure loop on a chamber behind its delay.

    Parameters
    ----------
    gains, config : PidGains, PidConfig
    sample_period, transport_delay : float, s
    volumes : sequence of float, m^3
        Gas volumes, known to the loop.
    gain_errors : sequence of float
        Errors e: the true pressure rate is 1 + e times the loop's model.
    low, high : float, Pa (gauge)
        Start and end of the step.
    """
    return [_pressure_step(gains, config, sample_period, transport_delay, volume, error, low, high)
            for volume in volumes for error in gain_errors]


def _pressure_step(gains, config, period, delay, volume, error, low, high):
    pid, fine = PressurePid(gains, config), 20
    late = [0.0] * (round(delay / period * fine) + 1)
    pressure, spool, speed, natural = low, 0.0, 0.0, 2.0 * math.pi * 125.0
    values, dt = [], period / fine
    for _ in range(round(1.0 / period)):
        command = pid.update(high, pressure, period, config.supply, volume)
        for _ in range(fine):
            late.append(command)
            speed += dt * (natural ** 2 * (late.pop(0) - spool) - 1.4 * natural * speed)
            spool += dt * speed
            absolute = pressure + config.ambient
            flow = config.valve.flow(config.valve.opening(spool), absolute,
                                     config.supply + config.ambient, config.ambient)
            pressure += dt * (1.0 + error) * pressure_rate(absolute, volume, 0.0, flow)
            values.append(pressure)
    values = (np.array(values) - low) / (high - low)
    outside = np.flatnonzero(np.abs(values - 1.0) > _BAND)
    return PressureStep(volume, error, _overshoot(values),
                        float((outside[-1] + 1) * dt) if len(outside) else 0.0)


def _overshoot(values):
    """Return the relative overshoot of a step to 1; what rounding leaves of a sum is none."""
    return max(0.0, round(float(np.max(values)) - 1.0, 9))


def _check(sample_period, lag):
    if not (sample_period > 0.0 and lag >= 0.0):
        raise InputError('tune needs a sample period above 0 and a lag of 0 or more; got '
                         f'{sample_period} and {lag}')


def _force_step(whole, observer, gain, e):
    """
    Return times and force of a reference that steps by 1.

    demand = r - observer(F - P) + gain (r - F), both filtered and late, where P is the model's
    force at the measured pressures and F = (1 + e) P.
    """
    dt = whole / _FINE
    count = _LAGS * _FINE
    late = np.zeros(count + _FINE)
    bias = error = 0.0
    for k in range(count):
        believed = late[k]
        bias += dt / observer * (e * believed - bias)
        error += dt / whole * (1.0 * (k >= _FINE) - (1.0 + e) * believed - error)
        late[k + _FINE] = 1.0 - bias + gain * error
    return np.arange(count) * dt, (1.0 + e) * late[:count]


def _strain_step(ct, control, dead, plant):
    """
    Return times and strain of a reference that steps by 1.

    Feed-forward adds the static force of the step at once, with the muscles' own stiffness.
    """
    ahead = 1.0 / ct.dcgain(plant)
    closed = (ahead + control * dead) * plant / (1.0 + control * dead * plant)
    return ct.step_response(ct.minreal(closed, verbose=False), np.linspace(0.0, 2.0, 4000))


def _point(ct, loop, e, response):
    gains, phases, _, _, crossovers, _ = ct.stability_margins(loop, returnall=True)
    times, values = response
    outside = np.flatnonzero(np.abs(values - 1.0) > _BAND)
    settling = float(times[outside[-1]]) if len(outside) else 0.0
    # A loop with a resonance has several crossovers: take the smallest margin on either side.
    reached = len(crossovers) > 0
    nearest = int(np.argmin(np.abs(phases))) if reached else 0
    gain_margin = min((abs(20.0 * math.log10(gain)) for gain in gains if gain > 0.0),
                      default=math.inf)
    stable = bool(np.all(ct.feedback(loop, 1).poles().real < 0.0))
    sign = 1.0 if stable else -1.0
    return LoopPoint(
        e, sign * gain_margin, sign * abs(float(phases[nearest])) if reached else math.inf,
        float(crossovers[nearest]) / (2.0 * math.pi) if reached else math.nan,
        sign * min(math.radians(float(phase) % 360.0) / float(crossover)
                   for phase, crossover in zip(phases, crossovers)) if reached else math.inf,
        _overshoot(values),
        settling if settling < 0.98 * float(times[-1]) else math.inf)
