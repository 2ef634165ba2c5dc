# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of closed-loop runs."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.model import load_model
from fam_bundle_ros.plant import Dynamometer
from fam_bundle_ros.report import control_figures
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.simulation import ClosedLoop, Trajectory


@pytest.fixture(scope='module')
def log():
    """Return a run of half a second."""
    hold = Trajectory('hold', 'force', 0.5, lambda t: 30.0, lambda t: 0.0, Dynamometer(0.16))
    return ClosedLoop(load_model(config_path('models/spie2021.yaml'))).run(hold)


def test_states_of_a_run_are_named_on_their_strip(log):
    """Two states, two tints on the strip, and their names."""
    state = np.where(np.arange(len(log.time)) < 60, 1, 2)
    drawing = control_figures.run(replace(log, state=state))
    assert {note.text for note in drawing.layout.annotations} >= {'RS1', 'RS2'}
    assert len([s for s in drawing.layout.shapes if s.fillcolor]) == 4


def test_chatter_is_a_line_not_thousands_of_shapes(log):
    """A run that switches every second sample: no tint, every switch in one trace."""
    state = 1 + np.arange(len(log.time) * 8) // 2 % 2
    long = replace(log, **{name: np.repeat(getattr(log, name), 8, axis=0) for name in (
        'time', 'reference', 'force', 'strain', 'pressure', 'setpoint')}, state=state)
    drawing = control_figures.run(long)
    assert len(drawing.layout.shapes) < 5
    shown, = (trace for trace in drawing.data if trace.name == 'state')
    assert np.array_equal(shown.y, state)
