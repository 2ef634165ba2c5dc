# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A measurement of a muscle or a bundle: arrays in SI units, with trials, direction and rate.

`Measurement` is what every step of discovery takes. It comes from a file of any format
(`formats`), a ROS 2 bag (`bagfile`) or a pandas frame; whichever way, `build` applies the same
checks, and a wrong unit or a row of nonsense ends in one sentence that says where.
"""

from collections.abc import Mapping, Sequence
import csv
from dataclasses import dataclass, replace
from functools import cached_property
import hashlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.atomic import whole
from fam_bundle_ros.data import checks, rates
from fam_bundle_ros.data.dropouts import what_was_lost
from fam_bundle_ros.data.resolution import follow_the_motion
from fam_bundle_ros.data.smoothing import Smooth, smooth
from fam_bundle_ros.data.trials import (
    fresh_stamps,
    MIN_ROWS,
    recordings_of,
    spread_stamps,
    trials_of,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.told import counted, Told

#: More rows than this are refused before they are held in memory (about 0.5 GB of arrays).
MAX_ROWS = 5_000_000
#: Resolution of the best load cells, as a share of the largest force.
RESOLUTION = 1e-4
#: Strain that no sensor tells from rest: 0.3 um of 300 mm.
_REST_STRAIN = 1e-6

#: Reason for which a row is left out; the name of the quantity follows.
_WITHOUT = 'without a number in'

#: What `Measurement.direction` was read from.
REST, BY_STRAIN, BY_PRESSURE = 0, 1, 2


class Taken(NamedTuple):
    """
    What a column of a file was taken for.

    Attributes
    ----------
    header : str
        As it stands in the file.
    quantity : str
        'time', 'trial', 'strain', 'contraction', 'elongation', 'length', 'pressure',
        'pressure.<motor unit>', 'force', 'strain_rate'; empty where the column is not used.
    unit : str
    sign : int
        -1 where the sign was turned round.
    why : str
        Where the unit or the sign were guessed, or why the column is not used.
    """

    header: str
    quantity: str
    unit: str = ''
    sign: int = 1
    why: str = ''

    @property
    def turned(self) -> bool:
        """Whether the sign was turned round; that of an elongation always is for a strain."""
        return (self.sign < 0) != (self.quantity == 'elongation')


@dataclass(frozen=True, repr=False)
class Measurement(Told):
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
    recording : ndarray of int, shape (T,)
        Rows of one are a continuous past of the muscle (`trials.recordings_of`): of one trial, or
        of several between which the clock runs on. Of a static map the trials.
    time : ndarray, shape (T,), s, or None
        Clock time; increasing within a trial (rows that shared a stamp are spread evenly up to
        the next, `trials.spread_stamps`). None for a static map.
    strain_rate : ndarray, shape (T,), 1/s
        Smoothed slope of the strain, zero for a static map.
    direction : ndarray of int, shape (T,)
        +1 shortening, -1 lengthening; where the strain rests, +1 filling, -1 venting (either
        would shorten or lengthen a free muscle); 0 at rest or unknown.
    direction_basis : ndarray of int, shape (T,)
        What ``direction`` was read from: `REST`, `BY_STRAIN` or `BY_PRESSURE`.
    motor_units : tuple of str
        Names of the pressure columns, empty names for a single muscle.
    notes : tuple of str
        What a reader should know: oddities that are not errors.
    dropped : mapping of str to int
        Rows that were left out, by reason.
    first_dropped : mapping of str to (int, str)
        By reason, for rows without a number: the first of them, and what stands there ('' where
        that is nothing, or not known).
    sha256 : str
        Digest of the file that was read, empty when there was none.
    taken : tuple of Taken
        What each column of the file was taken for; empty for arrays and bags.
    rest_length : float, m, or None
        By which lengths were made strains, None where there were none.
    """

    name: str
    strain: np.ndarray
    pressure: np.ndarray
    force: np.ndarray
    trial: np.ndarray
    recording: np.ndarray
    time: np.ndarray | None
    strain_rate: np.ndarray
    direction: np.ndarray
    direction_basis: np.ndarray
    trial_names: tuple[str, ...]
    motor_units: tuple[str, ...]
    notes: tuple[str, ...]
    dropped: Mapping[str, int]
    first_dropped: Mapping[str, tuple[int, str]]
    sha256: str = ''
    taken: tuple[Taken, ...] = ()
    rest_length: float | None = None

    def __len__(self) -> int:
        return len(self.force)

    @property
    def is_static(self) -> bool:
        """True for a map without time: effects that depend on history cannot be seen in it."""
        return self.time is None

    @property
    def is_held(self) -> bool:
        """True if most directions were read from the pressure, at a constant strain."""
        basis = self.direction_basis
        return bool(np.sum(basis == BY_PRESSURE) > np.sum(basis == BY_STRAIN))

    @property
    def ways(self) -> tuple[str, str]:
        """Names of the directions +1 and -1."""
        return ('filling', 'venting') if self.is_held else ('shortening', 'lengthening')

    @property
    def start(self) -> np.ndarray:
        """Return a (T,) bool array, True at the first sample of each trial."""
        return rates.begins(self.trial)

    @property
    def restart(self) -> np.ndarray:
        """Return which rows have an unknown past, (T,) bool: the first ones of recordings."""
        return self.start if self.time is None else rates.begins(self.recording)

    @property
    def remembers(self) -> bool:
        """Whether the past of a trial is another trial: the clock runs on between them."""
        return bool(self.restart.sum() < self.start.sum())

    def afresh(self) -> 'Measurement':
        """Return the same rows with a memory that starts anew with each trial."""
        return replace(self, recording=self.trial)

    @property
    def clock(self) -> np.ndarray:
        """Return the time, or for a static map seconds that merely count the rows, (T,)."""
        return np.arange(len(self), dtype=float) if self.time is None else self.time

    @cached_property
    def signals(self) -> tuple[Smooth, ...]:
        """Strain and pressures, those of a log without as much of their noise as possible."""
        columns = (self.strain, *self.pressure.T)
        if self.time is None:
            return tuple(Smooth(column, np.zeros(len(self)), 0.0) for column in columns)
        return tuple(smooth(self.time, column, self.trial) for column in columns)

    @property
    def smoothed(self) -> tuple[np.ndarray, np.ndarray]:
        """Strain (T,) and pressure (T, n) of `signals`."""
        strain, *pressures = (each.value for each in self.signals)
        return strain, np.stack(pressures, -1)

    @property
    def dropped_words(self) -> str:
        """What was left out and why, empty where nothing was."""
        total = sum(self.dropped.values())
        if not total:
            return ''
        first = {reason: f' ({"first " * (self.dropped[reason] > 1)}row {row}'
                         + (f": '{text}')" if text else ')')
                 for reason, (row, text) in self.first_dropped.items()}
        reasons = ', '.join(f'{count} {reason}{first.get(reason, "")}'
                            for reason, count in self.dropped.items())
        return f'{total} of {total + len(self)} rows left out: {reasons}'

    def select(self, keep: np.ndarray, reason: str = '') -> 'Measurement':
        """
        Return the rows where ``keep`` (bool or index array, shape (T,)) holds.

        With a ``reason`` the others are counted in ``dropped``.
        """
        names = ('strain', 'pressure', 'force', 'trial', 'recording', 'strain_rate', 'direction',
                 'direction_basis')
        picked = {name: getattr(self, name)[keep] for name in names}
        dropped = dict(self.dropped)
        gone = len(self) - len(picked['force'])
        if reason and gone:
            dropped[reason] = dropped.get(reason, 0) + gone
        return replace(self, time=None if self.time is None else self.time[keep],
                       dropped=dropped, **picked)

    def to_dict(self) -> dict[str, Any]:
        """Return where the data come from and what was taken and left out, as plain values."""
        return {'name': self.name, 'sha256': self.sha256, 'rows': len(self),
                'trials': len(self.trial_names), 'dropped': dict(self.dropped),
                'columns': [taken._asdict() for taken in self.taken], 'notes': list(self.notes)}

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
        said = [*([self.dropped_words] if self.dropped else []), *self.notes]
        return '\n'.join(lines + [f'  note: {note}' for note in said])


def pressure_labels(measurement: Measurement) -> list[str]:
    """Return the pressure columns' names: `pressure`, or `pressure.mu1`, ... for a bundle."""
    return labels_of(measurement.motor_units)


def labels_of(motor_units: Sequence[str]) -> list[str]:
    """Return the names of the pressures of motor units: `pressure` where there is one."""
    return ['pressure'] if len(motor_units) == 1 else [f'pressure.{name}' for name in motor_units]


def file_digest(path: str | Path) -> str:
    """Return the SHA-256 of a file, or of all files of a folder with their names, in hex."""
    path = Path(path)
    if not path.is_dir():
        with path.open('rb') as stream:
            return hashlib.file_digest(stream, 'sha256').hexdigest()
    files = (file for file in sorted(path.rglob('*')) if file.is_file())
    listed = ''.join(f'{file.relative_to(path)} {file_digest(file)}\n' for file in files)
    return hashlib.sha256(listed.encode()).hexdigest()


def write_csv(measurement: Measurement, path: str | Path,
              extra: dict[str, np.ndarray] | None = None) -> None:
    """
    Write a measurement as a CSV that `read_measurement` takes (s, kPa, N).

    Parameters
    ----------
    extra : dict of str to ndarray (T,), optional
        More columns, named with their unit, such as ``'model_force [N]'``.
    """
    columns: dict[str, list[str]] = {}
    if measurement.time is not None:
        columns['time [s]'] = [f'{t:.6g}' if t < 1e3 else f'{t:.6f}' for t in measurement.time]
    columns['trial'] = [measurement.trial_names[i] for i in measurement.trial]
    columns['strain'] = [f'{value:.7g}' for value in measurement.strain]
    for label, values in zip(pressure_labels(measurement), measurement.pressure.T):
        columns[f'{label} [kPa]'] = [f'{value / 1e3:.6g}' for value in values]
    for label, values in {'force [N]': measurement.force, **(extra or {})}.items():
        columns[label] = [f'{value:.6g}' for value in values]
    with whole(path) as draft, open(draft, 'w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values()))


def build(name: str, strain: np.ndarray, pressure: np.ndarray, force: np.ndarray,
          trial: Sequence[Any] | np.ndarray | None = None, time: np.ndarray | None = None,
          motor_units: Sequence[str] | None = None, strain_rate: np.ndarray | None = None,
          rows: np.ndarray | None = None, notes: Sequence[str] = (),
          units: Mapping[str, tuple[str, float]] | None = None, max_pressure: float | None = None,
          max_strain: float | None = None) -> Measurement:
    """
    Check SI arrays and return them as a `Measurement`; every reader calls this.

    Rows without a finite number in every column are left out and counted. Rows that share a time
    stamp are left out too where they repeat the row before in all columns (a row written
    twice); where they differ the clock is coarser than the sampling, and they are spread evenly
    up to the next stamp (`trials.spread_stamps`). One strain only (isometric) or
    one pressure only (isobaric) is enough.

    Parameters
    ----------
    motor_units : sequence of str, optional
        A name for each column of the pressure; by default ``mu1``, ``mu2``, ...
    rows : ndarray of int, shape (T,), optional
        What to call each row in messages; by default 1, 2, ...
    units : dict, optional
        The unit that each quantity was given in and its factor to SI, for messages.
    max_pressure, max_strain : float, optional
        Limits of this muscle (Pa gauge, 1), where it goes further than others.

    Raises
    ------
    InputError
        For other names than pressure columns, too few or too many rows, a reading out of range,
        time that runs backwards, and data in which neither strain nor pressure changes.
    """
    strain, force = np.asarray(strain, float), np.asarray(force, float)
    pressure = np.asarray(pressure, float)
    pressure = pressure[:, None] if pressure.ndim == 1 else pressure
    if motor_units is None:
        motor_units = [f'mu{i + 1}' for i in range(pressure.shape[1])]
    if len(motor_units) != pressure.shape[1]:
        raise InputError(f'{name}: {pressure.shape[1]} pressure columns and {len(motor_units)} '
                         'names of motor units; expected as many')
    time = None if time is None else np.asarray(time, float)
    rows = np.arange(1, len(force) + 1) if rows is None else np.asarray(rows)
    if len(force) > MAX_ROWS:
        raise InputError(f'{name}: {len(force)} rows; expected at most {MAX_ROWS} '
                         '(decimate or split the log)')
    labels = labels_of(motor_units)
    named = {'strain': strain, 'force': force, **dict(zip(labels, pressure.T))}
    if time is not None:
        named['time'] = time
    if strain_rate is not None:
        named['strain_rate'] = np.asarray(strain_rate, float)
    keep, dropped, first = _complete(named, rows, None if trial is None else np.asarray(trial))
    notes = list(notes)
    codes = ''.join(f'; {note}' for note in notes if note.endswith('taken as no reading'))
    if keep.sum() < MIN_ROWS:
        label, row = next(iter(first.items()), ('', 0))
        words = f' ({label} has none in row {row})' if label else ''
        raise InputError(f'{name}: {counted(int(keep.sum()), "row")} with a number in every '
                         f'column{words}; expected at least {MIN_ROWS}{codes}')
    if not keep.all():
        rows, named = rows[keep], {label: values[keep] for label, values in named.items()}
        trial = None if trial is None else np.asarray(trial)[keep]
    lost = {f'{_WITHOUT} {label}': (row, '') for label, row in first.items()}
    limits = checks.ranges(max_pressure, max_strain)
    try:
        for label, values in named.items():
            quantity = label.partition('.')[0]
            if quantity in limits:
                checks.check_range(name, label, values, rows, (units or {}).get(label), quantity,
                                   limits[quantity])
        checks.check_pressure_units(name, {label: named[label] for label in labels}, units or {},
                                    limits['pressure'])
    except InputError as error:
        raise InputError(f'{error}{codes}') from error
    trials = trials_of(name, trial, named.get('time'), rows)
    of_row = trials.of_row
    named = {label: values[trials.order] for label, values in named.items()}
    strain, force = named['strain'], named['force']
    pressure = np.stack([named[label] for label in labels], -1)
    notes += [*trials.notes, *checks.what_does_not_change(name, strain, pressure),
              *checks.odd_signs(strain, pressure, force)]
    still = np.zeros(len(force), int)
    measured = Measurement(
        name, strain, pressure, force, of_row, of_row, time=None, strain_rate=np.zeros(len(force)),
        direction=still, direction_basis=still, trial_names=trials.names,
        motor_units=tuple(motor_units), notes=tuple(notes), dropped=dropped, first_dropped=lost)
    if time is None:
        return measured
    notes += what_was_lost(strain, {label: named[label] for label in labels}, force, of_row,
                           rows[trials.order])
    time = spread_stamps(named['time'], of_row)
    shared = int((~fresh_stamps(named['time'], of_row)).sum())
    if shared:
        notes.append(f'{counted(shared, "row")} with the time stamp of the row before, or in one '
                     'packet with it: spread evenly up to the next stamp')
    if not np.ptp(time) > 0:
        raise InputError(f'{name}: time stands still at {time[0]:.6g} s; expected it to increase, '
                         'or no column for it')
    if not follow_the_motion(time, strain, pressure, force, of_row):
        notes.append('the force follows steps of strain and pressure from row to row: the rows '
                     'are points, read without times (effects of rate and history are not seen)')
        return replace(measured, notes=tuple(notes))
    rate, rate_noise, _ = rates.slope(time, strain, of_row)
    rate = named.get('strain_rate', rate)
    direction, basis = _directions(time, strain, pressure, of_row, rate, rate_noise)
    return replace(measured, recording=recordings_of(time, of_row), time=time, strain_rate=rate,
                   direction=direction, direction_basis=basis,
                   notes=tuple(notes))


def _complete(named: Mapping[str, np.ndarray], rows: np.ndarray, trial: np.ndarray | None,
              ) -> tuple[np.ndarray, dict[str, int], dict[str, int]]:
    """Return the rows to keep, (T,) bool, and by missing quantity the count and the first row."""
    keep = np.ones(len(rows), bool)
    dropped, first = {}, {}
    for label, values in named.items():
        bad = keep & ~np.isfinite(values)
        if bad.any():
            first[label] = int(rows[np.argmax(bad)])
            dropped[f'{_WITHOUT} {label}'] = int(bad.sum())
            keep &= ~bad
    if 'time' in named:
        kept = np.flatnonzero(keep)
        shared = np.diff(named['time'][kept]) == 0
        again = shared.copy()
        for values in (*named.values(), *([] if trial is None else [trial])):
            again &= values[kept[1:]] == values[kept[:-1]]
        # under a coarse clock equal rows may be samples at rest; then other rows of equal time
        # differ
        if again.any() and again.sum() > 0.9 * shared.sum():
            dropped['that repeat the row before'] = int(again.sum())
            keep[kept[1:][again]] = False
    return keep, dropped, first


def _directions(time: np.ndarray, strain: np.ndarray, pressure: np.ndarray, trial: np.ndarray,
                rate: np.ndarray, rate_noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return direction and what it was read from: the strain's rate, else the pressure's."""
    least = max(_REST_STRAIN, 2.0 * rates.signal_step(strain, trial))
    way = rates.direction(time, rate, rate_noise, trial, least)
    basis = np.where(way != 0, BY_STRAIN, REST)
    resting = way == 0
    top = float(np.abs(pressure).max())
    # the motor unit whose pressure changes most says which way
    column = pressure[:, int(np.argmax(pressure.std(axis=0)))]
    if resting.any() and np.ptp(column) > rates.REST_PRESSURE * top:
        slope, noise, _ = rates.slope(time, column, trial)
        least = max(rates.REST_PRESSURE * top, 2.0 * rates.signal_step(column, trial))
        filling = rates.direction(time, slope, noise, trial, least)
        way = np.where(resting, filling, way)
        basis = np.where(resting & (filling != 0), BY_PRESSURE, basis)
    return way, basis
