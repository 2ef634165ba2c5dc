# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands on measurements: what they find, and one line for what is wrong with a file."""

from functools import partial
import json
import shlex

import numpy as np
import pytest
from typer.testing import CliRunner

from fam_bundle_ros import discovery
from fam_bundle_ros.cli.app import app
from fam_bundle_ros.cli.common import candidate_table
from fam_bundle_ros.discovery.result import Candidate
from fam_bundle_ros.model.modelfile import load_model
from fam_bundle_ros.resources import model_path

HEADER = 'strain,pressure [kPa],force [N]\n'
ROWS = ''.join(f'{0.01 * (i % 20):.2f},{100 * (1 + i // 20)},{50 - i % 20}\n' for i in range(60))


def test_compare_tells_how_large_the_error_is_and_where(fam_bundle, tmp_path):
    """`compare` of the ideal braid with the measured DMSP-20 map: some 150 N, page and JSON."""
    result = fam_bundle('compare', 'dmsp20_static_map', '--model', 'dmsp20_static_map', '--out',
                        'page.html', '--json', 'result.json')
    assert result.returncode == 0, result.stderr
    found = json.loads((tmp_path / 'result.json').read_text())
    assert 140.0 < found['error_N'] < 160.0
    assert found['located']
    assert '151 N rms' in result.stdout
    page = (tmp_path / 'page.html').read_text()
    assert page.count('class="drawing"') == 2
    assert found['data_sha256'][:16] in page


@pytest.fixture
def alone(monkeypatch):
    """Limit searches to one effect: what is found is the claim of test/discovery."""
    monkeypatch.setattr(discovery, 'Choices', partial(discovery.Choices, most=1))


@pytest.mark.usefixtures('alone')
def test_diagnose_names_the_hidden_effect(fam_bundle, repository, tmp_path):
    """
    `diagnose` on loops of a muscle with hidden dry friction names it, in JSON too.

    The file has columns and signs of its own. What is said to type next takes the same ones, and
    where there is a better.yaml, that of an earlier step, it writes another file.
    """
    (tmp_path / 'better.yaml').write_text('an earlier step')
    case = repository / 'test/data/practice/p03'
    rows = [','.join(row[:4]) + f',{-float(row[4]):.4f}' for row in lab_rows(repository)]
    (tmp_path / 'one.csv').write_text('\n'.join(['c1,c2,c3,c4,c5', *rows]))
    result = fam_bundle('diagnose', 'one.csv', '--model', f'{case}.model.yaml', '--columns',
                        'time=c1 [ms]', '--columns', 'trial=c2', '--columns', 'length=c3 [mm]',
                        '--columns', 'pressure=c4 [bar]', '--columns', 'force=-c5 [N]',
                        '--out', 'page.html', '--json', 'result.json', '--protocol-out',
                        'next.yaml')
    assert result.returncode == 0, result.stderr
    assert 'fam_bundle measure next.yaml --model' in result.stdout
    planned = fam_bundle('measure', 'next.yaml', '--model', f'{case}.model.yaml', '--dry-run')
    assert planned.returncode == 0, planned.stderr
    assert 'segments, ' in planned.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        'better.yaml', 'next.yaml', 'one.csv', 'page.html', 'result.json']
    found = json.loads((tmp_path / 'result.json').read_text())
    keys = {'verdict', 'noise_floor_N', 'error_N', 'effects', 'ranking', 'tied', 'located',
            'next_experiment'}
    assert keys <= set(found)
    assert (found['data']['rows'], found['data']['dropped']) == (1260, {})
    assert set(found['error_N']) >= {'model', 'recalibrated', 'best'}
    named = {*found['effects'], *(name for tie in found['tied'] for name in tie)}
    assert named & {'coulomb_friction', 'presliding_hysteresis'}
    assert found['error_N']['best'] < 0.3 * found['error_N']['model']
    entry = found['ranking'][0]
    assert {'effect', 'probability', 'error_N', 'parameters'} <= set(entry)
    page = (tmp_path / 'page.html').read_text()
    for figure in ('candidates', 'ladder', 'confounding', 'comparison', 'maps', 'loops'):
        assert f'<figure id="{figure}">' in page
    command = next(line for line in result.stdout.splitlines() if line.startswith('add: '))
    done = fam_bundle(*shlex.split(command)[2:])
    assert done.returncode == 0, done.stderr
    assert (tmp_path / 'better.yaml').read_text() == 'an earlier step'
    assert (tmp_path / 'better_2.yaml').exists()


@pytest.mark.usefixtures('alone')
def test_what_stands_for_a_mistake_in_the_data_is_not_told_to_be_added(fam_bundle, tmp_path):
    """A force in lbf that is read as N: what to check stands first, the rest under a condition."""
    strain, pressure = np.tile(np.linspace(0.0, 0.2, 12), 4), np.repeat([1e5, 2e5, 3e5, 4e5], 12)
    force = load_model(model_path('dmsp20_static_map')).force(strain, pressure[:, None])
    rows = np.stack([strain, pressure / 1e3, force / 4.448222], axis=1)
    np.savetxt(tmp_path / 'a.csv', rows, '%.3f', ',', comments='', header=HEADER.strip())
    told = fam_bundle('diagnose', 'a.csv', '--model', 'dmsp20_static_map').stdout
    assert told.index('check first: with a force in lbf') < told.index('recalibrated')
    assert 'if the data are right, recommended: ' in told
    assert '\nadd: ' not in told


@pytest.mark.parametrize(('effect', 'shape', 'of', 'label'), [
    ('end_caps', 'end_caps', {}, 'end_caps'),
    ('softening', 'softening_travel', {}, 'softening as softening_travel'),
    ('stribeck_friction', 'stribeck_friction', {'replaces': 'coulomb_friction'},
     'stribeck_friction for coulomb_friction'),
    ('braid_elasticity', 'braid_elasticity', {'removes': True}, 'no braid_elasticity')])
def test_a_candidate_is_printed_under_its_whole_label(capfd, effect, shape, of, label):
    """Be it added, added in another shape, put in place of one, or taken away."""
    candidate_table([Candidate(effect, shape, 'family', 0.5, 3.0, 0.0, (), '-', **of)], '', 'p')
    assert capfd.readouterr().out.splitlines()[1].split() == [*label.split(), '0.50', '3', '-']


@pytest.mark.parametrize(('text', 'words'), [
    ('', ['empty']),
    (HEADER, ['data.csv']),
    (HEADER + ROWS.replace(',45\n', ',much\n', 1), ['row 7', 'force', 'much']),
    (HEADER.replace('kPa', 'mm') + ROWS, ['pressure', 'mm']),
    (HEADER.replace('kPa', 'MPa') + ROWS, ['pressure', 'MPa', 'kPa']),
    (HEADER.replace('force [N]', 'torque [N]') + ROWS, ['force', 'torque']),
    (HEADER + ''.join(ROWS.splitlines(keepends=True)[:3]), ['3']),
])
@pytest.mark.parametrize('command', ['compare', 'diagnose'])
def test_a_bad_measurement_is_one_clear_line(fam_bundle, tmp_path, command, text, words):
    """Empty CSV, text in a number column, wrong unit, too few rows: one line, status 2."""
    (tmp_path / 'data.csv').write_text(text)
    result = fam_bundle(command, 'data.csv', '--model', 'dmsp20_static_map', '--json', 'out.json')
    assert result.returncode == 2, result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert [word for word in ['data.csv', *words] if word not in result.stderr] == []
    assert not (tmp_path / 'out.json').exists()


def test_data_and_model_must_have_the_same_units(fam_bundle):
    """Data of one muscle against a bundle of two is refused with both numbers."""
    result = fam_bundle('compare', 'dmsp20_static_map', '--model', 'spie2021')
    assert result.returncode == 2
    assert 'expected 2' in result.stderr


def test_the_model_tells_the_rest_length(fam_bundle, repository, tmp_path):
    """A contraction in mm needs no option beside a model; another length is pointed out."""
    case = repository / 'test/data/practice/p03'
    header, *rows = (case.parent / 'p03.csv').read_text().splitlines()
    at = header.split(',').index('strain')
    table = [row.split(',') for row in rows]
    for cells in table:
        cells[at] = f'{127.0 * float(cells[at]):.5f}'
    (tmp_path / 'mm.csv').write_text('\n'.join(
        [header.replace('strain', 'contraction [mm]'), *(','.join(cells) for cells in table)]))
    as_strain, as_length, other = (
        fam_bundle('compare', *words, '--model', f'{case}.model.yaml')
        for words in ((f'{case}.csv',), ('mm.csv',), ('mm.csv', '--rest-length', '150 mm')))
    assert as_length.stdout.splitlines()[1] == as_strain.stdout.splitlines()[1]
    assert '--rest-length is 150 mm' in other.stderr


def test_convert_writes_a_csv_that_reads_back(fam_bundle, repository, tmp_path):
    """`convert` with a model adds its force and residual; the result is a measurement again."""
    case = repository / 'test/data/practice/p10'
    result = fam_bundle('convert', f'{case}.csv', 'out.csv', '--model', f'{case}.model.yaml')
    assert result.returncode == 0, result.stderr
    header = (tmp_path / 'out.csv').read_text().splitlines()[0]
    assert header.endswith('force [N],model force [N],residual [N]')
    again = [fam_bundle('compare', data, '--model', f'{case}.model.yaml').stdout.splitlines()[1]
             for data in (f'{case}.csv', 'out.csv')]
    assert again[0] == again[1]


def test_convert_makes_a_bag_of_a_csv(fam_bundle, repository):
    """A log from elsewhere becomes a bag with the same error against the same model."""
    case = repository / 'test/data/practice/p10'
    result = fam_bundle('convert', f'{case}.csv', 'bag')
    assert result.returncode == 0, result.stderr
    numbers = [fam_bundle('compare', data, '--model', f'{case}.model.yaml').stdout.splitlines()[1]
               .partition(':')[2] for data in (f'{case}.csv', 'bag')]
    assert numbers[0] == numbers[1]


def test_convert_leaves_no_half_a_file(fam_bundle, tmp_path):
    """A measurement that cannot be read leaves the folder as it was."""
    (tmp_path / 'bad.csv').write_text('strain,pressure [kPa],force [N]\n')
    assert fam_bundle('convert', 'bad.csv', 'out.csv').returncode == 2
    assert [path.name for path in tmp_path.iterdir()] == ['bad.csv']


def test_add_and_ladder_show_the_error_fall(fam_bundle, repository, tmp_path):
    """`add` writes a model that explains the data; `ladder` shows both against the noise floor."""
    case = repository / 'test/data/practice/p03'
    # friction that follows the sign of the rate is off in the rows of a reversal; this is not
    added = fam_bundle('add', 'presliding_hysteresis', '--data', f'{case}.csv',
                       '--model', f'{case}.model.yaml', '--out', 'better.yaml')
    assert added.returncode == 0, added.stderr
    shown = fam_bundle('ladder', f'{case}.csv', '--models', f'{case}.model.yaml', 'better.yaml',
                       '--json', 'ladder.json', '--out', 'ladder.html')
    assert shown.returncode == 0, shown.stderr
    found = json.loads((tmp_path / 'ladder.json').read_text())
    before, after = found['steps']
    assert before['error_N'] > 5.0
    assert after['error_N'] < 1.1 * found['noise_floor_N']
    assert after['held_out_N'] < 1.1 * found['noise_floor_N']
    assert '<figure id="ladder">' in (tmp_path / 'ladder.html').read_text()


def test_add_refuses_a_second_measurement():
    """The last one was used alone."""
    told = CliRunner().invoke(app, ['add', '-d', 'a.csv', '-d', 'b.csv', '-m', 'spie2021', '-o',
                                    'better.yaml'])
    assert str(told.exception) == '--data was given 2 times; expected one measurement'


def test_add_takes_a_users_own_expression(fam_bundle, repository, tmp_path):
    """An effect written as an expression in a model file is added from there and refitted."""
    case = repository / 'test/data/practice/p03'
    text = (repository / 'test/data/practice/p03.model.yaml').read_text()
    (tmp_path / 'mine.yaml').write_text(
        text + '\n  - rub: {expression: "-k * tanh(strain_rate / v)", place: loss, '
        'parameters: {k: {value: 1 N, lower: 0 N, upper: 50 N}, '
        'v: {value: 0.002 1/s, lower: 0.0015 1/s, upper: 0.003 1/s}}}\n')
    result = fam_bundle('add', 'rub', '--from', 'mine.yaml', '--data', f'{case}.csv',
                        '--model', f'{case}.model.yaml', '--out', 'better.yaml',
                        '--json', 'added.json')
    assert result.returncode == 0, result.stderr
    found = json.loads((tmp_path / 'added.json').read_text())
    assert found['error_N']['best'] < 0.5 * found['error_N']['model']
    assert 'rub' in (tmp_path / 'better.yaml').read_text()


@pytest.mark.parametrize(('effects', 'words'), [
    (['coulomb_frction'], ['coulomb_frction', 'coulomb_friction']),
    (['mesh'], ['mesh', 'already']),
    (['rub', '--from', 'dmsp20_static_map'], ["no effect 'rub'"]),
])
def test_add_of_what_cannot_be_added_fails(fam_bundle, repository, tmp_path, effects, words):
    """An unknown effect, or one that is there already: one line, and no model file."""
    case = repository / 'test/data/practice/p03'
    result = fam_bundle('add', *effects, '--data', f'{case}.csv',
                        '--model', f'{case}.model.yaml', '--out', 'better.yaml')
    assert result.returncode == 2
    assert [word for word in words if word not in result.stderr] == []
    assert not (tmp_path / 'better.yaml').exists()


def test_add_does_not_overwrite_the_model_that_it_changes(fam_bundle, repository, tmp_path):
    """The step before would be lost."""
    case, mine = repository / 'test/data/practice/p03', tmp_path / 'mine.yaml'
    mine.write_text((repository / 'test/data/practice/p03.model.yaml').read_text())
    before = mine.read_text()
    result = fam_bundle('add', 'presliding_hysteresis', '--data', f'{case}.csv',
                        '--model', mine, '--out', './mine.yaml')
    assert result.returncode == 2
    assert '--out mine.yaml is also --model; expected another name' in result.stderr
    assert mine.read_text() == before


@pytest.mark.parametrize(('words', 'said'), [
    (('map', 'a.yaml', '--json', 'a.yaml'), '--json a.yaml is also [MODEL]'),
    (('compare', 'log.csv', '--model', 'a.yaml', '--json', 'log.csv'), '--json log.csv is also'),
    (('compare', 'log.csv', '--model', 'a.yaml', '--save-recipe', './a.yaml'),
     '--save-recipe a.yaml is also --model'),
    (('compare', 'log.csv', '--model', 'a.yaml', '--out', 'p.html', '--json', 'p.html'),
     '--out p.html is also --json'),
    (('convert', 'log.csv', 'log.csv'), 'OUT log.csv is also')])
def test_no_command_writes_over_its_input_or_one_output_twice(fam_bundle, repository, tmp_path,
                                                              words, said):
    """It is refused before anything is read."""
    case = repository / 'test/data/practice'
    (tmp_path / 'a.yaml').write_bytes((case / 'p03.model.yaml').read_bytes())
    (tmp_path / 'log.csv').write_bytes((case / 'p03.csv').read_bytes())
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    result = fam_bundle(*words)
    assert result.returncode == 2
    assert said in result.stderr
    assert 'expected another name' in result.stderr
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


@pytest.mark.parametrize(('option', 'out', 'words'), [
    ('--out', 'none/page.html', 'none/page.html: there is no folder none'),
    ('--out', '/proc/page.html', '/proc/page.html: cannot be written ('),
    ('--json', '/proc/result.json', '/proc/result.json: cannot be written ('),
    ('--out', 'page.pdf', '--out page.pdf: expected the name of a page (.html) to write')])
def test_a_file_that_cannot_be_written_is_refused_before_the_work(fam_bundle, option, out, words):
    """Not after a minute of it."""
    result = fam_bundle('compare', 'dmsp20_static_map', option, out)
    assert (result.returncode, result.stdout) == (2, '')
    assert words in result.stderr


def lab_rows(repository):
    """Return the rows of practice case p03 as a lab writes them: ms, length in mm, bar."""
    header, *rows = (repository / 'test/data/practice/p03.csv').read_text().splitlines()
    assert header == 'time [s],trial,strain,pressure [kPa],force [N]'
    table = [row.split(',') for row in rows]
    return [[f'{1e3 * float(t):.1f}', trial, f'{127.0 * (1.0 - float(e)):.6f}',
             f'{float(p) / 100.0:.5f}', force] for t, trial, e, p, force in table]


def test_any_log_is_taken_and_said(fam_bundle, repository, tmp_path):
    """A German table of lengths: the same error as the plain CSV, and a line of what was what."""
    case = repository / 'test/data/practice/p03'
    rows = [';'.join(cell.replace('.', ',') for cell in row) for row in lab_rows(repository)]
    (tmp_path / 'lab.csv').write_text('\n'.join(
        ['Pruefstand 3', 'Zeit [ms];Versuch;L\u00e4nge [mm];Druck [bar];Kraft [N];Notiz',
         *(f'{row};ok' for row in rows)]), encoding='latin-1')
    plain = fam_bundle('compare', f'{case}.csv', '--model', f'{case}.model.yaml')
    lab = fam_bundle('compare', 'lab.csv', '--model', f'{case}.model.yaml', '--json', 'lab.json')
    assert lab.returncode == 0, lab.stderr
    assert lab.stdout.splitlines()[1] == plain.stdout.splitlines()[1]
    assert "length 'L\u00e4nge [mm]'" in lab.stderr
    assert "not used: 'Notiz' (text)" in lab.stderr
    assert plain.stderr == ''
    told = json.loads((tmp_path / 'lab.json').read_text())['data']
    assert [column['quantity'] for column in told['columns']] == [
        'time', 'trial', 'length', 'pressure', 'force', '']


def test_columns_are_told_once_and_kept_in_a_recipe(fam_bundle, repository, tmp_path):
    """Names that nobody knows: an error that lists them, options, then a recipe for the next."""
    case = repository / 'test/data/practice/p03'
    rows = [','.join(row[:4]) + f',{-float(row[4]):.4f}' for row in lab_rows(repository)]
    for name in ('one.csv', 'two.csv'):
        (tmp_path / name).write_text('\n'.join(['c1,c2,c3,c4,c5', *rows]))
    model = ('--model', f'{case}.model.yaml')
    unknown = fam_bundle('compare', 'one.csv', *model)
    assert unknown.returncode == 2
    assert "'c3' not known" in unknown.stderr
    assert '--columns' in unknown.stderr
    told = fam_bundle('compare', 'one.csv', *model, '--columns', 'time=c1 [ms]', '--columns',
                      'trial=c2', '--columns', 'length=c3 [mm]', '--columns', 'pressure=c4 [bar]',
                      '--columns', 'force=-c5 [N]', '--save-recipe', 'lab.yaml')
    assert told.returncode == 0, told.stderr
    # the model's length is not kept: the next file may be of another muscle
    assert 'length: ' not in (tmp_path / 'lab.yaml').read_text().replace('length: c3', '')
    again = fam_bundle('compare', 'two.csv', *model, '--recipe', 'lab.yaml')
    assert again.stdout == told.stdout
    plain = fam_bundle('compare', f'{case}.csv', *model)
    assert told.stdout.splitlines()[1] == plain.stdout.splitlines()[1]


def test_compare_takes_several_recordings_of_one_muscle(fam_bundle, repository, tmp_path):
    """The first half and the second are as good as the whole."""
    case = repository / 'test/data/practice/p03'
    header, *rows = (repository / 'test/data/practice/p03.csv').read_text().splitlines()
    half = len(rows) // 2
    for name, part in (('one.csv', rows[:half]), ('two.csv', rows[half:])):
        (tmp_path / name).write_text('\n'.join([header, *part]))
    model = ('--model', f'{case}.model.yaml')
    whole, parts = fam_bundle('compare', f'{case}.csv', *model), fam_bundle(
        'compare', 'one.csv', 'two.csv', *model)
    assert parts.stdout.splitlines()[1] == whole.stdout.splitlines()[1]


def test_rows_left_out_are_counted_on_screen_and_in_json(fam_bundle, repository, tmp_path):
    """Blank cells are dropped, and both outputs say how many."""
    case = repository / 'test/data/practice/p03'
    header, *rows = (repository / 'test/data/practice/p03.csv').read_text().splitlines()
    gaps = [row if k % 100 else row.rpartition(',')[0] + ',' for k, row in enumerate(rows)]
    (tmp_path / 'gaps.csv').write_text('\n'.join([header, *gaps]))
    result = fam_bundle('compare', 'gaps.csv', '--model', f'{case}.model.yaml', '--json',
                        'out.json')
    assert result.returncode == 0, result.stderr
    assert '13 of 1260 rows left out' in result.stderr
    found = json.loads((tmp_path / 'out.json').read_text())
    assert found['data']['dropped'] == {'without a number in force': 13}


@pytest.mark.parametrize(('options', 'words'), [
    (['--columns', 'force'], 'expected QUANTITY=COLUMN'),
    (['--columns', 'forse=c1'], "'forse' is not a quantity"),
    (['--rest-length', '127'], '--rest-length'), (['--max-pressure', '3 mm'], '--max-pressure'),
    (['--recipe', 'none.yaml'], 'none.yaml')])
def test_a_wrong_option_of_reading_is_one_line(fam_bundle, options, words):
    """Each names the option and what was expected."""
    result = fam_bundle('compare', 'dmsp20_static_map', '--model', 'dmsp20_static_map', *options)
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1
    assert words in result.stderr


def test_convert_makes_a_plain_csv_of_a_workbook(fam_bundle, repository, tmp_path):
    """A workbook with lengths becomes a CSV that needs no option any more."""
    pandas = pytest.importorskip('pandas')
    pytest.importorskip('openpyxl')
    rows = lab_rows(repository)
    frame = pandas.DataFrame(rows, columns=['t [ms]', 'run', 'L [mm]', 'p [bar]', 'F [N]'])
    frame.astype({name: float for name in frame if name != 'run'}).to_excel(
        tmp_path / 'lab.xlsx', index=False)
    result = fam_bundle('convert', 'lab.xlsx', 'plain.csv', '--rest-length', '127 mm')
    assert result.returncode == 0, result.stderr
    case = repository / 'test/data/practice/p03'
    errors = [fam_bundle('compare', data, '--model', f'{case}.model.yaml').stdout.partition(';')[0]
              for data in ('plain.csv', f'{case}.csv')]
    assert errors[0] == errors[1]
