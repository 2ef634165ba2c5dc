# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The menu of next experiments: protocols within the data, and their motions."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.data.protocol import (
    dumps_protocol,
    duration,
    Hold,
    Pause,
    PressureSteps,
    Protocol,
    read_protocol,
    save_protocol,
    Sweep,
)
from fam_bundle_ros.discovery.experiment import (
    _is_swept,
    best_experiment,
    finer,
    menu,
    motion,
    remedy_of,
)
from fam_bundle_ros.discovery.priors import own_priors, Prior
from fam_bundle_ros.model import Bundle, load_model
from fam_bundle_ros.resources import config_path


@pytest.fixture(scope='module')
def bundle():
    """Return the bundle of the paper."""
    return load_model(config_path('models/spie2021.yaml'))


@pytest.fixture
def log():
    """Return a function: cells of a sweep of both motor units over some strains."""
    def make(low=0.02, high=0.2, top=300e3, offset=0.0):
        way = np.concatenate([np.linspace(low, high, 50), np.linspace(high, low, 50)])
        share = np.repeat([0.3, 1.0], 100)
        pressure = np.column_stack([top * share, top * share / 2]) + offset
        return SimpleNamespace(data=build('log', np.tile(way, 2), pressure,
                                          np.tile(200.0 - 600.0 * way, 2), np.repeat([0, 1], 100),
                                          np.arange(200) * 0.1,
                                          max_pressure=max(2.0 * top, 1e6)))
    return make


def test_every_experiment_can_be_measured_and_keeps_to_the_data(bundle, log, tmp_path):
    """Each is a file that is read again; strain and pressure stay where the data are."""
    for protocol in [*menu(log(), bundle), finer(log(), bundle)]:
        save_protocol(protocol, tmp_path / 'next.yaml')
        assert dumps_protocol(read_protocol(tmp_path / 'next.yaml')) == dumps_protocol(protocol)
        assert max(protocol.highest) <= 300e3
        assert protocol.highest[1] <= 150e3
        assert protocol.limits.force == pytest.approx(1.5 * 188.0)
        low, high = protocol.limits.strain
        assert low >= 0.02 - 1e-9
        assert high <= 0.2 + (0.08 if 'past its free strain' in protocol.name else 0.0) + 1e-9


def test_a_hydraulic_muscle_has_a_next_experiment_at_its_own_pressures(bundle, log):
    """Data up to 5 MPa: what is proposed goes as far as they do, whatever is usual for air."""
    tests = menu(log(top=5e6), bundle)
    assert max(tests[0].highest) == pytest.approx(5e6, rel=0.02)


def test_the_highest_pressure_may_be_a_rounding_of_a_float_below_a_multiple(bundle, log):
    """Unit conversions do that; such data have experiments like any others."""
    assert [max(protocol.highest) for protocol in menu(log(top=300e3 - 5e-5), bundle)] == [
        max(protocol.highest) for protocol in menu(log(top=300e3), bundle)]


def test_menu_has_what_tells_speed_memory_range_and_units_apart(bundle, log):
    """Two other speeds, holds, an hour's pause, low pressures, each motor unit alone."""
    tests = {protocol.name: protocol for protocol in menu(log(), bundle)}
    plain = next(iter(tests.values()))
    fast, slow = (tests[f'sweep the same isobars ten times {word}'] for word in (
        'faster', 'slower'))
    rates = [protocol.steps[0].rate for protocol in (fast, plain, slow)]
    assert rates == pytest.approx([10 * rates[1], rates[1], 0.1 * rates[1]])
    assert any(duration(protocol) > 3600.0 for protocol in tests.values())
    alone = tests['sweep with mu2 alone under pressure']
    assert alone.highest == (0.0, 150e3)
    one = Bundle('one', bundle.motor_units[:1], bundle.effects)
    data = log().data
    single = SimpleNamespace(data=build('one', data.strain, data.pressure[:, :1], data.force,
                                        data.trial, data.time))
    assert not any('alone' in protocol.name for protocol in menu(single, one))


def test_motion_is_what_the_protocol_does():
    """Strain, pressure, rate and time of sweeps, a hold and a pause, each segment a trial."""
    protocol = Protocol('p', 1, (
        Sweep((0.0, 0.2), 0.1, ((50e3,), (90e3,))), Hold((0.1, 0.2), 60.0, ((70e3,),)),
        Pause(1000.0), PressureSteps(((10e3,), (90e3,)), 0.5, 0.1)), settle=3.0)
    done = motion(protocol)
    begins = np.flatnonzero(done.start)
    assert len(begins) == 4
    assert done.time[0] == pytest.approx(1.0 + 3.0)
    sweep = slice(begins[1], begins[2])
    assert done.pressure[sweep, 0].tolist() == [90e3] * 50
    assert (done.strain[sweep].min(), done.strain[sweep].max()) == (0.0, 0.2)
    assert sorted(set(np.round(done.strain_rate[sweep], 9))) == [-0.1, 0.1]
    assert np.ptp(done.time[sweep]) == pytest.approx(4.0)
    moving = np.diff(done.strain[sweep]) / np.maximum(np.diff(done.time[sweep]), 1e-9)
    assert set(np.round(moving[np.diff(done.strain[sweep]) != 0.0], 6)) == {0.1, -0.1}
    hold = slice(begins[2], begins[3])
    assert (done.strain_rate[hold] == 0.0).sum() == 120
    assert np.ptp(done.time[hold]) == pytest.approx(120.2)
    assert done.time[begins[3]] - done.time[begins[3] - 1] > 1000.0
    steps = slice(begins[3], None)
    assert sorted(set(done.pressure[steps, 0])) == [10e3, 90e3]


def test_data_at_one_strain_or_without_pressure_still_have_a_next_experiment(bundle, log):
    """A range of 0.05 and 20 kPa are then tried; a reading just over a limit is its noise."""
    isometric, airless = log().data, log(top=0.0)
    still = SimpleNamespace(data=build(
        'still', np.full(200, 0.1), isometric.pressure + np.arange(200)[:, None],
        isometric.force, isometric.trial, isometric.time))
    sweep = menu(still, bundle)[0].steps[0]
    assert sweep.strain == pytest.approx((0.1, 0.15))
    assert max(menu(airless, bundle)[0].highest) == 20e3
    over = menu(log(top=345e3), bundle)[0]
    assert over.highest[0] == pytest.approx(344.7e3)


def test_other_speeds_are_multiples_of_that_of_the_data(bundle, log):
    """The plain experiment moves as the log did, 0.037 1/s; others ten times and a tenth."""
    rates = {protocol.name: protocol.steps[0].rate for protocol in menu(log(), bundle)[:3]}
    assert list(rates.values()) == pytest.approx([0.037, 0.37, 0.0037])
    assert 'faster' in list(rates)[1]
    assert 'slower' in list(rates)[2]


def test_a_calliper_is_asked_for_only_where_it_tells_something():
    """Dead ends can be measured; two laws of friction with one force cannot."""
    assert 'calliper' in remedy_of('bladder_elasticity', 'end_caps')
    assert 'same force' in remedy_of('coulomb_friction', 'viscous_power')


STROKE = np.linspace(0.0, 0.2, 50)
ISOBARS = np.repeat([1e5, 2e5, 3e5, 4e5], 100)


@pytest.mark.parametrize(('course', 'pressure', 'swept'), [
    ([STROKE, STROKE[::-1]] * 4, ISOBARS, True),
    ([STROKE[:-1], [0.2] * 51] * 4, ISOBARS, False),                    # one way only
    ([STROKE, STROKE[::-1]] * 4, np.tile(np.linspace(0.0, 4e5, 100), 4), False),  # no isobars
])
def test_a_log_that_is_the_plain_sweep_is_told_from_others(course, pressure, swept):
    """Where it was made, in one piece or not, another such sweep would tell nothing new."""
    strain, trial = np.concatenate(course), np.repeat(np.arange(4), 100)
    for pieces in (trial, 0 * trial) if swept else (trial,):
        log = build('log', strain, pressure[:, None], np.full(400, 50.0), pieces,
                    0.1 * np.arange(400))
        assert _is_swept(log) == swept
        assert not _is_swept(replace(log, time=None))


@pytest.mark.parametrize('static', [False, True])
def test_experiments_are_ranked_by_what_a_refit_cannot_make_up_for(bundle, log, static):
    """Squared noise deviations between both, with the freedom that the second's fit has."""
    keys = ('geometry.radius', 'geometry.braid_angle')
    values = [bundle.motor_units[0].geometry.radius, bundle.motor_units[0].geometry.braid_angle]
    priors = [Prior(key, 0.5 * value, 2.0 * value, value, 0.02 * value, 'normal', True)
              for key, value in zip(keys, values)]
    covariance = np.array([[0.3, 0.1], [0.1, 0.5]])
    first = SimpleNamespace(model=bundle.with_effect('coulomb_friction', force=3.0).with_effect(
        'force_sensor_gain', gain=0.02))
    second = SimpleNamespace(model=bundle, priors=priors, u=np.zeros(2), covariance=covariance)
    cells = log()
    cells.data = replace(cells.data, time=None) if static else cells.data
    cells.noise = 0.7
    best, ranked = best_experiment(SimpleNamespace(cells=cells), first, second)
    known, made_up = np.linalg.inv(covariance), []
    for item in ranked:
        test = motion(item.protocol)
        force = first.model.predict(test)

        def apart(u, test=test, force=force):
            moved = bundle.with_parameters(
                {prior.key: prior.theta(x) for prior, x in zip(priors, u)})
            return np.sum(((moved.predict(test) - force) / 0.7) ** 2) + u @ known @ u
        least = minimize(apart, np.zeros(2), method='Nelder-Mead').fun
        assert item.separation == pytest.approx(least, rel=2e-2)
        made_up.append(1.0 - item.separation / apart(np.zeros(2)))
    assert min(made_up) >= 0.0
    assert max(made_up) > 0.03
    assert best is ranked[0]
    plain = [item for item in ranked if item.words.startswith('sweep each isobar up and down')]
    assert len(plain) == static  # the log is such a sweep
    # no speed matters to these effects
    assert static or not any('ten times' in item.words for item in ranked)
    if static:
        # what is harder to do has to separate by a tenth more
        assert [item.separation > 1.1 * plain[0].separation for item in ranked] == [
            k < ranked.index(plain[0]) for k in range(len(ranked))]
    same = SimpleNamespace(model=bundle)
    assert best_experiment(SimpleNamespace(cells=cells), same, second)[0] is None


def test_a_rival_moves_its_parameters_no_further_than_their_bounds(bundle, log):
    """A viscous force of unknown exponent is no dry friction at ten times the speed."""
    cells = log()
    cells.noise = 0.1
    speed = np.median(np.abs(cells.data.strain_rate)) * bundle.length / 0.01
    viscous = bundle.with_effect('viscous_power', exponent=0.6, coefficient=300.0 / speed ** 0.6)
    priors = [prior for prior in own_priors(viscous) if prior.key.startswith('viscous_power.')]
    # what one speed tells: the logarithm of the force there
    along = np.array([priors[0].width, 0.6 * np.log(speed) * priors[1].width])
    assert [prior.kind for prior in priors] == ['log', 'log']
    rival = SimpleNamespace(model=viscous, priors=priors, u=np.zeros(2),
                            covariance=np.linalg.inv(np.eye(2) + 1e8 * np.outer(along, along)))
    first = SimpleNamespace(model=bundle.with_effect('coulomb_friction', force=3.0,
                                                     per_pressure=0.0))
    _, ranked = best_experiment(SimpleNamespace(cells=cells), first, rival)
    apart = {item.words: item.separation for item in ranked}
    # 200 samples of both units; the exponent is 0.3 or more, the force there may give way a little
    least = 200 * (2 * 3.0 * (10 ** 0.3 - 1.0) / 0.1) ** 2
    assert 0.5 * least < apart['sweep the same isobars ten times faster'] < least
