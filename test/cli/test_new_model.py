# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""`new-model`, and that no command takes a muscle that the user did not choose."""

import io
import json
import math

import pytest

from fam_bundle_ros.cli import common
from fam_bundle_ros.control import RecruitmentController
from fam_bundle_ros.control.adaptation import USUAL_PUSH
from fam_bundle_ros.model import load_model, save_model

OPTIONS = ['--radius', '6.35mm', '--length', '127 mm', '--braid-angle', '33deg', '--wall',
           '1,59 mm', '--muscles', '1,1', '--max-pressure', '50 psi']


def test_options_make_a_model_that_the_other_commands_take(fam_bundle, tmp_path):
    """Dimensions become a commented file; `map` draws it and says whose numbers they are."""
    made = fam_bundle('new-model', 'mine.yaml', *OPTIONS, '--effect', 'mesh', '--effect',
                      'bladder_elasticity', '--json', 'made.json')
    assert made.returncode == 0, made.stderr
    assert json.loads((tmp_path / 'made.json').read_text())['name'] == 'mine'
    text = (tmp_path / 'mine.yaml').read_text()
    assert '# wall of the bladder, at rest. Source: the user.' in text
    assert load_model(tmp_path / 'mine.yaml').max_pressure[1] == pytest.approx(344737.9, rel=1e-5)
    drawn = fam_bundle('map', 'mine.yaml', '--json', 'map.json')
    head = 'mine: mu1, mu2 of 1 muscle, radius 6.35 mm, length 127 mm, braid angle 33 deg'
    assert drawn.returncode == 0, drawn.stderr
    assert drawn.stdout.startswith(head)
    assert head in (tmp_path / 'map.html').read_text()
    assert json.loads((tmp_path / 'map.json').read_text())['muscle']['radius'] == '6.35 mm'


def test_a_part_needs_its_length_only_and_says_where_the_rest_is_from(fam_bundle, tmp_path):
    """A DMSP-20 of 296 mm explains the measured map as the model that ships does."""
    made = fam_bundle('new-model', 'mine.yaml', '--part', 'DMSP-20', '--length', '296 mm')
    assert made.returncode == 0, made.stderr
    assert 'not in the data sheet' in made.stderr
    mine, shipped = (fam_bundle('compare', 'dmsp20_static_map', '--model', model).stdout
                     for model in ('mine.yaml', 'dmsp20_static_map'))
    assert '151 N rms' in mine
    assert mine.splitlines()[1:] == shipped.splitlines()[1:]
    assert mine.splitlines()[0].startswith('mine: ')
    fam_bundle('new-model', 'other.yaml', '--part', 'dmsp-20', '--length', '296 mm', '--wall',
               '2 mm')
    assert '# wall of the bladder, at rest. Source: the user.' in (tmp_path / 'other.yaml'
                                                                  ).read_text()


def test_what_is_not_told_is_asked(fam_bundle, tmp_path, monkeypatch):
    """Answers make the same file as options; Enter takes what stands there."""
    answers = '\n6.35 mm\n127 mm\n33 deg\n1.59 mm\n1,1\n50 psi\n'
    monkeypatch.setattr('sys.stdin', io.StringIO(answers))
    asked = fam_bundle('new-model', 'asked.yaml', '--ask')
    assert asked.returncode == 0, asked.stderr
    assert 'Braid angle (of the threads from the axis' in asked.stdout + asked.stderr
    fam_bundle('new-model', 'told.yaml', '--name', 'asked', *OPTIONS)
    assert (tmp_path / 'asked.yaml').read_text() == (
        tmp_path / 'told.yaml').read_text()


def test_parts_are_listed_with_the_source_of_each_value(fam_bundle):
    """What a data sheet says and what it does not can be told apart."""
    shown = fam_bundle('new-model', '--list').stdout
    assert all(f'dmsp-{size}: Festo DMSP-{size}' in shown for size in (10, 20, 40))
    assert 'not in the data sheet' in shown


@pytest.mark.parametrize(('arguments', 'words'), [
    (['mine.yaml', '--no-ask'], ['--radius', '--length', '--max-pressure']),
    (['mine.yaml', '--part', 'mas-7'], ['--part', 'mas-7', 'dmsp-10']),
    (['mine.yaml', *OPTIONS, '--radius', '6.35'], ['--radius', 'unit', 'mm']),
    (['mine.yaml', *OPTIONS, '--effect', 'mehs'], ['mehs', 'mesh']),
    (['mine.yaml', *OPTIONS, '--effect', 'measured_surface'], ['measured_surface', 'table']),
    (['mine.txt', *OPTIONS], ['mine.txt', '.yaml']), ([], ['OUT', '.yaml'])])
def test_a_mistake_names_the_option_and_writes_nothing(fam_bundle, tmp_path, arguments, words):
    """One line, status 2."""
    result = fam_bundle('new-model', *arguments)
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1
    assert [word for word in words if word not in result.stderr] == []
    assert list(tmp_path.iterdir()) == []


def test_a_measured_muscle_becomes_a_bundle_of_such_muscles(fam_bundle, tmp_path):
    """Each unit pulls as its number of muscles; what belongs to the load cell stays behind."""
    fam_bundle('new-model', 'muscle.yaml', *OPTIONS, '--muscles', '1', '--effect', 'mesh',
               '--effect', 'bladder_elasticity')
    muscle = load_model(tmp_path / 'muscle.yaml').with_parameters(
        {'bladder_elasticity.c10': 99e3, 'geometry.radius': 6.1e-3}).with_effect(
            'force_sensor_bias', bias=3.0)
    save_model(muscle, tmp_path / 'muscle.yaml')
    made = fam_bundle('new-model', 'bundle.yaml', '--from', 'muscle.yaml', '--muscles', '1,2',
                      '--max-pressure', '300 kPa')
    assert made.returncode == 0, made.stderr
    assert 'force_sensor_bias is left out: belongs to the sensors' in made.stderr
    bundle = load_model(tmp_path / 'bundle.yaml')
    one = float(muscle.force(0.1, [2e5]))
    assert bundle.unit_forces(0.1, [2e5, 2e5]) == pytest.approx([one, 2.0 * one])
    assert bundle.max_pressure == pytest.approx([300e3, 300e3])
    assert [effect.name for effect in bundle.effects] == ['mesh', 'bladder_elasticity']
    drawn = fam_bundle('map', 'bundle.yaml', '--out', 'map.html')
    assert 'free strain does not dip while MU2 fills' in drawn.stdout
    assert '>does not dip while MU2 fills<' in (tmp_path / 'map.html').read_text()


def test_a_slack_muscle_pushes_back_between_rigid_ends_but_not_on_tendons(fam_bundle, tmp_path):
    """In tension only nothing shows the push-back: its default, less sure than a law's usually."""
    fam_bundle('new-model', 'muscle.yaml', *OPTIONS, '--muscles', '1', '--effect', 'mesh',
               '--effect', 'bladder_elasticity', '--effect', 'tendon_slack')
    pushed = 2.88 + 0.35 * math.pi * 6.35e-3 ** 2 * 1e5
    for options, least in (([], -pushed), (['--tendons'], 0.0)):
        made = fam_bundle('new-model', 'bundle.yaml', '--from', 'muscle.yaml', '--muscles', '1,1',
                          '--force', *options)
        assert ('tendon_slack is left out' in made.stderr) == (not options)
        bundle = load_model(tmp_path / 'bundle.yaml')
        assert bundle.unit_forces(0.3, [1e5, 1e5]) == pytest.approx([least, least])
        spread = RecruitmentController(bundle).settings.adaptation.spread[2]
        assert spread == USUAL_PUSH if options else spread > 1.1 * USUAL_PUSH


@pytest.mark.parametrize(('options', 'words'), [
    (['--from', 'spie2021'], ['spie2021', '2 motor units']),
    ([*OPTIONS, '--tendons'], ['--tendons', '--from']),
    (['--from', 'dmsp20_static_map', '--radius', '5 mm'], ['--radius', '--from']),
    (['--from', 'dmsp20_static_map', '--part', 'dmsp-20'], ['--part', '--from']),
    (['--from', 'dmsp20_static_map', '--muscles', '1,0'], ["--muscles: '0'"]),
    (['--from', 'dmsp20_static_map', '--max-pressure', '0 kPa'], ['max_pressure', "'0 kPa'"])])
def test_a_bundle_that_cannot_be_made_is_not_written(fam_bundle, tmp_path, options, words):
    """One line says which option, and what is expected."""
    result = fam_bundle('new-model', 'bundle.yaml', *options)
    assert result.returncode == 2
    assert [word for word in words if word not in result.stderr] == []
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_there_is_kept(fam_bundle, tmp_path):
    """Only --force writes over it."""
    (tmp_path / 'mine.yaml').write_text('kept')
    refused = fam_bundle('new-model', 'mine.yaml', *OPTIONS)
    assert (refused.returncode, 'mine.yaml: exists already' in refused.stderr) == (2, True)
    assert (tmp_path / 'mine.yaml').read_text() == 'kept'
    assert fam_bundle('new-model', 'mine.yaml', *OPTIONS, '--force').returncode == 0


@pytest.mark.parametrize('command', [['compare', 'dmsp20_static_map'],
                                     ['diagnose', 'dmsp20_static_map'],
                                     ['tune', '--loop', 'strain']])
def test_a_command_on_a_muscle_needs_its_model(fam_bundle, command):
    """Data alone are held against nobody's muscle: the message asks for --model."""
    result = fam_bundle(*command)
    assert result.returncode == 2
    assert '--model' in result.stderr


def test_the_papers_bundle_is_never_taken_silently(fam_bundle):
    """`map` without a model draws the paper's figures and says that nobody chose it."""
    result = fam_bundle('map')
    assert result.stdout.startswith(f'{common.PAPER}: mu1, mu2 of 1 muscle')
    assert 'no model was chosen' in result.stdout.splitlines()[1]
