# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a model tells about how a recording of its muscle is to be read."""

from fam_bundle_ros.data.recipe import Recipe
from fam_bundle_ros.model import Bundle

__all__ = ['length_of', 'recipe_for']


def length_of(model: Bundle) -> float | None:
    """Return the rest length (m) that all units of a model share; None where they differ."""
    lengths = {float(unit.geometry.length) for unit in model.motor_units}
    return lengths.pop() if len(lengths) == 1 else None


def recipe_for(model: Bundle, recipe: Recipe | None = None) -> Recipe:
    """Return a recipe with what the model knows: length, and pressure where it has none."""
    recipe = recipe or Recipe()
    recipe = recipe.merged(muscle_length=length_of(model))
    if recipe.max_pressure is None:
        recipe = recipe.merged(max_pressure=max(float(unit.max_pressure)
                                                for unit in model.motor_units))
    return recipe
