# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Atomic file writing: to a temporary file in the same folder, which then replaces the old one."""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import tempfile

from fam_bundle_ros.errors import InputError, system_errors


def write_whole(path: str | Path, content: str | bytes) -> Path:
    """
    Write a file atomically: readers see the old or the new content, never a part.

    Raises
    ------
    InputError
        When the folder does not exist or the file cannot be written.
    """
    with whole(path) as draft:
        draft.write_bytes(content.encode() if isinstance(content, str) else content)
    return Path(path)


@contextmanager
def whole(path: str | Path) -> Iterator[Path]:
    """
    Yield a temporary file that replaces ``path`` if the block ends without an error.

    Raises
    ------
    InputError
        When the folder does not exist or the file cannot be written.
    """
    path = Path(path)
    draft = None
    try:
        with system_errors(path, 'cannot be written'):
            with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f'.{path.name}.',
                                             delete=False) as file:
                draft = Path(file.name)
            yield draft
            draft.chmod(0o666 & ~_umask())
            draft.replace(path)
    finally:
        if draft is not None:
            draft.unlink(missing_ok=True)


def refuse_unwritable(path: str | Path) -> None:
    """Raise InputError if a file could not be written, before the work that leads to it."""
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f'{path}: there is no folder {path.parent}')
    with system_errors(path, 'cannot be written'):
        tempfile.TemporaryFile(dir=path.parent).close()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
