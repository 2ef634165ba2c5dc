# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Several specimens: what is missing in all, what is a constant of the material, what is not."""

from dataclasses import replace
from functools import partial
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from fam_bundle_ros import discovery
from fam_bundle_ros.cli.app import app
from fam_bundle_ros.discovery import (
    Choices,
    diagnose_specimens,
    read_specimens,
    Specimen,
    Together,
    write_csv,
)
from fam_bundle_ros.discovery.options import Change
from fam_bundle_ros.discovery.specimen_table import incomplete_columns, unused_columns
from fam_bundle_ros.discovery.specimens import Verdict
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import load_model, save_model

LENGTHS = (0.08, 0.127, 0.25)


@pytest.fixture
def specimens(paper_muscle, sweeps):
    """
    Return a function that records muscles of three lengths; it is told what they hide.

    Of each sweep every fourth row: there are enough of them.
    """
    def make(hide, lengths=LENGTHS):
        found = []
        for seed, length in enumerate(lengths):
            muscle = paper_muscle.with_parameters({'geometry.length': length})
            data = sweeps(hide(muscle, length), seed=seed, cycles=1)
            found.append(Specimen(f's{seed}', data.select(np.arange(len(data)) % 4 == 0),
                                  {'length': length}, {'length': 1e3 * length}))
        return found
    return make


def constant(result, key):
    """Return what is said of one parameter."""
    return next(each for each in result.constants if each.key == key)


def test_a_dead_length_is_the_same_in_all_and_so_a_constant(specimens, paper_muscle, tmp_path,
                                                            monkeypatch):
    """On one length it ties with a factor of the strain; on two it does not, by the command."""
    lines = ['file,length [cm]']
    for each in specimens(lambda muscle, length: muscle.with_effect(
            'end_caps', dead_length=12e-3), LENGTHS[::2]):
        write_csv(each.data, tmp_path / f'{each.name}.csv')
        lines.append(f"{each.name}.csv,{100 * each.dimensions['length']}")
    (tmp_path / 'table.csv').write_text('\n'.join(lines))
    save_model(paper_muscle, tmp_path / 'model.yaml')
    monkeypatch.setattr(discovery, 'Choices', partial(Choices, most=1))
    done = CliRunner().invoke(app, [
        'diagnose', '--specimens', str(tmp_path / 'table.csv'), '--model',
        str(tmp_path / 'model.yaml'), '--model-out', str(tmp_path / 'better.yaml'), '--json',
        str(tmp_path / 'd.json'), '--odds', '5'])
    assert done.exit_code == 0, done.output
    assert 'end_caps.dead_length is' in done.output
    assert 'a constant of the material' in done.output
    result = json.loads((tmp_path / 'd.json').read_text())
    assert result['shapes'] == ['end_caps']
    found = next(c for c in result['constants'] if c['key'] == 'end_caps.dead_length')
    assert found['shared'] > 0.9
    assert found['value'] == pytest.approx(12.0, abs=0.3)
    assert {each['verdict'] for each in result['specimens']} == {'missing_effect'}
    for specimen, length in zip(result['specimens'], LENGTHS[::2]):
        assert specimen['error_N']['best'] < 0.66 < specimen['error_N']['model']
        better = load_model(tmp_path / f"better_{specimen['name']}.yaml")
        assert better.length == pytest.approx(length)
        assert better.effect('end_caps').values['dead_length'] == pytest.approx(12e-3, abs=1e-3)


def test_a_friction_in_proportion_to_length_is_no_constant(specimens, paper_muscle):
    """It is named in all, with its length; a recording of a spring is refused and left out."""
    made = specimens(
        lambda muscle, length: muscle.with_effect('coulomb_friction', force=24.0 * length))
    spring = replace(made[1].data, force=120.0 - 700.0 * made[1].data.strain)
    result = diagnose_specimens(paper_muscle, [
        *made, replace(made[1], name='spring', data=spring)], choices=Choices(most=1))
    assert result.effects == ('coulomb_friction',)
    assert [each.finding.verdict for each in result.verdicts] == 3 * ['missing_effect'] + [
        'unexplained']
    assert [each.left_out for each in result.verdicts] == 3 * [False] + [True]
    assert 'a curve of the strain alone' in str(result.verdicts[3])
    assert all(each.error_N['held_out'] < 0.7 for each in result.verdicts[:3])
    found = constant(result, 'coulomb_friction.force')
    assert found.shared < 0.01
    assert found.specimens == ['s0', 's1', 's2']
    assert found.relation.goes_with == 'length'
    assert found.relation.power == pytest.approx(1.0, abs=0.1)
    assert found.values == pytest.approx([24.0 * length for length in LENGTHS], rel=0.1)
    # the rubber is the same in all: no fit may pass its error on to it
    assert constant(result, 'bladder_elasticity.c10').shared > 0.9


def test_what_is_replaced_in_all_is_said():
    """An effect of one rig is not; both are told by the recordings that need them."""
    rubber, bias = Change('bladder_elasticity', 'bladder_polynomial'), Change('', 'pressure_bias')
    verdicts = tuple(Verdict(Specimen(name, ''), own, (), None, {}, {}, (), False, None)
                     for name, own in (('a', (rubber,)), ('b', (rubber, bias))))
    assert Together((rubber,), {}, (), {}, verdicts, (), ()).headlines == [
        ('missing in all', 'nothing'),
        ('changed in all', 'bladder_polynomial for bladder_elasticity'),
        ('needed in 1 of 2', 'pressure_bias (b)')]


@pytest.mark.parametrize(('lengths', 'tied'), [(LENGTHS, False), (LENGTHS[::2], True)])
def test_an_end_effect_of_clamps_and_a_share_of_the_length_is_named(specimens, paper_muscle,
                                                                    lengths, tied):
    """Three lengths part the two, which each alone cannot; on two end caps stay a tie."""
    made = specimens(lambda muscle, length: muscle.with_effect(
        'end_effect_of_length', dead_length=12e-3, share=0.08), lengths)
    result = diagnose_specimens(paper_muscle, made, choices=Choices(most=1))
    assert result.effects == ('end_caps',)
    shapes = {change.new for change in result.changes}
    assert 'end_effect_of_length' in shapes | {name for group in result.tied for name in group}
    assert tied == any({'end_caps', 'end_effect_of_length'} <= set(group)
                       for group in result.tied)
    if not tied:
        dead = constant(result, 'end_effect_of_length.dead_length')
        share = constant(result, 'end_effect_of_length.share')
        assert min(dead.shared, share.shared) > 0.75
        assert dead.value == pytest.approx(12.0, abs=0.8)
        assert share.value == pytest.approx(0.08, abs=0.01)


def test_rigs_that_are_a_little_off_do_not_make_a_constant_of_the_rubber_differ(specimens,
                                                                                paper_muscle):
    """Load cells off by 2.5 N, which fits follow with 77 to 139 kPa for c01 of one rubber."""
    made = specimens(lambda muscle, length: muscle.with_effect('coulomb_friction', force=6.0))
    made = [replace(each, data=replace(each.data, force=each.data.force + off))
            for each, off in zip(made, (2.5, -2.5, 0.5), strict=True)]
    result = diagnose_specimens(paper_muscle, made, choices=Choices(most=1))
    assert [change.label for change in result.changes] == ['coulomb_friction']
    assert constant(result, 'coulomb_friction.force').is_shared
    assert [each.key for each in result.constants if each.is_shared is False] == []


def test_a_table_gives_each_recording_its_dimensions_in_any_unit(tmp_path):
    """Diameters are halved; remarks are no facts; files are beside the table."""
    table = tmp_path / 'specimens.csv'
    table.write_text('file,length [cm],diameter [in],age [days],remark\n'
                     'a.csv,12.7,0.5,30,new\n\nb.csv,,0.25,400,frayed\n')
    first, second = read_specimens(table)
    assert first.data == tmp_path / 'a.csv'
    assert first.dimensions == pytest.approx({'length': 0.127, 'radius': 6.35e-3})
    assert first.facts == {'length': 12.7, 'diameter': 0.5, 'age': 30.0}
    assert (second.name, second.dimensions) == ('b', pytest.approx({'radius': 3.175e-3}))


@pytest.mark.parametrize('separator', [';', '\t'])
def test_a_table_may_have_decimal_commas(tmp_path, separator):
    """As a German spreadsheet writes it, with semicolons or tabs; names of files keep theirs."""
    table = tmp_path / 'specimens.csv'
    table.write_text('file,length [cm],age [days]\na.csv,12.7,1.5\n'.replace(
        ',', separator).replace('.', ',').replace('a,csv', 'a,1.csv'))
    [specimen] = read_specimens(table)
    assert specimen.data.name == 'a,1.csv'
    assert specimen.facts == {'length': 12.7, 'age': 1.5}


def test_a_dimension_is_known_by_its_usual_names(tmp_path):
    """In any case; another column of a length is said to be no dimension."""
    table = tmp_path / 'specimens.csv'
    table.write_text('File,Rest length [mm],OD [mm],Wall_Thickness [mm],stroke [mm],age [days]\n'
                     'a.csv,127,12.7,1.59,30,10\n')
    [specimen] = read_specimens(table)
    assert specimen.dimensions == pytest.approx(
        {'length': 0.127, 'radius': 6.35e-3, 'wall_thickness': 1.59e-3})
    [note] = unused_columns([specimen])
    assert "'stroke [mm]' is not one of the dimensions length, radius" in note


def test_a_column_with_a_blank_is_noted_with_the_specimens_that_it_does_not_count(tmp_path):
    """By name; a full column is not."""
    table = tmp_path / 'specimens.csv'
    table.write_text('file,length [mm],age [days]\na.csv,127,\nb.csv,,3\nc.csv,80,\n')
    assert incomplete_columns(read_specimens(table)) == [
        "column 'length' has no number for b: constants are compared with it in the others",
        "column 'age' has no number for a, c: constants are compared with it in the others"]
    table.write_text('file,length [mm]\na.csv,127\nb.csv,90\n')
    assert incomplete_columns(read_specimens(table)) == []


def test_files_of_one_name_in_two_folders_are_named_apart(tmp_path):
    """So that their models are two files; the rest keep their short names."""
    table = tmp_path / 'specimens.csv'
    table.write_text('file\na/x.csv\nb/x.csv\nb/x.mcap\nb/y.csv\n')
    assert [each.name for each in read_specimens(table)] == ['a_x', 'b_x.csv', 'b_x.mcap', 'y']


@pytest.mark.parametrize(('text', 'said'), [
    ('file\na.csv\na.csv\n', "a.csv is in column 'file' twice"),
    ('name,length [mm]\na,1\n', "expected one called 'file'"),
    ('file,length\na.csv,127\n', "row 2, column 'length' has no unit"),
    ('file,length [mm]\na.csv,long\n', "row 2, column 'length': 'long'; expected a number"),
    ('file,length [mm]\na.csv,-127\n', "row 2, column 'length': -127; expected a number above 0"),
    ('file,length [kPa]\na.csv,127\n', "unit 'kPa' does not fit"),
    ('file,length [mm]\n,127\n', 'row 2: no file'),
    ('', "expected one called 'file'"),
])
def test_a_table_that_cannot_be_read_is_said_by_row_and_column(tmp_path, text, said):
    """The row, the column, and what was expected there."""
    table = tmp_path / 'specimens.csv'
    table.write_text(text)
    with pytest.raises(InputError, match=said):
        read_specimens(table)


def test_a_recording_that_is_not_in_the_table_is_said(tmp_path):
    """And several recordings without a table are not taken for one."""
    (tmp_path / 'table.csv').write_text('file\na.csv\n')
    told = CliRunner().invoke(app, ['diagnose', 'b.csv', '--model', 'spie2021', '--specimens',
                                    str(tmp_path / 'table.csv')])
    assert "b.csv: not in column 'file'" in str(told.exception)
    told = CliRunner().invoke(app, ['diagnose', 'a.csv', 'b.csv', '--model', 'spie2021'])
    assert '2 recordings; expected one, or --specimens' in str(told.exception)


def test_one_specimen_is_not_several(paper_muscle):
    """One recording says nothing about what specimens share."""
    with pytest.raises(InputError, match='1 specimens; expected two or more'):
        diagnose_specimens(paper_muscle, [Specimen('a', 'a.csv')])
