# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The workbench: a local web page that shows where a model fails and improves it.

The content of the page is computed by plain Python (`session`, `drawings`, `explorer`, ...)
without a browser; `page` and the `..._view` modules display it with NiceGUI (extra `web`);
`main.run` starts it.
"""
