# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""``python -m fam_bundle_ros``: the same as ``fam_bundle``."""

import sys

from fam_bundle_ros.cli import main

sys.exit(main())
