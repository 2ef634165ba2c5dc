# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Version of the code behind a result: release, hash of the sources, laws of other packages."""

from functools import cache
import hashlib
from importlib import metadata
from pathlib import Path

import fam_bundle_ros

#: Sources on which a diagnosis depends.
_SOURCES = ('model', 'data', 'discovery', 'kernels.py', 'units.py')
_LAWS = 'fam_bundle_ros.effects'


@cache
def code_version(whole: bool = False) -> str:
    """
    Return the version and a hash of the sources, which also change between releases.

    The hash includes the laws of other packages (entry points). It is of the ``whole`` package, or
    of the sources on which a diagnosis depends.
    """
    root = Path(fam_bundle_ros.__file__).parent
    digest = hashlib.sha256()
    for name in ('.',) if whole else _SOURCES:
        path = root / name
        for file in sorted(path.rglob('*.py')) if path.is_dir() else [path]:
            digest.update(f'{file.relative_to(root)}\n'.encode() + file.read_bytes())
    for point in sorted(metadata.entry_points(group=_LAWS), key=lambda point: point.name):
        maker = f'{point.dist.name} {point.dist.version}' if point.dist else ''
        digest.update(f'{point.name} {point.value} {maker}\n'.encode())
    return f'{fam_bundle_ros.__version__}+{digest.hexdigest()[:12]}'
