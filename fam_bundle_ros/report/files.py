# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Writes files whole or not at all, and results as strict JSON."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
import json
import math
import os
from pathlib import Path
import tempfile
from typing import Any

import numpy as np

from fam_bundle_ros.errors import InputError

__all__ = ['plain', 'to_json', 'whole', 'write_json', 'write_whole']


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


def plain(value: Any) -> Any:
    """
    Return numbers, text, lists and dicts for JSON; nan and infinity become null.

    Examples
    --------
    >>> plain({'force': np.array([1.0, np.nan]), 'on': np.bool_(True)})
    {'force': [1.0, None], 'on': True}
    """
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return str(value)


def to_json(value: Any) -> str:
    """Return a result as JSON that every reader takes."""
    return json.dumps(plain(value), indent=2, allow_nan=False, ensure_ascii=False) + '\n'


def write_json(path: str | Path, value: Any) -> Path:
    """Write a result as JSON, whole or not at all."""
    return write_whole(path, to_json(value))


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
