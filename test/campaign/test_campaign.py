# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A folder of recordings: tables, what they say together, and what a kill leaves behind."""

import os
import shutil
import signal
import subprocess
import sys
import time

import pandas
import pytest

from fam_bundle_ros.campaign import job, run_campaign
from fam_bundle_ros.campaign.campaign import Store
from fam_bundle_ros.campaign.recordings import find, Recording
from fam_bundle_ros.campaign.tables import parameter_rows
from fam_bundle_ros.data import Recipe
from fam_bundle_ros.data.measurement import file_digest
from fam_bundle_ros.discovery import Choices
from fam_bundle_ros.errors import InputError

TABLES = ('recordings', 'effects', 'parameters')


def read(out, name):
    """Return a table of results."""
    return pandas.read_parquet(out / f'{name}.parquet')


def assert_same_of_three(out, other):
    """Three recordings have the rows that they have among more, but for the time that it took."""
    files = ['m0.csv', 'm1.csv', 'm2.csv']
    assert list(read(out, 'recordings').file) == files
    for name in TABLES:
        among = read(other, name)
        pandas.testing.assert_frame_equal(
            read(out, name).drop(columns='seconds', errors='ignore'),
            among[among.file.isin(files)].reset_index(drop=True).drop(
                columns='seconds', errors='ignore'), rtol=1e-6)


def test_every_recording_has_a_row_and_a_bad_one_its_error(alone):
    """What is broken is named with the reason; the others are worked on all the same."""
    result, out = alone
    rows = read(out, 'recordings').set_index('file')
    assert list(rows.index) == ['a_copy.csv', 'later/broken.csv', 'm0.csv', 'm1.csv', 'm2.csv',
                                'm3.csv', 'm4.csv']
    assert list(rows.index[rows.status == 'failed']) == ['later/broken.csv']
    assert rows.error['later/broken.csv'].startswith("no column 'Kraft [N]' for force")
    assert rows.verdict[rows.status == 'done'].isin(['missing_effect', 'partial']).all()
    assert result.computed == 7
    assert [len(read(out, name)) for name in TABLES] == [
        len(result.recordings), len(result.effects), len(result.parameters)]


def test_a_copy_of_a_recording_counts_once(alone):
    """The one that the table of specimens tells about is the original."""
    result, _ = alone
    assert {row['file']: row['duplicate_of'] for row in result.recordings
            if row['duplicate_of']} == {'a_copy.csv': 'm2.csv'}
    assert result.muscles == {f'm{k}': 1 for k in range(5)}


def test_the_table_of_specimens_stands_beside_each_recording(alone):
    """With its units; a word among numbers is a number that is not known."""
    rows = read(alone[1], 'recordings').set_index('file')
    assert rows['length [mm]'].dropna().tolist() == [90.0, 120.0, 160.0, 210.0, 280.0]
    assert rows['age [days]'].dtype == float
    assert rows['age [days]'].isna()[['m0.csv', 'm1.csv']].tolist() == [True, False]
    assert 'age' not in rows
    assert rows.supplier['m3.csv'] == 'ACME'
    assert rows.in_table.tolist() == [False, False, *[True] * 5]


def test_what_muscles_lack_and_what_it_goes_with_is_found(alone):
    """Dead ends in all; longer muscles have longer ones, and age has nothing to do with it."""
    result, _ = alone
    first = result.shares[0]
    assert (first.effect, first.muscles, first.of) == ('end_caps', 5, 5)
    assert first.low < 0.6 < first.high == 1.0
    found = {(trend.parameter, trend.fact): trend for trend in result.trends}
    length = found['end_caps.dead_length', 'length [mm]']
    assert length.power_low < 1.0 < length.power_high
    assert length.power == pytest.approx(1.0, abs=0.1)
    assert length.values == pytest.approx([0.08 * each for each in length.fact_values], rel=0.1)
    assert [str(each) for each in result.clear_trends] == [str(length)]
    assert 'end_caps is missing in 5 of 5 muscles' in str(result)


def test_a_second_run_computes_nothing_but_what_is_new(alone, campaign, lab, tmp_path):
    """A recording that is added is worked on, and nothing else."""
    out = shutil.copytree(alone[1], tmp_path / 'out')
    assert campaign(out, workers=1).computed == 0
    added = lab / 'added.csv'
    added.write_text('nothing')
    try:
        assert campaign(out, workers=1).computed == 1
    finally:
        added.unlink()
    assert campaign(out, workers=1).computed == 0


def test_a_campaign_that_was_killed_goes_on_where_it_was(alone, campaign, lab, three, tmp_path):
    """SIGKILL in the middle: what was done stays as it is, and the tables are the same."""
    out = tmp_path / 'out'
    command = subprocess.Popen(
        [sys.executable, '-m', 'fam_bundle_ros', 'campaign', str(lab), '--model',
         str(lab / 'model.yaml'), '--recipe', str(lab / 'recipe.yaml'), '--specimens',
         str(three['specimens']), '--pattern', three['pattern'], '--out', str(out),
         '--workers', '1'],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120.0
    while len(list(out.glob('recordings/*.json'))) < 1 and time.monotonic() < deadline:
        time.sleep(0.01)
    command.send_signal(signal.SIGKILL)
    assert command.wait() == -signal.SIGKILL
    before = {path: path.stat().st_mtime_ns for path in out.glob('recordings/*.json')}
    assert 1 <= len(before) < 3
    assert campaign(out, workers=1, **three).computed == 3 - len(before)
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert_same_of_three(out, alone[1])


def test_a_result_is_found_by_what_it_depends_on_and_nothing_else(lab, monkeypatch):
    """Data, model, dimensions, recipe, options: another address; name and place: the same."""
    model = job.Model.of(lab / 'model.yaml')
    usual = {'recording': Recording('a.csv', lab / 'a.csv', 'abc'), 'model': model,
             'recipe': Recipe(), 'choices': Choices()}

    def address(**other):
        return job.Job(**{**usual, **other}).address
    in_table = {each.file: each for each in find(lab, lab / 'specimens.csv')}['m0.csv'].specimen
    usual_address, others = address(), [
        address(recording=Recording('a.csv', lab / 'a.csv', 'abd')),
        address(recording=Recording('a.csv', lab / 'a.csv', 'abc', in_table)),
        address(model=job.Model(model.text.replace('30 deg', '31 deg'), 'm', str(lab))),
        address(recipe=Recipe(gauge=False)), address(choices=Choices(odds=10.0))]
    assert len({address(), *others}) == 1 + len(others)
    assert address(recording=Recording('b.csv', lab / 'later' / 'b.csv', 'abc')) == address()
    monkeypatch.setattr(job, 'code_version', lambda: '9.9')
    assert address() not in {usual_address, *others}


def test_an_error_of_the_machine_is_tried_again_and_one_of_the_data_is_not(lab, tmp_path):
    """A file that a worker cannot see is no finding about the file."""
    there, gone = (job.Job(Recording('x.csv', path, 'other'), job.Model.of(lab / 'model.yaml'),
                           Recipe(), Choices())
                   for path in (lab / 'm0.csv', tmp_path / 'gone.csv'))
    assert 'changed while' in job.run(there)['error']
    assert 'expected every worker to see' in job.run(gone)['error']
    empty = tmp_path / 'empty.csv'
    empty.touch()
    broken = job.Job(Recording('x.csv', empty, file_digest(empty)), there.model, Recipe(),
                     Choices())
    assert [job.run(each)['passing'] for each in (there, gone, broken)] == [True, True, False]


def test_a_result_that_cannot_be_used_is_made_again(tmp_path):
    """An error of the machine, half a file, another program's file; what is done stays."""
    store = Store(tmp_path / 'recordings')
    for name, passing in (('done', False), ('again', True)):
        store.write(name, {'error': '', 'passing': passing})
    store.path('half').write_text('{"error": "", "pass')
    store.path('other').write_text('[]')
    assert [store.is_done(name) for name in ('done', 'again', 'half', 'other', 'none')] == [
        True, False, False, False, False]


def test_a_parameter_that_the_data_do_not_tell_is_not_sure(lab):
    """At its bound, or not moved from its prior: it stands in the table, and in no trend."""
    told = {'value': 2.0, 'unit': 'N', 'interval': [1.0, 3.0], 'flag': '', 'tolerances': None,
            'data_alone': [2.0, 1.0, 3.0]}
    rows = parameter_rows(Recording('a.csv', lab / 'a.csv', 'abc'), {'diagnose': {'parameters': {
        'sure': told, 'traded': {**told, 'flag': 'traded off with geometry.radius'},
        'bound': {**told, 'flag': 'at bound'},
        'dead': {**told, 'flag': 'dead: the data do not move it', 'data_alone': []}}}})
    assert {row['parameter']: row['sure'] for row in rows} == {
        'sure': True, 'traded': True, 'bound': False, 'dead': False}


@pytest.mark.parametrize(('change', 'said'), [
    ({'specimens': 'twice.csv'}, r"m0\.csv is in column 'file' twice"),
    ({'folder': 'nowhere'}, 'nowhere: no such folder'),
    ({'pattern': '*.mcap'}, r"no recording called '\*.mcap'"),
    ({'out': '.'}, 'holds the recordings; expected another folder'),
    ({'specimens': 'recipe.yaml'}, "expected one called 'file'"),
    ({'model': 'none.yaml'}, 'none.yaml: no such model file'),
    ({'workers': 2, 'scheduler': 'tcp://h:1'}, 'expected one of the two'),
    ({'scheduler': 'nonsense'}, r'scheduler nonsense: no scheduler answers \(missing port'),
])
def test_a_campaign_that_cannot_be_run_says_why(lab, tmp_path, change, said):
    """Before any work is done."""
    options = {'folder': '.', 'model': 'model.yaml', 'out': str(tmp_path / 'out'), **change}
    (tmp_path / 'twice.csv').write_text(f'file\n{lab}/m0.csv\n{lab}/m0.csv\n')
    if change.get('specimens') == 'twice.csv':
        options['specimens'] = str(tmp_path / 'twice.csv')
    paths = {key: lab / options.pop(key) for key in ('folder', 'model', 'out', 'specimens')
             if key in options}
    with pytest.raises(InputError, match=said):
        run_campaign(**paths, **options)


def test_results_and_hidden_files_are_no_recordings(tmp_path):
    """Results inside of the folder are left out at the next run; a bag is one recording."""
    folder = tmp_path / 'lab'
    (folder / 'results').mkdir(parents=True)
    (folder / 'results' / 'campaign.json').write_text('{}')
    (folder / 'results' / 'recordings.parquet').write_text('x')
    (folder / 'bag').mkdir()
    (folder / 'bag' / 'metadata.yaml').write_text('')
    (folder / 'bag' / 'bag_0.mcap').write_text('x')
    (folder / '.hidden.csv').write_text('x')
    (folder / 'notes.md').write_text('x')
    os.symlink(tmp_path / 'gone.csv', folder / 'link.csv')
    found = find(folder)
    assert [(each.file, bool(each.problem)) for each in found] == [
        ('bag', False), ('link.csv', True)]


@pytest.fixture
def two(tmp_path):
    """Return a folder with two recordings; a file with the name of one is beside the folder."""
    folder = tmp_path / 'lab'
    folder.mkdir()
    for name, text in (('lab/a.csv', 'a'), ('lab/b.csv', 'b'), ('a.csv', 'another muscle')):
        (tmp_path / name).write_text(text)
    return folder


def test_paths_of_the_table_start_at_its_folder(two):
    """The table is one folder up; each file stays one recording, with its row."""
    table = two.parent / 'spec.csv'
    table.write_text('file,age\nlab/a.csv,30\n')
    assert [(each.file, each.specimen is not None) for each in find(two, table)] == [
        ('a.csv', True), ('b.csv', False)]


@pytest.mark.parametrize('file', ['a.csv', 'b.csv'])
def test_a_row_of_the_table_without_a_recording_is_told_with_the_path_that_was_meant(two, file):
    """A file that is elsewhere, or nowhere, is no recording of this folder."""
    table = two.parent / 'spec.csv'
    table.write_text(f'file,age\n{file},30\n')
    with pytest.raises(InputError, match=rf"spec\.csv, column 'file': '{file}' is not among the "
                       rf"recordings in .*lab; expected a path .*, 'lab/{file}'"):
        find(two, table)


def test_rows_of_the_table_that_the_pattern_excludes_are_left_out(two):
    """The table may be that of all recordings."""
    (two / 'spec.csv').write_text('file,age\na.csv,30\nb.csv,40\n')
    assert [each.file for each in find(two, two / 'spec.csv', 'a*')] == ['a.csv']


def test_a_file_that_only_the_table_knows_as_a_recording_is_one(two):
    """Its ending says nothing."""
    (two / 'run.strange').write_text('c')
    (two / 'spec.csv').write_text('file,age\nrun.strange,30\n')
    assert [each.file for each in find(two, two / 'spec.csv')] == ['a.csv', 'b.csv', 'run.strange']


def test_a_link_to_another_recording_is_no_second_one(two):
    """Duplicates are different files of equal content."""
    (two / '0_again.csv').symlink_to(two / 'b.csv')
    assert [each.file for each in find(two)] == ['a.csv', 'b.csv']


def test_a_recording_with_a_slip_of_unit_is_not_counted(in_psi):
    """What it would need to fit is no physics; the words stand in its row."""
    result = in_psi()
    rows = {row['file']: row for row in result.recordings}
    assert 'psi, not in kPa' in rows['psi.csv']['check_first']
    assert [row['file'] for row in result.counted] == ['right.csv']
    assert not result.shares
    assert '0 duplicates, 1 to check first; 1 counted, of 1 muscle: ' in result.summary


def test_a_recording_with_a_slip_counts_where_the_user_says_that_it_is_right(in_psi):
    """Nothing is computed again for that."""
    in_psi()
    result = in_psi(as_read=True)
    assert [row['file'] for row in result.counted] == ['psi.csv', 'right.csv']
    assert {share.of for share in result.shares} == {2}
    assert result.computed == 0
