# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Synthetic measurements with a known hidden effect: the generator of the discovery benchmark.

Motions of the rig, noise, and cases; the physics is in `discovery_truth`, which shares no code
with the catalogue. Cases are determined by their seeds.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from fam_bundle_ros.benchmarks.discovery_truth import (
    ANGLE,
    C01,
    C10,
    LENGTH,
    make_hidden,
    make_outsider,
    RADIUS,
    Record,
    Rig,
    true_force,
    WALL,
)
from fam_bundle_ros.data.measurement import build, Measurement
from fam_bundle_ros.model import Bundle, catalogue, Geometry, MotorUnit


@dataclass
class Case:
    """One synthetic measurement and the truth about it; ``shown_force`` (T,) is without noise."""

    name: str
    model: Bundle
    data: Measurement
    hidden: tuple[str, ...]
    verdicts: tuple[str, ...]
    noise: float
    shown_force: np.ndarray
    form: str
    parameters: dict[str, float]
    size: float


# --- motions of the rig ------------------------------------------------------------------------

def static_record(rng: np.random.Generator, shuffled: bool = False) -> Record:
    """Return seven isobars, two cycles each, up and down: 1260 rows."""
    speed = float(rng.choice([0.015, 0.024, 0.04]))
    levels = np.tile(np.linspace(0.0, 413.7e3, 7), 2)
    if shuffled:
        rng.shuffle(levels)
    once = 0.25 * np.concatenate([np.linspace(0, 1, 45), np.linspace(1, 0, 45)])
    duration = 0.5 / speed
    clock = np.linspace(0, duration, 90)
    rows = [(clock + k * (duration + 5.0), np.full(90, k), once, np.full(90, level),
             np.where(np.arange(90) < 45, speed, -speed)) for k, level in enumerate(levels)]
    t, k, e, p, v = (np.concatenate(part) for part in zip(*rows))
    return Record(t, k, e, p[:, None], v)


def dynamic_record(rng: np.random.Generator) -> Record:
    """Return three logs of moves, pressure steps, holds and sines: 4800 rows at 40 Hz."""
    rate, seconds, parts = 40.0, 40.0, []
    for number in range(3):
        t = np.arange(0, seconds, 1.0 / rate)
        pressure = _steps(rng, t, np.array([69, 138, 207, 276, 345, 413.7]) * 1e3, 1.5, 0.12)
        slow = 0.1 + 0.035 * np.sin(2 * np.pi * (0.05 * t + 0.006 * t ** 2 + rng.uniform()))
        steps = _steps(rng, t, np.array([0.05, 0.08, 0.11, 0.14]), 2.5, 0.25)
        chosen = (t // (seconds / 4)).astype(int) % 2 == 0
        strain = _lag(np.where(chosen, slow, steps), 0.08 * rate)
        parts.append((t, np.full(len(t), number), strain, pressure,
                      np.gradient(strain, 1.0 / rate)))
    t, k, e, p, v = (np.concatenate(part) for part in zip(*parts))
    return Record(t, k, e, p[:, None], v)


def bundle_record(rng: np.random.Generator) -> Record:
    """Return eleven pressures of the second unit with the first full: 1320 rows."""
    speed = float(rng.choice([0.02, 0.026]))
    second = np.linspace(0, 345e3, 9)
    pairs = [(345e3, p) for p in second] + [(0.0, 345e3), (172e3, 0.0), (69e3, 207e3)]
    order = rng.permutation(len(pairs)) if rng.uniform() < 0.5 else np.arange(len(pairs))
    once = 0.235 * np.concatenate([np.linspace(0, 1, 55), np.linspace(1, 0, 55)])
    clock = np.linspace(0, 0.47 / speed, 110)
    rows = [(clock + k * (clock[-1] + 2.0), np.full(110, k), once,
             np.tile(np.array(pairs[i]), (110, 1)),
             np.where(np.arange(110) < 55, speed, -speed)) for k, i in enumerate(order)]
    t, k, e, p, v = (np.concatenate(part) for part in zip(*rows))
    return Record(t, k, e, p, v)


def _steps(rng: np.random.Generator, t: np.ndarray, levels: np.ndarray, hold: float,
           smooth: float) -> np.ndarray:
    values, at = np.empty(len(t)), 0.0
    while at < t[-1] + 1:
        stay = hold * rng.uniform(0.5, 1.6)
        values[(t >= at) & (t < at + stay)] = rng.choice(levels)
        at += stay
    return _lag(values, smooth / (t[1] - t[0]))


def _lag(values: np.ndarray, samples: float) -> np.ndarray:
    gain = 1.0 / (1.0 + samples)
    for _ in range(2):
        values, _ = lfilter([gain], [1.0, gain - 1.0], values, zi=[(1.0 - gain) * values[0]])
    return values


# --- noise and the case ------------------------------------------------------------------------

def noise_of(kind: str, sd: float, record: Record, rng: np.random.Generator) -> np.ndarray:
    """Return noise: 'white', 'ar' (AR(1) of 0.8) or 'outliers' (3 %, 5 to 15 sd)."""
    white = sd * rng.standard_normal(len(record.time))
    if kind == 'ar':
        return lfilter([0.6], [1.0, -0.8], white)
    if kind == 'outliers':
        bad = rng.uniform(size=len(white)) < 0.03
        return white + bad * sd * rng.uniform(5, 15, len(white)) * rng.choice([-1, 1], len(white))
    return white


def nominal(units: int, bladder: bool = True) -> Bundle:
    """Return the initial model of the user."""
    geometry = Geometry(RADIUS, LENGTH, ANGLE, WALL)
    effects = [catalogue.get('mesh')()]
    if bladder:
        effects.append(catalogue.get('bladder_elasticity')())
    return Bundle('baseline', [MotorUnit(f'mu{k + 1}', 1, geometry) for k in range(units)],
                  effects)


#: Effects that may be hidden in each kind of data.
HIDEABLE = {
    'static': ('bladder_elasticity', 'resistive_buckling', 'tendon_slack', 'coulomb_friction',
               'presliding_hysteresis', 'end_caps', 'braid_elasticity', 'threshold_pressure',
               'force_sensor_bias', 'pressure_sensor_bias', 'strain_sensor_offset',
               'temperature', 'softening', 'force_sensor_gain', 'pressure_sensor_gain'),
    'dynamic': ('bladder_elasticity', 'coulomb_friction', 'presliding_hysteresis',
                'viscous_damping', 'viscoelastic_relaxation', 'end_caps', 'braid_elasticity',
                'threshold_pressure', 'pressure_line_lag', 'force_sensor_bias',
                'pressure_sensor_bias', 'strain_sensor_offset'),
    'bundle': ('bladder_elasticity', 'resistive_buckling', 'tendon_slack', 'coulomb_friction',
               'end_caps', 'braid_elasticity', 'threshold_pressure', 'motor_unit_mismatch',
               'force_sensor_bias', 'strain_sensor_offset', 'presliding_hysteresis'),
}
#: Effects that count as the same physics in all data.
SAME_PHYSICS = {'coulomb_friction': ('presliding_hysteresis',),
                'presliding_hysteresis': ('coulomb_friction',)}
PAIRS = {
    'static': (('coulomb_friction', 'end_caps'), ('coulomb_friction', 'threshold_pressure'),
               ('resistive_buckling', 'coulomb_friction'), ('force_sensor_bias', 'end_caps'),
               ('resistive_buckling', 'end_caps'), ('coulomb_friction', 'force_sensor_bias')),
    'dynamic': (('viscous_damping', 'end_caps'), ('coulomb_friction', 'viscous_damping'),
                ('viscoelastic_relaxation', 'threshold_pressure'),
                ('coulomb_friction', 'end_caps'), ('viscous_damping', 'force_sensor_bias')),
}


def make_case(kind: str, seed: int, hidden: tuple[str, ...] = (), form: str = 'same',
              noise: str = 'white', off: float = 0.4, outsider: str = '',
              size: float = 1.0) -> Case:
    """
    Return a case.

    Parameters
    ----------
    kind : str
        'static', 'dynamic' or 'bundle'.
    hidden : tuple of str
        Names of hidden effects.
    form : str
        Functional form: 'same' as the catalogue's or 'other'.
    noise : str
        'white', 'ar' or 'outliers'.
    off : float
        Standard deviation of the errors of the model's own parameters, in tolerances.
    outsider : str
        An effect beyond the catalogue, from `discovery_truth.OUTSIDERS`.
    size : float
        Scale of the hidden effect.
    """
    rng = np.random.default_rng([seed, sum(map(ord, kind + form + noise + outsider)), len(hidden)])
    if kind == 'static':
        record = static_record(rng, shuffled=bool({'temperature'} & set(hidden)))
    elif kind == 'dynamic':
        record = dynamic_record(rng)
    else:
        record = bundle_record(rng)
    parts = [make_hidden(name, form, rng, size) for name in hidden]
    if outsider:
        parts.append(make_outsider(outsider, rng))
    jitter = off * rng.standard_normal(4)
    rig = Rig(RADIUS * (1 + 0.04 * jitter[0]), ANGLE + np.radians(1.5) * jitter[1],
              C10 * (1 + 0.1 * jitter[2]), C01 * (1 + 0.1 * jitter[3]))
    for part in parts:
        for key, value in part.rig.items():
            setattr(rig, key, value)
    sd = float(rng.uniform(0.5, 0.9))
    force = true_force(record, rig, parts)
    strain, pressure = record.strain, record.pressure
    for part in parts:
        if part.shown:
            force, strain, pressure = part.shown(force, strain, pressure)
    shown_force = force
    force = force + noise_of(noise, sd, record, rng)
    strain = strain + 1e-4 * rng.standard_normal(len(strain))
    pressure = pressure + 350.0 * rng.standard_normal(pressure.shape)
    units = pressure.shape[1]
    data = build(f'{kind}-{"+".join(hidden) or outsider or "none"}-{form}-{noise}-{seed}', strain,
                 pressure, force, record.trial, record.time, [f'mu{k + 1}' for k in range(units)])
    model = nominal(units, 'bladder_elasticity' not in hidden)
    if outsider:
        verdicts: tuple[str, ...] = ('unexplained', 'partial')
    elif hidden:
        verdicts = ('missing_effect', 'partial')
    else:
        verdicts = ('adequate',) if off == 0 else ('recalibrate', 'adequate')
    hidden_size = float(np.std(true_force(record, rig, parts) - true_force(record, rig, [])) / sd)
    return Case(data.name, model, data, hidden, verdicts, sd, shown_force, form,
                {f'{p.name}.{k}': v for p in parts for k, v in p.parameters.items()}, hidden_size)
