# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A measurement of a muscle or a bundle: arrays in SI units, with trials, direction and rate.

`Measurement` is what every step of discovery takes. It comes from a CSV file (`csvfile`), a ROS 2
bag (`bagfile`) or a pandas frame; whichever way, the same checks apply and a wrong unit or a row
of nonsense ends in one sentence that says where.
"""

from __future__ import annotations

from collections.abc import Sequence
import csv
from dataclasses import dataclass, field, replace
import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from fam_bundle_ros.data import rates
from fam_bundle_ros.errors import InputError

#: Fewer rows than this cannot carry a comparison.
MIN_ROWS = 12
#: More rows than this are refused before they are held in memory (about 0.5 GB of arrays).
MAX_ROWS = 5_000_000
#: The best load cells are good to this share of the largest force; what is less is rounding.
RESOLUTION = 1e-4

#: quantity: (lowest, highest, SI unit, words); a reading outside is a unit slip, not physics.
_RANGES = {
    'pressure': (-60e3, 1.2e6, 'Pa', 'gauge pressure between 0 and 1 MPa'),
    'strain': (-0.2, 0.6, '', 'a strain between 0 and 0.5, positive when shorter'),
    'force': (-20e3, 20e3, 'N', 'a force within 20 kN, tension positive'),
}
#: A guess is worth making only if the largest reading then is at least this.
_SMALLEST = {'pressure': 20e3, 'strain': 0.02, 'force': 5.0}
#: What people write instead: (what the header probably should have said, factor to SI).
_GUESSES = {
    'pressure': (('kPa', 1e3), ('Pa', 1.0), ('MPa', 1e6), ('bar', 1e5), ('psi', 6894.757)),
    'strain': (('%', 0.01), ('1', 1.0)),
    'force': (('N', 1.0), ('lbf', 4.448222), ('mN', 1e-3), ('kN', 1e3)),
}


@dataclass(frozen=True)
class Measurement:
    """
    Measured force against strain and pressure, in SI units.

    Attributes
    ----------
    name : str
        Where it comes from, for messages and reports.
    strain : ndarray, shape (T,)
        Contraction over rest length, positive when shorter.
    pressure : ndarray, shape (T, n), Pa (gauge)
        One column per motor unit.
    force : ndarray, shape (T,), N
        Tension positive.
    trial : ndarray of int, shape (T,)
        Index into ``trial_names``; rows of one trial are neighbours.
    time : ndarray, shape (T,), s, or None
        Clock time; increasing within a trial. None for a static map.
    strain_rate : ndarray, shape (T,), 1/s
        Smoothed slope of the strain, zero for a static map.
    rate_noise : float, 1/s
        Standard deviation of the noise left in ``strain_rate``.
    direction : ndarray of int, shape (T,)
        +1 shortening, -1 lengthening, 0 at rest or unknown.
    motor_units : tuple of str
        Names of the pressure columns, empty names for a single muscle.
    sha256 : str
        Digest of the file that was read, empty when there was none.
    notes : tuple of str
        What a reader should know: oddities that are not errors.
    """

    name: str
    strain: np.ndarray
    pressure: np.ndarray
    force: np.ndarray
    trial: np.ndarray
    time: np.ndarray | None = None
    strain_rate: np.ndarray = field(default_factory=lambda: np.zeros(0))
    rate_noise: float = 0.0
    direction: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    trial_names: tuple[str, ...] = ('0',)
    motor_units: tuple[str, ...] = ('mu1',)
    sha256: str = ''
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.force)

    @property
    def is_static(self) -> bool:
        """True for a map without time: nothing that depends on history can be seen."""
        return self.time is None

    @property
    def start(self) -> np.ndarray:
        """Return a (T,) bool array, True at the first sample of each trial."""
        first = np.ones(len(self), bool)
        first[1:] = np.diff(self.trial) != 0
        return first

    @property
    def clock(self) -> np.ndarray:
        """Return the time, or for a static map seconds that merely count the rows, (T,)."""
        return np.arange(len(self), dtype=float) if self.time is None else self.time

    def select(self, keep: np.ndarray) -> Measurement:
        """Return the rows where ``keep`` (bool or index array, shape (T,)) holds."""
        picked = {name: getattr(self, name)[keep]
                  for name in ('strain', 'pressure', 'force', 'trial', 'strain_rate', 'direction')}
        return replace(self, time=None if self.time is None else self.time[keep], **picked)

    def to_frame(self) -> Any:
        """Return a pandas DataFrame in SI units (pandas is an extra: `tools`)."""
        import pandas
        columns: dict[str, Any] = {}
        if self.time is not None:
            columns['time [s]'] = self.time
        columns['trial'] = [self.trial_names[i] for i in self.trial]
        columns['strain'] = self.strain
        for label, values in zip(pressure_labels(self), self.pressure.T):
            columns[f'{label} [Pa]'] = values
        columns['force [N]'] = self.force
        if self.time is not None:
            columns['strain_rate [1/s]'] = self.strain_rate
            columns['direction'] = self.direction
        return pandas.DataFrame(columns)

    def __str__(self) -> str:
        low, high = self.pressure.min() / 1e3, self.pressure.max() / 1e3
        kind = 'static map' if self.time is None else counted(len(self.trial_names), 'trial')
        units = 'one muscle' if self.pressure.shape[1] == 1 else (
            f'{self.pressure.shape[1]} motor units')
        lines = [f'{self.name}: {len(self)} samples, {kind}, {units}, strain '
                 f'{self.strain.min():.3f} to {self.strain.max():.3f}, pressure {low:.0f} to '
                 f'{high:.0f} kPa, force {self.force.min():.0f} to {self.force.max():.0f} N']
        return '\n'.join(lines + [f'  note: {note}' for note in self.notes])


def pressure_labels(measurement: Measurement) -> list[str]:
    """Return the pressure columns' names: `pressure`, or `pressure.mu1`, ... for a bundle."""
    if measurement.pressure.shape[1] == 1:
        return ['pressure']
    return [f'pressure.{name}' for name in measurement.motor_units]


def counted(number: int, noun: str) -> str:
    """Return a number and a noun: `1 trial`, `2 trials`."""
    return f'{number} {noun}{"s" * (number != 1)}'


def file_digest(path: str | Path) -> str:
    """Return a file's SHA-256 in hex, read in pieces."""
    digest = hashlib.sha256()
    with open(path, 'rb') as stream:
        for piece in iter(lambda: stream.read(1 << 20), b''):
            digest.update(piece)
    return digest.hexdigest()


def write_csv(measurement: Measurement, path: str | Path,
              extra: dict[str, np.ndarray] | None = None) -> None:
    """
    Write a measurement as a CSV that `read_measurement` takes (s, kPa, N).

    Parameters
    ----------
    extra : dict of str to ndarray (T,), optional
        More columns, named with their unit, such as ``'model_force [N]'``.
    """
    header, columns = [], []
    if measurement.time is not None:
        header, columns = ['time [s]'], [[f'{t:.6g}' if t < 1e3 else f'{t:.6f}'
                                          for t in measurement.time]]
    header += ['trial', 'strain'] + [f'{label} [kPa]' for label in pressure_labels(measurement)]
    columns.append([measurement.trial_names[i] for i in measurement.trial])
    columns.append([f'{v:.7g}' for v in measurement.strain])
    columns += [[f'{v / 1e3:.6g}' for v in values] for values in measurement.pressure.T]
    header.append('force [N]')
    columns.append([f'{v:.6g}' for v in measurement.force])
    for label, values in (extra or {}).items():
        header.append(label)
        columns.append([f'{v:.6g}' for v in values])
    with open(path, 'w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(header)
        writer.writerows(zip(*columns))


def build(name: str, strain: np.ndarray, pressure: np.ndarray, force: np.ndarray,
          trial: Sequence[Any] | np.ndarray | None = None, time: np.ndarray | None = None,
          motor_units: Sequence[str] = ('mu1',), strain_rate: np.ndarray | None = None,
          first_row: int = 1, notes: Sequence[str] = (), units: dict[str, str] | None = None,
          allow_constant_pressure: bool = False) -> Measurement:
    """
    Check SI arrays and make a `Measurement` of them: the one gate that every reader uses.

    Parameters
    ----------
    first_row : int
        What to call the first row in messages (2 for a CSV with a header).
    units : dict, optional
        The unit each quantity was given in, for messages.
    """
    strain, force = np.asarray(strain, float), np.asarray(force, float)
    pressure = np.asarray(pressure, float)
    pressure = pressure[:, None] if pressure.ndim == 1 else pressure
    rows = len(force)
    if rows < MIN_ROWS:
        raise InputError(f'{name}: only {rows} rows; expected at least {MIN_ROWS} to compare with')
    if rows > MAX_ROWS:
        raise InputError(f'{name}: {rows} rows; expected at most {MAX_ROWS} '
                         '(decimate or split the log)')
    labels = ['pressure'] if pressure.shape[1] == 1 else [f'pressure.{m}' for m in motor_units]
    named = [('strain', 'strain', strain), ('force', 'force', force)]
    named += [(label, 'pressure', values) for label, values in zip(labels, pressure.T)]
    if time is not None:
        named.append(('time', 'time', np.asarray(time, float)))
    for label, _, values in named:
        bad = ~np.isfinite(values)
        if bad.any():
            row = int(np.argmax(bad)) + first_row
            raise InputError(f'{name}, row {row}: {label} is not a finite number '
                             f'({int(bad.sum())} such rows); expected a number in every row')
    for label, quantity, values in named:
        if quantity in _RANGES:
            _check_range(name, label, quantity, values, first_row, (units or {}).get(label, ''))
    notes = list(notes)
    if np.ptp(pressure, axis=0).max() < max(1e3, 0.01 * np.abs(pressure).max()):
        text = (f'pressure is constant at {pressure.mean() / 1e3:.1f} kPa; expected at least two '
                'levels, else effects of pressure cannot be told apart')
        if not allow_constant_pressure:
            raise InputError(f'{name}: {text}')
        notes.append(text)
    if np.ptp(strain) < 1e-4:
        raise InputError(f'{name}: strain is constant at {strain.mean():.4f}; expected a sweep or '
                         'several strains')
    index, trial_names, order = _trials(name, trial, time, rows, first_row)
    if order is not None:
        strain, pressure, force = strain[order], pressure[order], force[order]
        time = None if time is None else np.asarray(time, float)[order]
    if time is None:
        return Measurement(name, strain, pressure, force, index, None, np.zeros(rows), 0.0,
                           np.zeros(rows, int), trial_names, tuple(motor_units), '', tuple(notes))
    time = np.asarray(time, float)
    rate, rate_noise = rates.strain_rate(time, strain, index)
    if strain_rate is not None:
        rate = np.asarray(strain_rate, float)
        if not np.isfinite(rate).all():
            raise InputError(f'{name}, row {int(np.argmin(np.isfinite(rate))) + first_row}: '
                             'strain_rate is not a number')
        rate = rate if order is None else rate[order]
    direction = rates.direction(rate, rate_noise)
    return Measurement(name, strain, pressure, force, index, time, rate, rate_noise, direction,
                       trial_names, tuple(motor_units), '', tuple(notes))


def _check_range(name: str, label: str, quantity: str, values: np.ndarray, first_row: int,
                 unit: str) -> None:
    low, high, si, words = _RANGES[quantity]
    outside = (values < low) | (values > high)
    from fam_bundle_ros.units import si_factor
    factor = si_factor(unit, si or 'dimensionless') if unit else 1.0
    shown = unit or si
    if outside.any():
        row = int(np.argmax(np.abs(values)))
        value = values[row]
        guess = ''
        for other, scale in _GUESSES[quantity]:
            trial = values / factor * scale
            if other != unit and trial.min() >= low and trial.max() <= high and (
                    np.abs(trial).max() > _SMALLEST[quantity]):
                guess = f' (did you mean {other}?)'
                break
        if not guess and quantity == 'strain' and np.median(values) < 0:
            guess = ' (is the sign turned round?)'
        raise InputError(f'{name}, row {row + first_row}: {label} is {value / factor:.6g} {shown}'
                         f'; expected {words}{guess}'.replace(' ;', ';'))
    top = np.abs(values).max()
    if quantity == 'pressure' and 1.0 < top < 1.5e3 and values.min() > -0.1 * top:
        # hardly any pressure at all, and not the noise of a vented gauge: the header's unit is
        # too small
        for other, scale in _GUESSES[quantity]:
            if 20e3 <= top / factor * scale <= high:
                raise InputError(f'{name}: {label} reaches only {top / factor:.4g} {shown}; '
                                 f'expected {words} (did you mean {other}?)')


def _trials(name: str, trial: Sequence[Any] | np.ndarray | None, time: np.ndarray | None,
            rows: int, first_row: int) -> tuple[np.ndarray, tuple[str, ...], np.ndarray | None]:
    """Return trial indices, their names, and a row order that puts each trial together."""
    if trial is None:
        if time is None:
            return np.zeros(rows, int), ('0',), None
        back = np.diff(time) <= 0
        # a clock that restarts a few times is a file of several trials; many times is disorder
        if back.sum() > max(1, rows // 50) or (np.diff(time) == 0).any():
            raise _disorder(name, time, np.zeros(rows, int), ('0',), first_row)
        index = np.concatenate([[0], np.cumsum(back)])
        return index, tuple(str(i) for i in range(index[-1] + 1)), None
    labels = [str(value) for value in np.asarray(trial)]
    names: dict[str, int] = {}
    index = np.array([names.setdefault(label, len(names)) for label in labels])
    order = None
    if (np.diff(index) < 0).any():
        order = np.argsort(index, kind='stable')
        index = index[order]
    if time is not None:
        ordered = np.asarray(time, float) if order is None else np.asarray(time, float)[order]
        if ((np.diff(ordered) <= 0) & (np.diff(index) == 0)).any():
            raise _disorder(name, ordered, index, tuple(names), first_row, order)
    return index, tuple(names), order


def _disorder(name: str, time: np.ndarray, index: np.ndarray, names: tuple[str, ...],
              first_row: int, order: np.ndarray | None = None) -> InputError:
    back = (np.diff(time) <= 0) & (np.diff(index) == 0)
    at = int(np.argmax(back)) + 1
    row = (at if order is None else int(order[at])) + first_row
    return InputError(f'{name}, row {row}: time goes from {time[at - 1]:.6g} s to {time[at]:.6g} '
                      f's within trial {names[index[at]]}; expected time to increase')
