# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Cross-validation errors: physics alone, with the discrepancy, and of rival models.

Folds are whole trials, isobars and inner strain levels, as far as the data have several.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from fam_bundle_ros.data.folds import fold_labels, KINDS
from fam_bundle_ros.discovery import empirical_surface
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.covariance import Hyper
from fam_bundle_ros.discovery.fitter import Fit, Fitter, with_coordinates
from fam_bundle_ros.discovery.rivals import BLIND, rival_error, RIVALS
from fam_bundle_ros.discovery.surface import Surface
from fam_bundle_ros.model import Bundle


@dataclass(frozen=True)
class Unseen:
    """
    Forces of held-out cells, each predicted by fits without its fold.

    Attributes
    ----------
    measured : ndarray, shape (k,), N
        Mean force of the cell.
    predicted : dict of str to ndarray, shape (k,), N
        ``physics``: the effects alone; ``discrepancy``: with a `Surface` of the residual; and each
        of the rivals.
    """

    measured: np.ndarray
    predicted: dict[str, np.ndarray]


@dataclass(frozen=True)
class HeldOut:
    """
    Cross-validation errors, N rms over all folds.

    Attributes
    ----------
    physics : float
        Effects alone.
    discrepancy : float
        Effects with a surface of the residual.
    rivals : dict of str to float
        ``mean``, ``plane``, ``empirical``; of a static map also ``empirical_surface``.
    kinds : dict of str to (float, float)
        ``physics`` and ``discrepancy`` for each kind of folds; empty if the data have no folds
        (the errors are then those of the fit).
    unseen : dict of str to Unseen
        Predictions of the cells, for each kind of folds.
    blind : float
        A curve of the strain alone, without pressure.
    squares : ndarray, shape (k,), N^2
        Contribution of each fold to the mean square of ``physics``.
    typical : dict of str to float
        Geometric mean of the errors of the folds, N, of ``physics``, ``discrepancy`` and each
        rival: unlike the rms, not that of the worst fold alone.
    """

    physics: float
    discrepancy: float
    rivals: dict[str, float]
    kinds: dict[str, tuple[float, float]]
    unseen: dict[str, Unseen] = field(default_factory=dict, repr=False)
    blind: float = np.inf
    squares: np.ndarray = field(default_factory=lambda: np.zeros(1), repr=False)
    typical: dict[str, float] = field(default_factory=dict)

    @property
    def best(self) -> float:
        """The lower error of physics with and without the discrepancy."""
        return min(self.physics, self.discrepancy)

    def is_no_worse(self, other: HeldOut) -> bool:
        """
        Return whether no kind of folds has a larger error, with and without the discrepancy.

        Errors on strain levels are tens of times those on isobars and would dominate a common rms.
        """
        return (self.physics <= other.physics and self.best <= other.best
                and all(here[0] <= there[0] and min(here) <= min(there)
                        for here, there in zip(self.kinds.values(), other.kinds.values(),
                                               strict=True)))

    def of_rows(self, beyond: float) -> HeldOut:
        """
        Return errors of rows: with the scatter of rows about their cells added, N rms.

        Those of each kind of folds and of each fold remain those of cells.
        """
        return replace(self, physics=float(np.hypot(self.physics, beyond)),
                       discrepancy=float(np.hypot(self.discrepancy, beyond)),
                       blind=float(np.hypot(self.blind, beyond)),
                       rivals={name: float(np.hypot(value, beyond))
                               for name, value in self.rivals.items()})


def splits(cells: Cells) -> list[tuple[str, np.ndarray]]:
    """Return each kind of folds and the fold of each cell, (n,) int, -1 for never left out."""
    rows = np.full(len(cells), -1)
    used = np.flatnonzero(cells.label >= 0)
    rows[cells.label[used[::-1]]] = used[::-1]
    found = [(kind, fold_labels(cells.data, kind)[rows]) for kind in KINDS]
    # a single inner strain level is a fold; a single trial or isobar leaves no training data
    return [(kind, label) for kind, label in found if label.max() >= (kind != 'strain')]


def folds(cells: Cells) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield each fold: its kind, and masks of training and test cells, (n,) bool."""
    for kind, label in splits(cells):
        for fold in range(label.max() + 1):
            test = label == fold
            if test.any() and (~test).sum() > 10:
                yield kind, ~test, test


def beyond_cells(cells: Cells, fit: Fit, error: float) -> float:
    """
    Return the rms error of rows beyond that of their cells, N: mostly noise.

    Parameters
    ----------
    error : float, N
        Rms error of the fitted model on all rows of the measurement.
    """
    return float(np.sqrt(max(error ** 2 - cells.mean_square(fit.residual), 0.0)))


def held_out_physics(fitter: Fitter, fit: Fit) -> float:
    """Return the cross-validation error of a fit without discrepancy, N rms."""
    return float(np.sqrt(squares_of_folds(fitter, fit).sum()))


def squares_of_folds(fitter: Fitter, fit: Fit) -> np.ndarray:
    """
    Return the contribution of each fold to the mean square error without discrepancy, N^2.

    If the data have no folds, the mean square of the fit itself, shape (1,).
    """
    cells = fitter.cells
    found, rows = [], 0.0
    for _, train, test in folds(cells):
        off = fitter.refit_to(fit, train)[1][test]
        found.append(float(np.sum(cells.count[test] * off ** 2)))
        rows += float(cells.count[test].sum())
    if not found:
        return np.array([cells.mean_square(fit.residual)])
    return np.array(found) / rows


def held_out(fitter: Fitter, physics: Fit, joint: Fit) -> HeldOut:
    """
    Return the errors of physics, physics with discrepancy, and rivals on the same folds.

    Parameters
    ----------
    fitter : Fitter
    physics : Fit
        Fitted without a discrepancy.
    joint : Fit
        The same effects fitted with a discrepancy.
    """
    cells = fitter.cells
    squares: dict[str, np.ndarray] = {}
    counts: dict[str, float] = {}
    of_folds: list[np.ndarray] = []
    seen: dict[str, list[np.ndarray]] = {}
    needed = joint.hyper.fits_a_table
    hyper = Surface.best(fitter, physics.model, joint.hyper).hyper if needed else None
    everything = np.ones(len(cells), bool)
    every = list(folds(cells)) or [('', everything, everything)]
    if fitter.rival_errors is None:
        fitter.rival_errors = _rival_errors(fitter, [fold[1:] for fold in every])
    names = ('physics', 'discrepancy', *fitter.rival_errors)
    for fold, (kind, train, test) in enumerate(every):
        weight = cells.count[test]
        u, residual, _ = fitter.refit_to(physics, train)
        alone = with_table = residual[test]
        if hyper is not None:
            model = with_coordinates(physics.model, physics.priors, u)
            with_table = alone - _on_a_table(fitter, model, hyper, train, test)
        errors = np.stack([alone, with_table,
                           *(rival[fold] for rival in fitter.rival_errors.values())])
        force = cells.force[test]
        seen.setdefault(kind, []).append(np.vstack([force, force - errors]))
        square = np.square(errors) @ weight
        of_folds.append(square / weight.sum())
        squares[kind] = squares.get(kind, 0.0) + square
        counts[kind] = counts.get(kind, 0.0) + float(weight.sum())
    rows = sum(counts.values())
    means = dict(zip(names, np.sqrt(sum(squares.values()) / rows).tolist()))
    typical = np.exp(0.5 * np.mean(np.log(np.add(of_folds, np.finfo(float).tiny)), axis=0))
    weights = np.array([cells.count[test].sum() for _, _, test in every])
    kinds = [kind for kind in squares if kind]
    whole = {kind: np.concatenate(seen[kind], axis=1) for kind in kinds}
    blind = means.pop(BLIND)
    return HeldOut(
        means.pop('physics'), means.pop('discrepancy'), means,
        {kind: tuple(np.sqrt(squares[kind][:2] / counts[kind]).tolist()) for kind in kinds},
        {kind: Unseen(each[0], dict(zip(names, each[1:]))) for kind, each in whole.items()},
        blind, np.array(of_folds)[:, 0] * weights / rows, dict(zip(names, typical.tolist())))


def _rival_errors(fitter: Fitter, folds: list[tuple[np.ndarray, np.ndarray]],
                  ) -> dict[str, list[np.ndarray]]:
    """Return the errors of each rival on the test cells of each fold, N."""
    cells = fitter.cells
    found = {rival: [rival_error(rival, cells, *fold) for fold in folds]
             for rival in (*RIVALS, BLIND)}
    if empirical_surface.applies_to(cells):
        found[empirical_surface.NAME] = empirical_surface.errors(fitter, folds)
    return found


def _on_a_table(fitter: Fitter, model: Bundle, hyper: Hyper, train: np.ndarray, test: np.ndarray,
                ) -> np.ndarray:
    """Return the force on test cells of a table made from the residual of training cells, N."""
    cells = fitter.cells
    rows = np.flatnonzero((cells.label >= 0) & test[cells.label])
    added = np.zeros(len(cells.label))
    added[rows] = Surface.of(fitter, model, hyper, train).of_rows(cells, rows)
    return cells.mean(added)[test]
