# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Force of a model and its derivatives with respect to parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fam_bundle_ros.model import Bundle, Motion


def jacobian(model: Bundle, motion: Motion, keys: Sequence[str],
             steps: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the predicted force (T,) and its forward differences (T, K), SI.

    Parameters
    ----------
    steps : sequence of float
        Step of each parameter, SI.
    """
    here = {key: value_of(model, key) for key in keys}
    force = model.predict(motion)
    columns = np.zeros((len(force), len(keys)))
    for j, (key, step) in enumerate(zip(keys, steps)):
        moved = model.with_parameters({key: here[key] + step})
        columns[:, j] = (moved.predict(motion) - force) / step
    return force, columns


def value_of(model: Bundle, key: str) -> float:
    """Return a parameter of a model by its key, SI."""
    owner, _, name = key.partition('.')
    if owner == 'geometry':
        return float(getattr(model.motor_units[0].geometry, name))
    return float(model.effect(owner).values[name])
