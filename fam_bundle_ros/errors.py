# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The one error that says "your input is wrong", shared by every layer."""

from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """
    Bad input from a user: a file, a parameter, a command-line value.

    The message is one sentence that names the file, row or parameter and what was expected.
    The command line prints it and exits with status 2.
    """


@contextmanager
def about(what: str) -> Iterator[None]:
    """Put in front of an `InputError` of the block what it is about."""
    try:
        yield
    except InputError as error:
        raise InputError(f'{what}: {error}') from error


def in_short(error: Exception) -> str:
    """
    Return what an error of a library says, in one line; its kind where it says nothing.

    YAML's has the place in its last line: the line of the file and what is wrong there.
    """
    mark = getattr(error, 'problem_mark', None)
    if mark is not None:
        return f'line {mark.line + 1}: {getattr(error, "problem", "")}'
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
