# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Synthetic measurements with a known hidden effect: the generator of the discovery benchmark.

Written apart from the catalogue: the physics is coded here a second time, sample by sample, and
for half of the cases in another functional form than the catalogue's (Fung instead of
Mooney-Rivlin, Dahl instead of Maxwell slip, a soft floor instead of a hard one, ...). Seeds fix
every case.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fam_bundle_ros.discovery.measurement import build, Measurement
from fam_bundle_ros.model import Bundle, catalogue, Geometry, MotorUnit

RADIUS, LENGTH, ANGLE, WALL = 6.35e-3, 0.127, np.radians(33.0), 1.59e-3
C10, C01 = 118.4e3, 105.7e3


@dataclass
class Rig:
    """The true muscle: nominal numbers and how far they are off."""

    radius: float = RADIUS
    angle: float = ANGLE
    c10: float = C10
    c01: float = C01
    bladder: Callable[[np.ndarray], np.ndarray] | None = None

    def mesh(self, e: np.ndarray, p: np.ndarray, stretch: np.ndarray | float = 1.0) -> np.ndarray:
        """Return the force of the braid, N."""
        long = (1.0 - e) ** 2
        return np.pi * self.radius ** 2 * p * (
            3.0 * long / np.tan(self.angle) ** 2 - stretch / np.sin(self.angle) ** 2)

    def rubber(self, e: np.ndarray, stretch: np.ndarray | float = 1.0) -> np.ndarray:
        """Return the force of the tube, N; threads that stretch let it widen."""
        if self.bladder is not None:
            return self.bladder(e)
        long, k = 1.0 - e, 1.0 / np.tan(self.angle) ** 2
        wide = (stretch - long ** 2 * np.cos(self.angle) ** 2) / np.sin(self.angle) ** 2
        ring = np.pi * (self.radius ** 2 - (self.radius - WALL) ** 2)
        first = 2 * long * (1 - k) - 2 / (long ** 3 * wide) + 2 * k / (long * wide ** 2)
        second = -2 / long ** 3 + 2 * k * long / wide ** 2 + 2 * long * wide - 2 * k * long ** 3
        return ring * (self.c10 * first + self.c01 * second)


@dataclass
class Record:
    """What the rig did: true strain, pressure, rate, time and trial."""

    time: np.ndarray
    trial: np.ndarray
    strain: np.ndarray
    pressure: np.ndarray
    rate: np.ndarray

    @property
    def starts(self) -> np.ndarray:
        """Return the rows where a trial begins."""
        return np.flatnonzero(np.diff(self.trial, prepend=self.trial[0] - 1))


@dataclass
class Case:
    """One synthetic measurement and the truth about it."""

    name: str
    kind: str
    model: Bundle
    data: Measurement
    hidden: tuple[str, ...]
    also_right: tuple[tuple[str, ...], ...]
    verdicts: tuple[str, ...]
    noise: float
    form: str = 'same'
    parameters: dict[str, float] = field(default_factory=dict)
    size: float = 0.0


# --- what the rig did --------------------------------------------------------------------------

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


def dynamic_record(rng: np.random.Generator, rate: float = 40.0, seconds: float = 40.0) -> Record:
    """Return three logs of moves, pressure steps, holds and sines: 4800 rows at 40 Hz."""
    parts = []
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
    result, gain = values.copy(), 1.0 / (1.0 + samples)
    for _ in range(2):
        state = result[0]
        for i, value in enumerate(result):
            state += gain * (value - state)
            result[i] = state
    return result


# --- forces by hand ----------------------------------------------------------------------------

@dataclass
class Hidden:
    """What is hidden: hooks on the parts of a muscle, and what it is called."""

    name: str
    form: str
    parameters: dict[str, float] = field(default_factory=dict)
    rig: dict[str, object] = field(default_factory=dict)
    strain: Callable | None = None      # (e, p) -> e felt
    pressure: Callable | None = None    # (p, record) -> p felt
    stretch: Callable | None = None     # (e, p) -> squared thread stretch
    limit: Callable | None = None       # (force, e, p) -> force
    loss: Callable | None = None        # (force, e, p, record) -> added force
    rubber: Callable | None = None      # (bladder force, record) -> added force
    area: Callable | None = None        # (unit) -> factor
    shown: Callable | None = None       # (force, e, p) -> readings


def true_force(record: Record, rig: Rig, hidden: list[Hidden]) -> np.ndarray:
    """Return the tension of all motor units, N, (T,)."""
    total = np.zeros(len(record.time))
    for unit in range(record.pressure.shape[1]):
        e, p = record.strain, record.pressure[:, unit]
        for h in hidden:
            if h.pressure:
                p = h.pressure(p, record)
        felt = e
        for h in hidden:
            if h.strain:
                felt = h.strain(felt, p)
        stretch = 1.0
        area = 1.0
        for h in hidden:
            if h.stretch:
                stretch = stretch * h.stretch(felt, p)
            if h.area:
                area *= h.area(unit)
        rubber = rig.rubber(felt, stretch)
        force = area * (rig.mesh(felt, p, stretch) + rubber)
        for h in hidden:
            if h.rubber:
                force = force + h.rubber(rubber, record)
        for h in hidden:
            if h.limit:
                force = h.limit(force, e, p)
        added = np.zeros_like(force)
        for h in hidden:
            if h.loss:
                added = added + h.loss(force, e, p, record)
        total += force + added
    return total


def per_trial(record: Record, step: Callable) -> np.ndarray:
    """Return a memory worked out sample by sample: ``step(state or None, i, dt) -> state``."""
    result = np.empty(len(record.time))
    begins = set(record.starts.tolist())
    state = None
    for i in range(len(result)):
        fresh = i in begins
        dt = 0.0 if fresh else record.time[i] - record.time[i - 1]
        state = step(None if fresh else state, i, dt)
        result[i] = state
    return result


def low_pass(record: Record, signal: np.ndarray, tau: float) -> np.ndarray:
    """Return a first-order lag, begun at rest with each trial."""
    def step(state, i, dt):
        if state is None:
            return signal[i]
        return state + (signal[i] - state) * (1.0 - np.exp(-dt / tau))
    return per_trial(record, step)


# --- the hidden effects: the same form as the catalogue's, and another one ---------------------

def make_hidden(name: str, form: str, rng: np.random.Generator, size: float = 1.0) -> Hidden:
    """Return a hidden effect of random size; ``form`` is 'same' or 'other'."""
    u = rng.uniform
    other = form == 'other'
    if name == 'resistive_buckling':
        f0, c = u(1.5, 5.0), u(0.25, 0.5)
        e0, s = u(0.02, 0.08), u(1.6e-6, 2.6e-6)
        m0, m1 = u(0.006, 0.02), u(0.3, 0.8)

        def limit(force, e, p):
            p = np.maximum(p, 0)
            top = f0 + c * np.pi * RADIUS ** 2 * p
            if other:
                soft = np.where(force < 0, -top * np.tanh(-force / top), force)
                fallen = 1.0 / (1.0 + np.exp(-(e - e0 - s * p) / 0.006))
                return np.where(force < 0, soft * (1.0 - 0.6 * fallen), force)
            bend = np.arccos(np.clip((1 - e) / np.maximum(1 - e0 - s * p, 0.05), -1, 1))
            hinge = 4 * (m0 + m1 * np.pi * p * RADIUS ** 3) / (
                LENGTH * np.maximum(np.sin(bend), 1e-6))
            floor = np.where(e > e0 + s * p, np.minimum(top, hinge), top)
            return np.maximum(force, -floor)
        return Hidden(name, form, {'euler_load': f0, 'pressure_share': c}, limit=limit)
    if name == 'tendon_slack':
        width = u(0.5, 1.5) if other else 1e-9

        def slack(force, e, p):
            return width * np.logaddexp(0.0, np.clip(force / width, -700, 700)) if other \
                else np.maximum(force, 0.0)
        return Hidden(name, form, limit=slack)
    if name == 'coulomb_friction':
        fc, cp = size * u(1.5, 5.0), size * rng.choice([0.0, u(3e-6, 1.5e-5)])
        rise, width = u(0.15, 0.4), u(5e-4, 3e-3)

        def friction(force, e, p, record):
            level = fc + cp * np.maximum(p, 0)
            if other:  # Stribeck: more at rest than in motion, rounded sign
                level = level * (1.0 + rise * np.exp(-np.abs(record.rate) / 0.01))
                return -level * np.tanh(record.rate / 0.004)
            return -level * np.tanh(record.rate / width)
        return Hidden(name, form, {'force': fc, 'per_pressure': cp}, loss=friction)
    if name == 'presliding_hysteresis':
        fc, cp, width = size * u(2.0, 6.0), size * u(0, 8e-6), u(0.006, 0.025)
        spread = np.array([0.25, 0.5, 1.0, 2.0])

        def presliding(force, e, p, record):
            level = fc + cp * np.maximum(p, 0)
            if other:  # Dahl
                def dahl(z, i, dt):
                    if z is None:
                        return 0.0
                    move = e[i] - e[i - 1]
                    return float(np.clip(z + move / width * (1 - z * np.sign(move)), -1, 1))
                return -level * per_trial(record, dahl)
            slip = np.zeros(len(e))
            for share in spread:
                half = share * width

                def stop(z, i, dt, half=half):
                    if z is None:
                        return 0.0
                    return float(np.clip(z + e[i] - e[i - 1], -half, half))
                slip += per_trial(record, stop) / half / len(spread)
            return -level * slip
        return Hidden(name, form, {'force': fc, 'width': width}, loss=presliding)
    if name == 'viscous_damping':
        c, power = size * u(60, 250), u(0.6, 0.8) if rng.uniform() < 0.5 else u(1.3, 1.6)

        def viscous(force, e, p, record):
            v = LENGTH * record.rate
            if other:
                return -c * 0.01 * np.sign(v) * np.abs(v / 0.01) ** power
            return -c * v
        return Hidden(name, form, {'coefficient': c}, loss=viscous)
    if name == 'viscoelastic_relaxation':
        share, tau = size * u(0.05, 0.15), u(0.8, 8.0)

        def relax(force, e, p, record):
            if other:  # rubber alone, two times
                slow = 0.6 * low_pass(record, e, tau) + 0.4 * low_pass(record, e, 4 * tau)
                return -share * 900.0 * (e - slow)
            return share * (force - low_pass(record, force, tau))
        return Hidden(name, form, {'share': share, 'time_constant': tau}, loss=relax)
    if name == 'end_caps':
        dead = u(0.006, 0.02)

        def ends(e, p):
            if other:  # a cone that flattens as the muscle widens
                return e * (1 + dead / LENGTH * (1.2 + 1.5 * e))
            return e * LENGTH / (LENGTH - dead)
        return Hidden(name, form, {'dead_length': dead}, strain=ends)
    if name == 'braid_elasticity':
        c = u(4e-8, 1.2e-7)

        def stretch(e, p):
            p = np.maximum(p, 0)
            give = c * p * (1 - e) * (0.55 + p / 413.7e3 if other else 1.0)
            return (1 + give) ** 2
        return Hidden(name, form, {'compliance': c}, stretch=stretch)
    if name == 'threshold_pressure':
        pth = u(20e3, 70e3)

        def threshold(p, record):
            p = np.maximum(p, 0)
            return p - pth * np.tanh(p / pth) if other else np.maximum(p - pth, 0)
        return Hidden(name, form, {'pressure': pth}, pressure=threshold)
    if name == 'pressure_line_lag':
        tau = size * u(0.02, 0.08)

        def lag(p, record):
            if other:  # two volumes one after the other
                return low_pass(record, low_pass(record, p, 0.6 * tau), 0.4 * tau)
            return low_pass(record, p, tau)
        return Hidden(name, form, {'time_constant': tau}, pressure=lag)
    if name == 'temperature':
        rise, tau = u(15, 50) * rng.choice([-1, 1]), u(60, 200)

        def warm(rubber, record):
            t = record.time - record.time[0]
            way = t / (t[-1] + 1) if other else 1 - np.exp(-t / tau)
            return rubber * rise / 293.15 * way
        return Hidden(name, form, {'rise': rise}, rubber=warm)
    if name == 'softening':
        depth, reach = u(0.12, 0.35), u(0.4, 1.2)

        def soften(rubber, record):
            moved = np.abs(np.diff(record.strain, prepend=record.strain[0]))
            moved[record.starts] = 0.0
            travel = np.zeros(len(moved))
            total = 0.0
            begins = set(record.starts.tolist())
            for i, step in enumerate(moved):
                total = 0.0 if i in begins else total + step
                travel[i] = total
            lost = travel / (travel + 0.7 * reach) if other else 1 - np.exp(-travel / reach)
            return -depth * lost * rubber
        return Hidden(name, form, {'depth': depth}, rubber=soften)
    if name == 'motor_unit_mismatch':
        m = u(0.05, 0.15) * rng.choice([-1, 1])
        return Hidden(name, form, {'mu2': m}, area=lambda unit: 1 + m if unit else 1.0)
    if name == 'bladder_elasticity':
        if other:  # Fung
            k, b = u(120, 200), u(-3.0, -1.0)
            return Hidden(name, form, rig={'bladder': lambda e: k / b * (1 - np.exp(b * e))})
        factor, ratio = u(0.7, 1.3), u(0.6, 1.5)
        return Hidden(name, form, {'c10': factor * C10, 'c01': ratio * factor * C01},
                      rig={'c10': factor * C10, 'c01': ratio * factor * C01})
    return _sensor(name, form, rng, size)


def _sensor(name: str, form: str, rng: np.random.Generator, size: float) -> Hidden:
    sign = rng.choice([-1.0, 1.0])
    u = rng.uniform
    if name == 'force_sensor_bias':
        b = size * sign * u(1.0, 5.0)
        return Hidden(name, form, {'bias': b}, shown=lambda f, e, p: (f + b, e, p))
    if name == 'force_sensor_gain':
        g = sign * u(0.02, 0.06)
        return Hidden(name, form, {'gain': g}, shown=lambda f, e, p: (f * (1 + g), e, p))
    if name == 'pressure_sensor_bias':
        b = sign * u(6e3, 25e3)
        return Hidden(name, form, {'bias': b}, shown=lambda f, e, p: (f, e, p + b))
    if name == 'pressure_sensor_gain':
        g = sign * u(0.02, 0.06)
        return Hidden(name, form, {'gain': g}, shown=lambda f, e, p: (f, e, p * (1 + g)))
    if name == 'strain_sensor_offset':
        o = sign * u(0.004, 0.015)
        return Hidden(name, form, {'offset': o}, shown=lambda f, e, p: (f, e + o, p))
    raise ValueError(f'no generator for {name}')


#: Effects beyond the catalogue: none of its families can make these.
OUTSIDERS = ('hard_stop', 'ripple', 'cell_bend', 'bad_run', 'detent', 'burst', 'hum')


def make_outsider(name: str, rng: np.random.Generator) -> Hidden:
    """Return an effect that the catalogue does not have."""
    u = rng.uniform
    if name == 'hard_stop':  # the rig touches something
        at, k, power = u(0.13, 0.19), u(200, 900), rng.choice([1.0, 1.5])
        return Hidden(name, '', loss=lambda f, e, p, r: -k * np.maximum(e - at, 0) * (
            np.maximum(e - at, 0) / 0.05) ** (power - 1))
    if name == 'ripple':  # a guide that binds periodically
        a, period, phase = u(1.5, 4.0), u(0.035, 0.08), u(0, 6)
        return Hidden(name, '', loss=lambda f, e, p, r: a * np.sin(2 * np.pi * e / period + phase))
    if name == 'cell_bend':  # a load cell that saturates
        top = u(220, 400)
        return Hidden(name, '', shown=lambda f, e, p: (f - np.sign(f) * f ** 2 / top, e, p))
    if name == 'bad_run':  # something slipped in one trial
        jump, which = u(3, 8) * rng.choice([-1, 1]), u()

        def slip(f, e, p, r):
            trial = int(which * (r.trial.max() + 1))
            return np.where(r.trial == trial, jump, 0.0)
        return Hidden(name, '', loss=slip)
    if name == 'detent':  # a bump at one strain
        at, a, w = u(0.06, 0.16), u(3, 8), u(0.008, 0.02)
        return Hidden(name, '', loss=lambda f, e, p, r: a * np.exp(-((e - at) / w) ** 2))
    if name == 'burst':  # a leak past the end fitting above a pressure
        at, k = u(200e3, 300e3), u(0.1, 0.3)
        return Hidden(name, '', pressure=lambda p, r: p - k * np.maximum(p - at, 0))
    if name == 'hum':  # vibration of the frame
        a, period = u(1.5, 4.0), u(2.0, 6.0)
        return Hidden(name, '', loss=lambda f, e, p, r: a * np.sin(2 * np.pi * r.time / period))
    raise ValueError(name)


# --- noise and the case ------------------------------------------------------------------------

def noise_of(kind: str, sd: float, record: Record, rng: np.random.Generator) -> np.ndarray:
    """Return noise: 'white', 'ar' (0.8 from one to the next) or 'outliers' (3 %, 5 to 15 sd)."""
    white = sd * rng.standard_normal(len(record.time))
    if kind == 'ar':
        result, state = np.empty(len(white)), 0.0
        for i, value in enumerate(white):
            state = 0.8 * state + 0.6 * value
            result[i] = state
        return result
    if kind == 'outliers':
        bad = rng.uniform(size=len(white)) < 0.03
        return white + bad * sd * rng.uniform(5, 15, len(white)) * rng.choice([-1, 1], len(white))
    return white


def nominal(units: int, bladder: bool = True) -> Bundle:
    """Return the model that the user starts from."""
    geometry = Geometry(RADIUS, LENGTH, ANGLE, WALL)
    effects = [catalogue.get('mesh')()]
    if bladder:
        effects.append(catalogue.get('bladder_elasticity')())
    return Bundle('baseline', [MotorUnit(f'mu{k + 1}', 1, geometry) for k in range(units)],
                  effects)


#: What may be hidden in each kind of data.
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
#: Names that are the same physics, whatever the data.
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
_RECORDS = {'static': static_record, 'dynamic': dynamic_record, 'bundle': bundle_record}


def make_case(kind: str, seed: int, hidden: tuple[str, ...] = (), form: str = 'same',
              noise: str = 'white', off: float = 0.4, outsider: str = '',
              size: float = 1.0, rows: int | None = None) -> Case:
    """
    Return a case.

    Parameters
    ----------
    kind : str
        'static', 'dynamic' or 'bundle'.
    seed : int
    hidden : tuple of str
        Names of hidden effects.
    form : str
        'same' as the catalogue's or 'other'.
    noise : str
        'white', 'ar' or 'outliers'.
    off : float
        Standard deviation of the errors of the model's own parameters, in tolerances.
    outsider : str
        An effect beyond the catalogue, from `OUTSIDERS`.
    size : float
        Scale of the hidden effect.
    rows : int, optional
        Rows of a dynamic record (default 4800).
    """
    rng = np.random.default_rng([seed, sum(map(ord, kind + form + noise + outsider)), len(hidden)])
    if kind == 'static':
        record = static_record(rng, shuffled=bool({'temperature'} & set(hidden)))
    elif kind == 'dynamic':
        record = dynamic_record(rng, rate=40.0 if rows is None else rows / 120.0)
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
    clean = true_force(record, rig, [])
    absorbed = 0.0
    if parts:
        with_it = true_force(record, rig, parts)
        absorbed = float(np.std(with_it - clean) / sd)
    return Case(data.name, kind, model, data, hidden,
                tuple(SAME_PHYSICS.get(name, ()) for name in hidden), verdicts, sd, form,
                {f'{p.name}.{k}': v for p in parts for k, v in p.parameters.items()}, absorbed)
