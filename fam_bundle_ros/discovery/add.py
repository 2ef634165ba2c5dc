# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Add an effect to a model, with everything refitted; and the ladder of errors, step by step.

    better = add_effect(model, 'coulomb_friction', data)
    save_model(better.model, 'better.yaml')
    print(ladder(data, [model, better.model]))
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
import json
from typing import Any

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.noise import noise_floor, NoiseFloor
from fam_bundle_ros.data.reading import as_measurement
from fam_bundle_ros.discovery import candidates as cand
from fam_bundle_ros.discovery.diagnose import SEARCH_ROWS, with_intervals
from fam_bundle_ros.discovery.fit import base_terms, confirm, held_out_of_whole, Problem
from fam_bundle_ros.discovery.predict import matched, predict
from fam_bundle_ros.discovery.result import finite
from fam_bundle_ros.discovery.search import Scale, Search
from fam_bundle_ros.discovery.uncertainty import Estimate, estimates
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, catalogue, Effect


@dataclass(frozen=True)
class Added:
    """
    A model with effects added and all its parameters refitted.

    Attributes
    ----------
    model : Bundle
        The new model, with the intervals of its parameters and its error.
    effects : tuple of str
        In the shape in which each was added.
    error_before_N, error_N, held_out_N : float
        Rms of the model as it was, of the new one, and of refits on blocks that they have not
        seen; over the rows that count.
    parameters : tuple of Estimate
    asked : tuple of str
        What the effects were asked for by.
    """

    model: Bundle
    effects: tuple[str, ...]
    error_before_N: float
    error_N: float
    held_out_N: float
    noise: NoiseFloor
    parameters: tuple[Estimate, ...]
    asked: tuple[str, ...] = ()

    @property
    def what(self) -> str:
        """What was added, in words."""
        return ' and '.join(
            name if name == asked else f'{name} (the shape of {asked} that fits best)'
            for name, asked in zip(self.effects, self.asked)
        ) or 'nothing; its own parameters were refitted'

    def __str__(self) -> str:
        return '\n'.join([f'added {self.what}: error {self.error_before_N:.3g} N -> '
                          f'{self.error_N:.3g} N, {self.held_out_N:.3g} N on data left out; '
                          f'{self.noise}', *(f'  {e}' for e in self.parameters)])

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers, lists and text."""
        return {'effects': list(self.effects), 'model': self.model.name,
                'error_N': {'model': self.error_before_N, 'best': self.error_N,
                            'held_out': self.held_out_N},
                'noise_floor_N': self.noise.value,
                'parameters': {e.key: e.to_dict() for e in self.parameters}}

    def to_json(self) -> str:
        """Return `to_dict` as JSON."""
        return json.dumps(finite(self.to_dict()), indent=1)

    def to_frame(self) -> Any:
        """Return the parameters as a pandas DataFrame."""
        import pandas
        return pandas.DataFrame([e.to_dict() for e in self.parameters])


def add_effect(model: Bundle, effect: str | Effect | Sequence[str | Effect], measurement: Any,
               name: str | None = None) -> Added:
    """
    Return a model with effects added, refitted together with its own parameters.

    Parameters
    ----------
    model : Bundle
    effect : str, Effect, or several of them
        Names of the catalogue, or effects (a user's own). None of them: recalibrate only. A name
        that stands for several shapes takes the one that fits best, as `diagnose` does; an effect
        is added as it is.
    measurement : Measurement, path, or DataFrame
    name : str, optional
        Name of the new model; by default the old one's with the effects'.

    Raises
    ------
    InputError
        For an unknown effect, one that the model has already, or bad data.
    """
    data = as_measurement(measurement)
    data = matched(model, data)
    listed = [effect] if isinstance(effect, (str, Effect)) else list(effect)
    effects = {}
    for item in listed:
        made = _effect(item)
        if made.name in {e.name for e in model.effects} or made.name in effects:
            raise InputError(f'{model.name} has {made.name} already; expected an effect that it '
                             'lacks')
        effects[made.name] = made
    asked = tuple(effects)
    for item in listed:
        if isinstance(item, str):
            effects.update((shape.name, shape) for shape in cand.shapes_of(item)
                           if shape.name not in effects)
    problem = Problem(data, model, largest=SEARCH_ROWS)
    search = Search(problem, model, effects)
    names = search.in_best_shapes(asked)
    fit = search.fit(names)
    full = problem if problem.block == 1 else Problem(data, model, largest=len(data))
    final = confirm(full, fit)
    scale = Scale.of(full, final)
    kept = full.weight
    label = name or '_'.join([model.name, *names])
    new = with_intervals(final, scale, kept)
    return Added(new.named(label), tuple(names), rms(full.residual(model)[kept]),
                 rms(final.residual[kept]), held_out_of_whole(full, final, problem, fit),
                 noise_floor(data.select(kept), final.residual[kept]),
                 tuple(estimates(final, scale)), asked)


def _effect(item: str | Effect) -> Effect:
    if isinstance(item, Effect):
        return item
    try:
        return catalogue.get(item)()
    except TypeError as error:
        raise InputError(f"effect '{item}' needs more than numbers; expected it in the model "
                         'file') from error


@dataclass(frozen=True)
class Ladder:
    """
    The error of one model after the other on the same data.

    Attributes
    ----------
    steps : list of dict
        ``step`` (name), ``error_N`` (as the model is), ``refitted_N``, ``held_out_N`` (refits on
        blocks that they have not seen), ``rows`` that count.
    noise : NoiseFloor
        Of the best model.
    data : str
    """

    steps: list[dict[str, Any]]
    noise: NoiseFloor
    data: str

    def __str__(self) -> str:
        width = max(len(step['step']) for step in self.steps)
        lines = [f"{'model':<{width}}  {'error':>9}  {'refitted':>9}  {'left out':>9}   (N rms)"]
        lines += [f"{s['step']:<{width}}  {s['error_N']:9.3g}  {s['refitted_N']:9.3g}  "
                  f"{s['held_out_N']:9.3g}" for s in self.steps]
        return '\n'.join([*lines, str(self.noise)])

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers, lists and text."""
        return {'data': self.data, 'steps': self.steps, 'noise_floor_N': self.noise.value,
                'noise': self.noise.to_dict()}

    def to_json(self) -> str:
        """Return `to_dict` as JSON."""
        return json.dumps(finite(self.to_dict()), indent=1)

    def to_frame(self) -> Any:
        """Return the steps as a pandas DataFrame."""
        import pandas
        return pandas.DataFrame(self.steps)

    def figure(self) -> Any:
        """Return the plotly figure of the ladder (extra `tools`)."""
        from fam_bundle_ros.discovery import figures
        return figures.ladder(self.steps, self.noise.value)


def ladder(measurement: Any, models: Sequence[Bundle]) -> Ladder:
    """
    Return the errors of models on the same data, in the order given.

    Parameters
    ----------
    measurement : Measurement, path, or DataFrame
    models : sequence of Bundle

    Raises
    ------
    InputError
        Without a model, or where data and a model have other motor units.
    """
    data = as_measurement(measurement)
    if not models:
        raise InputError('a ladder needs at least one model')
    steps, best = [], None
    data = matched(models[-1], data)
    # every model is held against the same rows: those that the last one leaves
    full = Problem(data, models[-1], largest=len(data))
    kept = full.weight
    thin = full if len(data) <= SEARCH_ROWS else Problem(data, models[-1], largest=SEARCH_ROWS)
    for model in models:
        data = matched(model, data)
        fit = thin.fit(model, base_terms(model))
        confirmed = confirm(full, fit)
        refitted = rms(confirmed.residual[kept])
        steps.append({
            'step': model.name, 'error_N': rms((data.force - predict(model, data))[kept]),
            'refitted_N': refitted,
            'held_out_N': held_out_of_whole(full, confirmed, thin, fit),
            'effects': [effect.name for effect in model.effects], 'rows': int(kept.sum())})
        if best is None or steps[-1]['refitted_N'] < best[0]:
            best = (steps[-1]['refitted_N'], fit.model)
    assert best is not None
    floor = noise_floor(data, data.force - predict(best[1], data))
    return Ladder(steps, floor, data.name)


def orders(model: Bundle, effects: Sequence[str], measurement: Any) -> dict[str, list[float]]:
    """
    Return the error after each step for every order of adding effects, N rms.

    What an effect seems to be worth depends on what was added before it; the last step does not.

    Returns
    -------
    dict of str to list of float
        Such as ``{'end_caps, coulomb_friction': [6.7, 5.3, 0.7]}``; the first is recalibration.
    """
    data = as_measurement(measurement)
    problem = Problem(data, model, largest=SEARCH_ROWS)
    search = Search(problem, model, {name: _effect(name) for name in effects})
    kept = problem.weight
    found = {}
    for order in permutations(effects):
        found[', '.join(order)] = [rms(search.fit(order[:k]).residual[kept])
                                   for k in range(len(order) + 1)]
    return found
