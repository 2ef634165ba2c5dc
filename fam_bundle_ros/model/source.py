# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Functions from generated source text.

The text must contain only known names and numbers, never input of a user. Tracebacks show its
lines.
"""

from collections.abc import Callable, Mapping
import hashlib
import linecache
import os
from typing import Any

from fam_bundle_ros import kernels


def defined(text: str, name: str, names: Mapping[str, Any], to_compile: bool = False) -> Callable:
    """Return the function of a name that a text defines; see `executed`."""
    return executed(text, name, names, to_compile)[name]


def executed(text: str, name: str, names: Mapping[str, Any], to_compile: bool = False,
             ) -> dict[str, Any]:
    """
    Return all names that a text uses and defines.

    Parameters
    ----------
    text : str
    name : str
        What the text defines, for its file.
    names : mapping
        Global names that it may use.
    to_compile : bool
        Whether numba will compile it: the text is then written to a file in the cache folder,
        which numba needs.
    """
    path = (to_compile and filed(text, name)) or f'<{name} {_digest(text)[:8]}>'
    linecache.cache[path] = (len(text), None, text.splitlines(True), path)
    scope = {**names, '__name__': __name__}
    exec(compile(text, path, 'exec'), scope)
    return scope


def filed(text: str, name: str) -> str:
    """Write a text to a file in the cache folder; return its path, empty if that fails."""
    path = kernels.cache_root() / 'models' / f'{name}_{_digest(text)}.py'
    if not path.exists():
        draft = path.with_suffix(f'.{os.getpid()}')
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            draft.write_text(text, encoding='utf-8')
            draft.replace(path)
        except OSError:
            return ''
    return str(path)


def _digest(text):
    return hashlib.sha256(text.encode()).hexdigest()[:16]
