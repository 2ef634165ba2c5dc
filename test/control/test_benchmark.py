# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The control benchmark on a subset, and its parts."""

from dataclasses import replace
from itertools import combinations
import json

import numpy as np
import pytest

from fam_bundle_ros.benchmarks import control, margins
from fam_bundle_ros.benchmarks.control import Case, cases_of, pairwise, run_benchmark
from fam_bundle_ros.benchmarks.control_metrics import chatters, compared, held_air, row_of
from fam_bundle_ros.benchmarks.control_summary import summarise
from fam_bundle_ros.benchmarks.control_trajectories import (
    is_strain,
    make_trajectory,
    STRAIN,
    top_force,
    TRAJECTORIES,
)
from fam_bundle_ros.benchmarks.margins import (
    asked_margin,
    CONTROLLERS,
    gain_margin,
    loop_of,
    settles,
)
from fam_bundle_ros.benchmarks.plants import paper_bundle, plant_of, PLANTS, UNITS
from fam_bundle_ros.control.baselines import BaselineConfig
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant import RigConfig
from fam_bundle_ros.simulation import Log


@pytest.fixture(scope='module')
def subset():
    """Return the benchmark on two plants and one trajectory, with what progress said."""
    said = []
    cases = [Case('delay_5', 'ramp_80', 2, ('neglect',)),
             Case('nominal', 'ramp_80', 2, ('no_feedback',))]
    # the search for the baseline's gains takes half of the time: one plant has its own
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(control, 'baseline_gains',
                      lambda plant, *case: margins.baseline_gains('nominal', *case))
        found = run_benchmark(cases, 1, lambda done, every, what: said.append(
            (done, every, what)))
    return found, said


def test_every_case_has_ours_and_equal_pressure_at_its_gains(subset):
    """Three runs a case, all figures of each, and the gains that were found for the baseline."""
    rows = subset[0].rows
    assert [row['controller'] for row in rows] == [
        'reversal_aware', 'equal_pressure', 'neglect',
        'reversal_aware', 'equal_pressure', 'no_feedback']
    assert {'tracking_rms', 'largest_error', 'error_there', 'dip_depth', 'switches', 'air_mass',
            'chatter', 'model_error', 'one_unit', 'rms_ratio'} <= set(rows[0])
    assert rows[0]['gain_margin'] > 1.0
    assert rows[1]['gains'][1] > 0.0
    assert rows[1]['rms_ratio'] == 1.0
    assert rows[1]['tracking_rms'] * rows[0]['rms_ratio'] == pytest.approx(
        rows[0]['tracking_rms'])


def test_result_survives_json_and_progress_counts_every_case(subset):
    """What is written can be read again; the worst plant is first, nominal last."""
    found, said = subset
    text = json.loads(json.dumps(found.to_json()))
    assert [line['plant'] for line in text['summary']['plants']] == ['delay_5', 'nominal']
    assert len(text['rows']) == 6
    assert said[-1][:2] == (2, 2)


def test_same_seed_gives_the_same_rows_and_another_does_not():
    """Runs are deterministic; the seed is that of the noise."""
    rows = [run_benchmark([Case('nominal', 'ramp_80', 2, (), seed)], 1).rows[0]
            for seed in (1, 1, 2)]
    assert rows[0] == rows[1]
    assert rows[2]['tracking_rms'] != rows[0]['tracking_rms']


# --- plants and trajectories ---------------------------------------------------------------------

#: Plants of the paper's bundle.
SMALL = [name for name in PLANTS if name != 'measured']


@pytest.fixture(scope='module')
def begun():
    """
    Return the first 1.3 s of every trajectory on every plant, with the nominal reference.

    Not on `measured`, another muscle with another model.
    """
    model = paper_bundle(2)
    found = {}
    for name in TRAJECTORIES:
        trajectory = replace(make_trajectory(name, model), duration=1.3, prepare=0.5)
        for plant in SMALL:
            log = loop_of(plant, 2, CONTROLLERS['reversal_aware'], BaselineConfig()).run(
                trajectory)
            found[plant, name] = log.force if log.kind == 'force' else log.strain
    return found


@pytest.mark.parametrize('name', TRAJECTORIES)
def test_every_plant_differs_from_nominal_on_every_trajectory(begun, name):
    """A plant that answers like the model would test nothing: each moves the result visibly."""
    least = 1e-6 if is_strain(name) else 0.02
    for plant in SMALL:
        if plant != 'nominal':
            assert np.abs(begun[plant, name] - begun['nominal', name]).max() > least, plant


@pytest.mark.parametrize('name', TRAJECTORIES)
def test_rates_of_trajectories_are_their_derivatives(name):
    """The rate that goes with a reference is the slope of its value; a step has none."""
    trajectory = make_trajectory(name, paper_bundle(2))
    for t in np.linspace(0.013, trajectory.duration - 0.011, 60):
        slope = (trajectory.value(t + 1e-5) - trajectory.value(t - 1e-5)) / 2e-5
        assert trajectory.rate(t) == pytest.approx(slope, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize('units', UNITS)
@pytest.mark.parametrize('plant', ['everything', 'units_10'])
def test_plant_and_model_can_both_give_what_is_asked(plant, units):
    """Force references stay within what both can give at their strain, whatever the size."""
    model, true = paper_bundle(units), plant_of(plant, units)
    for name in TRAJECTORIES:
        trajectory = make_trajectory(name, model, true)
        if trajectory.kind != 'force':
            continue
        for t in np.linspace(0.0, trajectory.duration, 40):
            strain = trajectory.imposed(t) if trajectory.imposed else STRAIN
            assert trajectory.value(t) < 0.95 * top_force(strain, model, true)
            assert trajectory.value(t) > 0.0


def test_ramps_have_the_rate_of_their_name():
    """5, 20 and 80 N/s, up and down."""
    for name in ('ramp_5', 'ramp_20', 'ramp_80'):
        trajectory = make_trajectory(name, paper_bundle(6))
        rates = {abs(round(trajectory.rate(t), 6))
                 for t in np.linspace(0.0, trajectory.duration, 500)}
        assert rates == {0.0, float(name.split('_')[1])}


# --- margins -------------------------------------------------------------------------------------

PI = CONTROLLERS['equal_pressure']


def test_twice_the_gain_is_half_the_margin():
    """And the loop settles below its margin, not above."""
    margins = [gain_margin('delay_10', 2, PI, BaselineConfig(force_gain=0.01 * size,
                                                             force_integral=size), 'force')
               for size in (10.0, 20.0)]
    assert margins[0] / margins[1] == pytest.approx(2.0, rel=0.2)
    usual = BaselineConfig(force_gain=0.1, force_integral=10.0)
    assert settles('delay_10', 2, PI, usual, 'force', 0.7 * margins[0])
    assert not settles('delay_10', 2, PI, usual, 'force', 1.5 * margins[0])


@pytest.mark.parametrize(('unsettled', 'margin'), [
    ((5.0, 20.0), 5.0), ((0.3, 0.7), 64.0), ((0.3, 20.0), 0.3), ((100.0, 200.0), 64.0)])
def test_the_margin_ends_at_the_first_gain_above_today_s_that_does_not_settle(
        unsettled, margin, monkeypatch):
    """A loop that comes to rest at its limits, at a far larger gain, has no larger margin."""
    low, high = unsettled
    monkeypatch.setattr(margins, 'settles', lambda *case: not low <= case[-1] <= high)
    assert gain_margin('nominal', 2, PI, BaselineConfig(), 'force') == pytest.approx(
        margin, rel=0.12)


def test_dead_time_costs_margin():
    """The same gains have less of it with 15 ms than with 5 ms."""
    gains = BaselineConfig(force_gain=0.3, force_integral=30.0)
    assert gain_margin('delay_15', 2, PI, gains, 'force') < 0.8 * gain_margin(
        'delay_5', 2, PI, gains, 'force')


def test_baselines_are_asked_for_our_margin_but_no_more_than_6_db():
    """No straw man: a cautious controller of ours does not make its rival cautious."""
    assert asked_margin(1.6) == 1.6
    assert asked_margin(30.0) == 2.0
    assert asked_margin(0.5) > 1.0


# --- cases ---------------------------------------------------------------------------------------

def test_cover_holds_every_pair_in_few_cases():
    """Every pair of values of two factors; not many more cases than the two longest need."""
    factors = [range(7), 'abcdef', (1, 2, 3), 'xyz']
    cases = pairwise(factors)
    for i, j in combinations(range(4), 2):
        assert {(case[i], case[j]) for case in cases} == {
            (a, b) for a in factors[i] for b in factors[j]}
    assert 42 <= len(cases) <= 50


def test_full_grid_has_all_controllers_in_every_case():
    """And the feedback's own cost is measured on the nominal plant only."""
    cases = cases_of(['valve', 'nominal'], ['moved'], [2, 3], ['neglect', 'batch'], [1, 2],
                     full=True)
    assert len(cases) == 8
    assert {case.others for case in cases if case.plant == 'valve'} == {('neglect', 'batch')}
    assert {case.others[-1] for case in cases if case.plant == 'nominal'} == {'no_feedback'}
    assert len(cases_of(seeds=(1, 2, 3))) == 3 * len(cases_of())


# --- figures -------------------------------------------------------------------------------------

def fake(plant, controller, rms, air=1e-4, trajectory='ramp_20', **more):
    """Return a row."""
    return {'plant': plant, 'controller': controller, 'trajectory': trajectory, 'units': 2,
            'seed': 1, 'kind': 'force', 'tracking_rms': rms, 'air_mass': air, 'switches': 1,
            'chatter': False, 'error_there': 2.0 * rms, 'dip_depth': rms, 'one_unit': False,
            'model_error': 5.0, **more}


def test_summary_holds_ours_against_equal_pressure():
    """Median, nine in ten and worst of the ratios; what is missed is said with its figure."""
    rows = []
    for k in range(10):
        rows += [fake('surface', 'reversal_aware', 0.5 + 0.1 * k, trajectory=f't{k}'),
                 fake('surface', 'equal_pressure', 1.0, 2e-4, trajectory=f't{k}')]
    rows += [fake('nominal', 'reversal_aware', 0.1, chatter=True),
             fake('nominal', 'equal_pressure', 1.0), fake('nominal', 'neglect', 0.2),
             fake('nominal', 'no_feedback', 0.08),
             fake('surface', 'diagnosed', 0.25, 3e-4, trajectory='t0', model=['mesh', 'end_caps'],
                  model_error=1.5)]
    found = summarise(rows)
    figures = {figure['figure']: figure for figure in found['figures']}
    tracking = figures['tracking rms over equal pressure']
    assert (tracking['median'], tracking['worst']) == pytest.approx((0.9, 1.4))
    assert tracking['nine_in_ten'] == pytest.approx(1.3)
    assert tracking['where'] == 'surface t9, 2 units'
    assert tracking['reached'] is False
    assert any('worst 1.4' in sentence for sentence in found['not_reached'])
    assert figures['air over equal pressure']['worst'] == 1.0
    assert figures['runs with chatter']['reached'] is False
    assert figures['dip at switches over that of neglect']['worst'] == pytest.approx(0.5)
    assert figures['nominal: rms over that without feedback']['worst'] == pytest.approx(1.25)
    assert figures['air over equal pressure, one unit is enough']['reached'] is None
    assert found['diagnosed'] == [{
        'plant': 'surface', 'units': 2, 'model': ['mesh', 'end_caps'], 'cases': 1,
        'model_error_before': 5.0, 'model_error': 1.5,
        **dict.fromkeys(('rms_ratio', 'rms_ratio_worst'), pytest.approx(0.5)),
        **dict.fromkeys(('air_ratio', 'air_ratio_worst'), pytest.approx(3.0))}]
    assert [line['plant'] for line in found['plants']] == ['surface', 'nominal']
    assert found['plants'][0]['rms_ratio'] == pytest.approx(0.95)
    assert found['plants'][0]['air_ratio'] == pytest.approx(0.5)


def log_of(state, force, reference=20.0, dt=0.01):
    """Return a log with a recruitment state and a force over time."""
    state, force = np.asarray(state), np.asarray(force, float)
    count, zero = len(state), np.zeros(len(state))
    return Log(dt * np.arange(count), np.full(count, reference), zero, np.full(count, 0.1), force,
               zero, np.full((count, 2), 1e5), zero, zero, state, zero,
               np.full(count, ''), zero, 1e-6 * np.arange(count), zero, [], 'force')


def test_a_switch_taken_back_at_a_still_reference_is_chatter():
    """Up and down while nothing moves is; up alone is not."""
    state = np.ones(300, int)
    assert not chatters(log_of(np.where(np.arange(300) > 100, 2, 1), state))
    state[100:120] = 2
    assert chatters(log_of(state, state))


def test_errors_at_switches_are_those_in_our_windows():
    """Of both controllers in the same stretch of time, whenever the other one switched."""
    up = np.where(np.arange(300) > 150, 2, 1)
    dipped, wavy = np.full(300, 20.0), np.full(300, 20.0)
    dipped[160], wavy[20], wavy[170] = 15.0, 5.0, 18.0
    ours, beside = log_of(up, dipped), log_of(np.zeros(300, int), wavy)
    assert compared(ours, ours, beside)['error_there'] == 5.0
    assert compared(beside, ours, beside)['error_there'] == 2.0
    assert row_of(ours, paper_bundle(2), RigConfig())['dip_depth'] == 5.0


def test_air_at_the_start_counts_as_if_filled_then():
    """What the first pressures hold is drawn air too: p V/(g R T) of each unit."""
    model = paper_bundle(2)
    volume = float(model.gas_volume(0.1)[0]) + 5e-6
    expected = 3e5 * volume / (1.2 * 287.05 * 293.15)
    assert held_air(model, np.array([1e5, 2e5]), 0.1, 5e-6) == pytest.approx(expected)
    log = log_of(np.ones(100, int), np.ones(100))
    assert row_of(log, model, RigConfig())['air_mass'] == pytest.approx(
        99e-6 + held_air(model, np.array([1e5, 1e5]), 0.1, 5e-6))


def test_unknown_trajectory_fails():
    """A name that is not there is refused with those that are."""
    with pytest.raises(InputError, match='expected one of ramp_5'):
        make_trajectory('loop', paper_bundle(2))


@pytest.mark.parametrize('plant', ['nominal', 'delay_5', 'delay_10', 'delay_15'])
def test_a_load_is_not_driven_on_where_push_back_collapses(plant):
    """
    Four muscles fold at 5 % strain as the second unit is switched on, at 0.18/s.

    The load goes ahead by no more than 0.3 %, and by four times what it moves in the dead time.
    """
    model, true = paper_bundle(6), plant_of(plant, 6)
    loop = loop_of(plant, 6, CONTROLLERS['reversal_aware'], BaselineConfig())
    # compiling the loop for another number of units takes longer than running its first second
    loop.compiled = False
    log = loop.run(replace(make_trajectory('load_step', model, true), duration=0.9))
    folding = (log.time > 0.3) & (log.time < 0.9)
    assert abs(log.error[folding]).max() < 0.003 + 4.0 * 0.18 * PLANTS[plant].delay
