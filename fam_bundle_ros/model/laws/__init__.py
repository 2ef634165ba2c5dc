# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The laws, one file per family. `fam_bundle_ros.model.catalogue` lists them in order."""
