# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Finds the files that ship with the package: models, parameters, trajectories, data.

An installed package (colcon or pip) carries ``config/`` inside itself; a source tree, also one
installed with ``pip install -e`` or ``colcon build --symlink-install``, has it beside the
package. No ROS share directory is asked for, so nodes start from wherever Python finds them.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

from fam_bundle_ros.errors import InputError


def config_path(relative: str | Path) -> Path:
    """
    Return the path of a file or folder that ships in ``config/``.

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
        When nothing of that name ships, or when the name leads out of ``config/``.

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
    Return the names of what ships in a folder of ``config/``, sorted.

    Parameters
    ----------
    folder : str
        Folder below ``config/``, for example ``models``. One that does not exist is empty.

    """
    path = _root() / folder
    if not path.is_dir():
        return ()
    return tuple(sorted(p.name for p in path.iterdir() if p.name[0] not in '._'))


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


def model_path(name: str | Path) -> Path:
    """Return the path of a model file, or of a shipped model by its name."""
    return _own_or(name, {**_shipped('data', '.model.yaml'), **_shipped('models', '.yaml')},
                   'model file', 'models', Path.exists)


def data_path(name: str | Path) -> Path:
    """Return the path of a measurement, or of one that ships by its name."""
    return _own_or(name, _shipped('data', '.csv'), 'file or bag', 'measurements', Path.exists)


def protocol_path(name: str | Path) -> Path:
    """Return the path of a protocol, or of one that ships by its name."""
    return _own_or(name, _shipped('protocols', '.yaml'), 'protocol', 'protocols', Path.is_file)


def _shipped(folder: str, suffix: str) -> dict[str, str]:
    """Return what ships in a folder with this ending: name -> path below ``config/``."""
    return {file.removesuffix(suffix): f'{folder}/{file}' for file in config_names(folder)
            if file.endswith(suffix)}


def _own_or(name: str | Path, shipped: Mapping[str, str], what: str, plural: str,
            there: Callable[[Path], bool]) -> Path:
    """Return a user's path where it is there, else that of what ships by this name."""
    if there(Path(name)):
        return Path(name)
    if str(name) in shipped:
        return config_path(shipped[str(name)])
    raise InputError(f'{name}: no such {what}; {plural} that ship: '
                     f'{", ".join(sorted(shipped)) or "none"}')


def _root() -> Path:
    package = Path(__file__).resolve().parent
    source = package.parent
    # package.xml tells a source tree from a site-packages that has some other config beside us.
    if (source / 'package.xml').is_file():
        return source / 'config'
    return package / 'config'
