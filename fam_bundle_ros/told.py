# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Display of results in a shell and in a notebook, and words for them."""

from html import escape


class Told:
    """Base of results: `repr` is the first line of the text, a notebook shows all of it."""

    def __repr__(self) -> str:
        return f'<{type(self).__name__} {str(self).splitlines()[0]}>'

    def _repr_html_(self) -> str:
        return f'<pre>{escape(str(self))}</pre>'


def counted(number: int, noun: str) -> str:
    """Return a number and a noun: `1 trial`, `2 trials`."""
    return f'{number} {noun}{"s" * (number != 1)}'
