# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Results as JSON."""

import json

import numpy as np
import pytest

from fam_bundle_ros.jsonfile import write_json


def test_json_is_strict(tmp_path):
    """Arrays, numpy numbers and nan come out as JSON that every reader takes."""
    path = write_json(tmp_path / 'a.json', {'x': np.array([1.0, np.nan, np.inf]),
                                            'n': np.int64(3), 'on': np.bool_(False)})
    assert json.loads(path.read_text(), parse_constant=pytest.fail) == {
        'x': [1.0, None, None], 'n': 3, 'on': False}
