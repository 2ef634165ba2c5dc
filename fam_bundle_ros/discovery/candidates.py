# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Which effects may be added to a model, from where each fit starts, and who is whose variant."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fam_bundle_ros.discovery.fit import effect_terms
from fam_bundle_ros.discovery.measurement import Measurement
from fam_bundle_ros.model import Bundle, catalogue, Effect, Place


@lru_cache(maxsize=1)
def _identities() -> dict[str, tuple[str, str]]:
    """Return head and family by name; the catalogue looks through entry points each time."""
    return {name: (law.variant_of or name, law.family)
            for name, law in catalogue.available().items()}


def head(name: str) -> str:
    """
    Return the name that a physical effect goes by: that of its first shape.

    `viscous_power` is another shape of `viscous_damping`; diagnosis names the effect by its head
    and gives the shape beside it.
    """
    return _identities().get(name, (name, 'user'))[0]


def family(name: str) -> str:
    """Return the family of an effect: look-alikes by the same physics."""
    return _identities().get(name, (name, 'user'))[1]


@lru_cache(maxsize=64)
def makers(kind: str) -> tuple[str, ...]:
    """Return the families of the catalogue that leave a kind of shape in an error."""
    return tuple(dict.fromkeys(law.family for law in catalogue.available().values()
                               if kind in law.leaves))


def candidates(model: Bundle, data: Measurement) -> dict[str, Effect]:
    """
    Return the effects that the data could show and the model does not have, by name.

    Left out: what the model has already (in whatever shape), the air supply (it changes no
    force), a user's table, memory and rate where there is no time, mismatch where there is one
    motor unit, and the load cell where the force hardly changes (a constant would pass for it).
    """
    found = {}
    have = {effect.name for effect in model.effects}
    heads = {head(name) for name in have}
    for name, law in catalogue.available().items():
        if head(name) in heads or not law.candidate:
            continue
        effect = law()
        if law.parameters and not effect_terms(effect, model.n):
            continue
        if law.parts[0].changes == 'force' and force_hardly_changes(data):
            continue
        if data.is_static and _silent(model, effect, data):
            continue
        found[name] = effect
    return found


def force_hardly_changes(data: Measurement) -> bool:
    """Return whether the force is nearly the same throughout, as with a weight that hangs."""
    return bool(data.force.std() < 0.1 * abs(data.force.mean()))


def _silent(model: Bundle, effect: Effect, data: Measurement) -> bool:
    """Return whether an effect with parameters away from zero changes nothing in a static map."""
    if effect.needs_time:
        return True
    away = {p.name: max(abs(effect.values[p.name]), 0.1 * (p.upper - p.lower) * p.scale)
            for p in effect.parameters}
    lively = effect.replace(**{k: min(v, effect.limits(k)[1]) for k, v in away.items()})
    strain, pressure = data.strain[:200], data.pressure[:200]
    zero = np.zeros(len(strain))
    from fam_bundle_ros.model import Motion
    motion = Motion(strain, pressure, zero)
    with_it = model.with_effect(lively).predict(motion)
    return bool(np.allclose(with_it, model.predict(motion), atol=1e-9)) and (
        effect.place is Place.LOSS)


def shapes_of(name: str) -> list[Effect]:
    """Return the other shapes that a head stands for; none for the name of a single shape."""
    return [law() for other, law in catalogue.available().items()
            if other != name and head(other) == name]


def other_shapes(model: Bundle) -> list[tuple[str, Effect]]:
    """Return the other shapes of the effects that a model has: (name of its effect, shape)."""
    have = {effect.name for effect in model.effects}
    return [(name, law()) for name in have for other, law in catalogue.available().items()
            if other != name and other not in have and head(other) == head(name)]


def starts(effect: Effect, units: int) -> list[dict[str, float]]:
    """
    Return start values for the shape parameters of an effect, defaults first.

    Sizes (the parameters that switch the effect off) need none: the fit is linear in them. Time
    constants, widths, exponents and onsets are tried smaller and larger, one at a time.
    """
    terms = effect_terms(effect, units)
    own = {term.key: term.start for term in terms}
    tries = [own]
    for term in terms:
        name = term.key.partition('.')[2]
        if name in effect.off and effect.place is not Place.LIMIT:
            continue
        if term.start <= 0:
            continue
        for factor in (0.2, 5.0):
            value = float(np.clip(term.start * factor, term.lower or 1e-3 * term.start,
                                  term.upper))
            if abs(value - term.start) > 0.2 * term.start:
                tries.append({**own, term.key: value})
    if effect.place is Place.LIMIT and len(terms) > 2:
        # regions with edges have many valleys: a fixed spread of all parameters together
        rng = np.random.default_rng(0)
        for _ in range(16):
            tries.append({term.key: float(np.clip(
                term.start * np.exp(rng.uniform(-1.3, 1.3)), term.lower, term.upper))
                for term in terms})
    return tries
