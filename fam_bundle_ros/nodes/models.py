# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Reads and writes the model files that parameters of nodes name."""

from pathlib import Path

from fam_bundle_ros.model import Bundle, load_model, save_model
from fam_bundle_ros.resources import shipped_or_own


def bundle_from(name: str) -> Bundle:
    """Return the bundle of a model file; InputError says what is wrong with it."""
    return load_model(shipped_or_own(name, 'models'))


def model_in(folder: str | Path, name: str, model: Bundle) -> str:
    """Write a model into a folder; return its path, as parameters of nodes take it."""
    path = Path(folder) / f'{name}.yaml'
    save_model(model, path)
    return str(path)
