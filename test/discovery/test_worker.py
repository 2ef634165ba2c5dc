# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A diagnosis in a process of its own."""

import time

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.worker import Worker
from fam_bundle_ros.model import load_model
from fam_bundle_ros.resources import config_path


@pytest.fixture
def model():
    """Return a bundle of two motor units."""
    return load_model(config_path('models/spie2021.yaml'))


def measurement(units):
    """Return a minute of something, with so many motor units."""
    t = np.arange(0.0, 60.0, 0.02)
    return build('some', 0.1 + 0.05 * np.sin(t), np.full((len(t), units), 1e5) + 1e4 * t[:, None],
                 t, None, t)


def test_what_is_wrong_with_the_data_is_told(model, tmp_path):
    """Bad input comes back as a sentence, and nothing is written."""
    worker = Worker(model, measurement(1), tmp_path / 'answers', 'one')
    end = time.monotonic() + 60.0
    while (done := worker.poll()) is None and time.monotonic() < end:
        time.sleep(0.05)
    assert 'expected 2, one for each motor unit' in done.error
    assert not (tmp_path / 'answers').exists()


def test_it_ends_when_it_is_killed_and_when_its_starter_is_gone(model, tmp_path):
    """Neither leaves a process that works on."""
    first, second = (Worker(model, measurement(2), tmp_path, name) for name in ('a', 'b'))
    first.kill()
    assert first._process.poll() is not None
    second._feeder.join()
    # what the system does for a starter that was killed
    second._process.stdin.close()
    assert second._process.wait(60.0) == 1
    second.kill()
