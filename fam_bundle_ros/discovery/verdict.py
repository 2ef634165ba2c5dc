# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Verdict of a search: adequate, recalibrate, missing effect, partial or unexplained.

It depends on the size of the discrepancy before and after the effects are added, and on whether
the evidence needs one. A refusal prevents that an effect is named: held-out errors no better than
a plane, a larger error of the rows, an impossible value, or an implausible value while structure
is left. A warning limits the verdict to `partial`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fam_bundle_ros.data.folds import KINDS
from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.artefacts import Artefact, returning
from fam_bundle_ros.discovery.cells import Cells, negligible
from fam_bundle_ros.discovery.covariance import Covariance, GRID
from fam_bundle_ros.discovery.fitter import Fit, Fitter, with_coordinates
from fam_bundle_ros.discovery.held_out import HeldOut
from fam_bundle_ros.discovery.linear import log_evidence
from fam_bundle_ros.discovery.lookalikes import lookalikes
from fam_bundle_ros.discovery.options import Change
from fam_bundle_ros.discovery.priors import Prior
from fam_bundle_ros.discovery.search import Search

#: Limit of a plausible shift, in widths of the prior. Geometry beyond it gives a warning; a
#: constant of a law beyond it gives a refusal if structure is left.
TOLERANCES = 3.0
#: Upper limit of the probability shown when there is a warning, or structure is left.
DOUBTED = 0.9


@dataclass(frozen=True)
class Left:
    """
    Size of the discrepancy of a set, N rms.

    Attributes
    ----------
    smooth : float
        Its posterior mean over strain, pressure and direction, and what a function of time
        follows that comes back with them.
    rough : float
        White misfit beyond noise.
    beside : float
        Both together in the joint fit, where the discrepancy also takes part of what the effects
        alone would explain.
    of_rows : float, optional
        ``total`` as the mean over rows, like printed errors; the others are means over cells.
    """

    smooth: float
    rough: float
    beside: float = 0.0
    of_rows: float | None = None

    @property
    def total(self) -> float:
        """Root of the sum of squares of both."""
        return float(np.hypot(self.smooth, self.rough))

    @property
    def shown(self) -> float:
        """Size as it is printed, N rms."""
        return self.total if self.of_rows is None else self.of_rows


def remaining_discrepancy(covariance: Covariance, fit: Fit, physics: Fit) -> Left:
    """
    Return the size of the discrepancy that a set needs.

    In a joint fit the parameters stay near their priors and the discrepancy compensates. So its
    size is limited to the error of ``physics``, the same set fitted without a discrepancy, unless
    the parameters of that fit are implausible.
    """
    h = fit.hyper._replace(slow=0)
    rough = float(np.sqrt(covariance.variance(fit.hyper.white)))
    if fit.hyper.is_white:
        return Left(0.0, rough, rough)
    # a function of time that returns with strain and pressure is no drift
    back = returning(covariance, fit)
    smooth = covariance.mean_of(h, fit.hyper, fit.residual)
    plausible = not (implausible_geometry(physics) or _impossible(physics))

    def square(weights: np.ndarray | None) -> float:
        most = float(np.average(smooth ** 2, weights=weights)) + back ** 2
        if not plausible:
            return most
        whole = float(np.average(physics.residual ** 2, weights=weights))
        return min(most, max(whole - rough ** 2, 0.0))
    beside = float(np.hypot(rms(smooth), back))
    return Left(float(np.sqrt(square(None))), rough, float(np.hypot(beside, rough)),
                float(np.sqrt(square(covariance.cells.count) + rough ** 2)))


def implausible_geometry(physics: Fit) -> list[str]:
    """Return in words which dimensions are implausibly far from their priors."""
    return [f'{prior.key} has moved {u:+.1f} tolerances'
            for prior, u in zip(physics.priors, physics.u)
            if prior.key.startswith('geometry.') and abs(u) > TOLERANCES]


def implausible_constants(physics: Fit) -> dict[str, str]:
    """
    Return in words, by key, which constants of laws are implausibly far from their priors.

    If structure is left as well, the law has probably been fitted to another effect.
    """
    return {prior.key: f'{prior.key} is {u:+.1f} widths of its prior from the usual value'
            for prior, u in zip(physics.priors, physics.u)
            if not prior.key.startswith('geometry.') and abs(u) > TOLERANCES
            and not _is_off(prior, u)}


def _impossible(physics: Fit) -> list[str]:
    """Return in words which of the model's own parameters are at a bound."""
    return [f'{prior.key} is at the limit of its possible range'
            for prior, u, bound in zip(physics.priors, physics.u, physics.at_bound)
            if bound and prior.own and not (prior.kind == 'size' and _is_off(prior, u))]


def evidence_of_structure(fitter: Fitter, fit: Fit) -> float:
    """Return the log Bayes factor of the smooth discrepancy against white and slow misfit."""
    best = -np.inf
    h = fit.hyper._replace(even=0, odd=0, speed=0)
    for _ in range(3):
        before = h
        for axis in ('white', 'slow', 'tau'):
            if axis not in fitter.covariance.axes:
                continue
            tries = [h._replace(**{axis: place}) for place in range(getattr(GRID, axis))]
            values = [log_evidence(fitter.covariance, q, fit.linear) for q in tries]
            h, best = tries[int(np.argmax(values))], max(best, max(values))
        if h == before:
            break
    return log_evidence(fitter.covariance, fit.hyper, fit.linear) - best


@dataclass(frozen=True)
class Finding:
    """
    A verdict with its reasons.

    Attributes
    ----------
    verdict : str
    after : Left
        Discrepancy of the chosen set.
    refusals, warnings : tuple of str
        Sentences; refusals are the reasons why effects that fit are not named.
    artefacts : tuple of Artefact
        Their words are also among the warnings.
    faint : float, N
        Size of a smooth discrepancy that the evidence needs but that is below half the noise of a
        row; 0 for none.
    slips : tuple of str
        Slips of unit, sign or ambient pressure that the data probably have: until they are
        settled an effect is named with a doubt.
    corrected : tuple of str
        What was corrected in the data before: beside it an effect is named with a doubt.
    worse : bool
        Whether the effects are refused since they increase the error of rows.
    against : frozenset of str
        Labels of effects in whose place a smooth discrepancy is more probable.
    """

    verdict: str
    after: Left
    refusals: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    artefacts: tuple[Artefact, ...] = ()
    faint: float = 0.0
    slips: tuple[str, ...] = ()
    corrected: tuple[str, ...] = ()
    worse: bool = False
    against: frozenset[str] = frozenset()

    @property
    def named(self) -> bool:
        """Whether the chosen effects are part of the answer."""
        return self.verdict in ('missing_effect', 'partial')

    @property
    def notes(self) -> tuple[str, ...]:
        """Refusals and warnings; without warnings about effects that are not named."""
        return (*self.refusals, *(self.warnings if self.named else
                                  (artefact.words for artefact in self.artefacts)))


def is_enough(probability: float) -> bool:
    """Return whether the evidence alone would name an effect of this probability."""
    return bool(probability >= 1.0 / (1.0 + np.exp(-settings.LEAST_LOSS)))


def shown_probability(finding: Finding, label: str, probability: float, named: bool) -> float:
    """
    Return the probability of an effect as it is shown: not above what other doubts allow.

    Evidence enough for a name, without one: the effect does not improve the prediction of
    held-out folds, or its constants are implausible. Then it is not likelier than not.
    """
    if (finding.refusals or finding.verdict == 'unexplained' or label in finding.against
            or not named and is_enough(probability)):
        return min(probability, 0.5)
    return min(probability, DOUBTED if finding.verdict == 'partial' else 1.0)


def judge(search: Search, base: Fit, chosen: Fit, physics: Fit, found: Sequence[Change],
          held: HeldOut, artefacts: Sequence[Artefact], likely: bool, slips: Sequence[str] = (),
          refusals: Sequence[str] = (), corrected: Sequence[str] = ()) -> Finding:
    """
    Return the verdict.

    Parameters
    ----------
    search : Search
    chosen : Fit
        The chosen set with its discrepancy.
    base, physics : Fit
        The model with its own effects, and the chosen set, fitted without a discrepancy.
    found : sequence of Change
        Changes of the chosen set; may be empty.
    held : HeldOut
    artefacts : sequence of Artefact
    likely : bool
        Whether the evidence named an effect before the test on held-out folds. If that test
        removed all effects, the verdict is `unexplained`, not `adequate`.
    slips, refusals, corrected : sequence of str
        As in `Finding`; refusals are reasons against the set that are known before.
    """
    fitter, null, cells = search.fitter, search.null, search.fitter.cells
    after = remaining_discrepancy(fitter.covariance, chosen, physics)
    needed = is_needed(evidence_of_structure(fitter, chosen), search.options.choices.inclusion)
    explained = _explained(base, physics) if found else 0.0
    structured = needed and _is_visible(after, cells)
    faint = after.smooth if needed and not structured else 0.0
    abnormal = settings.ABNORMAL * fitter.covariance.unexplained * cells.force_sd
    worse = _worse_rows(cells, base, physics) if found else []
    if found:
        refusals = (*refusals, *_refusals(physics, held, _effect_of_pressure(fitter, null)),
                    *worse)
    if found and structured and (odd := implausible_constants(physics)):
        refusals = (*refusals, f"{' and '.join(odd.values())}, and structure is left")
    warnings = (*_warnings(physics, held), *_undetermined(held, cells, physics),
                *lookalikes(cells, physics, found)) if found else ()
    lost = {change: chosen.posterior - search.fit(
        change.undone(chosen.names), chosen.start, chosen.hyper).posterior for change in found}
    weak = {change: each for change, each in lost.items() if each < settings.LEAST_LOSS}
    if weak:
        least = min(weak.values())
        warnings = (*warnings, 'a smooth discrepancy in place of '
                    + ' or of '.join(change.label for change in weak)
                    + (' is nearly as probable' if least >= 0.0 else ' is more probable')
                    + f' (odds of {np.exp(abs(least)):.2g} to 1)')
    warnings = (*warnings, *(artefact.words for artefact in artefacts))
    if not found:
        if artefacts or structured or likely or after.total > negligible(cells):
            verdict = 'unexplained'
        else:
            moved = _needs_recalibration(search)
            verdict = 'recalibrate' if moved else 'adequate'
    elif (refusals or after.total > max(negligible(cells), abnormal)
          or explained < settings.MOST_OF_IT and (
              after.beside > negligible(cells)
              # drift and vibration are no part of the discrepancy
              or artefacts and rms(physics.residual) > negligible(cells))):
        verdict = 'unexplained'
    else:
        rest = structured or after.total > negligible(cells)
        verdict = 'partial' if warnings or slips or corrected or rest else 'missing_effect'
    against = frozenset(change.label for change, each in weak.items() if each < 0.0)
    return Finding(verdict, after, tuple(refusals), warnings, tuple(artefacts), faint,
                   tuple(slips), tuple(corrected), bool(worse), against)


def leaves_structure(search: Search, fit: Fit, physics: Fit) -> bool:
    """
    Return whether a set leaves a smooth discrepancy, visible in the noise of rows.

    Parameters
    ----------
    search : Search
    fit, physics : Fit
        The set, fitted with and without a discrepancy.
    """
    fitter = search.fitter
    return (is_needed(evidence_of_structure(fitter, fit), search.options.choices.inclusion)
            and _is_visible(remaining_discrepancy(fitter.covariance, fit, physics), fitter.cells))


def _is_visible(left: Left, cells: Cells) -> bool:
    return left.smooth > settings.VISIBLE * cells.noise


def is_needed(need: float, inclusion: float) -> bool:
    """
    Return whether the data need a smooth discrepancy, with the same prior odds as an effect.

    ``need`` is the log Bayes factor of `evidence_of_structure`, ``inclusion`` the prior
    probability that something is missing.
    """
    return bool(need + np.log(inclusion / (1.0 - inclusion)) > settings.LEAST_LOSS)


def _explained(base: Fit, physics: Fit) -> float:
    """
    Return the relative reduction of the mean square error by the changes.

    The log evidence is no measure of this: it depends on the ratio of error to noise, so that
    the same effect would explain less with a better load cell.
    """
    return 1.0 - float(np.mean(physics.residual ** 2) / np.mean(base.residual ** 2))


def _needs_recalibration(search: Search) -> bool:
    """
    Return whether the model needs recalibration.

    It does if the evidence is against the parameters as given, or if they leave structure.
    """
    fitter, null = search.fitter, search.null
    residual = fitter.residual(null.model, null.priors, np.zeros(len(null.u)))
    as_given = fitter.beside_discrepancy(
        replace(null, priors=(), u=np.zeros(0), residual=residual,
                slopes=np.zeros((len(residual), 0))), null.hyper)
    return (null.evidence - as_given.evidence > settings.LEAST_LOSS
            or leaves_structure(search, as_given, as_given))


def _effect_of_pressure(fitter: Fitter, null: Fit) -> float:
    """Return the rms change of the given model's force due to the variation of pressure, N."""
    cells = fitter.cells
    record, model = cells.motion, with_coordinates(null.model, null.priors, np.zeros(len(null.u)))
    still = replace(record, pressure=np.broadcast_to(record.pressure.mean(axis=0),
                                                     record.pressure.shape))
    return rms(cells.mean(model.predict(record) - model.predict(still)))


def _refusals(physics: Fit, held: HeldOut, pressure: float) -> tuple[str, ...]:
    # `held` has errors of cells; those of rows are told with the recommendation
    found = []
    for name, words in (('mean', 'the mean force'), ('plane', 'a plane')):
        if held.physics >= held.rivals[name]:
            found.append(f'on held-out folds {words} predicts no worse than the effects')
    if pressure > held.blind <= held.physics:
        found.append(f'the pressures in the data change the force of the model by {pressure:.3g} '
                     'N, but on held-out folds a curve of the strain alone predicts no worse than '
                     'the effects: check that the pressure is that of this muscle')
    return (*found, *_impossible(physics))


def _worse_rows(cells: Cells, base: Fit, physics: Fit) -> list[str]:
    """
    Return a refusal if the effects reduce the error of cells but not that of their rows.

    Cells count alike. A few of one or two rows (where a smoothed strain is less exact, such as at
    the ends of trials) can be fitted better at the expense of most rows.
    """
    if cells.stiffness is not None:
        return []  # those errors are of the strain
    if rms(physics.residual) >= rms(base.residual):
        return []  # named for its prior: the model as given fits by an unlikely geometry
    used = cells.label >= 0
    before, after = (rms(cells.residual_of_rows(fit.model)[used]) for fit in (base, physics))
    return [f'the error of all rows grows from {before:.4g} to {after:.4g} N with the effects'
            ] if after > before else []


def _warnings(physics: Fit, held: HeldOut) -> tuple[str, ...]:
    found = [f'{prior.key} is at its bound'
             for prior, u, bound in zip(physics.priors, physics.u, physics.at_bound)
             if bound and not prior.own and not _is_off(prior, u)]
    found += implausible_geometry(physics)
    found += implausible_constants(physics).values()
    if held.physics > held.rivals['empirical']:
        found.append('on held-out folds a six-parameter empirical form predicts better than the '
                     'effects')
    return tuple(found)


def _undetermined(held: HeldOut, cells: Cells, physics: Fit) -> tuple[str, ...]:
    """
    Return a warning for each kind of folds that is predicted worse than the fit explains.

    What the effects leave in the fit too is no consequence of folds that were left out.
    """
    fitted = max(cells.mean_square(physics.residual),
                 float(np.average(cells.variance, weights=cells.count)))
    limit = np.sqrt(negligible(cells) ** 2 + fitted)
    return tuple(f'held-out {KINDS[kind]} are predicted with an error of {error:.3g} N: the data '
                 'do not determine the effects there'
                 for kind, (error, _) in held.kinds.items() if error > limit)


def _is_off(prior: Prior, u: float) -> bool:
    """Return whether a parameter at its bound is a size of zero, which switches a part off."""
    at_lower = u - prior.limits[0] < prior.limits[1] - u
    return at_lower and (prior.kind == 'half' or prior.lower == 0.0)
