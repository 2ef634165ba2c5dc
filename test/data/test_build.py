# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What is at rest, which way it moves, what is left out: the arrays of a measurement."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.data.measurement import build, BY_PRESSURE, BY_STRAIN, REST
from fam_bundle_ros.data.rates import signal_step, slope
from fam_bundle_ros.data.trials import spread_stamps
from fam_bundle_ros.discovery.log_rows import unknown_direction
from fam_bundle_ros.errors import InputError


@pytest.fixture
def isometric(muscle):
    """Return a function that fills and vents a muscle held at one length, 20 Hz."""
    def make(strain=0.1 / 3.0, noise=0.0, jitter=0.0, cycles=2):
        rng = np.random.default_rng(0)
        once = np.concatenate([np.linspace(0, 400e3, 60), np.full(30, 400e3),
                               np.linspace(400e3, 0, 60), np.zeros(30)])
        pressure = np.tile(once, cycles) + 300.0 * noise * rng.standard_normal(180 * cycles)
        held = strain + jitter * rng.standard_normal(len(pressure))
        force = muscle(held, pressure) + noise * rng.standard_normal(len(pressure))
        return build('held', held, pressure, force, None, 0.05 * np.arange(len(pressure)))
    return make


@pytest.mark.parametrize('jitter', [0.0, 1e-17, 1e-9])
def test_a_held_muscle_rests_whatever_the_last_digits_of_its_strain(isometric, jitter):
    """A constant strain with rounding noise has no direction, and no row is dropped."""
    data = isometric(jitter=jitter)
    assert (data.direction_basis != BY_STRAIN).all()
    assert len(data) == 360
    assert not data.dropped


@pytest.mark.parametrize('noise', [0.0, 0.5])
def test_a_held_muscle_takes_its_direction_from_the_pressure(isometric, noise):
    """Filling is +1, venting -1, a hold of the pressure is rest; the basis says which it is."""
    data = isometric(noise=noise)
    filling, full = slice(10, 50), slice(68, 82)
    venting, empty = slice(100, 140), slice(158, 172)
    assert (data.direction[filling] == 1).all()
    assert (data.direction[venting] == -1).all()
    assert (data.direction[full] == 0).mean() > 0.9
    assert (data.direction[empty] == 0).mean() > 0.9
    assert (data.direction_basis[filling] == BY_PRESSURE).all()
    assert (data.direction_basis[data.direction == 0] == REST).all()


def test_rows_that_came_in_packets_are_spread_as_they_were_taken(muscle):
    """Three or four rows every 16 ms, stamped 20 us apart: their rate is that of the motion."""
    true = 0.005 * np.arange(2000)
    stamps = 0.016 * np.ceil(true / 0.016)
    first = np.append(True, np.diff(stamps) > 0)
    place = np.arange(2000) - np.flatnonzero(first)[np.cumsum(first) - 1]
    strain = 0.02 + 0.01 * true
    data = build('usb', strain, np.full((2000, 1), 2e5), muscle(strain, np.full(2000, 2e5)),
                 None, stamps + 2e-5 * place)
    assert any(note.startswith('137') and 'packet' in note for note in data.notes)
    assert np.abs(data.strain_rate[20:-20] / 0.01 - 1.0).max() < 0.3
    assert np.all(data.direction == 1)


@pytest.mark.parametrize('pause', [60.0, 3600.0, 36e3, 2.6e6])
def test_a_pause_of_the_log_leaves_the_rates_of_the_rest(muscle, pause):
    """A clock that goes on for hours between two sweeps changes no rate and no direction."""
    time = 0.05 * np.arange(900)
    strain = 0.1 - 0.1 * np.cos(2 * np.pi * time / 6.0)
    pressure = np.full(900, 300e3)
    whole, apart = (build('log', strain, pressure, muscle(strain, pressure), None,
                          time + gap * (np.arange(900) >= 400)) for gap in (0.0, pause))
    assert np.allclose(apart.strain_rate, whole.strain_rate, atol=3e-3)
    assert (apart.direction == whole.direction).mean() > 0.99


def test_a_moving_muscle_takes_its_direction_from_the_strain(sweeps):
    """In a sweep at constant pressure the strain decides, on every row inside."""
    data = sweeps()
    inside = (data.strain > 0.01) & (data.strain < 0.23)
    assert (data.direction_basis[inside] == BY_STRAIN).all()
    assert (data.direction[inside] == np.sign(data.strain_rate[inside])).all()


def test_a_strain_read_in_steps_moves_all_the_same(muscle):
    """A sweep read in steps of 0.001 has one direction up and one down, not a flicker."""
    time = 0.02 * np.arange(2000)
    true = 0.1 - 0.1 * np.cos(2 * np.pi * time / 40.0)
    strain = 0.001 * np.round(true / 0.001)
    pressure = np.where(time < 20.0, 2e5, 3e5)
    data = build('steps', strain, pressure, muscle(strain, pressure), None, time)
    fast = np.abs(np.sin(2 * np.pi * time / 40.0)) > 0.3
    right = data.direction == np.sign(np.sin(2 * np.pi * time / 40.0))
    assert right[fast].mean() > 0.97
    rate = 0.1 * 2 * np.pi / 40.0 * np.sin(2 * np.pi * time / 40.0)
    assert np.sqrt(np.mean((data.strain_rate - rate)[fast] ** 2)) < 0.25 * np.abs(rate).max()


def test_noise_of_a_strain_at_rest_has_no_direction(muscle):
    """Between two sweeps the strain is held with noise of 1e-4: most of these rows rest."""
    up = np.linspace(0.0, 0.2, 100)
    true = np.concatenate([up, np.full(300, 0.2), up[::-1], np.zeros(300)])
    strain = true + 1e-4 * np.random.default_rng(0).standard_normal(800)
    data = build('held', strain, np.full(800, 3e5), muscle(true, 3e5), None, 0.05 * np.arange(800))
    held = np.r_[115:385, 515:785]
    assert (data.direction[held] == 0).mean() > 0.95
    assert (data.direction[10:90] == 1).all()


@pytest.mark.parametrize('share', [0.0, 0.2, 0.5])
@pytest.mark.parametrize('noise', [5e-5, 1e-4, 2e-4])
def test_a_strain_held_between_two_steps_of_its_gauge_rests(share, noise, muscle):
    """Readings that alternate by a step or two: the direction is that of the pressure."""
    step, time = 5e-4, np.arange(0.0, 200.0, 0.1)
    pressure = 2e5 - 1.5e5 * np.cos(2.0 * np.pi * time / 40.0)
    strain = 0.1 + share * step + noise * np.random.default_rng(0).standard_normal(len(time))
    data = build('log', step * np.round(strain / step), pressure[:, None],
                 muscle(strain, pressure), None, time)
    assert np.mean(data.direction_basis == BY_STRAIN) < 0.05


def test_a_muscle_held_at_one_level_after_another_rests_at_each(muscle):
    """The logged strain is the setpoint, exactly constant: filling is +1, venting -1."""
    level = np.repeat(np.arange(11) * 0.02, 200)
    pressure = np.tile(np.r_[np.linspace(5e4, 3e5, 100), np.linspace(3e5, 5e4, 100)], 11)
    data = build('levels', level, pressure[:, None], muscle(level, pressure), None,
                 0.05 * np.arange(2200))
    assert np.mean(data.direction_basis == BY_PRESSURE) > 0.95
    filling = np.tile(np.repeat([1, -1], 100), 11)
    assert np.mean(data.direction == filling) > 0.95


@pytest.mark.parametrize('seed', range(5))
def test_a_held_strain_rests_to_the_ends_of_its_trial(muscle, seed):
    """
    At an end the slope is known from one side only: its noise is eleven times larger there.

    Taken for motion, it would make half a window at each end a turn of unknown direction, more
    than half of these rows.
    """
    held = np.repeat([0.0, 0.06, 0.12, 0.18], 120)
    up = np.linspace(6e4, 4e5, 60)
    pressure = np.tile(np.r_[up, up[::-1]], 4)
    strain = held + 1e-4 * np.random.default_rng(seed).normal(size=480)
    data = build('held', strain, pressure[:, None], muscle(held, pressure),
                 np.repeat(range(4), 120), 0.2 * np.arange(480))
    assert not (data.direction_basis == BY_STRAIN).any()
    assert unknown_direction(data).sum() == 4


def test_even_ramps_are_not_read_in_steps(sweeps):
    """Ramps whose samples are evenly apart have no rounding noise in their rate."""
    data = sweeps()
    assert signal_step(data.strain, data.trial) == 0.0
    assert slope(data.time, data.strain, data.trial).noise.max() < 1e-2 * 0.024
    inside = (data.strain > 0.01) & (data.strain < 0.23)
    assert np.allclose(np.abs(data.strain_rate[inside]), 0.024, rtol=0.05)


@pytest.mark.parametrize('speed', [0.2, 0.7, 1.0, 1.3, 5.0])
def test_steps_are_seen_at_every_speed(speed):
    """A reading in steps of 2 is seen whether it stays or skips."""
    true = 60.0 * np.sin(np.arange(3000) * speed / 60.0)
    assert signal_step(2.0 * np.round(true / 2.0), np.zeros(3000, int)) == pytest.approx(2.0)


@pytest.mark.parametrize(('strain', 'pressure', 'words'), [
    (np.full(40, 0.1), np.linspace(0, 4e5, 40), 'one strain only'),
    (np.linspace(0, 0.2, 40), np.full(40, 3e5), 'one pressure only')])
def test_one_level_is_enough_and_is_said(strain, pressure, words):
    """Isometric and isobaric data are taken, with a note on what they cannot tell."""
    data = build('one', strain, pressure, np.linspace(1, 50, 40)[::-1])
    assert any(words in note for note in data.notes)


def test_data_in_which_nothing_changes_fails():
    """Data of one strain at one pressure are refused."""
    with pytest.raises(InputError, match='neither strain .* nor pressure'):
        build('still', np.full(40, 0.1), np.full(40, 3e5), np.arange(40.0))


def test_rows_without_a_number_are_left_out_and_counted(sweeps):
    """Each reason has its count; the string and the dictionary show it."""
    data = sweeps()
    force, strain = data.force.copy(), data.strain.copy()
    force[[3, 4, 100]] = np.nan
    strain[[4, 200]] = np.inf
    again = build('gaps', strain, data.pressure, force, data.trial, data.time)
    assert len(again) == len(data) - 4
    assert again.dropped == {'without a number in strain': 2, 'without a number in force': 2}
    assert '4 of 960 rows left out' in str(again)
    assert again.to_dict()['dropped'] == again.dropped
    assert np.allclose(again.force, np.delete(data.force, [3, 4, 100, 200]))


def test_a_selection_with_a_reason_is_counted_too(sweeps):
    """Rows that a later step leaves out add to the count, and sums stay right."""
    data = sweeps()
    kept = data.select(data.strain > 0.1, 'at small strains')
    assert len(kept) + sum(kept.dropped.values()) == len(data)
    assert data.select(data.strain > 0.1).dropped == {}


def test_too_few_rows_with_numbers_fail_and_name_the_first_gap(sweeps):
    """Where next to nothing is left the message says which row lacks what."""
    data = sweeps()
    force = np.full(len(data), np.nan)
    force[:5] = 1.0
    with pytest.raises(InputError, match=r'5 rows .* \(force has none in row 6\)'):
        build('gaps', data.strain, data.pressure, force, data.trial, data.time)


def test_equal_stamps_of_a_coarse_clock_are_spread_evenly(muscle):
    """Ten samples a second under whole seconds: the true clock comes back."""
    true = 0.1 * np.arange(395) + 0.45
    strain = 0.1 - 0.1 * np.cos(true / 6.0)
    pressure = 1e5 + 5e3 * true
    data = build('coarse', strain, pressure, muscle(strain, pressure), None, np.floor(true))
    assert len(data) == 395
    steps = np.diff(data.time)
    assert (steps > 0).all()
    assert np.allclose(steps, 0.1, atol=0.02)
    assert any('spread' in note for note in data.notes)


def test_spread_stamps_keep_trials_apart():
    """Rows at the end of a trial are not spread into the next trial."""
    time = np.array([0.0, 0.0, 1.0, 1.0, 50.0, 50.0, 51.0, 51.0])
    trial = np.repeat([0, 1], 4)
    assert np.allclose(spread_stamps(time, trial), [0, 0.5, 1, 1.5, 50, 50.5, 51, 51.5])


def test_rows_written_twice_are_left_out_and_counted(sweeps):
    """A logger that writes each row twice gives the same measurement, and the count."""
    data = sweeps()
    twice = [np.repeat(values, 2) for values in (data.strain, data.pressure[:, 0], data.force,
                                                 data.trial, data.time)]
    again = build('twice', *twice)
    assert again.dropped == {'that repeat the row before': len(data)}
    assert np.array_equal(again.time, data.time)


def test_time_that_stands_still_fails(sweeps):
    """A constant time column is refused."""
    data = sweeps()
    with pytest.raises(InputError, match='stands still'):
        build('stopped', data.strain, data.pressure, data.force, None, np.zeros(len(data)))


def test_a_clock_that_restarts_begins_a_trial(sweeps):
    """Without a column for trials the clock tells them; disorder is refused."""
    data = sweeps()
    clock = np.tile(np.linspace(0, 20, 240), 4)
    assert len(build('four', data.strain, data.pressure, data.force, None,
                     clock).trial_names) == 4
    with pytest.raises(InputError, match='expected time to increase'):
        build('mess', data.strain, data.pressure, data.force, None,
              np.random.default_rng(0).permutation(data.time))


def test_hydraulic_pressures_are_taken_where_told(sweeps):
    """5 MPa needs the muscle's limit; the message says which option."""
    data = sweeps()
    with pytest.raises(InputError, match='--max-pressure'):
        build('oil', data.strain, 12.0 * data.pressure, data.force, data.trial)
    told = build('oil', data.strain, 12.0 * data.pressure, data.force, data.trial,
                 max_pressure=5e6)
    assert told.pressure.max() == pytest.approx(12.0 * 413.7e3)
    # up to a fifth more than the limit is the muscle's, or its gauge's
    with pytest.raises(InputError, match='--max-pressure'):
        build('oil', data.strain, 15.0 * data.pressure, data.force, data.trial, max_pressure=5e6)


def test_large_strains_are_taken_where_the_muscle_allows(sweeps):
    """A strain of 0.8 needs the muscle's limit."""
    data = sweeps()
    with pytest.raises(InputError, match='--max-strain'):
        build('pleated', 3.3 * data.strain, data.pressure, data.force, data.trial)
    assert build('pleated', 3.3 * data.strain, data.pressure, data.force, data.trial,
                 max_strain=0.8).strain.max() > 0.75


@pytest.mark.parametrize(('strain', 'force', 'words'), [
    (1.0, -1.0, 'force is negative'), (-0.5, 1.0, 'sign turned round')])
def test_signs_turned_round_are_noticed(muscle, strain, force, words):
    """A load cell that reads compression positive, or a strain that is elongation, is noted."""
    e, p = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 0.2, 8),
                                                 np.linspace(1e5, 4e5, 8)))
    notes = build('map', strain * e, p, force * muscle(e, p)).notes
    assert any(words in note for note in notes)


def test_elongations_beyond_any_muscle_are_asked_for_their_sign(muscle):
    """A strain of -0.2 to -0.45 may be a contraction; of both signs it is none."""
    e, p = (grid.ravel() for grid in np.meshgrid(np.linspace(0.2, 0.45, 8),
                                                 np.linspace(1e5, 4e5, 8)))
    for sign, asked in ((np.full(64, -1.0), True), (np.where(e > 0.4, -1.0, 1.0), False)):
        with pytest.raises(InputError, match=r'strain is -0\.45;') as caught:
            build('map', sign * e, p, muscle(e, p), max_strain=0.5)
        assert ('is the sign turned round?' in str(caught.value)) == asked
    assert not build('map', e, p, muscle(e, p)).notes


def test_a_muscle_that_is_pressed_past_its_free_strain_has_its_sign(muscle):
    """A muscle that pushes: the negative force does not grow with pressure or length."""
    strain = np.tile(np.linspace(0.25, 0.4, 40), 2)
    for pressure in (np.full(80, 2e5), np.repeat([2e5, 2.02e5], 40)):
        force = muscle(strain, pressure)
        assert np.median(force) < 0.0
        assert not [note for note in build('map', strain, pressure, force, max_strain=0.5).notes
                    if 'sign' in note]


def test_the_order_in_which_trials_are_logged_does_not_show(sweeps):
    """Rows of two trials that alternate are sorted by trial."""
    data = sweeps(cycles=1).select(slice(0, 160))
    turns = np.append(0, np.random.default_rng(0).permutation(np.repeat([0, 1], [79, 80])))
    logged = np.argsort(np.argsort(turns, kind='stable'))
    mixed, whole = (build('two', *(values[rows] for values in (
        data.strain, data.pressure, data.force, data.trial, data.time)))
        for rows in (logged, slice(None)))
    for name in ('strain', 'force', 'trial', 'time', 'strain_rate', 'direction'):
        assert np.array_equal(getattr(mixed, name), getattr(whole, name)), name


def test_directions_survive_a_selection(sweeps):
    """Direction and its basis stay with their rows."""
    data = sweeps()
    some = data.select(np.arange(len(data)) % 3 == 0)
    assert np.array_equal(some.direction_basis, data.direction_basis[::3])
    assert replace(data, time=None).is_static


def test_repr_is_one_short_line(sweeps):
    """The representation in a notebook is a summary, not the arrays."""
    assert '\n' not in repr(sweeps())
    assert len(repr(sweeps())) < 200


def test_an_own_strain_rate_is_taken_with_its_sign(muscle):
    """A column strain_rate replaces the smoothed slope."""
    time = 0.05 * np.arange(200)
    strain = 0.1 - 0.1 * np.cos(time)
    data = read_measurement({'time [s]': time, 'strain': strain, 'pressure [kPa]': 100 + 10 * time,
                             'force [N]': muscle(strain, 1e5 + 1e4 * time),
                             'strain_rate [%/s]': 10.0 * np.sin(time)})
    assert np.allclose(data.strain_rate, 0.1 * np.sin(time))
