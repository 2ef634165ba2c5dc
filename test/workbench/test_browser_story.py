# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The story in a real browser: hidden friction, 6.6 N, found, added, 0.88 N.

`make browser-test` keeps its pictures in docs/images.
"""

import csv

import pandas
from PIL import Image
import pytest

from fam_bundle_ros.model import loads_model
from fam_bundle_ros.resources import config_path
from test.workbench.conftest import Watched

CSV = config_path('data/examples/hidden_friction.csv')
MODEL = config_path('data/examples/hidden_friction.model.yaml')
FORMULA = '-k * tanh(strain_rate / v)'
#: The muscle of the example, as it is typed: a bare number is in the unit of its field.
MUSCLE = {'radius': '6.35', 'length': '127 mm', 'braid_angle': '33 deg',
          'wall_thickness': '1,59 mm', 'max_pressure': '413.7 kPa'}


def shows(page, selector, text):
    """Wait until an element holds a text: the parts of an answer come one by one."""
    from playwright.sync_api import expect
    expect(page.locator(selector)).to_contain_text(text, use_inner_text=True, timeout=60_000)


def climbs(page, *rungs):
    """Wait until the ladder has these rungs, each a label and an error, and no others."""
    from playwright.sync_api import expect
    expect(page.locator('.rung')).to_have_text(rungs, use_inner_text=True, timeout=60_000)


def settled(page, folder, name):
    """Keep a picture, if it is wanted, once curves are at rest and no button is pointed at."""
    if folder is None:
        return
    page.mouse.move(2, 400)
    page.evaluate('scrollTo(0, 0)')
    page.wait_for_timeout(900)
    path = folder / f'workbench_{name}.png'
    page.screenshot(path=path)
    with Image.open(path) as picture:
        # a third of the size, and nobody sees the difference
        picture.convert('RGB').quantize(192).save(path, optimize=True)


def press(page, mark):
    """Go on with Tab until a button has the focus, and can be seen to have it; press Enter."""
    for _ in range(40):
        page.keyboard.press('Tab')
        if page.evaluate('document.activeElement.dataset.mark') == mark:
            outline = page.evaluate('getComputedStyle(document.activeElement).outlineStyle')
            assert outline == 'solid'
            page.keyboard.press('Enter')
            return
    pytest.fail(f'{mark} was not reached')


def test_the_story_from_hidden_friction_to_a_better_model(watched, pictures, tmp_path):
    """
    A new user opens the example, asks what is missing, adds it, and takes the model home.

    Up to the better model Tab and Enter are enough.
    """
    tab = watched(device_scale_factor=1.5 if pictures else 1.0)
    page = tab.open()
    press(page, 'open-first')
    tab.drawn()
    climbs(page, 'original model 6.6 N')
    shows(page, 'h1', '11 times the noise')
    settled(page, pictures, '1_see')

    press(page, 'diagnose')
    page.wait_for_selector('[data-mark=next-add]', timeout=180_000)
    shows(page, 'h1', 'Found: Coulomb friction.')
    settled(page, pictures, '2_found')

    press(page, 'next-add')
    climbs(page, 'original model 6.6 N', '+ Coulomb friction 0.88 N')
    shows(page, 'h1', 'close to the noise of these data')
    settled(page, pictures, '3_added')

    taken = {}
    for kind in ('model', 'csv', 'report'):
        with page.expect_download() as download:
            tab.click(f'download-{kind}')
        taken[kind] = tmp_path / download.value.suggested_filename
        download.value.save_as(taken[kind])
    assert taken['model'].name == 'hidden_friction.model.yaml'
    force = loads_model(taken['model'].read_text()).effect('coulomb_friction').force
    assert force == pytest.approx(6.66, abs=0.1)
    with taken['csv'].open() as stream:
        assert len(list(csv.DictReader(stream))) == 1260
    assert taken['report'].stat().st_size > 1_000_000

    tab.click('try')
    page.wait_for_selector('text=Tracking error', timeout=120_000)
    page.wait_for_selector('.sheet .trace')
    settled(page, pictures, '4_controller')
    shows(page, '.sheet', '% less')
    shows(page, '.sheet', 'hidden_friction')
    tab.click('trial-close')


def test_a_log_of_ones_own_is_opened_from_a_workbook(watched, tmp_path):
    """An .xlsx of lengths, no model: columns and muscle are typed, and it opens as the example."""
    log = pandas.read_csv(CSV)
    pandas.DataFrame({
        'Zeit [s]': log['time [s]'], 'Versuch': log['trial'],
        'Muskell\u00e4nge [mm]': 127.0 * (1.0 - log['strain']),
        'Druck [bar]': log['pressure [kPa]'] / 100.0, 'Kanal 4': log['force [N]']}).to_excel(
            tmp_path / 'lab.xlsx', index=False, startrow=2)
    tab = watched()
    page = tab.open()
    page.set_input_files('input[type=file]', tmp_path / 'lab.xlsx')
    page.wait_for_selector("text=column 'force' is missing")
    assert page.locator('.tick').count() == 0
    page.select_option('[data-mark="map:Kanal 4:quantity"]', 'force')
    page.wait_for_selector('text=the longest here is 127 mm')
    assert page.locator('tbody tr').count() == 20
    page.select_option('[data-mark="muscle:start"]', 'bladder')
    for key, typed in MUSCLE.items():
        page.click(f'[data-mark="muscle:{key}"]')
        page.keyboard.type(typed)
    page.wait_for_selector('[data-mark="intake:use"]:not([disabled])')
    assert [page.input_value(f'[data-mark="muscle:{key}"]') for key in MUSCLE] == list(
        MUSCLE.values())
    assert page.locator('.tick').count() == 5
    tab.click('intake:use')
    tab.drawn()
    climbs(page, 'original model 6.6 N')
    shows(page, '.answer', 'my_muscle: mu1 of 1 muscle, radius 6.35 mm')
    page.wait_for_selector('[data-mark=diagnose]')


def test_a_bad_file_is_told_and_the_page_goes_on(watched, tmp_path):
    """Model dropped first: the sentence names file and row; then a good file opens with it."""
    bad = tmp_path / 'broken run.csv'
    rows = CSV.read_text().splitlines()
    rows[21] = 'abc' + rows[21]
    bad.write_text('\n'.join(rows) + '\n')
    tab = watched()
    page = tab.open()
    page.set_input_files('input[type=file]', MODEL)
    page.wait_for_selector('text=is ready')
    page.set_input_files('input[type=file]', bad)
    page.wait_for_selector('text=broken run.csv, row 22')
    tab.click('intake:other')
    page.set_input_files('input[type=file]', CSV)
    tab.drawn()
    shows(page, '.answer', 'hidden_friction.csv')
    shows(page, '.answer', 'hidden_friction_start')


def test_a_refused_file_is_not_listed_as_done(watched, tmp_path):
    """The message says why; no tick of the upload says otherwise."""
    notes = tmp_path / 'notes.txt'
    notes.write_text('we measured\non a Monday\n')
    page = watched().open()
    page.set_input_files('input[type=file]', notes)
    page.wait_for_selector('[data-mark="alert"]')
    page.wait_for_selector('.q-uploader__file', state='detached')


def test_every_figure_is_drawn_and_a_region_zooms_it(watched):
    """Curves, maps and loops have traces; a region frames and zooms, and lets go again."""
    tab = watched()
    page = tab.open()
    tab.click('example:bundle_push_back')
    tab.drawn()
    tab.click('figure:maps')
    page.wait_for_selector('.plot .hm')
    tab.click('region:0')
    page.wait_for_selector('.plot .shapelayer path >> nth=0')
    page.wait_for_selector('[data-mark="region:0"][aria-pressed=true]')
    tab.click('figure:curves')
    tab.drawn()
    zoomed = page.locator('.plot .point').count()
    tab.click('region:0')
    page.wait_for_function(f"document.querySelectorAll('.plot .point').length > {zoomed}")
    tab.click('figure:loops')
    tab.drawn()


@pytest.fixture(scope='module')
def example(chromium, server):
    """Yield a watched tab in which the example is open, and what changes moves."""
    tab = Watched(chromium, server, reduced_motion='no-preference')
    tab.open()
    tab.click('open-first')
    tab.drawn()
    yield tab
    tab.close()


@pytest.fixture(scope='module')
def typed(example):
    """Return the tab after a formula, its name and its values were typed key by key."""
    page = example.page
    example.click('write-own')
    # the new name first: its field is there once all have been drawn anew
    for mark, text in (('own-formula', FORMULA), ('own-name', 'my_rub'),
                       ('own:v:value', '0.002 1/s'), ('own:k:value', '6 N')):
        page.click(f'[data-mark="{mark}"]')
        page.keyboard.press('Control+A')
        page.keyboard.type(text, delay=15)
        if mark == 'own-formula':
            page.wait_for_selector('[data-mark="own:v:value"]')
    page.wait_for_selector('text=less than the present 6.6 N')
    return example


def test_a_hover_names_its_row_and_long_work_says_so(example):
    """The label names the row of the file; what takes long shows it, and can be ended."""
    page = example.page
    page.wait_for_timeout(600)
    place = page.locator('.plot .points path.point').nth(40).bounding_box()
    page.mouse.move(place['x'] + place['width'] / 2, place['y'] + place['height'] / 2)
    page.wait_for_selector('.hoverlayer >> text=/row \\d+/')
    example.click('diagnose')
    page.wait_for_selector('.busy', state='attached')
    example.click('cancel')
    page.wait_for_selector('.busy', state='detached')


def test_a_formula_is_typed_key_by_key(typed):
    """Formula, name, values with units stay as they are typed, and the error is predicted."""
    page = typed.page
    assert page.input_value('[data-mark="own-formula"]') == FORMULA
    assert page.input_value('[data-mark="own-name"]') == 'my_rub'
    assert page.input_value('[data-mark="own:k:value"]') == '6 N'
    page.wait_for_selector('.sheet .trace')


def test_curves_move_from_the_old_model_to_the_new_and_back(typed):
    """Between the old and the new place a curve is somewhere in between, or jumps if asked to."""
    page, shapes = typed.page, {}
    for motion, mark in (('no-preference', 'own-add'), ('reduce', 'undo')):
        if motion == 'reduce':
            # back again in a browser that wants nothing to move: the tab keeps its work
            page.emulate_media(reduced_motion='reduce')
            page.reload()
            typed.drawn()
        # Ten times slower: a busy machine that drops frames must not drop all of them.
        page.evaluate("""() => {
            const react = Plotly.react;
            Plotly.react = (plot, figure, config) => {
                if (figure.layout.transition) figure.layout.transition.duration *= 10;
                return react(plot, figure, config);
            };
            window.shapes = new Set();
            const look = () => {
                const trace = document.querySelectorAll('.plot .trace')[1];
                const line = trace?.querySelector('.lines path');
                if (line) window.shapes.add(line.getAttribute('d'));
                requestAnimationFrame(look);
            };
            look();
        }""")
        typed.click(mark)
        page.wait_for_function(f'window.shapes.size > {1 if motion == "reduce" else 2}')
        if motion == 'reduce':
            # more than the time of ten frames, of which each would have another shape
            page.wait_for_timeout(500)
        shapes[motion] = page.evaluate('window.shapes.size')
    assert shapes['no-preference'] > 2
    assert shapes['reduce'] == 2
