# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The page "Live" in a real browser, over real ROS, with a simulated bundle."""

import time

import pytest

pytest.importorskip('rclpy', reason='rclpy is not installed')

from test.workbench.test_browser_story import settled


def test_a_hidden_effect_is_noticed_named_and_brought_into_the_model(watched, pictures, domain_id):
    """Friction comes into the rig; the page says so, names it, and both errors fall."""
    tab = watched(device_scale_factor=1.5)
    page = tab.open('live')
    t0 = time.time()

    def said(key):
        return page.inner_text(f'[data-mark="live:{key}"]')

    def newton(key):
        return float(said(key).split()[0])

    def heard(words, seconds=40):
        page.wait_for_selector(f'text={words}', timeout=1000 * seconds)
        print(words, round(time.time() - t0, 1), said('error'), said('tracking'))

    heard('No bundle speaks under /bundle')
    tab.click('live:simulate')
    heard('The model holds')
    right = newton('error')
    tab.click('live:hide')
    heard('The model no longer holds')
    page.wait_for_timeout(7000)
    tab.click('live:diagnose')
    heard('Found: Coulomb friction')
    heard('Apply brings')
    wrong, tracked = newton('error'), newton('tracking')
    settled(page, pictures, '5_live')
    tab.click('live:apply')
    heard('in use since now')
    page.wait_for_timeout(6000)
    heard('The model holds')
    print(right, wrong, newton('error'), tracked, newton('tracking'), time.time() - t0)
    assert newton('error') < 0.5 * wrong
    assert newton('tracking') < 0.8 * tracked
