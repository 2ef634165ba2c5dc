# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Benchmarks: the figures that the project promises, measured anew."""
