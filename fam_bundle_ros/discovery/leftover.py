# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The discrepancy left by the physics, as a map with uncertainty and as a table for a model file.

It is the mean of the Gaussian process over strain and pressure, with even and odd parts in the
direction of motion, for each motor unit; valid within the measured range. Another table corrects
the physics to an `EmpiricalSurface`.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fam_bundle_ros.atomic import whole
from fam_bundle_ros.data.grouping import ONE_STRAIN, pressure_levels
from fam_bundle_ros.discovery.covariance import Hyper
from fam_bundle_ros.discovery.empirical_surface import EmpiricalSurface
from fam_bundle_ros.discovery.fitter import Fit, Fitter
from fam_bundle_ros.discovery.surface import PRESSURES, STRAINS, Surface
from fam_bundle_ros.model import Bundle, Motion

#: Parts of the map: equal in both directions; while shortening; at rest after filling.
PARTS = ('even', 'odd', 'filling')


@dataclass(frozen=True)
class Leftover:
    """
    A discrepancy, or a correction, on a grid of strain and pressure.

    Attributes
    ----------
    strain : ndarray, shape (s,)
    pressure : ndarray, shape (n, p), Pa
        For each motor unit.
    even, odd, filling, sd : ndarray, shape (n, s, p), N
        For each motor unit; ``odd`` applies while shortening, ``filling`` at rest after the
        pressure has risen, both with opposite sign in the other direction; ``sd`` is the standard
        deviation of the even part.
    model : Bundle
        The physics to which it belongs.
    """

    strain: np.ndarray
    pressure: np.ndarray
    even: np.ndarray
    odd: np.ndarray
    filling: np.ndarray
    sd: np.ndarray
    model: Bundle

    @classmethod
    def of(cls, fitter: Fitter, physics: Fit, needed: Hyper) -> Leftover:
        """
        Return the discrepancy of a fit.

        Parameters
        ----------
        fitter : Fitter
        physics : Fit
            Fitted without a discrepancy.
        needed : Hyper
            Of the same effects fitted with a discrepancy; its parts of amplitude zero stay zero.
        """
        rows = fitter.cells.data
        # at a fixed length too a table has points beside each other
        strain = np.linspace(rows.strain.min(), max(rows.strain.max(), rows.strain.min()
                                                    + ONE_STRAIN), STRAINS)
        units = rows.pressure.shape[1]
        pressure = np.stack([np.linspace(column.min(), max(column.max(), column.min() + 1e3),
                                         PRESSURES) for column in rows.pressure.T])
        even, odd, sd = np.zeros((3, units, STRAINS, PRESSURES))
        if needed.fits_a_table:
            surface = Surface.best(fitter, physics.model, needed)
            for i in range(units):
                e, p = (grid.ravel() for grid in np.meshgrid(strain, pressure[i], indexing='ij'))
                points = np.zeros((len(e), units))
                points[:, i] = p
                even[i], odd[i] = np.reshape(surface.parts(e, points, i), (2, *even[i].shape))
                sd[i] = surface.sd(e, points, i).reshape(even[i].shape)
        none = np.zeros_like(odd)
        odd, filling = (none, odd) if rows.is_held else (odd, none)
        return cls(strain, pressure, even, odd, filling, sd, physics.model)

    @classmethod
    def to_empirical(cls, fitter: Fitter, physics: Fit) -> Leftover:
        """Return what corrects the force of a fit to that of an `EmpiricalSurface`."""
        rows, right = fitter.cells.data, EmpiricalSurface.of(fitter)
        strain, pressure = (_with_levels(*each) for each in (
            (rows.strain, STRAINS, 6), (rows.pressure[:, 0], PRESSURES, 0)))
        e, p = (grid.ravel() for grid in np.meshgrid(strain, pressure, indexing='ij'))
        there = Motion(e, p[:, None], np.zeros(len(e)))
        even = right.force(e, there.pressure) - physics.model.predict(there)
        even, sd = np.reshape([even, right.surface.sd(e, there.pressure, 0)],
                              (2, 1, len(strain), len(pressure)))
        zero = np.zeros_like(even)
        return cls(strain, pressure[None], even, zero, zero, sd, physics.model)

    def write(self, path: Path) -> None:
        """
        Write the table that the law `discrepancy_surface` reads, with forces of one muscle.

        The model's sensor errors are removed: bias and gain of strain and pressure, gain of the
        load cell.
        """
        model = self.model
        s = model.sensor_error
        felt_strain = (self.strain - s.strain_bias) / (1.0 + s.strain_gain)
        bias, gain = (np.broadcast_to(each, model.n)
                      for each in (s.pressure_bias, s.pressure_gain))
        felt_pressure = np.unique(np.concatenate(
            [(p - b) / (1.0 + g) for p, b, g in zip(self.pressure, bias, gain)]))
        with whole(path) as draft, open(draft, 'w', newline='', encoding='utf-8') as file:
            writer = csv.writer(file)
            writer.writerow(['motor_unit', 'strain', 'pressure [kPa]', 'force [N]', 'sd [N]',
                             'odd [N]', 'filling [N]'])
            for i, unit in enumerate(model.motor_units):
                share = unit.muscles * (1.0 + s.force_gain)
                shown = felt_pressure * (1.0 + gain[i]) + bias[i]
                for j, e in enumerate(felt_strain):
                    values = [np.interp(shown, self.pressure[i], grid[i, j]) / share
                              for grid in (self.even, self.sd, self.odd, self.filling)]
                    writer.writerows([i + 1, f'{e:.10g}', f'{p / 1e3:.10g}', *(
                        f'{value[k]:.5g}' for value in values)]
                        for k, p in enumerate(felt_pressure))


def _with_levels(column: np.ndarray, points: int, digits: int) -> np.ndarray:
    """
    Return even steps over a range, and the measured levels, rounded to so many digits.

    Physics may bend sharply where the form does not: a table is exact at the measured levels.
    """
    _, levels = pressure_levels(column, points)
    even = np.linspace(column.min(), column.max(), points)
    return np.unique(np.round(np.concatenate([even, levels]), digits))
