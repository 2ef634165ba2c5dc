# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Campaigns over many recordings, and the pool of processes that benchmarks use too.

    found = run_campaign('recordings', 'model.yaml', 'results')
"""

from typing import Any

__all__ = ['Campaign', 'run_campaign']


def __getattr__(name: str) -> Any:
    # imported on demand, as benchmarks need only the pool
    if name in __all__:
        from fam_bundle_ros.campaign import campaign
        return getattr(campaign, name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
