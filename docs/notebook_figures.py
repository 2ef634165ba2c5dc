# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Start-up file of the notebooks' kernels: figures as data that the page draws in its own theme.

`conf.py` puts it into the profile of IPython that the kernels start with.
"""

from typing import Any

import plotly.io
from plotly.io.base_renderers import MimetypeRenderer


class OnPage(MimetypeRenderer):
    """Hands a figure to docs/_static/figures.js."""

    def to_mimebundle(self, fig_dict: dict[str, Any]) -> dict[str, str]:
        """Return a place for the drawing and, in the next element, what is drawn there."""
        height = int(fig_dict['layout'].get('height', 400))
        data = plotly.io.json.to_json_plotly(fig_dict).replace('</', '<\\/')
        return {'text/html': f'<div class="drawing" style="height:{height}px"></div>'
                             f'<script type="application/json">{data}</script>'}


plotly.io.renderers['page'] = OnPage()
plotly.io.renderers.default = 'page'
