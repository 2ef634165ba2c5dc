# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""In a real browser: sizes, keyboard, contrast, dark, and what must not be reached."""

from types import SimpleNamespace
import urllib.error
import urllib.request

import pytest

from fam_bundle_ros.resources import config_path
from test.workbench.conftest import Watched

VIEWS = ('start', 'intake', 'case', 'explorer')
CSV = config_path('data/examples/hidden_friction.csv')
# The ratio of WCAG between the text of an element and what is painted behind it.
CONTRAST = """() => {
  const parse = (c) => c.match(/[\\d.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b].map(v => v / 255).map(
    v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const behind = (e) => { for (; e; e = e.parentElement) {
    const c = parse(getComputedStyle(e).backgroundColor);
    if (c.length < 4 || c[3] > 0.5) return c; } return [255, 255, 255]; };
  const bad = [];
  for (const e of document.querySelectorAll('.wb *')) {
    if (![...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim())) continue;
    if (e.closest('.plot, .skip, :disabled, option, svg') || !e.offsetParent) continue;
    const a = light(parse(getComputedStyle(e).color)), b = light(behind(e));
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) bad.push(`${e.textContent.trim().slice(0, 40)}: ${ratio.toFixed(2)}`);
  }
  return bad;
}"""
LOOKS = {
    'width': 'document.documentElement.scrollWidth', 'faint': CONTRAST,
    'paper': 'getComputedStyle(document.body).backgroundColor',
    'nameless': """() => [...document.querySelectorAll('button, input, select, a')].filter(e =>
        e.offsetParent && !e.innerText?.trim() && !e.getAttribute('aria-label')
        && !e.closest('label') && !e.closest('.q-uploader')).map(e => e.outerHTML)"""}


def show(tab, view):
    """Bring the next view on the screen: each comes from the one before."""
    page = tab.page
    if view == 'start':
        return tab.open()
    if view == 'intake':
        page.set_input_files('input[type=file]', CSV)
        page.wait_for_selector('[data-mark="intake:use"]')
    elif view == 'case':
        tab.click('intake:other')
        tab.click('open-first')
        tab.drawn()
    elif view == 'explorer':
        tab.click('tab:explore')
        tab.drawn()
    return page


#: The button to go on with in a view.
STEPS = {'start': 'open-first', 'case': 'diagnose'}
BOTTOM = 'e => e.getBoundingClientRect().bottom + scrollY'


# The narrow one is as high as a phone, whose width has the same rules.
@pytest.fixture(scope='module', params=[(1280, 720, 'light'), (320, 844, 'dark')],
                ids=['laptop', 'narrow'])
def seen(chromium, server, request):
    """Return the size and colours of a screen, and by view what the scripts find on it."""
    width, height, scheme = request.param
    tab = Watched(chromium, server, viewport={'width': width, 'height': height},
                  color_scheme=scheme)
    found, bottoms = {}, {}
    for view in VIEWS:
        page = show(tab, view)
        if view in STEPS:
            bottoms[view] = page.wait_for_selector(f'[data-mark={STEPS[view]}]').evaluate(BOTTOM)
        if view == 'case':
            tab.click('muscle:open')
            page.wait_for_selector('[data-mark="muscle:use"]')
        page.wait_for_timeout(300)
        found[view] = {name: page.evaluate(script) for name, script in LOOKS.items()}
    tab.close()
    return SimpleNamespace(width=width, height=height, scheme=scheme, views=found,
                           bottoms=bottoms)


@pytest.fixture(scope='module')
def explorer(chromium, server):
    """Yield a watched tab of light colours with the explorer in it."""
    tab = Watched(chromium, server, color_scheme='light')
    tab.open()
    show(tab, 'explorer')
    yield tab
    tab.close()


def test_nothing_is_cut_off(seen):
    """On a laptop and on a narrow phone no view is wider than the screen."""
    assert {view: look['width'] for view, look in seen.views.items()
            if look['width'] > seen.width} == {}


def test_words_stand_out(seen):
    """All text has a contrast of 4.5 to 1 at least, light and dark, as the system asks."""
    assert [text for look in seen.views.values() for text in look['faint']] == []
    assert {look['paper'] == 'rgb(255, 255, 255)' for look in seen.views.values()} == {
        seen.scheme == 'light'}


def test_every_control_has_a_name(seen):
    """Screen readers find words on every button, field and slider of every view."""
    assert [control for look in seen.views.values() for control in look['nameless']] == []


def test_the_first_step_is_on_the_first_screen(seen):
    """On a laptop and on a phone the button to begin with needs no scrolling, nor the next."""
    assert set(seen.bottoms) == set(STEPS)
    assert max(seen.bottoms.values()) < seen.height


def test_the_theme_button_changes_page_and_figures(explorer):
    """Dark is dark for the axes of a figure too, and back again."""
    page = explorer.page
    ink = "getComputedStyle(document.querySelector('.plot .ytick text') ?? document.body).fill"
    page.wait_for_selector('.plot .ytick text')
    before = page.evaluate(ink)
    explorer.click('theme')
    page.wait_for_function(f'() => document.querySelector(".plot .ytick text") && {ink} !== '
                           f'"{before}"')
    explorer.click('theme')
    page.wait_for_function(f'() => {ink} === "{before}"')


def test_the_sliders_teach_the_overlap(explorer):
    """Moving MU2 by keyboard makes RS2, and the figure of the free strain is there."""
    page = explorer.page
    slider = page.locator('[data-mark="slider:mu2"]')
    slider.focus()
    for _ in range(8):
        page.keyboard.press('PageUp')
    page.wait_for_selector('text=RS2: 2 of 2')
    assert page.locator('.plot').count() == 3


@pytest.mark.parametrize('path', [
    '..%2f..%2f..%2fetc/passwd', '%2e%2e/%2e%2e/etc/passwd', 'static/../../etc/passwd',
    '_nicegui/../../../../etc/passwd', '_nicegui/3/static/..%2f..%2f..%2f..%2fetc%2fpasswd',
    'config/data/dmsp20_static_map.csv', '_nicegui/auto/static/x', 'docs', 'openapi.json'])
def test_no_path_of_the_browser_reaches_the_disk(server, path):
    """Whatever the address, no file of the machine comes back."""
    try:
        with urllib.request.urlopen(server + path) as answer:
            content = answer.read()
    except urllib.error.HTTPError as error:
        content = error.read()
    assert b'root:' not in content
    assert b'force [N]' not in content


def test_an_upload_above_the_limit_is_refused(server):
    """Two gigabytes are refused by their header, before anything is read."""
    asked = urllib.request.Request(server + '_nicegui/client/x/upload/1', data=b'x', method='POST',
                                   headers={'Content-Length': str(2 << 30)})
    with pytest.raises(urllib.error.HTTPError) as error:
        urllib.request.urlopen(asked)
    assert error.value.code == 413
