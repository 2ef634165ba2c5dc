# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The page "Live" by records alone, as the listener of a running bundle tells them."""

import asyncio
import re

from nicegui import ui
from nicegui.testing.user_simulation import user_simulation
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.workbench import rig_view
from fam_bundle_ros.workbench.page import root
from fam_bundle_ros.workbench.rig_feed import LiveRig

pytestmark = pytest.mark.anyio
STATE = {'kind': 'state', 'file': 'models/spie2021.yaml', 'model': 'spie2021', 'holds': True,
         'looks': 12, 'words': 'the model holds: its mean error was small', 'error_N': 0.912,
         'noise_N': 0.9, 'diagnosing': None, 'failure': '', 'candidate': None}
FOUND = {'kind': 'diagnosis', 'verdict': 'missing_effect', 'effects': ['coulomb_friction'],
         'replaced': {}, 'summary': 'coulomb_friction explains the error', 'error_N': {
             'model': 8.0, 'best': 0.5}, 'next_experiment': 'sweep', 'model_file': 'b.model.yaml'}
CANDIDATE = {'file': 'b.model.yaml', 'error_N': 0.57, 'present_N': 7.99, 'refusal': ''}


class Told(LiveRig):
    """A rig that is told by the test what was heard, and remembers what it was ordered."""

    def __init__(self):
        super().__init__()
        self.orders = []

    async def listen(self, namespace):
        """Hear nothing by itself."""

    async def order(self, **order):
        """Refuse to apply, agree to all else."""
        self.orders.append(order)
        if order.get('call') == 'apply_model':
            await asyncio.sleep(0.3)
            raise InputError('it predicts the memory no better')
        return 'so be it'

    def hear(self, *records):
        """Take records, and a sample after them."""
        for record in records:
            self.record.take(record)
        time = self.record.now.get('time', 0.0) + 1.0
        self.record.take({'kind': 'sample', 'time': time, 'force': 20.0, 'model': 19.0,
                          'residual': 1.0, 'strain': 0.1, 'recruitment': 2, 'reference': 21.0,
                          'reference_kind': 'force', 'squares': 10.0, 'count': 10,
                          'pressure': [1e5], 'setpoint': [1e5]})


@pytest.fixture
async def page(monkeypatch):
    """Yield a user on the page, and the rig that he looks at."""
    rig = Told()
    monkeypatch.setattr(rig_view, '_rig', rig)
    monkeypatch.setattr(rig_view.live, 'available', lambda: True)
    async with user_simulation(root=root(view='live')) as user:
        user.javascript_rules[re.compile('.*matchMedia.*', re.S)] = lambda _: [False, True, False]
        await user.open('/')
        yield user, rig


async def sees(user, seen):
    """Wait until the user sees something."""
    await user.should_see(seen, retries=100)


def able(user, mark):
    """Return whether a button can be pressed."""
    button, = user.find(marker=mark).elements
    return not button._props.get('disabled', False)


async def test_without_a_bundle_it_says_how_to_start_one(page):
    """No topic is there: what to type, and a button; nothing can be asked."""
    user, _ = page
    await sees(user, 'No bundle is running under /bundle')
    await user.should_see('ros2 run fam_bundle_ros bundle_bringup')
    await user.should_see('Start a simulated bundle')
    assert not able(user, 'live:diagnose')


async def test_a_bundle_without_a_monitor_is_shown_and_said(page):
    """Force and tracking error are there, a judgement is not."""
    user, rig = page
    rig.hear()
    await sees(user, 'The bundle runs without model_monitor')
    await user.should_see('1 N')
    await user.should_see('RS2')
    await user.should_not_see('Start a simulated bundle')
    assert not able(user, 'live:diagnose')


async def test_from_a_failure_to_a_candidate_and_its_refusal(page):
    """What is seen, what can be pressed at each step, and the reason where it is refused."""
    user, rig = page
    rig.hear({**STATE, 'looks': 0})
    await sees(user, 'Watching the model')
    rig.hear(STATE, {'kind': 'graph', 'nodes': ['plant_simulator'], 'rig': True})
    await sees(user, 'The model holds')
    await user.should_see('0.91 N')
    user.find(marker='live:hide').click()
    await sees(user, 'so be it')
    assert rig.orders[-1] == {'set': 'hidden_effect', 'of': 'plant_simulator',
                              'value': 'coulomb_friction: {force: 4 N}'}
    rig.hear({**STATE, 'holds': False, 'error_N': 7.44, 'words': 'everywhere'})
    await sees(user, 'The model no longer holds')
    await user.should_see('7.44 N')
    await user.should_see('spie2021: everywhere')
    assert not able(user, 'live:apply')
    rig.hear({**STATE, 'diagnosing': {'share': 0.4, 'words': 'trying sets'}})
    await sees(user, '40 %, trying sets ...')
    assert not able(user, 'live:diagnose')
    rig.hear(FOUND, {**STATE, 'holds': False, 'candidate': CANDIDATE})
    await sees(user, 'Found: Coulomb friction')
    await user.should_see('Apply reduces the error from 7.99 N to 0.57 N.')
    assert able(user, 'live:apply')
    # the second of two clicks, while the answer is due, orders nothing
    for _ in range(2):
        user.find(marker='live:apply').click()
        await asyncio.sleep(0.05)
        assert not able(user, 'live:apply')
    await sees(user, 'it predicts the memory no better')
    assert sum(order.get('call') == 'apply_model' for order in rig.orders) == 1
    plot, = (each for each in user.find(ui.plotly).elements if each.figure['data'])
    assert any(trace.get('name') == 'residual' for trace in plot.figure['data'])
