# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Many recordings or runs on one machine or many: campaigns, and the pool that benchmarks share.

    found = run_campaign('recordings', 'model.yaml', 'results')
"""

from typing import Any

__all__ = ['Campaign', 'run_campaign']


def __getattr__(name: str) -> Any:
    # late: benchmarks need the pool alone
    if name in __all__:
        from fam_bundle_ros.campaign import campaign
        return getattr(campaign, name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
