# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The true muscle of the discovery benchmark and its hidden effects, without the catalogue's code.

For half of the cases the hidden effect has another functional form than the catalogue's (Fung
instead of Mooney-Rivlin, Dahl instead of Maxwell slip, a soft floor instead of a hard one, ...).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
import math

import numpy as np

RADIUS, LENGTH, ANGLE, WALL = 6.35e-3, 0.127, np.radians(33.0), 1.59e-3
C10, C01 = 118.4e3, 105.7e3


@dataclass
class Rig:
    """The true muscle: parameters, nominal by default."""

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
        """Return the force of the tube, N; stretched threads make it wider."""
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
    """Motion of the rig: true strain, pressure, rate, time and trial."""

    time: np.ndarray
    trial: np.ndarray
    strain: np.ndarray
    pressure: np.ndarray
    rate: np.ndarray

    @property
    def starts(self) -> np.ndarray:
        """Return the rows where the clock begins: in a pause the muscle remembers."""
        return np.append(0, np.flatnonzero(np.diff(self.time) < 0) + 1)


# --- forces ------------------------------------------------------------------------------------

@dataclass
class Hidden:
    """A hidden effect: its name, and hooks on the parts of a muscle."""

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
    def hooks(name: str) -> list[Callable]:
        return [hook for h in hidden if (hook := getattr(h, name))]

    total = np.zeros(len(record.time))
    for unit in range(record.pressure.shape[1]):
        e, p = record.strain, record.pressure[:, unit]
        for pressure in hooks('pressure'):
            p = pressure(p, record)
        felt = e
        for strain in hooks('strain'):
            felt = strain(felt, p)
        stretch = math.prod((hook(felt, p) for hook in hooks('stretch')), start=1.0)
        area = math.prod(hook(unit) for hook in hooks('area'))
        rubber = rig.rubber(felt, stretch)
        force = sum((hook(rubber, record) for hook in hooks('rubber')),
                    area * (rig.mesh(felt, p, stretch) + rubber))
        for limit in hooks('limit'):
            force = limit(force, e, p)
        total += force + sum(hook(force, e, p, record) for hook in hooks('loss'))
    return total


def remembered(record: Record, step: Callable) -> np.ndarray:
    """Return a state at each sample, (T,): ``step(state or None, i, dt) -> state``."""
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
    """Return a signal with a first-order lag, at rest where the clock begins."""
    def step(state, i, dt):
        if state is None:
            return signal[i]
        return state + (signal[i] - state) * (1.0 - np.exp(-dt / tau))
    return remembered(record, step)


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
            folded = np.maximum(1 - e0 - s * p, 0.05)
            bend = np.arccos(np.clip((1 - e) / folded, -1, 1))
            hinge = 4 * (m0 + m1 * np.pi * p * RADIUS ** 3) / (
                LENGTH * folded * np.maximum(np.sin(bend), 1e-6))
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
                return -level * remembered(record, dahl)
            slip = np.zeros(len(e))
            for share in spread:
                half = share * width

                def stop(z, i, dt, half=half):
                    if z is None:
                        return 0.0
                    return float(np.clip(z + e[i] - e[i - 1], -half, half))
                slip += remembered(record, stop) / half / len(spread)
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
            travel = remembered(record, lambda z, i, dt: 0.0 if z is None else z + moved[i])
            lost = travel / (travel + 0.7 * reach) if other else 1 - np.exp(-travel / reach)
            return -depth * lost * rubber
        return Hidden(name, form, {'depth': depth}, rubber=soften)
    if name == 'motor_unit_mismatch':
        m = u(0.05, 0.15) * rng.choice([-1, 1])
        return Hidden(name, form, {'mu2': m}, area=lambda unit: 1 + m if unit else 1.0)
    if name == 'bladder_elasticity':
        if other:  # Fung 1967: stiffens; with b < 0 it is the formula of `saturating_sheath`
            k, b = u(120, 200), u(1.0, 3.0)
            return Hidden(name, form, rig={'bladder': lambda e: k / b * (1 - np.exp(b * e))})
        factor, ratio = u(0.7, 1.3), u(0.6, 1.5)
        return Hidden(name, form, {'c10': factor * C10, 'c01': ratio * factor * C01},
                      rig={'c10': factor * C10, 'c01': ratio * factor * C01})
    return _sensor(name, form, rng, size)


#: Errors of sensors: parameter and its range, and what it (x) makes of force, strain and pressure.
_SENSORS: dict[str, tuple[str, float, float, Callable]] = {
    'force_sensor_bias': ('bias', 1.0, 5.0, lambda f, e, p, x: (f + x, e, p)),
    'force_sensor_gain': ('gain', 0.02, 0.06, lambda f, e, p, x: (f * (1 + x), e, p)),
    'pressure_sensor_bias': ('bias', 6e3, 25e3, lambda f, e, p, x: (f, e, p + x)),
    'pressure_sensor_gain': ('gain', 0.02, 0.06, lambda f, e, p, x: (f, e, p * (1 + x))),
    'strain_sensor_offset': ('offset', 0.004, 0.015, lambda f, e, p, x: (f, e + x, p))}


def _sensor(name: str, form: str, rng: np.random.Generator, size: float) -> Hidden:
    sign = rng.choice([-1.0, 1.0])
    parameter, low, high, shown = _SENSORS[name]
    x = (size if name == 'force_sensor_bias' else 1.0) * sign * rng.uniform(low, high)
    return Hidden(name, form, {parameter: x}, shown=partial(shown, x=x))


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
