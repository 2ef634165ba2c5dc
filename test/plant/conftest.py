# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A bundle for the rigs of these tests."""

import pytest

from fam_bundle_ros.model import load_model
from fam_bundle_ros.resources import config_path


@pytest.fixture(scope='session')
def bundle():
    """Return the paper's bundle: two motor units of one muscle each."""
    return load_model(config_path('models/spie2021.yaml'))
