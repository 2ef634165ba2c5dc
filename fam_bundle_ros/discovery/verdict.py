# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Adequate, recalibrate, missing effect, partial or unexplained: what a search amounts to.

The verdict goes by what is left: how large the discrepancy is before and after, and whether it is
needed. Two kinds of doubt stand beside it. Some refuse a name: no better than a plane on rows
not seen, a value that cannot be, or one that is hard to believe where structure stays. Others
warn: then it is `partial` at most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.grouping import pressure_speed, rms
from fam_bundle_ros.data.measurement import BY_PRESSURE
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.covariance import Covariance
from fam_bundle_ros.discovery.evidence import Fit, Fitter, with_coordinates
from fam_bundle_ros.discovery.held_out import HeldOut
from fam_bundle_ros.discovery.posterior import Change
from fam_bundle_ros.discovery.priors import Prior
from fam_bundle_ros.model import catalogue

#: Widths of the prior: geometry that is further off is said; a constant of a law that is further
#: off where structure stays refuses a name.
_TOLERANCES = 3.0
#: Belief is never above this while there is a doubt.
DOUBTED = 0.9


class Artefact(NamedTuple):
    """What is in the data by the way they were taken, so that no effect could explain it."""

    words: str
    remedy: str


@dataclass(frozen=True)
class Left:
    """
    What a set leaves to the discrepancy, N rms.

    Attributes
    ----------
    smooth : float
        Its mean over strain, pressure and direction.
    rough : float
        White misfit beyond noise.
    beside : float
        Both together where the discrepancy takes what it can, also of what the effects would
        explain without it.
    """

    smooth: float
    rough: float
    beside: float = 0.0

    @property
    def total(self) -> float:
        """Both together."""
        return float(np.hypot(self.smooth, self.rough))


def what_is_left(covariance: Covariance, fit: Fit, physics: Fit) -> Left:
    """
    Return the size of the discrepancy that a set needs.

    Beside a discrepancy the parameters stay near their priors, and it makes up for them. What the
    effects explain alone is not left to it: both parts together are no larger than the error of
    ``physics``, the same set fitted without one, where that is a muscle as it was described.
    """
    h = fit.hyper._replace(slow=0)
    rough = covariance.white_sd(fit.hyper)
    if h.is_white:
        return Left(0.0, rough, rough)
    smooth = covariance.structured(h) @ np.linalg.solve(covariance.matrix(fit.hyper),
                                                        fit.residual)
    beside = square = float(np.mean(smooth ** 2))
    if not (far(physics) or _impossible(physics)):
        square = min(square, max(float(np.mean(physics.residual ** 2)) - rough ** 2, 0.0))
    return Left(float(np.sqrt(square)), rough, float(np.hypot(np.sqrt(beside), rough)))


def far(physics: Fit) -> list[str]:
    """Return in words which dimensions are further off than can be."""
    return [f'{prior.key} has moved {u:+.1f} tolerances'
            for prior, u in zip(physics.priors, physics.u)
            if prior.key.startswith('geometry.') and abs(u) > _TOLERANCES]


def bent(physics: Fit) -> dict[str, str]:
    """
    Return constants of laws with values that their priors all but exclude, each in words.

    Where structure is left all the same, a law was bent to what it is not.
    """
    return {prior.key: f'{prior.key} would be {u:+.1f} widths of its prior off, and structure '
            'stays' for prior, u in zip(physics.priors, physics.u)
            if not prior.key.startswith('geometry.') and abs(u) > _TOLERANCES
            and not _is_off(prior, u)}


def _impossible(physics: Fit) -> list[str]:
    """Return in words which of the model's own parameters are at a bound."""
    return [f'{prior.key} would have to be at the end of what is possible'
            for prior, bound in zip(physics.priors, physics.at_bound) if bound and prior.own]


def small(cells: Cells) -> float:
    """Return the size up to which a discrepancy is as good as none, N."""
    return max(cells.noise, settings.SMALL * cells.largest_force)


def need_of_structure(fitter: Fitter, fit: Fit) -> float:
    """Return how many log units the smooth discrepancy gains over white and slow misfit."""
    best = -np.inf
    h = fit.hyper._replace(even=0, odd=0, speed=0)
    for _ in range(3):
        before = h
        for axis in ('white', 'slow', 'tau'):
            if axis not in fitter.covariance.axes:
                continue
            places = range(len(settings.AMPLITUDES) if axis != 'tau'
                           else len(settings.TIME_LENGTHS))
            tries = [h._replace(**{axis: place}) for place in places]
            values = [fitter.log_evidence(q, fit.linear) for q in tries]
            h, best = tries[int(np.argmax(values))], max(best, max(values))
        if h == before:
            break
    return fitter.log_evidence(fit.hyper, fit.linear) - best


@dataclass(frozen=True)
class Finding:
    """
    A verdict with its reasons.

    Attributes
    ----------
    verdict : str
    before, after : Left
        Discrepancy of the model as given (recalibrated) and of the chosen set.
    explained : float
        Share of the error's mean square, recalibrated, that the changes take.
    refusals, warnings : tuple of str
        Doubts in words; refusals are why effects that fit are no answer.
    artefacts : tuple of Artefact
        Also among the warnings.
    """

    verdict: str
    before: Left
    after: Left
    explained: float
    refusals: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    artefacts: tuple[Artefact, ...] = ()

    @property
    def named(self) -> bool:
        """Whether the effects that were chosen are part of the answer."""
        return self.verdict in ('missing_effect', 'partial')


def judge(fitter: Fitter, null: Fit, base: Fit, chosen: Fit, physics: Fit,
          found: Sequence[Change], held: HeldOut, artefacts: Sequence[Artefact],
          inclusion: float, likely: bool) -> Finding:
    """
    Return the verdict.

    Parameters
    ----------
    fitter : Fitter
    null, chosen : Fit
        The model with its own effects, and the chosen set, each with its discrepancy.
    base, physics : Fit
        The same without one.
    found : sequence of Change
        What was chosen; none where nothing earns a name.
    held : HeldOut
    artefacts : sequence of Artefact
    inclusion : float
        Prior probability that something is missing.
    likely : bool
        Whether the evidence names something, which may have predicted nothing on rows not seen:
        then no effect is the answer, but nor is that none is missing.
    """
    cells = fitter.cells
    before = what_is_left(fitter.covariance, null, base)
    after = what_is_left(fitter.covariance, chosen, physics)
    still = need_of_structure(fitter, chosen)
    explained = _explained(base, physics) if found else 0.0
    structured = is_structured(cells, still, after, inclusion)
    abnormal = settings.ABNORMAL * fitter.covariance.unexplained * cells.force_sd
    refusals = _refusals(physics, held, _worth_of_pressure(fitter, null)) if found else ()
    if found and structured:
        refusals = (*refusals, *bent(physics).values())
    warnings = (*_warnings(physics, held), *_alike_at_one_rate(cells, found)) if found else ()
    lost = chosen.posterior - null.posterior
    if found and lost < settings.LEAST_LOSS:
        warnings = (*warnings, 'a smooth discrepancy in their place is as probable (odds of '
                    f'{np.exp(lost):.2g} to 1)')
    warnings = (*warnings, *(artefact.words for artefact in artefacts))
    if not found:
        if artefacts or structured or likely:
            verdict = 'unexplained'
        else:
            verdict = 'recalibrate' if _moved(fitter, null, inclusion) else 'adequate'
    elif (refusals or after.total > max(small(cells), abnormal)
          or after.beside > small(cells) and explained < settings.MOST_OF_IT):
        verdict = 'unexplained'
    else:
        rest = structured or after.total > small(cells)
        verdict = 'partial' if warnings or rest else 'missing_effect'
    return Finding(verdict, before, after, float(np.clip(explained, 0.0, 1.0)), refusals,
                   warnings, tuple(artefacts))


def is_structured(cells: Cells, need: float, left: Left, inclusion: float) -> bool:
    """
    Return whether a smooth discrepancy is needed: it has prior odds to overcome as effects have.

    Parameters
    ----------
    cells : Cells
    need : float
        Of `need_of_structure`.
    left : Left
    inclusion : float
        Prior probability that something is missing.
    """
    return bool(need + np.log(inclusion / (1.0 - inclusion)) > settings.LEAST_LOSS
                and left.smooth > settings.VISIBLE * cells.noise)


def _explained(base: Fit, physics: Fit) -> float:
    """
    Return the share of the error's mean square that the changes take.

    Not of the need for a discrepancy in log units: that goes with the logarithm of error over
    noise, so that with a better load cell the same effect on the same muscle would explain less.
    """
    return 1.0 - float(np.mean(physics.residual ** 2) / np.mean(base.residual ** 2))


def _moved(fitter: Fitter, null: Fit, inclusion: float) -> bool:
    """
    Return whether the model's parameters had to move.

    The evidence is against those as given, or they leave a structure.
    """
    nothing = np.zeros(0)
    residual = fitter.residual(null.model, null.priors, np.zeros(len(null.u)))
    as_given = replace(null, priors=(), u=nothing, residual=residual,
                       slopes=np.zeros((len(residual), 0)))
    hyper, evidence = fitter.best_hyper(null.hyper, as_given.linear)
    as_given = replace(as_given, hyper=hyper, evidence=evidence)
    left = what_is_left(fitter.covariance, as_given, as_given)
    return (null.evidence - evidence > settings.LEAST_LOSS
            or is_structured(fitter.cells, need_of_structure(fitter, as_given), left, inclusion))


def _worth_of_pressure(fitter: Fitter, null: Fit) -> float:
    """Return by how much the pressures that were met change the force of the model as given."""
    cells = fitter.cells
    record, model = cells.motion, with_coordinates(null.model, null.priors, np.zeros(len(null.u)))
    still = replace(record, pressure=np.broadcast_to(record.pressure.mean(axis=0),
                                                     record.pressure.shape))
    return rms(cells.mean(model.predict(record) - model.predict(still)))


def _refusals(physics: Fit, held: HeldOut, pressure: float) -> tuple[str, ...]:
    found = []
    for name, words in (('mean', 'the mean force'), ('plane', 'a plane')):
        if held.physics >= held.rivals[name]:
            found.append(f'on rows not seen it is off by {held.physics:.3g} N, {words} by '
                         f'{held.rivals[name]:.3g} N')
    if pressure > held.blind <= held.physics:
        found.append(f'the pressures that were met change the force of the model by '
                     f'{pressure:.3g} N, but a curve of the strain that knows of no pressure is '
                     f'off by {held.blind:.3g} N on rows not seen, the effects by '
                     f'{held.physics:.3g} N: is it the pressure of this muscle?')
    return (*found, *_impossible(physics))


def _warnings(physics: Fit, held: HeldOut) -> tuple[str, ...]:
    found = [f'{prior.key} is at its bound'
             for prior, u, bound in zip(physics.priors, physics.u, physics.at_bound)
             if bound and not prior.own and not _is_off(prior, u)]
    found += far(physics)
    if held.physics > held.rivals['empirical']:
        found.append(f'on rows not seen the effects are off by {held.physics:.3g} N, a '
                     f'six-parameter empirical form by {held.rivals["empirical"]:.3g} N')
    return tuple(found)


def _alike_at_one_rate(cells: Cells, found: Sequence[Change]) -> list[str]:
    """
    Return in words that what was found with a memory could be another memory.

    Lag, creep and friction make the same loop where the pressure of a muscle at rest changes at
    one rate only: less than a factor of e between the tenth and the ninetieth percentile.
    """
    laws = catalogue.available()
    named = [change.label for change in found if change.new in laws and laws[change.new].memory]
    data = cells.data
    if not named or data.time is None or not data.is_held:
        return []
    filled = data.direction_basis == BY_PRESSURE
    slow, fast = np.percentile(pressure_speed(data)[filled], (10, 90)) / 1e3
    if slow <= 0.0 or np.log(fast / slow) > settings.SPEED_LENGTH:
        return []
    return [f'the pressure changes at {slow:.2g} to {fast:.2g} kPa/s only, where lag, creep and '
            f'friction look alike ({", ".join(named)}): fill and vent at another rate too']


def _is_off(prior: Prior, u: float) -> bool:
    """Return whether a bound merely switches a part off: a size that is zero."""
    at_lower = u - prior.limits[0] < prior.limits[1] - u
    return at_lower and (prior.kind == 'half' or prior.lower == 0.0)
