# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""State of a pressure loop besides the PID: last values, duration of an error, gas volume."""

import math
import time
from typing import Any

import numpy as np


class Latest:
    """The last value and rate of an optional reading, until it is too old."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._value, self._received = (math.nan, math.nan), -math.inf
        self._seen = False

    def take(self, value: float, rate: float = math.nan) -> None:
        """Take a reading."""
        self._value, self._received = (value, rate), time.monotonic()
        self._seen = self._seen or math.isfinite(value)

    def value(self, patience: float) -> tuple[float, float]:
        """Return value and rate, nan where they are older than ``patience`` (s)."""
        fresh = time.monotonic() - self._received <= patience
        return self._value if fresh else (math.nan, math.nan)

    def lost(self, patience: float) -> bool:
        """Whether the reading was available and is now older than ``patience`` (s)."""
        return self._seen and not math.isfinite(self.value(patience)[0])


class Stretch:
    """Time for which a value has been beyond a bound on one side."""

    def __init__(self) -> None:
        self.lasted = 0.0
        self._side, self._since = 0, 0.0

    def see(self, now: float, value: float, far: float) -> None:
        """Take a value at a time (s); the bounds are -``far`` and ``far``."""
        side = (value > far) - (value < -far)
        if side != self._side or now < self._since:
            self._side, self._since = side, now
        self.lasted = now - self._since if side else 0.0


class LongestGap:
    """
    The longest gap between recent readings.

    Parameters
    ----------
    window : float, s
        Gaps count for this time at least and for twice this time at most.

    Examples
    --------
    >>> gaps = LongestGap(1.0)
    >>> gaps.see(0.0, 0.05), gaps.see(0.5, 0.005), gaps.see(1.2, 0.005), gaps.see(2.3, 0.005)
    (0.05, 0.05, 0.05, 0.005)
    """

    def __init__(self, window: float):
        self._window = window
        self._since = -math.inf
        self._before = self._lately = 0.0

    def see(self, now: float, gap: float) -> float:
        """Take a gap (s) that ended ``now``; return the longest."""
        if now - self._since >= self._window:
            self._since, self._before, self._lately = now, self._lately, 0.0
        self._lately = max(self._lately, gap)
        return max(self._before, self._lately)


class Volume:
    """Table of gas volume and slope over strain, as the model is too slow for every tick."""

    def __init__(self, bundle: Any, index: int, tube: float):
        self._grid = np.linspace(-0.15, 0.5, 651)
        volume = np.maximum(bundle.gas_volume(self._grid)[:, index], 0.0) + max(tube, 1e-7)
        self._volume = volume.tolist()
        self._slope = np.gradient(volume, self._grid).tolist()
        #: Smallest and largest volume in operation (strain 0 to 0.3), m^3.
        self.ends = min(self._volume[150:451]), max(self._volume[150:451])

    def at(self, strain: float) -> tuple[float | None, float]:
        """Return volume (m^3) and dV/dstrain; (None, 0) where the strain is not known."""
        if not -0.15 <= strain <= 0.5:
            return None, 0.0
        k = round((strain + 0.15) * 1000.0)
        return self._volume[k], self._slope[k]
