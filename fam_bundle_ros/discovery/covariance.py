# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
r"""
Covariance of the residual: noise and a smooth discrepancy (Gaussian process).

    K = S + s_w^2 I + a_e^2 M + (a_o^2 + a_v^2 V) d d' M + a_t^2 exp(-|dt| / tau)

S is diagonal: the noise of the averages. M is a Matern 5/2 kernel of (strain, pressure), summed
over motor units like their forces; d is the direction of motion. The discrepancy has an even and
an odd part in d (Kennedy and O'Hagan 2001). V is a Matern 5/2 kernel of the logarithm of the
speed, used if the data have several speeds, as losses depend on it. The last part correlates rows
of the same trial. K does not depend on the physics, so its Cholesky factors are cached.
"""

from __future__ import annotations

from collections import OrderedDict
from copy import copy
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError
from scipy.linalg.blas import daxpy
from scipy.linalg.lapack import dpotrf, dtrtrs

from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import Cells

#: Largest cache of Cholesky factors, bytes.
_KEEP = 2e8
#: Numbers in a block of a kernel. With its temporary arrays it fits into the cache of a core, so
#: that it takes a quarter of the time.
_BLOCK = 16384
#: Noise of a cell that is left out, in standard deviations of the force.
_UNKNOWN = 1e6


class Hyper(NamedTuple):
    """Places on the grids of `settings`; place 0 of an amplitude switches its part off."""

    even: int = 0
    strain: int = 0
    pressure: int = 0
    odd: int = 0
    white: int = 0
    slow: int = 0
    tau: int = 1
    speed: int = 0

    @property
    def is_white(self) -> bool:
        """Whether there is no discrepancy."""
        return not (self.even or self.odd or self.slow or self.speed)

    @property
    def both_ways(self) -> bool:
        """Whether part of the discrepancy depends on the direction of motion."""
        return bool(self.odd or self.speed)

    @property
    def fits_a_table(self) -> bool:
        """Whether part of the discrepancy is a function of strain, pressure and direction."""
        return bool(self.even or self.both_ways)


#: Length of each grid, in the order of `Hyper`.
GRID = Hyper(*(len(grid) for grid in (
    settings.AMPLITUDES, settings.STRAIN_LENGTHS, settings.PRESSURE_LENGTHS, settings.AMPLITUDES,
    settings.AMPLITUDES, settings.AMPLITUDES, settings.TIME_LENGTHS, settings.AMPLITUDES)))


class Covariance:
    """
    Covariances of the cells' residuals over the grid of hyperparameters.

    Parameters
    ----------
    cells : Cells
    unexplained : float
        Mean of the prior on the amplitudes, as a share of the force's standard deviation.
    force_sd : float, N, optional
        Standard deviation of the force; by default that of the cells.
    """

    def __init__(self, cells: Cells, unexplained: float, force_sd: float | None = None):
        self.cells = cells
        self.unexplained = unexplained
        #: Python floats: single ones are read some ten thousand times, slower from an array.
        self._share = settings.AMPLITUDES.tolist()
        self._variance = [(share * (force_sd or cells.force_sd)) ** 2 for share in self._share]
        self._noise = cells.variance
        #: Part of log det L that is due to the cells that are left out.
        self._uncounted = 0.0
        both = np.outer(cells.direction, cells.direction)
        #: By axis: the factor of the Matern part, or the time difference within a trial, s.
        self._base: dict[str, np.ndarray] = {'odd': both}
        if cells.time is not None:
            gap = np.abs(cells.time[:, None] - cells.time)
            self._base['slow'] = np.where(cells.trial[:, None] == cells.trial, gap, np.inf)
        slow, fast = np.percentile(cells.speed[cells.direction != 0], (10, 90)) \
            if cells.both_ways else (0.0, 0.0)
        if fast - slow > settings.SPEED_LENGTH:
            gap = (cells.speed[:, None] - cells.speed) / settings.SPEED_LENGTH
            self._base['speed'] = both * matern_5_2(gap ** 2)
        self._parts: dict[tuple, np.ndarray] = {}
        self._factors: OrderedDict[Hyper, tuple[np.ndarray, float]] = OrderedDict()
        self._most = max(int(_KEEP / (8 * len(cells) ** 2)), 8)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the hyperparameters that the data can determine."""
        return ('even', 'white', 'strain', 'pressure',
                *(('odd',) if self.cells.both_ways else ()),
                *(('speed',) if 'speed' in self._base else ()),
                *(('slow', 'tau') if 'slow' in self._base else ()))

    def log_prior(self, h: Hyper) -> float:
        """Return the log prior of the amplitudes, up to a constant."""
        share = self._share
        return -(share[h.even] + share[h.odd] + share[h.white] + share[h.slow] + share[h.speed]
                 ) / self.unexplained

    def variance(self, place: int) -> float:
        """Return the square of an amplitude by its place on the grid, N^2."""
        return self._variance[place]

    def whiten(self, h: Hyper, values: np.ndarray) -> np.ndarray:
        """Return L^-1 values, K = L L', for values (n,) or (n, k)."""
        if h.is_white:
            sd = np.sqrt(self._noise + self._variance[h.white])
            return values / (sd if values.ndim == 1 else sd[:, None])
        # LAPACK directly: called some ten thousand times, and wrappers take half of the time
        return dtrtrs(self._factor(h)[0], values, lower=1)[0]

    def log_determinant(self, h: Hyper) -> float:
        """Return log det L of the cells that are not left out."""
        whole = (float(0.5 * np.log(self._noise + self._variance[h.white]).sum()) if h.is_white
                 else self._factor(h)[1])
        return whole - self._uncounted

    def matrix(self, h: Hyper) -> np.ndarray:
        """Return K, (n, n), N^2."""
        k = self.structured(h)
        k.flat[::len(k) + 1] += self._noise + self._variance[h.white]
        return k

    def structured(self, h: Hyper) -> np.ndarray:
        """Return K without noise and white misfit, (n, n), N^2."""
        parts = [(self._variance[getattr(h, axis)], self._part(axis, h))
                 for axis in ('even', 'odd', 'speed', 'slow') if getattr(h, axis)]
        if not parts:
            return np.zeros((len(self.cells), len(self.cells)))
        (first, part), *others = parts
        k = first * part
        for variance, part in others:
            # in place: allocating arrays of this size takes longer than filling them
            daxpy(part.ravel(), k.ravel(), a=variance)
        return k

    def mean_of(self, part: Hyper, whole: Hyper, residual: np.ndarray) -> np.ndarray:
        """Return the posterior mean of a part of the discrepancy in the cells, (n,), N."""
        return self.structured(part) @ np.linalg.solve(self.matrix(whole), residual)

    def across(self, h: Hyper, strain: np.ndarray, pressure: np.ndarray,
               unit: int | None = None) -> np.ndarray:
        """
        Return the Matern kernel between points and cells, (k, n), for amplitude 1.

        Parameters
        ----------
        strain : ndarray, shape (k,)
        pressure : ndarray, shape (k, m), Pa
        unit : int, optional
            Only the part of this motor unit.
        """
        c = self.cells
        units = range(c.pressure.shape[1]) if unit is None else (unit,)
        long = settings.STRAIN_LENGTHS[h.strain] * c.strain_range
        wide = settings.PRESSURE_LENGTHS[h.pressure] * c.pressure_range
        total = np.zeros((len(strain), len(c)))
        step = max(_BLOCK // len(c), 1)
        for begin in range(0, len(strain), step):
            rows = slice(begin, begin + step)
            across_strain = ((strain[rows, None] - c.strain_coordinate) / long) ** 2
            for i in units:
                gap = (pressure[rows, i, None] - c.pressure[:, i]) / wide[i]
                total[rows] += matern_5_2(across_strain + gap ** 2)
        total /= c.pressure.shape[1]
        return total

    def _part(self, axis: str, h: Hyper) -> np.ndarray:
        """Return the kernel of one part of the discrepancy, (n, n), for amplitude 1."""
        key = (axis, h.tau) if axis == 'slow' else (axis, h.strain, h.pressure)
        if key not in self._parts:
            if axis == 'slow':
                part = np.exp(-self._base['slow'] / settings.TIME_LENGTHS[h.tau])
            elif axis == 'even':
                part = self.across(h, self.cells.strain_coordinate, self.cells.pressure)
            else:
                part = self._part('even', h) * self._base[axis]
            self._parts[key] = part
        return self._parts[key]

    def without(self, gone: np.ndarray) -> Covariance:
        """
        Return the covariance with some cells, (n,) bool, left out: given very large noise.

        Evidences with it are those of the other cells alone.
        """
        other, unknown = copy(self), _UNKNOWN * self.cells.force_sd
        other._noise = np.where(gone, unknown ** 2, self._noise)
        # log_evidence counts log(2 pi) / 2 for every cell
        other._uncounted = float(gone.sum() * np.log(np.sqrt(2.0 * np.pi) * unknown))
        other._factors = OrderedDict()
        return other

    def _factor(self, h: Hyper) -> tuple[np.ndarray, float]:
        if h in self._factors:
            self._factors.move_to_end(h)
            return self._factors[h]
        lower, failed = dpotrf(self.matrix(h).T, lower=1, clean=0, overwrite_a=1)
        if failed:
            raise LinAlgError(f'the covariance of {h} is not positive definite')
        while len(self._factors) >= self._most:
            self._factors.popitem(last=False)
        self._factors[h] = (lower, float(np.log(np.diag(lower)).sum()))
        return self._factors[h]


def matern_5_2(squared: np.ndarray) -> np.ndarray:
    """Return the Matern 5/2 kernel of squared scaled distances."""
    x = np.sqrt(5.0 * squared)
    return (1.0 + x + x * x / 3.0) * np.exp(-x)
