# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The workbench: a local web page that shows where a model fails and improves it.

What the page shows is worked out by plain Python (`session`, `drawings`, `explorer`, ...) that
knows no browser; `page` and the `..._view` modules put it on the screen with NiceGUI (extra
`web`); `main.run` starts it.
"""
