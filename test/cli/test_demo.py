# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The runs of `demo`, in process: what their story says of recruitment is what happens."""

import pytest

from fam_bundle_ros.cli.demo import stories
from fam_bundle_ros.model import load_model
from fam_bundle_ros.report.demo_page import visited
from fam_bundle_ros.simulation import ClosedLoop


@pytest.mark.parametrize('story', [0, 1], ids=['force', 'strain'])
def test_the_second_unit_is_recruited_and_released(repository, story):
    """A force over the overlap and a mass that is lifted end where one unit is enough: RS1."""
    bundle = load_model(repository / 'config' / 'models' / 'spie2021.yaml')
    log = ClosedLoop(bundle).run(stories(bundle)[story][1])
    assert visited(log) == ['RS1', 'RS2', 'RS1']
