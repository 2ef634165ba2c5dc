# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Paths of the files that are shipped with the package: models, parameters, trajectories, data.

An installed package (colcon or pip) contains ``config/``; a source tree, also one installed with
``pip install -e`` or ``colcon build --symlink-install``, has it beside the package. No ROS share
directory is used, so that nodes run wherever Python finds the package.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

from fam_bundle_ros.errors import InputError


def config_path(relative: str | Path) -> Path:
    """
    Return the path of a shipped file or folder in ``config/``.

    Parameters
    ----------
    relative : str or Path
        Path below ``config/``, for example ``models/spie2021.yaml``.

    Returns
    -------
    Path
        Absolute path of an existing file or folder.

    Raises
    ------
    InputError
        When no such file is shipped, or the name leads out of ``config/``.

    """
    root = _root()
    path = (root / relative).resolve()
    if path.is_relative_to(root) and path.exists():
        return path
    folder = Path(relative).parent
    inside = (root / folder).resolve().is_relative_to(root)
    known = ', '.join(config_names(str(folder))) if inside else ''
    raise InputError(
        f'{relative}: no such file ships with fam_bundle_ros; '
        f'config/{"" if str(folder) == "." or not inside else folder} has: {known or "nothing"}'
    )


def config_names(folder: str = '.') -> tuple[str, ...]:
    """
    Return the names of the shipped files in a folder of ``config/``, sorted.

    A folder (for example ``models``) that does not exist is empty.
    """
    path = _root() / folder
    if not path.is_dir():
        return ()
    return tuple(sorted(p.name for p in path.iterdir() if p.name[0] not in '._'))


def shipped_or_own(name: str, folder: str) -> Path:
    """
    Return the path of a user's file, or of a shipped file in a folder of ``config/``.

    A file that exists is used; else ``spie2021``, ``spie2021.yaml`` and
    ``models/spie2021.yaml`` all name the shipped one.
    """
    path = Path(name).expanduser()
    if path.is_file():
        return path
    stem = Path(name).name
    if path.is_absolute() or Path(name).parent not in (Path('.'), Path(folder)):
        raise InputError(f'{name}: no such file')
    return config_path(f"{folder}/{stem if stem.endswith('.yaml') else stem + '.yaml'}")


def model_path(name: str | Path) -> Path:
    """Return the path of a model file, or of a shipped model by its name."""
    return _own_or(name, {**_shipped('data', '.model.yaml'), **_shipped('models', '.yaml')},
                   'model file', 'models', Path.exists)


def data_path(name: str | Path) -> Path:
    """Return the path of a measurement, or of a shipped one by its name."""
    return _own_or(name, _shipped('data', '.csv'), 'file or bag', 'measurements', Path.exists)


def protocol_path(name: str | Path) -> Path:
    """Return the path of a protocol, or of a shipped one by its name."""
    return _own_or(name, _shipped('protocols', '.yaml'), 'protocol', 'protocols', Path.is_file)


def _shipped(folder: str, suffix: str) -> dict[str, str]:
    """Return the shipped files in a folder with a suffix: name -> path below ``config/``."""
    return {file.removesuffix(suffix): f'{folder}/{file}' for file in config_names(folder)
            if file.endswith(suffix)}


def _own_or(name: str | Path, shipped: Mapping[str, str], what: str, plural: str,
            there: Callable[[Path], bool]) -> Path:
    """Return a user's path if it exists, else that of the shipped file of this name."""
    if there(Path(name)):
        return Path(name)
    if str(name) in shipped:
        return config_path(shipped[str(name)])
    raise InputError(f'{name}: no such {what}; {plural} that ship: '
                     f'{", ".join(sorted(shipped)) or "none"}')


def _root() -> Path:
    package = Path(__file__).resolve().parent
    source = package.parent
    # package.xml distinguishes a source tree from a site-packages with another config folder.
    if (source / 'package.xml').is_file():
        return source / 'config'
    return package / 'config'
