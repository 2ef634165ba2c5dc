# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Adds effects to a model and moves every parameter together, on every row of the data."""

from collections.abc import Callable, Sequence

from fam_bundle_ros.discovery import Measurement
from fam_bundle_ros.discovery.diagnose import held_out_error, SEARCH_ROWS
from fam_bundle_ros.discovery.fit import Problem
from fam_bundle_ros.discovery.search import Scale, Search
from fam_bundle_ros.discovery.uncertainty import estimates
from fam_bundle_ros.model import Bundle, Effect
from fam_bundle_ros.workbench.session import Refit

__all__ = ['refit']


def refit(model: Bundle, data: Measurement, effects: Sequence[Effect],
          progress: Callable[[float, str], None] = lambda share, words: None) -> Refit:
    """
    Return the model with effects added and everything refitted.

    Parameters
    ----------
    model : Bundle
        The model as it was before any effect was added: its values are what is known before.
    data : Measurement
    effects : sequence of Effect
        None: the model's own parameters are recalibrated.
    progress : callable
        Of a share and words.
    """
    names = [effect.name for effect in effects]
    problem = Problem(data, model, largest=SEARCH_ROWS)
    search = Search(problem, model, {effect.name: effect for effect in effects})
    fit = search.fit(())
    for count, name in enumerate(names, start=1):
        progress(count / (len(names) + 2), f'refitting with {name}')
        fit = search.fit(names[:count])
    if problem.block > 1:
        progress(0.8, 'refitting every row')
        full = Problem(data, model, largest=len(data))
        start = {term.key: value for term, value in zip(fit.terms, fit.values)}
        fit, problem = full.fit(fit.model, fit.terms, start, iterations=4, tolerance=1.0), full
    progress(0.9, 'predicting data that the fit has not seen')
    return Refit(_with_intervals(problem, fit), held_out_error(problem, fit))


def _with_intervals(problem: Problem, fit) -> Bundle:
    """Return the fitted model with the 95 % intervals of its effects, in the order of the file."""
    intervals: dict[str, dict[str, tuple[float, float]]] = {}
    for estimate in estimates(fit, Scale.of(problem, fit)):
        owner, _, name = estimate.key.partition('.')
        intervals.setdefault(owner, {})[name] = estimate.si_interval
    effects = []
    for effect in fit.model.effects:
        known = effect.replace()
        known.intervals = {**effect.intervals, **intervals.get(effect.name, {})}
        effects.append(known)
    return Bundle(fit.model.name, fit.model.motor_units, effects, notes=fit.model.notes)
