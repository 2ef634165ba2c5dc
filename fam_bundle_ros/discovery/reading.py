# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of a model's muscle, read with what the model says about it."""

from typing import Any

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.reading import read_measurement
from fam_bundle_ros.data.recipe import Recipe
from fam_bundle_ros.model import Bundle

__all__ = ['length_of', 'measurement_of', 'recipe_for']


def measurement_of(model: Bundle, source: Any) -> Measurement:
    """Return a `Measurement` as it is, and read anything else with the length of the model."""
    if isinstance(source, Measurement):
        return source
    return read_measurement(source, recipe=recipe_for(model, Recipe()))


def length_of(model: Bundle) -> float | None:
    """Return the rest length of all units of a model, m; None if it differs between them."""
    lengths = {float(unit.geometry.length) for unit in model.motor_units}
    return lengths.pop() if len(lengths) == 1 else None


def recipe_for(model: Bundle, recipe: Recipe) -> Recipe:
    """Return a recipe with the length, and a missing highest pressure, of the model."""
    highest = float(model.max_pressure.max()) if recipe.max_pressure is None else None
    return recipe.merged(muscle_length=length_of(model), max_pressure=highest)
