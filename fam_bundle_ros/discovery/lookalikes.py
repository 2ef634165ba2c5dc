# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Warnings about effects that were found, but that another one imitates in these data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fam_bundle_ros.data.grouping import pressure_speed
from fam_bundle_ros.data.measurement import BY_PRESSURE
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.fitter import Fit
from fam_bundle_ros.discovery.options import Change, family
from fam_bundle_ros.model import catalogue


def lookalikes(cells: Cells, physics: Fit, found: Sequence[Change]) -> list[str]:
    """
    Return the warnings of this module.

    Parameters
    ----------
    physics : Fit
        The set, fitted without a discrepancy.
    found : sequence of Change
        Its changes.
    """
    return [*alike_at_one_rate(cells, found), *late_force(physics, found),
            *alike_at_one_pace(cells, found)]


def alike_at_one_rate(cells: Cells, found: Sequence[Change]) -> list[str]:
    """
    Return a warning if an effect with memory that was found could be another one.

    Lag, creep and friction give the same hysteresis loop if the pressure of a muscle at rest
    changes at one rate only: a factor below e between the rates below which a tenth and nine
    tenths of the changes are made.
    """
    laws = catalogue.available()
    named = [change.label for change in found if change.new in laws and laws[change.new].memory]
    data = cells.data
    if not named or data.time is None or not data.is_held:
        return []
    filled = data.direction_basis == BY_PRESSURE
    speed = np.sort(pressure_speed(data)[filled])
    slow, fast = np.interp((0.1, 0.9), np.cumsum(speed) / max(speed.sum(), 1e-9), speed) / 1e3
    if slow <= 0.0 or np.log(fast / slow) > settings.SPEED_LENGTH:
        return []
    rates = ' to '.join(dict.fromkeys(f'{rate:.3g}' for rate in (slow, fast)))
    return [f'the pressure changes at {rates} kPa/s only, where lag, creep and friction look '
            f'alike ({", ".join(named)}): fill and vent at another rate too']


def late_force(physics: Fit, found: Sequence[Change]) -> list[str]:
    """
    Return a warning if the lags of strain and pressure that were found may be one late force.

    A force that is logged late by tau lags by tau behind the strain and behind every pressure.
    So it explains a lag of the line that is not clearly longer (two standard deviations) than
    that behind the strain.
    """
    new = {change.new for change in found}
    lags = {family(owner): (prior.theta(u), prior.slope(u) * np.sqrt(variance), owner)
            for prior, u, variance in zip(physics.priors, physics.u, np.diag(physics.covariance))
            for owner, _, name in [prior.key.partition('.')]
            if owner in new and name in ('lag', 'time_constant')}
    if not {'strain_sensor_lag', 'line_lag'} <= lags.keys():
        return []
    (strain, of_strain, _), (line, of_line, owner) = lags['strain_sensor_lag'], lags['line_lag']
    if strain >= 0.0 or line > 2.0 * np.hypot(of_strain, of_line) - strain:
        return []
    return [f'the force lags behind the strain by {-1e3 * strain:.2g} ms and behind the pressure '
            f'by {1e3 * line:.2g} ms: a force that is logged late lags behind both, without '
            f'{owner}: check the filter and the clock of the load cell']


def late_or_lagging(cells: Cells, physics: Fit, found: Sequence[Change]) -> list[str]:
    """Return a note that at fixed lengths a late force is the same as the lag of the line."""
    new = {change.new for change in found}
    return [f'at fixed lengths {owner} ({1e3 * prior.theta(u):.2g} ms) looks the same as a force '
            'that is logged late: check the filter and the clock of the load cell, or log a sweep '
            'of the strain too' for prior, u in zip(physics.priors, physics.u)
            for owner in [prior.key.partition('.')[0]]
            if cells.data.is_held and owner in new and family(owner) == 'line_lag']


def alike_at_one_pace(cells: Cells, found: Sequence[Change]) -> list[str]:
    """
    Return a warning if warming up and softening were both found, and may be one of them.

    Both change the bladder, one with time, the other with the strain travelled. Where all tenths
    of the travel take about the same time (within a factor of e) these are in proportion, and
    both effects together follow any gradual change of the bladder.
    """
    both = {family(change.new): change.new for change in found
            if change.new and family(change.new) in ('softening', 'temperature')}
    if len(both) < 2 or cells.data.time is None:
        return []
    travel = np.cumsum(np.abs(np.diff(cells.motion.strain, prepend=cells.motion.strain[0])))
    tenths = np.diff(np.interp(np.linspace(0.0, travel[-1], 11), travel, cells.data.time))
    if np.log(tenths.max() / tenths.min()) > settings.SPEED_LENGTH:
        return []
    return [f'the muscle travels at about one pace, where warming up and softening look alike '
            f'({", ".join(both.values())}): repeat a part after a pause of some minutes']
