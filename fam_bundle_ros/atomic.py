# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Writes files whole or not at all: beside their place first, then moved there."""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import tempfile

from fam_bundle_ros.errors import InputError


def write_whole(path: str | Path, content: str | bytes) -> Path:
    """
    Write a file so that a reader finds the old one or the new one, never a part.

    Raises
    ------
    InputError
        When the folder is not there or the file cannot be written.
    """
    with whole(path) as draft:
        draft.write_bytes(content.encode() if isinstance(content, str) else content)
    return Path(path)


@contextmanager
def whole(path: str | Path) -> Iterator[Path]:
    """
    Yield a draft beside a file; it takes the file's place when the block ends well.

    Raises
    ------
    InputError
        When the folder is not there or the file cannot be written.
    """
    path = Path(path)
    draft = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f'.{path.name}.',
                                         delete=False) as file:
            draft = Path(file.name)
        yield draft
        draft.chmod(0o666 & ~_umask())
        draft.replace(path)
    except OSError as error:
        raise InputError(f'{path}: cannot be written ({error.strerror or error})') from error
    finally:
        if draft is not None:
            draft.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
