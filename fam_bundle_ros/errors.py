# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The error for invalid user input, shared by all layers."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class InputError(ValueError):
    """
    Bad input from a user: a file, a parameter, a command-line value.

    The message is one sentence that names the file, row or parameter and what was expected.
    The command line prints it and exits with status 2.
    """


@contextmanager
def about(what: str) -> Iterator[None]:
    """Prefix the message of an `InputError` in the block with its subject."""
    try:
        yield
    except InputError as error:
        raise InputError(f'{what}: {error}') from error


def in_short(error: Exception) -> str:
    """
    Return the message of a library's error in one line; the name of its class if it is empty.

    For an error of YAML: the line of the file and the problem there.
    """
    mark = getattr(error, 'problem_mark', None)
    if mark is not None:
        return f'line {mark.line + 1}: {getattr(error, "problem", "")}'
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


@contextmanager
def system_errors(path: str | Path, what: str, hint: str = '') -> Iterator[None]:
    """Raise an InputError, ``path: what (reason) hint``, for an error of the operating system."""
    try:
        yield
    except OSError as error:
        raise InputError(f'{path}: {what} ({error.strerror or error}){hint}') from error
