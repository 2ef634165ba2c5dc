# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Simple shapes that describe an error which no effect of the catalogue explains.

The shapes are products of functions of strain, pressure, direction of motion, speed, force or
time, each with the unit of its coefficient. They are fitted to the part of the residual that the
model's own parameters cannot absorb. The best one of each kind describes the error in words and
can be saved as an expression effect.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fam_bundle_ros.data.grouping import pressure_levels, rms
from fam_bundle_ros.data.measurement import pressure_labels
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.fitter import Fit
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, catalogue, Effect, Parameter
from fam_bundle_ros.model.expression import expression_law, usual_place
from fam_bundle_ros.model.laws.discrepancy import ROUNDING
from fam_bundle_ros.model.scan import affine_scan
from fam_bundle_ros.told import number


@dataclass(frozen=True)
class Template:
    """
    A shape that describes an error.

    Attributes
    ----------
    words : str
    coefficient : float
        Fitted value, SI.
    unit : str
        Unit of the coefficient.
    explained : float
        Relative reduction of the mean square error, 0 to 1.
    gain : float
        Reduction of chi2.
    families : tuple of str
        Families of the catalogue that leave such a shape.
    expression : str or None
        Formula for a model file, with ``k`` as the coefficient; None if it has none.
    kind : str
        Only the best shape of each kind is reported.
    size_N : float
        Rms of the shape's force beyond what the model's own parameters can absorb.
    constants : tuple of (str, float, str)
        Other names in the formula: name, value and unit.
    """

    words: str
    coefficient: float
    unit: str
    explained: float
    gain: float
    families: tuple[str, ...]
    expression: str | None
    kind: str
    size_N: float = 0.0
    constants: tuple[tuple[str, float, str], ...] = ()

    def __str__(self) -> str:
        coefficient = f'{number(self.coefficient)} {self.unit}'.rstrip()
        return (f'{self.words}: {number(self.size_N)} N rms (k = {coefficient}), '
                f'{100 * self.explained:.0f} %')

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as plain numbers and text."""
        return asdict(self)

    def effect(self, name: str = 'found_shape') -> Effect:
        """
        Return the shape as an expression effect, to be added to a model and saved with it.

        Raises
        ------
        InputError
            If the shape cannot be written as a formula.
        """
        if self.expression is None:
            raise InputError(f"'{self.words}' cannot be written as a formula of a model file")
        size = abs(self.coefficient) or 1.0
        unit = self.unit or '1'
        coefficient = Parameter(self.coefficient, unit, -100.0 * size, 100.0 * size,
                                self.words, name='k')
        others = (Parameter(value, of, 0.1 * value, 10.0 * value, 'of the shape', fitted=False,
                            name=key) for key, value, of in self.constants)
        return expression_law(name, self.expression, usual_place(self.expression),
                              (coefficient, *others))()


#: To what the shares of shapes refer.
SHARE = 'of the mean square error that the best model leaves'
#: Least share that is not printed as 0 %.
_LEAST = 0.005
#: Words for a loss, and for the same with the other sign: play or delay, not friction.
_OPPOSITE = {'against the motion': 'with the motion',
             'lower while filling': 'higher while filling'}


@dataclass(frozen=True)
class _Shape:
    columns: np.ndarray  # (T, c): one column, or a sine and cosine
    words: str
    unit: str
    kind: str
    expression: str | None
    constants: tuple[tuple[str, float, str], ...]  # with a unit: name, value, unit


def bank(cells: Cells, model: Bundle) -> list[_Shape]:
    """Return the shapes that the data can show, with coefficient 1."""
    data = cells.data
    e, total = cells.motion.strain, cells.motion.pressure.mean(-1)
    force = model.predict(cells.motion)
    single = data.pressure.shape[1] == 1
    shapes: list[_Shape] = []

    def add(column: np.ndarray, words: str, unit: str, kind: str, expression: str | None = None,
            constants: tuple[tuple[str, float, str], ...] = ()) -> None:
        columns = column if column.ndim == 2 else column[:, None]
        if np.all(np.isfinite(columns)):
            shapes.append(_Shape(columns, words, unit, kind, expression, constants))

    pressures = [(np.ones_like(total), '', '', '', 0),
                 (total, ' times pressure', '/Pa', ' * pressure', 1),
                 (total ** 2, ' times pressure squared', '/Pa**2', ' * pressure**2', 2)]
    low, high = float(e.min()), float(e.max())
    span = max(high - low, 1e-9)
    smooth = [(np.ones_like(e), 'constant', '1'), (e, 'in proportion to strain', 'strain'),
              (e ** 2, 'with the square of strain', 'strain**2'),
              (e ** 3, 'with the cube of strain', 'strain**3')]
    for g, g_words, g_unit, g_text, power in pressures:
        def text(formula: str, g_text: str = g_text) -> str | None:
            return f'k * {formula}{g_text}' if single else None
        unit = 'N' + g_unit
        for h, words, formula in smooth:
            add(h * g, words + g_words, unit, f'smooth{power}', text(formula))
        for onset in np.linspace(low + 0.12 * span, high - 0.08 * span, 25):
            add(np.maximum(e - onset, 0) * g, f'starts at strain {onset:.3f} and grows{g_words}',
                unit, f'onset{power}', text(f'max(0, strain - {onset:.4f})'))
            add(np.maximum(e - onset, 0) ** 2 * g,
                f'starts at strain {onset:.3f} and grows with its square{g_words}', unit,
                f'onset{power}', text(f'max(0, strain - {onset:.4f})**2'))
            add(np.maximum(onset - e, 0) * g, f'only below strain {onset:.3f}{g_words}', unit,
                f'below{power}', text(f'max(0, {onset:.4f} - strain)'))
            width = span / 10
            add(np.exp(-((e - onset) / width) ** 2) * g,
                f'a bump about strain {onset:.3f}{g_words}', unit, f'bump{power}',
                text(f'exp(-((strain - {onset:.4f}) / {width:.4f})**2)'))
        # no period below three samples of strain, and none at all on a map of a few strains
        steps = np.abs(np.diff(e))[np.diff(data.trial) == 0]
        levels = len(np.unique(np.round(e / span * 400)))
        shortest = 3.0 * float(np.median(steps)) if not data.is_static else 4.0 * span / levels
        for count in np.arange(1.5, 24.1, 0.5):
            period = span / count
            if period < shortest or levels < 20:
                break
            wave = 2 * np.pi * e / period
            add(np.column_stack([np.sin(wave) * g, np.cos(wave) * g]),
                f'periodic in strain, every {period:.4f}{g_words}', unit, f'periodic{power}')
    for onset in np.linspace(total.min(), total.max(), 9)[1:-1]:
        for h, words, formula in smooth[:2]:
            add(np.maximum(total - onset, 0) * h,
                f'only above {onset / 1e3:.0f} kPa, {words}', 'N/Pa', 'above_pressure',
                f'k * {formula} * max(0, pressure - onset)' if single else None,
                (('onset', float(onset), 'Pa'),))
    for label, column in zip(pressure_labels(data), cells.motion.pressure.T):
        means = np.sort(pressure_levels(column)[1])
        if len(means) < 3:
            continue
        for k, centre in enumerate(means):
            # half the distance to the next isobar: the value there is 2 %
            width = 0.5 * float(np.abs(np.delete(means, k) - centre).min())
            of = label.partition('.')[2]
            add(np.exp(-((column - centre) / width) ** 2),
                f'at {of}{" " * bool(of)}{centre / 1e3:.0f} kPa and not at other pressures',
                'N', 'one_isobar',
                'k * exp(-((pressure - centre) / width)**2)' if single else None,
                (('centre', float(centre), 'Pa'), ('width', width, 'Pa')))
    below = np.minimum(force, 0.0)
    if (below < 0).mean() > 0.01:
        add(below, 'past free strain, with the resistive force', '', 'past_free')
        add((below < 0).astype(float), 'past free strain, constant', 'N', 'past_free')
        add((below < 0) * total, 'past free strain, with pressure', 'N/Pa', 'past_free')
    add(force, 'in proportion to the force', '', 'force')
    add(force ** 2, 'with the square of the force', '1/N', 'force_squared')
    reach = float(np.abs(force).max())
    for share in (0.5, 0.65, 0.8):
        add(np.maximum(force - share * reach, 0), f'only above {share * reach:.0f} N of force', '',
            'force_onset')
    if not data.is_static:
        _add_motion(add, cells, data.force - force, e, total, force, single)
    return shapes


def _add_motion(add: Any, cells: Cells, residual: np.ndarray, e: np.ndarray,
                total: np.ndarray, force: np.ndarray, single: bool) -> None:
    """Add the shapes that need a log: direction, speed, memory, drift, a single trial."""
    data = cells.data
    rate, way = data.strain_rate, data.direction.astype(float)
    sign, given = 'tanh(strain_rate / rounding)', (('rounding', ROUNDING, '1/s'),)
    on = ' * pressure' if single else None
    # a formula has the strain rate, but not the direction of the pressure at rest
    against = 'lower while filling than while venting' if data.is_held else 'against the motion'
    for size, words, unit, formula, kind in (
            (np.ones_like(e), 'constant', 'N', '', 'friction'),
            (total, 'with pressure', 'N/Pa', on, 'friction'),
            (np.abs(force), 'with the force', '', ' * abs(force)', 'friction'),
            (e, 'with strain', 'N', ' * strain', 'friction_strain'),
            (e * total, 'with strain and pressure', 'N/Pa', on and f' * strain{on}',
             'friction_strain')):
        add(-way * size, f'{against}, {words}', unit, kind,
            None if data.is_held or formula is None else f'-k * {sign}{formula}', given)
    add(-rate, 'against the motion, with speed', 'N*s', 'speed', '-k * strain_rate')
    add(-rate * np.abs(rate), 'against the motion, with speed squared', 'N*s**2', 'speed',
        '-k * strain_rate * abs(strain_rate)')
    add(-rate * total, 'against the motion, with speed and pressure', 'N*s/Pa', 'speed',
        f'-k * strain_rate{on}' if on else None)
    add(np.abs(rate), 'with speed, equal in both directions', 'N*s', 'even_speed',
        'k * abs(strain_rate)')
    time = data.clock
    first = np.flatnonzero(data.start)
    own = time - time[first][np.cumsum(data.start) - 1]
    continuing = bool(len(first) > 1 and np.all(np.diff(time) > 0))
    overall = time - time[0] if continuing else own
    if np.ptp(overall) > 0:
        t = overall / np.ptp(overall)
        add(t, 'grows with the time of the log', 'N', 'drift')
        add(t * force, 'grows with the time of the log, with the force', '', 'drift')
        add(t ** 2, 'grows with the square of the time of the log', 'N', 'drift')
    if continuing and np.ptp(own) > 0:
        add(own / np.ptp(own), 'grows with the time of each trial', 'N', 'drift_trial')
    dt = np.diff(time, prepend=time[0])
    usual = float(np.median(dt[~data.start])) if (~data.start).any() else 1.0
    speed = np.zeros_like(total)
    moving = ~data.start
    speed[moving] = np.diff(total)[moving[1:]] / np.maximum(dt[moving], 1e-9)
    add(speed, 'with the rate of the pressure', 'N*s/Pa', 'pressure_rate')
    passed = np.where(data.restart, np.inf, dt)
    names = ((e, 'strain', 'N'), (total, 'pressure', 'N/Pa'), (force, 'force', ''))
    for signal, words, unit in names:
        for steps in (4, 16, 64, 256, 1024):
            slow_part = _lagged(signal, passed, steps * usual)
            add(slow_part - signal, f'decays over {steps * usual:.3g} s after {words} changes',
                unit, 'decay')
    _add_hum(add, cells, residual, time if continuing else own)
    count = len(data.trial_names)
    if 4 <= count <= 60:
        for k in range(count):
            inside = (data.trial == k).astype(float)
            add(inside, f'trial {data.trial_names[k]} alone', 'N', 'one_trial')


def _add_hum(add: Any, cells: Cells, residual: np.ndarray, time: np.ndarray) -> None:
    """Add a sine wave in time at the highest peak of the residual's spectrum, if significant."""
    step = float(np.median(np.diff(time)[np.diff(cells.data.trial) == 0]))
    count = int(np.ptp(time) / max(step, 1e-12)) // 2
    if count < 8 or count > 20000:
        return
    kept = cells.label >= 0
    r = np.where(kept, residual - residual[kept].mean(), 0.0)
    # one grid of times for all trials, whether they share a clock or restart it, and one FFT
    slot = np.round((time - time.min()) / step).astype(int)
    size = 1 << int(np.ceil(np.log2(4 * (slot.max() + 1))))
    power = np.abs(np.fft.rfft(np.bincount(slot, r, size), size)) ** 2
    frequency = np.arange(len(power)) / (size * step)
    band = (frequency > 2.0 / max(np.ptp(time), step)) & (frequency < 0.3 / step)
    if band.sum() < 16:
        return
    inside = np.flatnonzero(band)
    top = int(inside[np.argmax(power[inside])])
    near = power[np.clip(np.arange(top - 200, top + 201), inside[0], inside[-1])]
    if power[top] < 40.0 * np.median(near):
        return
    wave = 2 * np.pi * frequency[top] * time
    add(np.column_stack([np.sin(wave), np.cos(wave)]),
        f'periodic in time, every {1.0 / frequency[top]:.3g} s', 'N', 'hum')


def _lagged(signal: np.ndarray, dt: np.ndarray, time_constant: float) -> np.ndarray:
    """Return the signal behind a first-order lag; where the step ``dt`` is infinite, without."""
    new = 1.0 / (1.0 + time_constant / np.maximum(dt, 1e-12))
    start = np.isinf(dt)
    first = signal[np.maximum.accumulate(np.where(start, np.arange(len(signal)), 0))]
    # less its first value a constant stays constant to the last bit
    return first + affine_scan(0.0, 1.0 - new, new * (signal - first))


def describe(cells: Cells, fit: Fit, most: int = 5) -> tuple[Template, ...]:
    """
    Return the shapes that best describe the residual of a fit, best first, one of each kind.

    Without those below half the noise of a row, and those whose share would be printed as 0 %.

    Parameters
    ----------
    cells : Cells
    fit : Fit
        Fitted without a discrepancy; its parameters are refitted (linearised) with each shape.
    most : int
        Number of shapes to return.
    """
    sd = np.sqrt(cells.variance + (settings.SMALL * cells.largest_force) ** 2)
    r, jacobian = fit.residual / sd, fit.slopes / sd[:, None]
    gram = jacobian.T @ jacobian + np.eye(len(fit.u))
    slope = jacobian.T @ r - fit.u
    step = np.linalg.solve(gram, slope)
    before = max(cells.mean_square(fit.residual), 1e-18)
    scored = []
    for shape in bank(cells, fit.model):
        columns = cells.mean(shape.columns) / sd[:, None]
        across = jacobian.T @ columns
        absorbed = np.linalg.solve(gram, across)
        own = columns.T @ columns - across.T @ absorbed
        if np.any(np.diag(own) <= 1e-6 * np.sum(columns ** 2, axis=0)):
            continue  # the model's parameters can absorb this shape
        right = columns.T @ r - across.T @ step
        weight = np.linalg.solve(own, right)
        taken = (columns - jacobian @ absorbed) @ weight
        left = (r - jacobian @ step - taken) * sd
        share = float(np.clip(1.0 - cells.mean_square(left) / before, 0.0, 1.0))
        scored.append((float(right @ weight), share, weight, shape, rms(taken * sd)))
    scored.sort(key=lambda item: -item[0])
    found: list[Template] = []
    for gain, share, weight, shape, size in scored:
        if (any(t.kind == shape.kind for t in found) or share < _LEAST
                or size < settings.VISIBLE * cells.noise):
            continue
        coefficient = float(np.linalg.norm(weight) if len(weight) > 1 else weight[0])
        words = _signed(shape.words, coefficient)
        found.append(Template(
            words, coefficient, shape.unit, share, gain,
            _families(shape.kind) if words == shape.words else (), shape.expression, shape.kind,
            size, shape.constants))
        if len(found) == most:
            break
    return tuple(found)


def _families(kind: str) -> tuple[str, ...]:
    """Return the families of laws which, when missing in a model, leave this shape of error."""
    kind = kind.removesuffix('_strain')  # friction that grows with strain is friction
    return tuple(sorted({law.family for law in catalogue.available().values()
                         if kind in law.leaves}))


def _signed(words: str, coefficient: float) -> str:
    """Return the words of a shape for the sign of its coefficient."""
    if coefficient < 0.0:
        for way, other in _OPPOSITE.items():
            words = words.replace(way, other)
    return words
