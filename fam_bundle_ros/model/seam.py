# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a loop needs of a model, plain or compiled (stand-in until branch a lands)."""

from typing import Any, NamedTuple


class Model(NamedTuple):
    """Force and volume of motor units, and what they read."""

    force: Any
    volume: Any
    volume_slope: Any
    shape: Any
    parameters: Any
    tables: Any
    memory: Any
    after: Any
