# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Finds and reads the model file that a parameter names."""

from pathlib import Path

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, load_model, save_model
from fam_bundle_ros.resources import config_path


def shipped_or_own(name: str, folder: str) -> Path:
    """
    Return the path of a user's file, or of one that ships in a folder of ``config/``.

    A file that exists is taken as it is; else ``spie2021``, ``spie2021.yaml`` and
    ``models/spie2021.yaml`` all name the one that ships.
    """
    path = Path(name).expanduser()
    if path.is_file():
        return path
    stem = Path(name).name
    if path.is_absolute() or Path(name).parent not in (Path('.'), Path(folder)):
        raise InputError(f'{name}: no such file')
    return config_path(f"{folder}/{stem if stem.endswith('.yaml') else stem + '.yaml'}")


def bundle_from(name: str) -> Bundle:
    """Return the bundle of a model file; InputError says what is wrong with it."""
    return load_model(shipped_or_own(name, 'models'))


def model_in(folder: str | Path, name: str, model: Bundle) -> str:
    """Write a model into a folder; return its path, as parameters of nodes take it."""
    path = Path(folder) / f'{name}.yaml'
    save_model(model, path)
    return str(path)
