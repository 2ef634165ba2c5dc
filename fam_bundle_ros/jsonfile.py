# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Results as strict JSON."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from fam_bundle_ros.atomic import write_whole
from fam_bundle_ros.told import Told


def plain(value: Any) -> Any:
    """
    Return numbers, text, lists and dicts for JSON; nan and infinity become null.

    Examples
    --------
    >>> plain({'force': np.array([1.0, np.nan]), 'on': np.bool_(True)})
    {'force': [1.0, None], 'on': True}
    """
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return str(value)


def to_json(value: Any) -> str:
    """Return a result as strict JSON (without nan and infinity)."""
    return json.dumps(plain(value), indent=2, allow_nan=False, ensure_ascii=False) + '\n'


def write_json(path: str | Path, value: Any) -> Path:
    """Write a result as JSON, atomically."""
    return write_whole(path, to_json(value))


class Answer(Told, ABC):
    """Base of results that can be written as JSON."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and text."""

    def to_json(self) -> str:
        """Return `to_dict` as strict JSON (numbers that are not finite become null)."""
        return to_json(self.to_dict())
