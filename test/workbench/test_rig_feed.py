# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the page "Live" knows and draws of a running bundle."""

import math

import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.workbench.rig_drawings import live_figure
from fam_bundle_ros.workbench.rig_feed import LiveRig, Record

pytestmark = pytest.mark.anyio


def sample(time, squares=0.4, kind='force', **more):
    """Return a record of ten samples, each 0.2 N from the reference."""
    return {'kind': 'sample', 'time': time, 'force': 20.0, 'squares': squares, 'count': 10,
            'reference_kind': kind, 'reference': 20.2, 'pressure': [1e5, None], 'setpoint': [1e5],
            **more}


def test_tracking_is_that_of_the_last_minute_and_begins_anew_with_a_model():
    """Rms over a minute; another model, rig, kind of reference, a clock set back: from zero."""
    record = Record()
    assert math.isnan(record.tracking)
    record.take({'kind': 'state', 'file': 'one.yaml'})
    for k in range(300):
        record.take(sample(k, 0.4 if k > 200 else 1000.0))
    assert record.tracking == pytest.approx(0.2)
    assert record.samples[0]['time'] >= 299 - 20.0
    record.take({'kind': 'state', 'file': 'two.yaml'})
    assert math.isnan(record.tracking)
    record.take(sample(300.0, 90.0))
    record.take({'kind': 'state', 'file': 'two.yaml'})
    assert record.tracking == pytest.approx(3.0)
    record.take(sample(300.1, 1e-3, 'strain'))
    assert record.tracking == pytest.approx(0.01)
    record.take(sample(10.0))
    assert len(record.samples) == 1
    assert record.tracking == pytest.approx(0.2)
    record.forget_tracking()
    assert math.isnan(record.tracking)


def test_the_figure_has_what_was_heard_and_gaps_for_the_rest():
    """Force, its reference, pressures as told, noise band; None is a gap."""
    samples = [sample(0.1 * k, model=None if k == 1 else 19.0, residual=1.0, strain=0.1)
               for k in range(3)]
    figure = live_figure(samples, 0.5)
    traces = {trace['name']: trace for trace in figure['data']}
    assert list(traces['measured']['x']) == [-0.2, -0.1, 0.0]
    assert list(traces['model']['y']) == [19.0, None, 19.0]
    assert list(traces['MU1']['y']) == [100.0] * 3
    assert list(traces['MU2']['y']) == [None] * 3
    assert max(traces['noise, 95 %']['y']) == 1.0
    assert list(traces['strain']['y']) == [10.0] * 3
    assert list(traces['reference']['y']) == [20.2] * 3
    assert live_figure([], None)['data']


async def test_nobody_to_obey_and_bad_names_fail():
    """An order without a listener, and a namespace that is none, are told."""
    rig = LiveRig()
    with pytest.raises(InputError, match='reload the page'):
        await rig.order(call='diagnose')
    with pytest.raises(InputError, match='expected a ROS name'):
        await rig.listen('/bundle; rm')
    await rig.close()
