# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Optional packages, and the extra that installs each."""

import importlib
from typing import Any

from fam_bundle_ros.errors import InputError

#: Import name of a package -> extra of setup.py.
EXTRAS = {'distributed': 'cluster', 'h5py': 'files', 'nicegui': 'web', 'nptdms': 'files',
          'openpyxl': 'files', 'pandas': 'tools', 'plotly': 'tools', 'pyarrow': 'files',
          'rich': 'tools', 'rosbags': 'tools', 'typer': 'tools'}


def library(module: str, what: str) -> Any:
    """
    Return a module of one of the packages in `EXTRAS`.

    Parameters
    ----------
    module : str
    what : str
        Purpose, for the message: ``log.xlsx: reading it``.

    Raises
    ------
    InputError
        If it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition('.')[0]
        extra = EXTRAS[package]
        raise InputError(f'{what} needs the package {package}; install the extra `{extra}`: '
                         f"pip install 'fam_bundle_ros[{extra}]'") from error
