# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Add, replace or remove effects of a model and refit it; compare errors of several models.

    better = add_effect(model, 'coulomb_friction', data)
    save_model(better.model, 'better.yaml')
    print(ladder(data, [model, better.model]))
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import permutations
import math
from typing import Any

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.noise import NoiseFloor
from fam_bundle_ros.discovery import empirical_surface, settings
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.compare import floor_of
from fam_bundle_ros.discovery.estimates import Estimate, estimates, with_intervals
from fam_bundle_ros.discovery.fitter import Fit, Fitter
from fam_bundle_ros.discovery.held_out import beyond_cells, held_out, HeldOut
from fam_bundle_ros.discovery.leftover import Leftover
from fam_bundle_ros.discovery.options import head, Names, Options, shapes_of, usual
from fam_bundle_ros.discovery.predict import likelier_past, matched, predict, stiffness
from fam_bundle_ros.discovery.reading import measurement_of
from fam_bundle_ros.discovery.result import Diagnosis, Recommended
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.discovery.verdict import remaining_discrepancy
from fam_bundle_ros.discovery.words import renamed
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.jsonfile import Answer
from fam_bundle_ros.model import Bundle, catalogue, Effect
from fam_bundle_ros.processes import on_one_core

#: What a table adds to the name of a model, by kind of `Recommended`.
_NAMED = {'discrepancy': '_and_discrepancy', empirical_surface.NAME: '_corrected'}


@dataclass(frozen=True, repr=False)
class Added(Answer):
    """
    A model with effects added, replaced or removed, and all its parameters refitted.

    Attributes
    ----------
    model : Bundle
        The new model, with the intervals of its parameters and its error.
    effects : tuple of str
        Names of the shapes that were added.
    error_before_N, error_N, held_out_N : float
        Rms error of the model as given, of the new one, and of its refits on held-out folds.
    parameters : tuple of Estimate
    asked : tuple of str
        Names by which the effects were requested.
    replaced : dict of str to str
    removed : tuple of str
    recommended : Recommended
        The same effects alone or with a table; see `recommend`.
    log_odds : float or None
        Natural log of the posterior odds of these effects against those of the model as given,
        both with a smooth discrepancy. None if the effects are the same.
    least_odds : float
        Lower odds do not separate the two models (`Choices.odds`).
    afresh : bool
        Whether the memory starts anew with each trial although the clock runs on, see
        `Measurement.afresh`.
    """

    model: Bundle
    effects: tuple[str, ...]
    error_before_N: float
    error_N: float
    held_out_N: float
    noise: NoiseFloor
    parameters: tuple[Estimate, ...]
    asked: tuple[str, ...]
    replaced: dict[str, str]
    removed: tuple[str, ...]
    recommended: Recommended
    log_odds: float | None
    least_odds: float
    afresh: bool = False

    @property
    def doubt(self) -> str:
        """A warning if a smooth discrepancy explains the data nearly as well, or better."""
        if self.log_odds is None or self.log_odds >= math.log(self.least_odds):
            return ''
        odds = math.exp(self.log_odds)
        if odds < 1.0:
            return (f'these data do not support the change: with it they are {odds:.2g} times as '
                    'probable as without it')
        return (f'caution: a smooth discrepancy in its place is nearly as probable (odds of '
                f'{odds:.2g} to 1; {self.least_odds:.3g} to 1 would be clear)')

    @property
    def past(self) -> str:
        """What was assumed of the trial before, in words; empty where the clock tells."""
        return ('the memory starts anew with each trial: the data are less probable if the muscle '
                'remembers the trial before') if self.afresh else ''

    @property
    def what(self) -> str:
        """The changes in words."""
        words = [name if name == asked else f'{name} (the shape of {asked} that fits best)'
                 for name, asked in zip(self.effects, self.asked)]
        words += [f'{new} in place of {old}' for old, new in self.replaced.items()]
        words += [f'no {name}' for name in self.removed]
        return ' and '.join(words) or 'nothing; its own parameters were refitted'

    def __str__(self) -> str:
        return '\n'.join([f'added {self.what}: error {self.error_before_N:.3g} N -> '
                          f'{self.error_N:.3g} N, {self.held_out_N:.3g} N on held-out data; '
                          f'{self.noise}', *filter(None, [self.doubt, self.past]),
                          *(f'  {e}' for e in self.parameters)])

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers, lists and text."""
        return {'effects': list(self.effects), 'model': self.model.name,
                'replaced': dict(self.replaced), 'removed': list(self.removed),
                'error_N': {'model': self.error_before_N, 'best': self.error_N,
                            'held_out': self.held_out_N},
                'recommended': self.recommended.to_dict(), 'noise_floor_N': self.noise.value,
                'log_odds': self.log_odds, 'least_odds': self.least_odds, 'afresh': self.afresh,
                'parameters': {e.key: e.to_dict() for e in self.parameters}}

    def to_frame(self) -> Any:
        """Return the parameters as a pandas DataFrame."""
        import pandas
        return pandas.DataFrame([e.to_dict() for e in self.parameters])


@on_one_core
def add_effect(model: Bundle, effect: str | Effect | Sequence[str | Effect] | Diagnosis,
               measurement: Any, name: str | None = None, *,
               replacing: Mapping[str, str] | None = None, removing: Sequence[str] = (),
               choices: Choices | None = None) -> Added:
    """
    Return a model with effects added, replaced or removed, and all parameters refitted.

    Parameters
    ----------
    model : Bundle
    effect : str, Effect, several of them, or Diagnosis
        Names in the catalogue, or effects (a user's own). An empty list only recalibrates. Of a
        name with several shapes another shape is added only if it is more probable than the named
        one by more than the odds of a tie (`Choices.odds`); an `Effect` is added as it is. Of a
        diagnosis its effects, replacements and removals.
    measurement : Measurement, path, or DataFrame
    name : str, optional
        Name of the new model; by default that of the old model and of the effects.
    replacing : mapping of str to str, optional
        Effect of the model -> its replacement.
    removing : sequence of str
        Effects of the model to remove.
    choices : Choices, optional

    Raises
    ------
    InputError
        For an unknown effect, an effect to add that the model has, one to remove or replace that
        it does not have, or bad data.
    """
    choices = choices or Choices()
    if isinstance(effect, Diagnosis):
        replacing = {**effect.replaced, **(replacing or {})}
        removing = (*effect.removed, *removing)
        effect = effect.shapes
    data = matched(model, measurement_of(model, measurement))
    listed = [effect] if isinstance(effect, (str, Effect)) else list(effect)
    replacing = dict(replacing or {})
    for gone in (*replacing, *removing):
        model.effect(gone)
    incoming = [_effect(item, model) for item in (*listed, *replacing.values())]
    had = {e.name for e in model.effects}
    for made in incoming:
        if made.name in had or [e.name for e in incoming].count(made.name) > 1:
            raise InputError(f'{model.name} has {made.name} already; expected an effect that it '
                             'lacks')
    open_ = [item for item in listed if isinstance(item, str)]
    shapes = [shape for item in open_ for shape in shapes_of(item, model)]
    addable = (*incoming, *shapes)
    kept = had - set(replacing) - set(removing)
    asked = tuple(e.name for e in incoming[:len(listed)])

    def best(data: Measurement) -> tuple[Search, Fit, tuple[str, ...]]:
        search = Search(Options(model, reduce(model, data), choices, addable))
        return search, *_best_shapes(search, kept | set(replacing.values()), asked, open_)

    search, chosen, added = best(data)
    afresh = False
    if data.remembers and chosen.model.has_memory:
        # as in a diagnosis: does the muscle remember the trial before?
        anew = best(data.afresh())
        afresh = anew[1].posterior - chosen.posterior > settings.LEAST_LOSS
        if afresh:
            data, (search, chosen, added) = data.afresh(), anew
    own = search.options.own
    log_odds = None if chosen.names == own else chosen.posterior - search.fit(own).posterior
    physics, held, residual = _alone(search, chosen, data)
    parameters = estimates(physics)
    words = [*added, *replacing.values(), *(f'without_{gone}' for gone in removing)]
    new = with_intervals(
        physics.model.named(name or renamed(model.name, words or ['recalibrated'])), parameters,
        rms(residual))
    return Added(new, added, rms(data.force - predict(model, data)), rms(residual), held.physics,
                 floor_of(data, residual, stiffness(new, data)), tuple(parameters), asked,
                 replacing, tuple(removing),
                 recommend(new, physics, chosen, held, search.fitter), log_odds, choices.odds,
                 afresh)


def _alone(search: Search, joint: Fit, data: Measurement) -> tuple[Fit, HeldOut, np.ndarray]:
    """Return a set fitted without discrepancy, its held-out errors and its residual of rows, N."""
    fitter = search.fitter
    physics = fitter.without_discrepancy(joint)
    residual = data.force - predict(physics.model, data)
    beyond = beyond_cells(fitter.cells, physics, rms(residual))
    return physics, held_out(fitter, physics, joint).of_rows(beyond), residual


def recommend(best: Bundle, physics: Fit, joint: Fit, held: HeldOut, fitter: Fitter,
              ) -> Recommended:
    """
    Return physics alone, with its discrepancy, or corrected to an `EmpiricalSurface`.

    The discrepancy is added if held-out folds are predicted better with it and if it is visible in
    the noise of a row. The model is corrected to the empirical surface if this predicts the folds
    better, visibly in the noise of a row, and not only one of them: by their rms and by the
    geometric mean of their errors.

    Parameters
    ----------
    best : Bundle
        The model as it is to be saved.
    physics, joint : Fit
        Fitted without and with a discrepancy.
    """
    left = remaining_discrepancy(fitter.covariance, joint, physics).smooth
    seen = settings.VISIBLE * fitter.cells.noise
    kind, error, table = 'physics', held.physics, None
    if joint.hyper.fits_a_table and held.discrepancy < error and left > seen:
        kind, error = 'discrepancy', held.discrepancy
        table = Leftover.of(fitter, physics, joint.hyper)
    form = held.rivals.get(empirical_surface.NAME, np.inf)
    # without folds the errors are those of the fit, where a surface is always better
    if (held.kinds and error ** 2 - form ** 2 > seen ** 2
            and held.typical[empirical_surface.NAME] < held.typical[kind]):
        kind, error = empirical_surface.NAME, form
        table = Leftover.to_empirical(fitter, physics)
    model = best.named(best.name + _NAMED[kind]) if table else best
    return Recommended(model, tuple(effect.name for effect in best.effects), kind, table,
                       error, held.physics, held.discrepancy, dict(held.rivals))


def _best_shapes(search: Search, kept: set[str], asked: Sequence[str], open_: Sequence[str],
                 ) -> tuple[Fit, tuple[str, ...]]:
    """
    Return the fit with the shape of each effect, and the names of the shapes.

    Another shape is used only if it is more probable than the one asked for, by more than the odds
    of a tie.
    """
    added = list(asked)
    least = math.log(search.options.choices.odds)
    best = search.fit(tuple(sorted(kept | set(added))))
    for slot, name in enumerate(asked):
        if name not in open_:
            continue
        named = best.posterior
        for shape in search.options.effects:
            if shape == name or head(shape) != name or shape in kept:
                continue
            tried = [*added[:slot], shape, *added[slot + 1:]]
            fit = search.fit(tuple(sorted(kept | set(tried))))
            if fit.posterior > max(best.posterior, named + least):
                best, added = fit, tried
    return best, tuple(added)


def _effect(item: str | Effect, model: Bundle) -> Effect:
    if isinstance(item, Effect):
        return item
    law = catalogue.get(item)
    if law.load is not None:
        raise InputError(f"effect '{item}' needs more than numeric parameters; write it into the "
                         'model file')
    return usual(law, model)


@dataclass(frozen=True, repr=False)
class Ladder(Answer):
    """
    Errors of several models on the same data.

    Attributes
    ----------
    steps : list of dict
        ``step`` (name), ``error_N`` (model as given), ``refitted_N``, ``held_out_N`` (refits
        without held-out folds), ``rows``, ``seen``: whether values or tables of the model may come
        from a fit to these rows, which makes the held-out error too small.
    noise : NoiseFloor
        Estimated with the best model.
    data : str
    rivals_N : dict of str to float
        Held-out errors of rivals, see `HeldOut`.
    """

    steps: list[dict[str, Any]]
    noise: NoiseFloor
    data: str
    rivals_N: dict[str, float]

    def __str__(self) -> str:
        width = max(len(step['step']) for step in self.steps)
        ends = dict.fromkeys(f"{s['error_N']:.3g} N with {s['step']}"
                             for s in (self.steps[0], self.steps[-1]))
        lines = [f"{self.data}: error {', '.join(ends)}",
                 f"{'model':<{width}}  {'error':>9}  {'refitted':>9}  {'held out':>9}   (N rms)"]
        lines += [f"{s['step']:<{width}}  {s['error_N']:9.3g}  {s['refitted_N']:9.3g}  "
                  f"{s['held_out_N']:9.3g}" for s in self.steps]
        lines.append('on the same held-out rows: ' + ', '.join(
            f'{name} {value:.3g} N' for name, value in self.rivals_N.items()))
        return '\n'.join([*lines, *filter(None, [self.doubt]), str(self.noise)])

    @property
    def doubt(self) -> str:
        """Which held-out errors may be too small, and why; empty for none."""
        seen = ', '.join(step['step'] for step in self.steps if step['seen'])
        return seen and (f'{seen}: fitted before, or with a table; if to these rows, the held-out '
                         'error is too small. Let the model before the fit be the first')

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers, lists and text."""
        return {'data': self.data, 'steps': self.steps, 'noise_floor_N': self.noise.value,
                'rivals_N': dict(self.rivals_N), 'noise': self.noise.to_dict()}

    def to_frame(self) -> Any:
        """Return the steps as a pandas DataFrame."""
        import pandas
        return pandas.DataFrame(self.steps)

    def figure(self) -> Any:
        """Return the plotly figure of the ladder (extra `tools`)."""
        from fam_bundle_ros.discovery import figures
        return figures.ladder(self.steps, self.noise.value, self.rivals_N['empirical'])


@on_one_core
def ladder(measurement: Any, models: Sequence[Bundle]) -> Ladder:
    """
    Return the errors of models on the same data, in the order given.

    A model that was fitted before (it states its error) is refitted from the geometry of the first
    and the defaults of the effects that the first lacks, as by `add_effect`: its own values may be
    those of a fit to the rows that are held out.

    Parameters
    ----------
    measurement : Measurement, path, or DataFrame
    models : sequence of Bundle

    Raises
    ------
    InputError
        Without a model, or if data and a model have different motor units.
    """
    if not models:
        raise InputError('a ladder needs at least one model')
    data = measurement_of(models[0], measurement)
    steps: list[dict[str, Any]] = []
    residuals = []
    for model in models:
        own = likelier_past(model, matched(model, data))
        base = models[0] if model.error and model.n == models[0].n else model
        had = {effect.name for effect in base.effects}
        new = [effect for effect in model.effects if effect.name not in had]
        search = Search(Options(base, reduce(base, own), Choices(), tuple(
            effect if effect.law.load else usual(effect.law, base) for effect in new)))
        names = tuple(sorted(effect.name for effect in model.effects))
        _, held, residual = _alone(search, search.fit(names), own)
        steps.append({
            'step': model.name, 'error_N': rms(own.force - predict(model, own)),
            'refitted_N': rms(residual), 'held_out_N': held.physics,
            'held_out_discrepancy_N': held.discrepancy,
            'effects': [effect.name for effect in model.effects], 'rows': len(own),
            'seen': bool(base.error) or any(effect.law.load for effect in new)})
        residuals.append((own, residual, stiffness(model, own)))
    best = min(residuals, key=lambda each: rms(each[1]))
    return Ladder(steps, floor_of(*best), data.name, held.rivals)


@on_one_core
def orders(model: Bundle, effects: Sequence[str], measurement: Any) -> dict[str, list[float]]:
    """
    Return the error after each step for every order of adding effects, N rms.

    The improvement by an effect depends on the effects added before it; the final error does not.

    Parameters
    ----------
    model : Bundle
    effects : sequence of str
        Names in the catalogue.
    measurement : Measurement, path, or DataFrame

    Returns
    -------
    dict of str to list of float
        Such as ``{'end_caps, coulomb_friction': [6.7, 5.3, 0.7]}``; the first is recalibration.
    """
    data = matched(model, measurement_of(model, measurement))
    search = Search(Options(model, reduce(model, data), Choices(), tuple(
        _effect(name, model) for name in effects)))

    @cache
    def error(names: Names) -> float:
        fit = search.fitter.without_discrepancy(search.fit(names))
        return rms(data.force - predict(fit.model, data))

    return {', '.join(order): [error(tuple(sorted({*search.options.own, *order[:k]})))
                               for k in range(len(order) + 1)] for order in permutations(effects)}
