# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Start-up file of the notebooks' kernels: figures as data that the page draws in its own theme.

`conf.py` puts it into the profile of IPython that the kernels start with.
"""

from html import escape
from typing import Any

import plotly.io
from plotly.io.base_renderers import MimetypeRenderer


class OnPage(MimetypeRenderer):
    """Hands a figure to docs/_static/figures.js."""

    def to_mimebundle(self, fig_dict: dict[str, Any]) -> dict[str, str]:
        """Return a place for the drawing and, in the next element, what is drawn there."""
        layout = fig_dict['layout']
        titles = [layout.get(axis, {}).get('title', {}).get('text', '')
                  for axis in ('yaxis', 'xaxis')]
        label = escape(' over '.join(title for title in titles if title) or 'figure', quote=True)
        data = plotly.io.json.to_json_plotly(fig_dict).replace('</', '<\\/')
        return {'text/html': f'<div class="drawing" role="img" aria-label="{label}" '
                             f'style="height:{int(layout.get("height", 400))}px"></div>'
                             f'<script type="application/json">{data}</script>'}


plotly.io.renderers['page'] = OnPage()
plotly.io.renderers.default = 'page'
