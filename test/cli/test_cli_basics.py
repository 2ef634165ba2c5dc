# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The command line as a user meets it: help, results, one line for each mistake."""

import json
import os
import subprocess
import sys

import pytest

from fam_bundle_ros.control.baselines import BaselineConfig
from fam_bundle_ros.model import catalogue

MODEL = """format: fam-bundle-model/1
name: small
motor_units:
  - name: mu1
    muscles: 1
    geometry: {radius: 6.35 mm, length: 127 mm, braid_angle: 33 deg, wall_thickness: 1.59 mm}
effects:
"""


def test_help_needs_nothing_heavy(repository):
    """The help is there at once: it imports no numerics, no plots, no ROS."""
    heavy = ['numpy', 'scipy', 'pint', 'plotly', 'pandas', 'control', 'rclpy', 'nicegui']
    result = subprocess.run(
        [sys.executable, '-c', 'import sys\nfrom fam_bundle_ros.cli import main\n'
         f'main(["--help"])\nprint("heavy", *(set({heavy}) & set(sys.modules)))'],
        capture_output=True, text=True, check=True, cwd=repository)
    assert 'Usage: fam_bundle' in result.stdout
    assert result.stdout.splitlines()[-1] == 'heavy'


def test_map_writes_page_and_numbers(fam_bundle, tmp_path):
    """`map` says where free strain dips and what tendons change, in page, terminal and JSON."""
    result = fam_bundle('map', '--model', 'spie2021', '--tendon', '20mm', '--json', 'map.json')
    assert result.returncode == 0, result.stderr
    assert 'free strain dips' in result.stdout
    found = json.loads((tmp_path / 'map.json').read_text())
    assert found['free_strain_dip'] < found['free_strain_start'] - 0.01
    ends = found['tendons']
    assert ends['tendons']['blocked_force_N'] == pytest.approx(ends['fixed']['blocked_force_N'])
    assert ends['tendons']['free_strain_full'] < ends['fixed']['free_strain_full']
    assert 'packaging length of 127 mm' in result.stdout
    assert f'{ends["tendons"]["free_strain_full"]:.3g}' in result.stdout
    page = (tmp_path / 'map.html').read_text()
    assert page.count('class="drawing"') == 6
    # nothing is fetched: no element names an address
    for fetched in ('src="http', 'href="http', '@import', 'src="//'):
        assert fetched not in page.replace(page[page.index('<script>'):
                                                page.index('id="colours"')], '')


def test_effects_lists_the_whole_catalogue(fam_bundle, tmp_path):
    """`effects` has every effect; one by name shows formula, file, units and bounds."""
    listed = fam_bundle('effects', '--json', 'effects.json')
    assert [name for name in catalogue.names() if name not in listed.stdout] == []
    entries = json.loads((tmp_path / 'effects.json').read_text())['effects']
    assert [entry['name'] for entry in entries] == catalogue.names()
    assert all(entry['source'] for entry in entries)
    one = fam_bundle('effects', 'coulomb_friction').stdout
    assert [word for word in ('F = -', 'laws/dry_friction.py', 'force', 'lower', 'upper', 'N/kPa',
                              'source') if word not in one] == []


def test_tune_shows_gains_and_margins(fam_bundle, tmp_path):
    """`tune` prints gains and keeps the margins that are asked for."""
    result = fam_bundle('tune', '--phase-margin', '60', '--transport-delay', '0ms',
                        '--sample-period', '2e0ms', '--spool-frequency', '125Hz',
                        '--json', 'gains.json')
    assert result.returncode == 0, result.stderr
    found = json.loads((tmp_path / 'gains.json').read_text())
    assert found['phase_margin_deg'] >= 60.0
    assert found['gain_margin_dB'] >= 8.0
    assert found['gains']['p'] > 0.0


@pytest.mark.parametrize(('arguments', 'words'), [
    (['map', 'absent.yaml'], ['absent.yaml', 'spie2021']),
    (['effects', 'coulomb_frction'], ['coulomb_frction', 'coulomb_friction']),
    (['tune', '--sample-period', '2 kPa'], ['--sample-period', 'kPa']),
    (['tune', '--gain-margin', 'much'], ['--gain-margin']),
    (['tune', '--gain-margin', '-3'], ['--gain-margin']),
    (['tune', '--phase-margin', '-1'], ['--phase-margin']),
    (['tune', '--transport-delay', '1kPa'], ['--transport-delay', 'kPa']),
    (['tune', '--phase-margin', '175'], ['no gain keeps']),
    (['map', 'spie2021', '--out', 'no/such/folder/map.html'], ['no/such/folder/map.html']),
    (['map', '--outt', 'a.html'], ['--outt']),
    (['map', 'spie2021', '--tendon', '20 kPa'], ['--tendon', 'kPa', 'like m']),
    (['map', 'spie2021', '--tendon', '127 mm'], ['tendon is 127 mm', 'no muscle is left']),
    (['map', 'spie2021', '--model', 'spie2021'], ['--model is spie2021', 'expected one of']),
    (['mapp'], ['mapp']),
])
def test_a_mistake_is_one_clear_line(fam_bundle, tmp_path, arguments, words):
    """Bad arguments: exit status 2, one line on stderr that names the mistake, nothing written."""
    result = fam_bundle(*arguments)
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1
    assert [word for word in words if word not in result.stderr] == []
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(('effects', 'words'), [
    ('  - mesh\n  - coulomb_frction\n', ['line 9', "'coulomb_frction'", 'coulomb_friction']),
    ('  - mesh\n  - coulomb_friction: {force: 4 kPa}\n', ['line 9', 'force', 'kPa', 'N']),
    ('  - mesh\n  - coulomb_friction: {force: 4 kN}\n', ['line 9', '4000 N', '0 and 2000 N']),
    ('  - mesh: {stiffness: 3 N}\n', ['line 8', 'stiffness']),
    ('effect_files: [a.py]\n', ['effects']),
])
def test_a_bad_model_file_is_one_clear_line(fam_bundle, tmp_path, effects, words):
    """Unknown effect, unit that does not fit, value out of bounds: file, line, key; status 2."""
    (tmp_path / 'bad.yaml').write_text(MODEL + effects)
    result = fam_bundle('map', 'bad.yaml')
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1
    assert [word for word in ['bad.yaml', *words] if word not in result.stderr] == []
    assert not (tmp_path / 'map.html').exists()


def test_python_effects_run_only_when_allowed(fam_bundle, tmp_path):
    """A model that names a Python file is refused, and runs with --allow-python."""
    (tmp_path / 'mine.py').write_text(
        'from pathlib import Path\n'
        'from fam_bundle_ros.model import law\n'
        'Path("ran").touch()\n'
        '@law("force", summary="a", source="b", family="mine", signature="c")\n'
        'def mine():\n'
        '    return -1.0\n')
    (tmp_path / 'own.yaml').write_text(MODEL + '  - mesh\n  - mine\neffect_files: [mine.py]\n')
    refused = fam_bundle('map', 'own.yaml')
    assert refused.returncode == 2
    assert '--allow-python' in refused.stderr
    assert not (tmp_path / 'ran').exists()
    assert fam_bundle('map', 'own.yaml', '--allow-python').returncode == 0
    assert (tmp_path / 'ran').exists()


def test_the_installed_command_reports_its_status(repository, tmp_path):
    """As a process: 0 and results on stdout; 2 and one line; 1 and what to install."""
    (tmp_path / 'hidden').mkdir()
    (tmp_path / 'hidden' / 'sitecustomize.py').write_text(
        'import sys\nsys.modules["plotly"] = None\n')

    def run(*arguments):
        return subprocess.run(
            [sys.executable, '-m', 'fam_bundle_ros', *arguments], cwd=tmp_path,
            capture_output=True, text=True, timeout=120, check=False, env={
                **os.environ,
                'PYTHONPATH': os.pathsep.join([str(tmp_path / 'hidden'), str(repository)])})

    fine, wrong, lacking = run('effects', 'mesh'), run('effects', 'mesch'), run('map')
    assert (fine.returncode, fine.stderr) == (0, '')
    assert 'Chou and Hannaford' in fine.stdout
    assert (wrong.returncode, len(wrong.stderr.splitlines())) == (2, 1)
    assert lacking.returncode == 1
    assert lacking.stderr.splitlines() == [
        "fam_bundle: this command needs plotly: pip install 'fam_bundle_ros[tools]'"]


def test_a_reader_that_leaves_early_costs_no_file(repository, tmp_path):
    """`fam_bundle ... | head`: the pipe is closed, and the numbers are still written."""
    read, write = os.pipe()
    os.close(read)
    found = subprocess.run(
        [sys.executable, '-m', 'fam_bundle_ros', 'map', '--json', 'map.json'], cwd=tmp_path,
        stdout=write, stderr=subprocess.PIPE, text=True, timeout=120, check=False,
        env={**os.environ, 'PYTHONPATH': str(repository)})
    os.close(write)
    assert found.returncode == 0, found.stderr
    assert 'Traceback' not in found.stderr
    assert (tmp_path / 'map.json').exists()


def test_an_unexpected_error_is_a_short_line(fam_bundle, monkeypatch):
    """A bug ends in one line and status 1; --debug lets the traceback through."""
    def broken(*arguments, **options):
        raise RuntimeError('of an unforeseen kind')

    monkeypatch.setattr(catalogue, 'names', broken)
    result = fam_bundle('effects')
    assert result.returncode == 1
    assert result.stderr.splitlines() == [
        'fam_bundle: unexpected RuntimeError: of an unforeseen kind (--debug shows where)']
    with pytest.raises(RuntimeError):
        fam_bundle('effects', '--debug')


def test_a_file_that_must_not_be_read_is_named(fam_bundle, tmp_path, monkeypatch):
    """As root every file may be read, so the system's answer is put in its place."""
    (tmp_path / 'log.csv').write_text('strain,pressure [kPa],force [N]\n')

    def denied(path):
        raise PermissionError(13, 'Permission denied', str(path))
    monkeypatch.setattr('fam_bundle_ros.data.reading.is_bag', denied)
    result = fam_bundle('compare', 'log.csv', '--model', 'spie2021')
    assert result.returncode == 2
    assert 'log.csv: Permission denied; expected a file that this user may' in result.stderr


def test_benchmark_control_reports_every_run_beside_equal_pressure(fam_bundle, tmp_path,
                                                                   monkeypatch):
    """One trajectory on two plants: rows and summary in JSON, a page, the terminal's tables."""
    # test/control/test_benchmark.py has the search for its gains
    monkeypatch.setattr('fam_bundle_ros.benchmarks.control.baseline_gains',
                        lambda *case: BaselineConfig())
    result = fam_bundle('benchmark-control', '--trajectories', 'ramp_80', '--plants',
                        'nominal,units_5', '--units', '2', '--controllers', 'none', '--no-ros',
                        '--workers', '1', '--json', 'runs.json', '--out', 'runs.html')
    assert result.returncode == 0, result.stderr
    found = json.loads((tmp_path / 'runs.json').read_text())
    assert [row['controller'] for row in found['rows']].count('equal_pressure') == 2
    assert [line['plant'] for line in found['summary']['plants']] == ['units_5', 'nominal']
    assert result.stdout.index('units_5') < result.stdout.index('nominal')
    assert 'not run' in result.stdout  # without neglect there is nothing to hold the dip against
    page = (tmp_path / 'runs.html').read_text()
    assert page.index('units_5') < page.index('the model itself')
    wrong = fam_bundle('benchmark-control', '--plants', 'nominal,nosuch')
    assert wrong.returncode == 2
    assert "'nosuch'" in wrong.stderr
    seeds = fam_bundle('benchmark-control', '--seeds', '1,two')
    assert seeds.returncode == 2
    assert "--seeds: '1,two'" in seeds.stderr
