# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Anti-windup: integrals stop where the last command was saturated. Kernels."""

from typing import Any

#: Names of the kinds of saturation; only 'high' and 'low' stop integrals.
SATURATION = ('', 'high', 'low', 'gap')
FREE, HIGH, LOW, GAP = 0, 1, 2, 3


def integrate_error(state: Any, step: float, saturated: int) -> None:
    """Integrate unless that would push further into a limit (conditional integration)."""
    if not ((saturated == HIGH and step > 0.0) or (saturated == LOW and step < 0.0)):
        state.integral += step


def unwind(state: Any, error: float, excess: float, saturated: int) -> None:
    """
    Take the integral's part of a demand beyond the limit away once the error has turned back.

    Parameters
    ----------
    state : record with ``integral``
    error : float
        Reference minus reading.
    excess : float
        Last demand minus what the saturated pressures give.
    saturated : int
    """
    if saturated == HIGH and error < 0.0:
        state.integral -= min(max(excess, 0.0), max(state.integral, 0.0))
    elif saturated == LOW and error > 0.0:
        state.integral -= max(min(excess, 0.0), min(state.integral, 0.0))
