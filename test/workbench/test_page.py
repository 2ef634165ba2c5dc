# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The page, clicked through in Python by NiceGUI's simulated user: no browser needed."""

import asyncio
import re

from nicegui import Client, ui
from nicegui.elements.upload_files import SmallFileUpload
from nicegui.testing.user_simulation import user_simulation
import pytest

from fam_bundle_ros.discovery import compare
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.workbench.cases import EXAMPLES, load_example
from fam_bundle_ros.workbench.jobs import Job
from fam_bundle_ros.workbench.page import root
from fam_bundle_ros.workbench.session import short

pytestmark = pytest.mark.anyio
DATA = config_path('data/examples/hidden_friction.csv')
#: The muscle of the examples, as it is typed.
MUSCLE = {'radius': '6.35 mm', 'length': '127 mm', 'braid_angle': '33 deg',
          'wall_thickness': '1.59 mm', 'max_pressure': '413.7 kPa'}
_CASE = load_example('hidden_friction')
#: The error that the example starts with, as `compare` has it and the page writes it.
START = f'{short(compare(_CASE.model, _CASE.data).error_N)} N'


@pytest.fixture
async def user():
    """Yield a user who has opened the start page."""
    async with user_simulation(root=root()) as made:
        await opened(made)
        yield made


async def opened(user):
    """Open the page as a browser with light colours and nothing that moves."""
    user.javascript_rules[re.compile('.*matchMedia.*', re.S)] = lambda _: [False, True, False]
    await user.open('/')
    await user.should_see('fam_bundle', retries=30)


async def sees(user, seen, seconds=30.0):
    """Wait until the user sees something."""
    await user.should_see(seen, retries=int(10 * seconds))


async def open_first(user):
    """Open the example that the page recommends, and wait for its ladder."""
    user.find(marker='open-first').click()
    await sees(user, 'rung:0')
    await user.should_see(START)


def upload(user, name, content):
    """Drop a file on the page."""
    element, = user.find(marker='upload').elements
    return element.handle_uploads([SmallFileUpload(name, 'text/csv', content)])


def figure(user):
    """Return the figure on the page that has traces."""
    return next(plot.figure for plot in user.find(ui.plotly).elements if plot.figure['data'])


async def test_the_first_view_says_what_to_click(user):
    """One example is marked as the one to begin with; the others and the upload are there."""
    await user.should_see('New here?')
    await user.should_see(marker='open-first')
    await user.should_see(marker='upload')
    for example in EXAMPLES:
        await user.should_see(example.title)


async def test_cancel_leaves_everything_as_it_was(user):
    """After cancel the question can be asked again, and nothing was learned."""
    await open_first(user)
    user.find(marker='diagnose').click()
    await sees(user, 'Cancel')
    user.find(marker='cancel').click()
    await sees(user, 'What is missing?')
    await user.should_not_see('probability')


@pytest.mark.parametrize('outcome', ['found', 'failed'])
async def test_a_browser_that_left_during_a_diagnosis_is_not_drawn_to(
        user, outcome, friction_found, monkeypatch):
    """The log stays clean, and what was found is there when the tab is opened again."""
    await open_first(user)
    client = user.client

    async def leave(job):
        client.delete()
        if outcome == 'failed':
            raise InputError('no')
        return friction_found

    monkeypatch.setattr(Job, 'run', leave)
    drawn = []
    monkeypatch.setattr(Client, 'check_existence', lambda self: drawn.append(self._deleted))
    user.find(marker='diagnose').click()
    await asyncio.sleep(0.5)
    assert not any(drawn)
    await opened(user)
    await sees(user, 'Found: Coulomb friction' if outcome == 'found' else 'What is missing?')


async def test_an_uploaded_measurement_asks_for_the_muscle(user):
    """A dropped CSV shows its columns and opens once the muscle is told: none is assumed."""
    await upload(user, 'mine.csv', DATA.read_bytes())
    await sees(user, 'Are the columns of the file correct?')
    await user.should_see('Not yet: your muscle is not complete')
    await user.should_see('A muscle needs Radius')
    for key, value in MUSCLE.items():
        user.find(marker=f'muscle:{key}').trigger('input', value)
    await user.should_not_see('Not yet')
    user.find(marker='intake:use').click()
    await sees(user, 'mine.csv · your own file')
    await user.should_see('Model my_muscle: mu1 of 1 muscle, radius 6.35 mm, length 127 mm')
    await user.should_see('Where the model fails')
    user.find(marker='columns').click()
    await sees(user, 'Are the columns of the file correct?')
    user.find(marker='map:force [N]:quantity').trigger('change', '')
    await sees(user, "column 'force' is missing")
    user.find(marker='intake:back').click()
    await sees(user, 'Where the model fails')
    user.find(marker='tab:explore').click()
    await sees(user, 'Model my_muscle: mu1 of 1 muscle')


async def test_a_column_is_told_on_the_page(user):
    """A force of an unknown name: what is missing stands there until its column is told."""
    renamed = DATA.read_bytes().replace(b'force [N]', b'Kanal 3', 1)
    await upload(user, 'mine.csv', renamed)
    await sees(user, "Not yet: mine.csv: column 'force' is missing")
    await user.should_not_see('✓')
    user.find(marker='map:Kanal 3:quantity').trigger('change', 'force')
    await user.should_not_see("column 'force' is missing")
    await user.should_see('✓ N guessed, no unit given')
    user.find(marker='map:Kanal 3:unit').trigger('change', 'lbf')
    await sees(user, 'force -192 to 882 N')
    await user.should_see('✓ used')


async def test_voltages_are_told_on_the_page(user):
    """What one volt is worth: typed beside the column, which says until then what is expected."""
    head, *rows = DATA.read_text().splitlines()
    place = head.split(',').index('force [N]')
    cells = [row.split(',') for row in rows]
    for row in cells:
        row[place] = f'{float(row[place]) / 50.0:.6f}'
    await upload(user, 'volts.csv', '\n'.join([head.replace('force [N]', 'U_F [V]'),
                                               *map(','.join, cells)]).encode())
    await sees(user, 'in V: tell what one V is worth')
    user.find(marker='map:U_F [V]:quantity').trigger('change', 'force')
    await sees(user, "unit 'V' does not fit; expected a unit like N")
    user.find(marker='map:U_F [V]:scale').trigger('input', '* 50 N')
    await sees(user, '✓ as told: * 50 N')
    await user.should_see('force -43')


async def test_a_model_dropped_first_is_used(user):
    """Model, then data: the case starts from that model."""
    await upload(user, 'start.model.yaml',
                 config_path('data/dmsp20_static_map.model.yaml').read_bytes())
    await sees(user, 'Model dmsp20_ideal is ready')
    await upload(user, 'map.csv', config_path('data/dmsp20_static_map.csv').read_bytes())
    await sees(user, '151 N')


@pytest.mark.parametrize('endings', [('model.yaml', 'csv'), ('csv', 'model.yaml')])
async def test_a_model_and_its_data_are_dropped_together(user, endings):
    """Whichever comes first, nothing is asked."""
    element, = user.find(marker='upload').elements
    await element.handle_uploads([SmallFileUpload(
        f'map.{ending}', 'text/csv', config_path(f'data/dmsp20_static_map.{ending}').read_bytes())
        for ending in endings])
    await sees(user, '151 N')


async def test_the_muscle_is_edited_beside_the_plot(user):
    """Another radius changes the error that is predicted, and opens the case with it anew."""
    await open_first(user)
    user.find(marker='muscle:radius').trigger('input', '5 mm')
    await sees(user, 'With these dimensions the error would be')
    user.find(marker='muscle:radius').trigger('input', '5 kg')
    await sees(user, "Radius: unit 'kg' does not fit")
    user.find(marker='muscle:radius').trigger('input', '5')
    await sees(user, 'With these dimensions the error would be')
    user.find(marker='muscle:use').click()
    await sees(user, 'mu1 of 1 muscle, radius 5 mm, length 127 mm')
    await user.should_not_see(START)


async def test_a_wrong_unit_is_pointed_out(user):
    """Newtons under a header of lbf: the page says what to check before any physics."""
    await upload(user, 'start.model.yaml',
                 config_path('data/examples/hidden_friction.model.yaml').read_bytes())
    await sees(user, 'is ready')
    await upload(user, 'slip.csv', DATA.read_bytes().replace(b'force [N]', b'force [lbf]'))
    await sees(user, 'Check first: with a force in N, not in lbf')


@pytest.mark.parametrize(('name', 'content', 'said'), [
    ('broken.csv', DATA.read_bytes().splitlines()[0] + b'\n' + b'\n'.join(
        b'x' + row if k == 20 else row
        for k, row in enumerate(DATA.read_bytes().splitlines()[1:])), 'broken.csv, row 22'),
    ('words.csv', b'strain,pressure [kPa],force [N]\n0,1,x\n', "column 'force' is missing"),
    ('empty.csv', b'', 'empty'),
    ('photo.png', b'\x89PNG', "'.png' is not known"),
    ('bad.yaml', b'format: something', 'bad.yaml, line 1'),
    ('two.csv', b'strain,pressure.mu1 [kPa],force [N]\n', 'rows')])
async def test_a_bad_file_is_told_on_the_page(user, name, content, said):
    """The sentence stands on the page until it is closed, and the page goes on working."""
    await upload(user, name, content)
    await sees(user, said, 10.0)
    asks = name in ('broken.csv', 'words.csv')  # a table: its columns can be told
    user.find(marker='intake:other' if asks else 'close-alert').click()
    await user.should_not_see(said)
    await open_first(user)


async def test_the_caption_names_a_direction_only_where_there_is_one(user):
    """A static map has none."""
    await open_first(user)
    await user.should_see('Points: measured (open: lengthening).')
    user.find(marker='start-over').click()
    for ending in ('model.yaml', 'csv'):
        await asyncio.sleep(0.3)
        await upload(user, f'map.{ending}',
                     config_path(f'data/dmsp20_static_map.{ending}').read_bytes())
    await sees(user, 'Points: measured. Lines: model.')


async def test_selecting_draws_the_selected(user):
    """Choosing a pressure leaves its points alone on the figure."""
    await open_first(user)
    user.find(marker='pick:Pressure').trigger('change', '2')
    await asyncio.sleep(0.3)
    drawn = [trace for trace in figure(user)['data'] if trace['name'] == 'measured']
    assert [len(trace['x']) > 0 for trace in drawn] == [k == 2 for k in range(7)]


async def test_two_tabs_keep_their_own_work(user):
    """What one user opens another does not see, and comes back when the tab is loaded again."""
    await open_first(user)
    tab, user.tab_id = user.tab_id, 'another-tab'
    await opened(user)
    await user.should_see('New here?')
    user.tab_id = tab
    await opened(user)
    await sees(user, 'rung:0')


async def test_the_explorer_moves_with_its_sliders(user):
    """MU2 under pressure is RS2; strain zero has no dip."""
    user.find(marker='tab:explore').click()
    await sees(user, 'RS1: 1 of 2')
    user.find(marker='slider:mu2').trigger('input', '200')
    await sees(user, 'RS2: 2 of 2')
    user.find(marker='slider:strain').trigger('input', '0')
    await sees(user, 'no dip')
    user.find(marker='slider:strain').trigger('input', 'nan')
    await user.should_see('no dip')


async def test_an_effect_of_ones_own_is_tried_and_added(user):
    """Typing shows what a formula would do; a wrong unit is told; adding refits."""
    await open_first(user)
    user.find(marker='write-own').click()
    await sees(user, 'start, with unit')
    user.find(marker='own-formula').trigger('input', '-k * tanh(strain_rate / (v))')
    await sees(user, 'parameter')
    user.find(marker='own:v:value').trigger('input', '0.002 1/s')
    user.find(marker='own:k:value').trigger('input', '5 kg')
    await sees(user, 'must give N')
    user.find(marker='own:k:value').trigger('input', '6 N')
    await sees(user, f'less than the present {START}')
    user.find(marker='own-add').click()
    await sees(user, '+ my effect')
    with user.scope('rung:1'):
        await user.should_see('0.88 N')


async def test_the_page_opens_with_the_case_of_the_command_line():
    """`fam_bundle workbench DATA` shows the data at once."""
    async with user_simulation(root=root(load_example('nothing_missing'))) as made:
        await opened(made)
        await sees(made, 'the residual is noise')


async def test_downloads_arrive(user):
    """Model file and CSV come as they are, not as an address."""
    await open_first(user)
    for mark, inside in (('model', b'fam-bundle-model/1'), ('csv', b'model_force [N]')):
        waiting = asyncio.create_task(user.download.next(timeout=10.0))
        await asyncio.sleep(0)
        user.find(marker=f'download-{mark}').click()
        assert inside in (await waiting).content
