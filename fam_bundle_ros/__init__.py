# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Variable-recruitment control of fluidic artificial muscle bundles on ROS 2."""

__version__ = '0.1.0'
