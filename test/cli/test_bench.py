# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""`fam_bundle bench` on tiny cases: what it compares is the same, and what it says is complete."""

from importlib import import_module
import json

import numpy as np
import pytest

from fam_bundle_ros import discovery, kernels
from fam_bundle_ros.benchmarks import (
    plants,
    speed,
    speed_loop,
    speed_model,
    speed_peers,
    speed_ros,
    speed_start,
    speed_studies,
    speed_ticks,
)
from fam_bundle_ros.benchmarks.speed_rows import ROWS, warm_up
from fam_bundle_ros.plant import MassSpring, Rig, RigConfig
from fam_bundle_ros.processes import environment

FIGURE = {'what', 'value', 'unit', 'peer', 'beside', 'ratio', 'reach', 'at_least', 'reached',
          'note'}
TINY = 0.02


@pytest.fixture(scope='module')
def bundle():
    """Return the bundle of two motor units."""
    return plants.paper_bundle(2)


def test_bench_writes_table_page_and_numbers(fam_bundle, tmp_path, monkeypatch):
    """Each figure stands beside its peer and its reach, in the terminal, the JSON and the page."""
    # with the bytecode that is there: to compile all that starts is half of the work
    monkeypatch.setattr(speed_start, '_environment', environment)
    result = fam_bundle('bench', '--only', 'force,start', '--scale', TINY, '--json', 'bench.json',
                        '--out', 'bench.html')
    assert result.returncode == 0, result.stderr
    found = json.loads((tmp_path / 'bench.json').read_text())
    assert set(found) == {'machine', 'scale', 'rows'}
    assert {'cores', 'python', 'numba', 'load'} <= set(found['machine'])
    assert [row['name'] for row in found['rows']] == ['force', 'start']
    for row in found['rows']:
        assert set(row) == {'name', 'what', 'skipped', 'where', 'seconds', 'figures'}
        assert row['figures']
        for figure in row['figures']:
            assert set(figure) == FIGURE
            assert figure['what'].split(',')[0] in result.stdout
        assert row['where'] or all(figure['reached'] is not False for figure in row['figures'])
    page = (tmp_path / 'bench.html').read_text()
    assert 'fam_bundle --help' in page
    assert len(page) < 100_000


def test_bench_lists_its_rows_and_refuses_others(fam_bundle):
    """`--list` names every row; a name that is none is one line with those that are."""
    listed = fam_bundle('bench', '--list').stdout
    assert [row.name for row in ROWS if row.name not in listed] == []
    wrong = fam_bundle('bench', '--only', 'force,speed')
    assert wrong.returncode == 2
    assert "'speed'" in wrong.stderr
    assert 'lock-step' in wrong.stderr
    assert len(wrong.stderr.splitlines()) == 1


def here(function, *given, plain=False, **more):
    """Call a function as `elsewhere` does, in this process, with numba if it has it."""
    module, _, name = function.partition(':')
    return getattr(import_module(module), name)(*given, **more)


@pytest.mark.parametrize('name', ['solvers', 'jacobian', 'ticks'])
def test_every_row_gives_figures_or_says_why_not(name, monkeypatch):
    """A row measures something, or names what is missing."""
    monkeypatch.setattr(speed_ticks, 'elsewhere', here)
    row, = speed.choose(ROWS, [name])
    result = speed.run(row, TINY)
    assert result.figures or result.skipped
    assert all(figure.value > 0.0 for figure in result.figures)


@pytest.mark.parametrize(('graph', 'case'), [
    ('pids', {'rate': 1000.0, 'units': 3}), ('bundle', {'lock_step': True})])
def test_rows_over_ros_hold_nodes_against_empty_ones(domain_id, monkeypatch, graph, case):
    """Both graphs answer samples: three loops at 1 kHz, all in lock-step."""
    pytest.importorskip('rclpy', reason='rclpy is not installed')
    from fam_bundle_ros.nodes import latency
    monkeypatch.setattr(speed_ros, 'elsewhere',
                        lambda function, *given, **more: latency.measure(*given, **more))
    ours, empty = speed_ros.pair(TINY, graph, **case)
    assert set(ours) == set(empty) == {'median', 'p99', 'max', 'answered', 'sent', 'cpu'}
    assert 0.0 < ours['median'] <= ours['p99'] <= ours['max']
    assert empty['answered'] > 50.0


def test_diagnose_is_timed_on_a_log_with_hidden_friction(monkeypatch):
    """Without it the model is off by the friction, with it by the noise."""
    asked = []
    monkeypatch.setattr(discovery, 'diagnose', lambda model, data: asked.append((model, data)))
    assert speed_studies.diagnose_seconds(700) >= 0.0
    (model, data), = asked
    assert len(data) == 700
    friction = model.with_effect('coulomb_friction')
    assert discovery.compare(model, data).error_N > 0.8 * friction.effect('coulomb_friction').force
    assert discovery.compare(friction, data).error_N < 1.0


def test_the_closed_loop_runs_without_numba_elsewhere():
    """The plain figures come from a process that has no numba, whatever this one has."""
    assert speed.elsewhere('fam_bundle_ros.kernels:numba', plain=True) is None
    found = speed_loop.speeds(2, TINY, [('reversal_aware', 'orderly')], ['sine_0.5'], 0.0)
    assert list(found) == ['reversal_aware/orderly/sine_0.5']


def test_a_failure_elsewhere_is_a_row_that_is_skipped():
    """What goes wrong in another process is said in a line."""
    with pytest.raises(speed.Skipped, match='KeyError'):
        speed.elsewhere('operator:getitem', {}, 'a')


@pytest.mark.parametrize(('figure', 'reached'), [
    (speed.Figure('a', 3.0, 's', reach=4.0), True),
    (speed.Figure('a', 3.0, 's', reach=2.0), False),
    (speed.Figure('a', 3.0, 's', 'b', 2.0, 1.4), False),
    (speed.Figure('a', 3.0, 's', 'b', 2.0, 1.4, at_least=True), True),
    (speed.Figure('a', 3.0, 's', 'b', 2.0), None)])
def test_a_figure_is_reached_by_its_ratio_or_by_itself(figure, reached):
    """Beside a peer the ratio counts, else the value; more or less as the row says."""
    assert figure.reached is reached


def test_the_force_by_hand_is_that_of_the_bundle(bundle):
    """The NumPy that stands for a user's own gives the same force."""
    simple, motion = bundle.without_effect('resistive_buckling'), speed_model.motion_of(500)
    assert speed_model.by_hand(simple, motion.strain, motion.pressure) == pytest.approx(
        simple.force(motion.strain, motion.pressure), rel=1e-9)


def test_the_whole_catalogue_is_one_effect_of_every_family(bundle):
    """No law that acts in a muscle is left out, and no family stands twice."""
    families = [effect.family for effect in speed_model.whole_catalogue(bundle).effects]
    assert len(families) == len(set(families))
    assert {'mesh', 'bladder', 'dry_friction', 'relaxation', 'braid', 'threshold',
            'softening'} <= set(families)


def test_the_solvers_plant_is_the_rig(bundle):
    """Written from the equations, the ODE moves a mass and fills chambers as the rig does."""
    config = RigConfig(load=MassSpring(mass=4.0, damping=40.0), step=5e-5)
    commands = np.array([[0.4, 0.2], [0.4, -0.3], [0.1, 0.3], [-0.2, 0.3]]).repeat(25, axis=0)
    rig, rows = Rig(bundle, config), []
    for command in commands:
        rig.step(command, 2e-3)
        rows.append([rig.truth.strain, *rig.truth.pressure])
    plant = speed_peers.Plant(bundle, config)
    found = speed_peers.replay(plant, commands, 2e-3, 1e-5)
    assert np.ptp(found[:, 0]) > 0.02
    assert speed_peers.errors(found, np.array(rows)).strain < 1e-4
    assert speed_peers.errors(found, np.array(rows)).pressure < 100.0
    response = speed_peers.respond(plant, commands[:30], 2e-3, 1e-6)
    assert speed_peers.errors(response, found).pressure < 20.0


def test_where_the_time_goes_names_files():
    """A profile is summed up by file, C functions with their callers."""
    text = speed.where_of(lambda: np.sort(np.random.default_rng(1).random(200_000)).sum())
    assert '%' in text
    assert 'test_bench.py' in text or 'numpy' in text


def test_warming_up_is_silent_and_leaves_compiled_code(tmp_path, monkeypatch, capfd):
    """`make install` fills the cache without a word; without numba there is nothing to do."""
    monkeypatch.setattr(kernels, 'numba', lambda: None)
    warm_up()
    assert capfd.readouterr() == ('', '')
