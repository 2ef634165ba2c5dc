# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Sets of effects that may be tried: effects added, replaced by another shape, or removed.

The catalogue defines the family of an effect and its head: the common name of all shapes of one
physical effect. A set has at most one shape of each head.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from fam_bundle_ros.data.folds import fold_labels
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.priors import effect_priors, own_priors, Prior
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.model import Bundle, catalogue, Effect, Law, Motion, Place

Names = tuple[str, ...]


@lru_cache(maxsize=1)
def _identities() -> dict[str, tuple[str, str]]:
    """Return head and family by name; cached, as the catalogue reads entry points each time."""
    return {name: (kind.variant_of or name, kind.family)
            for name, kind in catalogue.available().items()}


def head(name: str) -> str:
    """Return the common name of all shapes of an effect: that of its first shape."""
    return _identities().get(name, (name, 'user'))[0]


def family(name: str) -> str:
    """Return the family of an effect: effects of the same physics."""
    return _identities().get(name, (name, 'user'))[1]


def usual(law: Law, model: Bundle) -> Effect:
    """
    Return an effect with its default values scaled to the size of a model's muscles.

    The defaults of the catalogue are for one muscle: forces are scaled with the cross section,
    pi r0^2, and limited to the bounds of the law.
    """
    made = law()
    radius = model.motor_units[0].geometry.radius
    share = (radius / settings.USUAL_RADIUS) ** 2
    return made.replace(**{
        p.name: float(np.clip(share * made.values[p.name], *made.limits(p.name)))
        for p in law.parameters if p.unit == 'N' and made.values[p.name]})


def shapes_of(name: str, model: Bundle) -> list[Effect]:
    """
    Return the other shapes of a head; none for the name of a single shape.

    Shapes that only some data can show (`Law.needs`) are excluded.
    """
    return [usual(kind, model) for other, kind in catalogue.available().items()
            if other != name and head(other) == name and not kind.needs]


@dataclass(frozen=True)
class Change:
    """
    One difference between a set and the model as given.

    ``old`` is empty for an effect that is added, ``new`` for one that is removed.
    """

    old: str
    new: str

    @property
    def name(self) -> str:
        """Name of the effect that is added, else of the one that is removed."""
        return self.new or self.old

    @property
    def label(self) -> str:
        """Name in a ranking: the family of an added effect, or the shape that replaces another."""
        return self.new if self.old and self.new else head(self.name)

    def __str__(self) -> str:
        if self.old and self.new:
            return f'{self.new} for {self.old}'
        return self.new or f'no {self.old}'

    def done(self, names: Names) -> Names:
        """Return the names of a set with this change."""
        return tuple(sorted({*names, self.new} - {self.old, ''}))

    def undone(self, names: Names) -> Names:
        """Return the names of a set with this change reversed."""
        return Change(self.new, self.old).done(names)


@dataclass(frozen=True)
class Options:
    """
    The sets of effects that may be tried.

    Attributes
    ----------
    model : Bundle
    cells : Cells
    choices : Choices
    addable : tuple of Effect
        Effects that may be added to those of the model.
    """

    model: Bundle
    cells: Cells
    choices: Choices
    addable: tuple[Effect, ...] = ()

    @classmethod
    def of(cls, model: Bundle, cells: Cells, choices: Choices, lengths: int = 1) -> Options:
        """
        Return the options with all effects of the catalogue that these data could show.

        At one force a function of the force is one number: `Law.is_of_force_alone` is left out.

        Parameters
        ----------
        lengths : int
            Number of different muscle lengths in the analysis.
        """
        has = {'': True, 'several lengths': lengths > 1, 'length readings': any(
            taken.quantity == 'length' for taken in cells.data.taken),
            'three strains': fold_labels(cells.data, 'strain').max() >= 0}
        own = {effect.name for effect in model.effects}
        addable = []
        for name, kind in catalogue.available().items():
            if name in own or not kind.candidate or kind.load is not None:
                continue
            if kind.place is Place.PNEUMATICS or not has[kind.needs] or (
                    kind.needs_time and cells.data.is_static) or (
                    kind.is_of_force_alone and cells.one_force):
                continue
            effect = usual(kind, model)
            if not _has_no_parameters(effect) and not _has_no_influence(model, effect, cells):
                addable.append(effect)
        return cls(model, cells, choices, tuple(addable))

    @cached_property
    def effects(self) -> dict[str, Effect]:
        """Effects of the model and those that may be added, by name."""
        effects = {effect.name: effect for effect in self.model.effects}
        for effect in self.addable:
            effects.setdefault(effect.name, effect)
        return effects

    @cached_property
    def own(self) -> Names:
        """Effects of the model as given."""
        return tuple(sorted(effect.name for effect in self.model.effects))

    @cached_property
    def fixed(self) -> frozenset[str]:
        """Effects of the model that are never removed: pneumatics, forces without parameters."""
        return frozenset(e.name for e in self.model.effects
                         if e.place is Place.PNEUMATICS or _has_no_parameters(e))

    @cached_property
    def _shapes(self) -> dict[str, list[str]]:
        """Names of the shapes of each head."""
        found: dict[str, list[str]] = {}
        for name in self.effects:
            found.setdefault(head(name), []).append(name)
        return found

    @cached_property
    def _priors(self) -> dict[str, list[Prior]]:
        own = own_priors(self.model)
        found = {'geometry': [p for p in own if p.key.startswith('geometry.')]}
        for name, effect in self.effects.items():
            found[name] = [p for p in own if p.key.startswith(f'{name}.')] if name in self.own \
                else self._added_priors(effect)
        return found

    def _added_priors(self, effect: Effect) -> list[Prior]:
        with_it = self.model.with_effect(effect)

        def change(key: str, step: float) -> float:
            value = effect.values[key.partition('.')[2]]
            before = with_it.predict(self.cells.motion)
            after = with_it.with_parameters({key: value + step}).predict(self.cells.motion)
            moved = self.cells.mean(after - before)
            return float(np.sqrt(np.mean(moved ** 2))) if np.isfinite(moved).all() else 0.0

        priors = effect_priors(effect, self.model.n, change=change,
                               size=settings.SIGNED_SIZE * self.cells.force_sd)
        if not effect.law.memory or self.cells.data.time is None:
            return priors
        # what takes longer than the log is no decay in it, but looks like a static law
        longest = _longest_memory(self.cells.motion)
        return [replace(prior, upper=max(prior.value, min(prior.upper, longest)))
                if effect.parameter(prior.key.partition('.')[2]).unit == 's' else prior
                for prior in priors]

    def bundle(self, names: Iterable[str]) -> Bundle:
        """Return the model with a set of effects; its own effects keep their order."""
        wanted = set(names)
        bundle = self.model
        for effect in self.model.effects:
            if effect.name not in wanted:
                bundle = bundle.without_effect(effect.name)
        for name in sorted(wanted - set(self.own)):
            bundle = bundle.with_effect(self.effects[name])
        return bundle

    def priors(self, names: Iterable[str]) -> list[Prior]:
        """Return the priors of the geometry and of a set's effects."""
        found = list(self._priors['geometry'])
        for name in sorted(names):
            found += self._priors[name]
        return found

    def log_prior(self, names: Iterable[str]) -> float:
        """Return the log prior of a set: prior odds of each change, divided among its shapes."""
        share = self.choices.inclusion
        odds = np.log(share / (1.0 - share))
        wanted = set(names)
        total = 0.0
        heads = {head(name) for name in wanted}
        for name in wanted - set(self.own):
            shapes = [shape for shape in self._shapes[head(name)] if shape not in self.own]
            total += odds - np.log(len(shapes))
        total += odds * sum(head(name) not in heads for name in set(self.own) - wanted)
        return float(total)

    def changes(self, names: Names) -> list[Change]:
        """Return the differences between a set and the model as given."""
        own = {head(name) for name in self.own}
        shapes = {head(name): name for name in names}
        return [*(Change('', name) for name in names if head(name) not in own),
                *(Change(old, shapes[head(old)]) for old in self.own
                  if old not in names and head(old) in shapes),
                *(Change(old, '') for old in self.own if head(old) not in shapes)]

    def further(self, names: Names) -> list[Names]:
        """Return the sets with one change more."""
        had, own_heads = {head(name) for name in names}, {head(name) for name in self.own}
        found = [Change('', name).done(names) for name in self.effects
                 if head(name) not in had and head(name) not in own_heads]
        for name in set(names) & set(self.own) - self.fixed:
            found += [Change(name, shape).done(names)
                      for shape in (*self._shapes[head(name)], '') if shape != name]
        return found

    def back(self, names: Names) -> list[Names]:
        """Return the sets with one change less."""
        return [change.undone(names) for change in self.changes(names)]

    def reshaped(self, names: Names) -> list[Names]:
        """Return the sets with another shape of one effect that has been changed."""
        return self._other_shapes(
            names, [change.new for change in self.changes(names) if change.new])

    def reshaped_own(self, names: Names) -> list[Names]:
        """Return the sets with another shape of one effect that the model has."""
        return self._other_shapes(names, set(names) & set(self.own) - self.fixed)

    def _other_shapes(self, names: Names, of: Iterable[str]) -> list[Names]:
        return [Change(name, shape).done(names) for name in sorted(of)
                for shape in self._shapes[head(name)] if shape not in (name, *self.own)]


def _longest_memory(motion: Motion) -> float:
    """Return the longest time over which laws of a model remember in these data, s."""
    begin = np.append(np.flatnonzero(motion.stepping[1]), len(motion.clock))
    return float(max(motion.clock[begin[1:] - 1] - motion.clock[begin[:-1]]))


def _has_no_parameters(effect: Effect) -> bool:
    """Return whether an effect is a force without parameters to fit."""
    return effect.place in (Place.FORCE, Place.RESIDUAL) and not effect.parameters


def _has_no_influence(model: Bundle, effect: Effect, cells: Cells) -> bool:
    """Return whether an effect with nonzero sizes does not change the force in these data."""
    if effect.parameters and not effect.active(model.n):
        return True
    away = {}
    for parameter in effect.active(model.n):
        low, high = effect.limits(parameter.name)
        value = effect.values[parameter.name]
        away[parameter.name] = value if value else min(0.1 * (high - low), high)
    change = (model.with_effect(effect.replace(**away)).predict(cells.motion)
              - model.predict(cells.motion))
    return bool(np.abs(change).max() < 1e-9 * max(cells.largest_force, 1.0)) and (
        effect.place is not Place.LIMIT)
