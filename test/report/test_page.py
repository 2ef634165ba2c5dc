# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A page is one file that shows what it was given, draws it, and asks the network nothing."""

import re

import pytest

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.report.page import Headline, Page, Picture, render, Section, Table, write_page


@pytest.fixture
def page():
    """Return a page with a figure whose name tries to break out of it."""
    drawing = plotting.figure('strain', 'force (N)')
    drawing.add_trace(plotting.line([0.0, 0.1], [1.0, 2.0], '</script><b>bold', palette.effect(
        'mesh')))
    return Page('Title <1>', 'Lead & more', [Headline('error', '4 N', 'rms')], [
        Section('One', 'Text', [
            Picture('figure-1', 'A figure', drawing, 'A caption'),
            Table(('effect', 'value (N)', 'note'),
                  [(('effect', 'mesh'), 1234.5678, None),
                   (('effect', 'slack'), float('nan'), True)])])],
        [('seed', '1')])


def test_text_is_shown_as_it_is(page):
    """Names from files and models cannot add elements or scripts to the page."""
    text = render(page)
    assert '<h1>Title &lt;1&gt;</h1>' in text
    assert '</script><b>bold' not in text
    assert 'Lead &amp; more' in text


def test_tables_show_numbers_as_people_write_them(page):
    """Three digits are enough; what is not there is a dash; names carry their colour."""
    text = render(page)
    assert '<td class=number>1235</td>' in text
    assert '<td class=number>–</td>' in text
    assert palette.effect('mesh').light in text
    assert 'slack</span>' in text


def test_nothing_is_fetched(page):
    """No element of the page names an address, plotly's own code aside."""
    text = re.sub(r'<script>.*?</script>', '', render(page), flags=re.S)
    assert not re.search(r'(src|href)="(https?:)?//|@import|url\(', text)


@pytest.mark.parametrize('theme', ['light', 'dark'])
def test_a_browser_draws_every_figure_in_its_theme(page, tmp_path, chromium, theme):
    """Chromium, without a network, draws the figure, and in dark with the dark colours."""
    path = write_page(tmp_path / 'page.html', page)
    tab = chromium.new_page(offline=True)
    tab.goto(f'{path.as_uri()}#{theme}')
    tab.wait_for_selector('html[data-drawn=yes]')
    drawn = tab.inner_html('.drawing')
    tab.close()
    red, green, blue = (int(getattr(palette.effect('mesh'), theme)[k:k + 2], 16)
                        for k in (1, 3, 5))
    assert f'stroke: rgb({red}, {green}, {blue})' in drawn


def test_a_printed_figure_is_as_wide_as_the_paper(page, tmp_path, chromium):
    """A4 has 190 mm between its margins, 718 px; after printing the figure fills the window."""
    path = write_page(tmp_path / 'page.html', page)
    tab = chromium.new_page(viewport={'width': 1280, 'height': 800})
    tab.goto(path.as_uri())
    tab.wait_for_selector('html[data-drawn=yes]')
    tab.evaluate("""() => { window.widths = [];
        ['beforeprint', 'afterprint'].forEach((name) => window.addEventListener(name, () =>
            window.widths.push(document.querySelector('.main-svg').clientWidth))); }""")
    printed = tab.pdf(format='A4')
    tab.wait_for_function('window.widths.length == 2')
    on_paper, on_screen = tab.evaluate('window.widths')
    tab.close()
    assert printed.startswith(b'%PDF')
    assert on_paper < 718 < on_screen
