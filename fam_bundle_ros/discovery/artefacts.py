# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Errors of a measurement that come from how it was taken, which no effect explains.

Offsets between trials, loops in a map without time, rows that contradict each other, vibration,
and drift within the trials.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.special import gammaincc

from fam_bundle_ros.data.grouping import rms, visit_cells
from fam_bundle_ros.data.noise import NoiseFloor
from fam_bundle_ros.data.trial_offsets import Offsets, trial_offsets
from fam_bundle_ros.data.vibration import vibration
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import Cells, negligible
from fam_bundle_ros.discovery.covariance import Covariance
from fam_bundle_ros.discovery.fitter import Fit, Fitter
from fam_bundle_ros.told import number


class Artefact(NamedTuple):
    """An error caused by how the data were taken."""

    words: str
    remedy: str


def artefacts(fitter: Fitter, chosen: Fit, physics: Fit, floor: NoiseFloor,
              offsets: Offsets | None) -> tuple[Artefact, ...]:
    """
    Return the artefacts of a measurement.

    Parameters
    ----------
    fitter : Fitter
    chosen, physics : Fit
        The chosen set with its discrepancy, and without one.
    floor : NoiseFloor
        Of the measurement.
    offsets : Offsets or None
        Offsets between the trials of a map, which were subtracted.
    """
    data = fitter.cells.data
    if offsets is None and not data.is_static:
        offsets = _offsets_left(fitter.cells, physics)
    found = []
    if offsets is not None:
        found.append(Artefact(str(offsets),
                              'tare the load cell before each trial and measure again'))
    if floor.hides_loops:
        found.append(Artefact(floor.note, 'log the time of each row and measure again'))
    elif data.is_static:
        found += _contradictions(fitter, chosen)
    if not data.is_static:
        found += [*_vibrations(fitter, chosen, physics)] or [*_drifts(fitter, chosen)]
    return tuple(found)


def drift(covariance: Covariance, fit: Fit) -> float:
    """
    Return the size of the part of the discrepancy that is a function of time, N rms.

    Where strain and pressures returned to a place, only what differs between its cells counts: an
    error that comes back is no drift, though a smooth function of time can follow it in a trial.
    """
    return _over_time(covariance, fit)[0]


def returning(covariance: Covariance, fit: Fit) -> float:
    """Return the size of what a function of time follows, but is no `drift`, N rms."""
    drifting, whole = _over_time(covariance, fit)
    return float(np.sqrt(whole ** 2 - drifting ** 2))


def _over_time(covariance: Covariance, fit: Fit) -> tuple[float, float]:
    """Return the drift and the whole function of time in the discrepancy, N rms."""
    slow = fit.hyper._replace(even=0, odd=0, speed=0)
    found, cells = covariance.mean_of(slow, fit.hyper, fit.residual), covariance.cells
    whole, (apart, again) = rms(found), _within(cells.place, found)
    return (min(whole, apart) if again else whole), whole


def _within(place: np.ndarray, values: np.ndarray) -> tuple[float, int]:
    """Return the standard deviation of values at one place, and its degrees of freedom."""
    count = np.bincount(place)
    again = count[place] > 1
    apart = (values - (np.bincount(place, values) / count)[place])[again]
    free = int(again.sum()) - int((count > 1).sum())
    return float(np.sqrt(apart @ apart / max(free, 1))), free


def _offsets_left(cells: Cells, physics: Fit) -> Offsets | None:
    """Return the offsets between the trials of a log, if they are visible in the noise."""
    kept = cells.label >= 0
    found = trial_offsets(cells.data.select(kept), cells.residual_of_rows(physics.model)[kept])
    return found if found is not None and found.size > settings.VISIBLE * cells.noise else None


def _unexplained(fitter: Fitter, chosen: Fit) -> np.ndarray:
    """Return the error of the used rows that neither effects nor discrepancy explain, N."""
    cells = fitter.cells
    kept = cells.label >= 0
    smooth = fitter.covariance.mean_of(chosen.hyper._replace(slow=0), chosen.hyper,
                                       chosen.residual)
    return cells.residual_of_rows(chosen.model)[kept] - smooth[cells.label[kept]]


def _contradictions(fitter: Fitter, chosen: Fit) -> Iterator[Artefact]:
    """
    Yield the difference of rows at one place of a map, if no law could neglect it.

    It must be more than noise too, by a chi-square test.
    """
    cells = fitter.cells
    kept = cells.label >= 0
    place, _ = visit_cells(cells.data.select(kept))
    size, free = _within(place, _unexplained(fitter, chosen))
    if size > negligible(cells) and gammaincc(free / 2.0, free / 2.0 * (
            size / cells.noise) ** 2) < settings.ALARM:
        yield Artefact(
            f'rows of the same strain, pressure and direction differ by {number(size)} N rms, the '
            f'noise is {number(cells.noise, 2)} N: two muscles in one file, or something that was '
            'not recorded',
            'look at the rows of one strain and pressure, and log the time of each row')


def _vibrations(fitter: Fitter, chosen: Fit, physics: Fit) -> Iterator[Artefact]:
    """
    Yield the vibration in what is left, if it is visible in the noise of rows.

    First in the error of the effects alone: at places that were visited once, the discrepancy
    follows the vibration. If other errors are as large, the discrepancy is subtracted.
    """
    cells = fitter.cells
    kept = cells.label >= 0
    data = cells.data.select(kept)
    found = (vibration(data, cells.residual_of_rows(physics.model)[kept], cells.noise)
             or vibration(data, _unexplained(fitter, chosen), cells.noise))
    if found is not None and found.amplitude > np.sqrt(2.0) * settings.VISIBLE * cells.noise:
        yield Artefact(
            f'the force swings by {number(found.amplitude, 2)} N with a period of '
            f'{found.period:.2g} s, whatever the strain and the pressure: vibration of the rig, '
            'or hum that looks slow at this sampling rate',
            'log the load cell at rest, with and without the drives, pumps and fans nearby, and '
            'at another sampling rate')


def _drifts(fitter: Fitter, fit: Fit) -> Iterator[Artefact]:
    size, time = drift(fitter.covariance, fit), settings.TIME_LENGTHS[fit.hyper.tau]
    if size > negligible(fitter.cells):
        yield Artefact(
            f'the error drifts by {number(size, 2)} N rms within the trials, over about '
            f'{time:g} s, whatever the strain and the pressure',
            'log a trial at constant strain and pressure: it shows whether the load cell or the '
            'muscle drifts')
