# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Provenance of a result: files with their hashes, versions, the machine's Python."""

from collections.abc import Sequence
from contextlib import suppress
from importlib import metadata
from pathlib import Path
import platform

import fam_bundle_ros
from fam_bundle_ros.data.measurement import file_digest

_PACKAGES = ('numpy', 'scipy', 'plotly', 'control')


def provenance(files: Sequence[tuple[str, str | Path]] = (),
               more: Sequence[tuple[str, str]] = ()) -> list[tuple[str, str]]:
    """
    Return the rows of a report's provenance table.

    ``files`` are (what it is, path), ``more`` (what, value): seeds; what is simulated, measured.
    """
    versions = []
    for name in _PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            versions.append(f'{name} {metadata.version(name)}')
    return [*((what, f'{Path(path).name}, sha256 {file_digest(path)[:16]}…')
              for what, path in files), *more,
            ('fam_bundle_ros', fam_bundle_ros.__version__), ('versions', ', '.join(versions)),
            ('Python', f'{platform.python_version()} on {platform.system()} '
                       f'{platform.machine()}')]
