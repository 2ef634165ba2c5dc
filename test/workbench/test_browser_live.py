# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The page "Live" in a real browser, over real ROS, with a simulated bundle."""

import pytest

pytest.importorskip('rclpy', reason='rclpy is not installed')

from test.workbench.test_browser_story import settled


def test_a_hidden_effect_is_noticed_named_and_brought_into_the_model(watched, pictures, domain_id):
    """Friction comes into the rig; the page says so, names it, and both errors fall."""
    tab = watched(device_scale_factor=1.5 if pictures else 1.0)
    page = tab.open('live')

    def sees(words):
        page.wait_for_selector(f'text={words}', timeout=120_000)

    def newton(key):
        return float(page.inner_text(f'[data-mark="live:{key}"]').split()[0])

    sees('No bundle is running under /bundle')
    tab.click('live:simulate')
    sees('The model holds')
    right = newton('error')
    tab.click('live:hide')
    sees('The model no longer holds')
    # a full to and fro at every force is what a diagnosis wants
    page.wait_for_timeout(5000)
    tab.click('live:diagnose')
    sees('Found: Coulomb friction')
    sees('Apply reduces')
    page.wait_for_selector('text=the next experiment of the diagnosis', state='attached')
    wrong, tracked = newton('error'), newton('tracking')
    settled(page, pictures, '5_live')
    told = page.locator('[data-mark="live:told"]')
    told.evaluate("""told => {
        new MutationObserver(() => { window.emptied ||= !told.innerText; }).observe(
            told, {childList: true, characterData: true, subtree: true});
    }""")
    for _ in range(120):
        page.evaluate('window.emptied = false')
        tab.click('live:apply')
        # a busy page shows the last answer on; asked twice, the second is that it is in use
        page.wait_for_function("""window.emptied && document.querySelector(
            '[data-mark="live:told"]').innerText""")
        if 'try again in a second' not in told.inner_text():
            break
        # the controller still compiles the new model
        page.wait_for_timeout(1000)
    assert 'is in use now' in told.inner_text()
    sees('The model holds')
    for key, most in (('error', 0.6 * wrong), ('tracking', tracked)):
        page.wait_for_function(
            "([mark, most]) => parseFloat(document.querySelector(`[data-mark='${mark}']`)"
            '.innerText) < most', arg=[f'live:{key}', most], timeout=120_000)
    assert newton('error') > right
