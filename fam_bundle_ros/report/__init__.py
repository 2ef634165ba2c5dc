# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Figures (plotly) and the self-contained HTML report.

Plotly is imported by the modules that draw, not here, as pages without figures use the palette.
"""
