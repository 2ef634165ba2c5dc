# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Display of results in a shell and in a notebook."""

from html import escape


class Told:
    """Base of results: `repr` is the first line of the text, a notebook shows all of it."""

    def __repr__(self) -> str:
        return f'<{type(self).__name__} {str(self).splitlines()[0]}>'

    def _repr_html_(self) -> str:
        return f'<pre>{escape(str(self))}</pre>'
