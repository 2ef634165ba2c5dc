# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""How rows become cells and long logs short ones: whole, in order, as fine as there is room."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
import pytest
from scipy.signal import lfilter

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery import Choices, diagnose, settings
from fam_bundle_ros.discovery.cells import _at_most, _places, _renumbered, reduce, visits
from fam_bundle_ros.discovery.log_rows import (
    _widest_block,
    averaged,
    averages,
    jumped,
    stretches,
    thinned,
    unknown_direction,
)
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.model import load_model, Motion


@pytest.fixture(scope='module')
def long_log():
    """Return a log of 8000 rows in two trials: slow to and fro at two pressures."""
    time = 0.05 * np.arange(8000)
    strain = 0.1 - 0.1 * np.cos(2.0 * np.pi * time / 80.0)
    trial = np.repeat([0, 1], [5000, 3000])
    pressure = np.where(trial == 0, 1e5, 3e5)
    return build('long', strain, pressure, 50.0 - 100.0 * strain, trial, time)


@pytest.fixture(scope='module')
def one_way(long_log):
    """Return the log as if it did not turn round."""
    return replace(long_log, direction=np.ones(len(long_log), int))


def test_averages_are_means_of_the_rows_of_a_cell():
    """Rows of no cell do not count; columns are averaged one by one."""
    label = np.array([2, 0, -1, 2, 1, 0, 2])
    values = np.arange(14.0).reshape(7, 2) ** 2
    mean = averages(label, 3)
    for k in range(3):
        assert_allclose(mean(values)[k], values[label == k].mean(axis=0))
    assert_allclose(mean(values[:, 0]), mean(values)[:, 0])


def test_labels_without_gaps_keep_their_order():
    """And none stays none."""
    assert _renumbered(np.array([7, 3, -1, 7, 20])).tolist() == [1, 0, -1, 1, 2]
    assert _renumbered(np.array([7, 3, 20])).tolist() == [1, 0, 2]


@pytest.mark.parametrize('most', [12, 60, 200])
def test_without_memory_a_few_blocks_of_rows_have_the_averages_of_all(make_sweeps, paper_muscle,
                                                                      most):
    """Of forces and of the columns of a Jacobian, to a thousandth of the largest force."""
    cells = reduce(paper_muscle, make_sweeps(), most=most)
    motion, mean = cells.blocks
    assert len(motion.strain) <= 4 * len(cells) + 1
    assert_allclose(mean(np.stack([motion.strain, motion.clock], -1)),
                    cells.mean(np.stack([cells.motion.strain, cells.motion.clock], -1)))
    of_all = cells.mean(paper_muscle.predict(cells.motion))
    assert_allclose(mean(paper_muscle.predict(motion)), of_all, atol=1e-3 * cells.largest_force)


@pytest.mark.parametrize('most', [3, 10, 24, 25, 60])
def test_of_too_many_cells_of_one_size_an_even_choice_stays(most):
    """The rows of the others are in none."""
    label = np.repeat(np.arange(25), 4)
    found = _at_most(most, label)
    kept = np.unique(label[found >= 0])
    assert len(kept) == found.max() + 1 == min(most, 25)
    assert np.ptp(np.diff(kept)) <= 1
    assert kept[0] + 24 - kept[-1] <= 25 / most
    assert all(len(np.unique(found[label == k])) == 1 for k in range(25))


def test_of_too_many_cells_those_of_many_rows_stay_rather_than_those_of_few():
    """All of the long ones, and of the short ones in proportion to their rows."""
    rows = np.random.default_rng(2).permutation(np.tile([40, 8, 4, 4, 4], 60))
    label = np.repeat(np.arange(300), rows)
    found = _at_most(100, label)
    kept = np.unique(label[found >= 0])
    assert len(kept) == found.max() + 1 == 100
    assert np.count_nonzero(rows[kept] == 40) == 60
    # each short one kept stands for 30 rows of short ones
    between = np.diff(np.cumsum(rows * (rows < 40))[kept[rows[kept] < 40]])
    assert between.min() > 30 - 8
    assert between.max() < 30 + 8


@pytest.mark.parametrize('memory', [0.0, 0.8])
def test_long_and_short_visits_have_the_noise_that_their_means_have(paper_muscle, memory):
    """Holds of 16 and of 76 rows; with a memory of five rows each row resembles the last."""
    rng = np.random.default_rng(8)
    hold = np.tile([16, 76], 85)
    strain = np.repeat(rng.permutation(np.linspace(0.0, 0.2, 170)), hold)
    time = 0.02 * np.arange(len(strain))
    pressure = np.full(len(strain), 3e5)
    white = 0.5 * np.sqrt(1.0 - memory ** 2) * rng.normal(size=len(strain))
    noise = lfilter([1.0], [1.0, -memory], white)
    exact = paper_muscle.predict(Motion(strain, pressure[:, None], 0.0 * strain, time))
    cells = reduce(paper_muscle, build('holds', strain, pressure, exact + noise, None, time))
    square = cells.mean(noise) ** 2 / cells.variance
    long = cells.count > 40
    assert np.count_nonzero(long) > 60
    assert np.mean(square[long]) == pytest.approx(1.0, abs=0.35)
    assert np.mean(square[~long]) == pytest.approx(1.0, abs=0.35)
    assert cells.noise == pytest.approx(0.5, rel=0.15)


@pytest.mark.parametrize('noise', [(1e-3, 0.0), (0.0, 2e3)])
@pytest.mark.parametrize('speed', [0.01, 0.2])
def test_noise_of_strain_and_pressure_is_in_the_noise_of_the_cells(paper_muscle, speed, noise):
    """The load cell is exact; neighbours, which share the error, agree in the force."""
    time = 0.02 * np.arange(1800)
    strain = 0.01 + 0.18 * np.abs((time * speed / 0.18 + 1.0) % 2.0 - 1.0)
    pressure = 2e5 + 1e5 * np.sin(time)
    force = paper_muscle.force(strain, pressure[:, None])
    ratio = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        draw = rng.standard_normal((2, len(time)))
        cells = reduce(paper_muscle, build(
            'log', strain + noise[0] * draw[0], pressure + noise[1] * draw[1], force, None, time))
        off = cells.force - cells.mean(paper_muscle.predict(cells.motion))
        ratio.append(np.sqrt(np.mean(off ** 2 / cells.variance)))
    assert np.mean(ratio) == pytest.approx(0.9, abs=0.15)


def test_places_are_as_fine_as_there_is_room_for(sweeps):
    """Rows of one place are near in strain, at one pressure and of one way; more room, finer."""
    data = sweeps(cycles=3)
    span = np.ptp(data.strain), np.ptp(data.pressure, axis=0)
    sizes = []
    for most in (140, 300, 700):
        label = _places(data, data.direction, *span, most)
        assert label.max() + 1 <= most
        widths = [np.ptp(data.strain[label == k]) for k in range(label.max() + 1)]
        sizes.append(max(widths))
        assert all(len(np.unique(data.direction[label == k])) == 1 for k in np.unique(label))
        assert max(np.ptp(data.pressure[label == k]) for k in np.unique(label)) < 5e4
        # one place, whatever the visit
        assert len(np.unique(data.trial[label == label[20]])) == 3
    assert sizes[0] > sizes[1] > sizes[2]


def test_stays_end_with_trial_direction_and_distance(sweeps):
    """They follow each other in time; within one the muscle has moved by less than a bin."""
    data = sweeps(cycles=2)
    span = np.ptp(data.strain), np.ptp(data.pressure, axis=0)
    label = visits(data, data.direction, *span, 300)
    assert label[0] == 0
    assert set(np.diff(label)) == {0, 1}
    assert label.max() < 300
    same = np.diff(label) == 0
    assert not np.any(same & data.start[1:])
    assert not np.any(same & (np.diff(data.direction) != 0))
    lengths = np.bincount(label)
    assert np.median(lengths) >= 2
    widths = np.array([np.ptp(data.strain[label == k]) for k in range(label.max() + 1)])
    assert widths.max() < 0.24 / 10.0


def test_neighbours_are_averaged_in_blocks_trial_by_trial(one_way):
    """The first row of a trial stays; blocks have rows of one trial, the last may be shorter."""
    long_log, (found, blurred) = one_way, averaged(one_way, 7)
    assert not blurred.any()
    assert len(found) == 716 + 430
    for name in ('time', 'strain', 'force', 'strain_rate'):
        values = getattr(long_log, name)
        assert_allclose(getattr(found, name)[[0, 716]], values[[0, 5000]])
        assert_allclose(getattr(found, name)[3], values[15:22].mean())
        assert_allclose(getattr(found, name)[715], values[4999:5000].mean())
        assert_allclose(getattr(found, name)[717], values[5001:5008].mean())
    assert_allclose(found.pressure[715:717, 0], [1e5, 3e5])
    assert np.bincount(found.trial).tolist() == [716, 430]


def test_a_lag_begins_from_the_state_of_the_first_row(one_way, paper_muscle):
    """The pressure steps in the second row: its mean with the first is no state of rest."""
    pressure = one_way.pressure.copy()
    pressure[1:5000] += 2e5
    time = 1e-3 * np.arange(8000)
    log = replace(one_way, strain=np.full(8000, 0.1), pressure=pressure, time=time,
                  strain_rate=np.zeros(8000))
    model = paper_muscle.with_effect('pressure_line_lag', time_constant=0.05)
    found, _ = averaged(log, 8)
    begun = found.trial == 0
    exact = np.interp(found.time[begun], time, predict(model, log))
    assert_allclose(predict(model, found)[begun], exact, atol=0.1 * np.ptp(exact))


def test_averages_over_both_directions_are_known(long_log, paper_muscle):
    """The mean of friction both ways is that of none: they are in no cell."""
    found, blurred = averaged(long_log, 8)
    turned = np.flatnonzero(np.diff(long_log.direction) != 0)
    row = np.arange(8000)
    # in each trial one row, then blocks of 8
    block = np.where(row < 5000, (row + 7) // 8, 626 + (row - 5000 + 7) // 8)
    assert np.bincount(long_log.trial).tolist() == [5000, 3000]
    inside = block[turned][block[turned] == block[turned + 1]]
    assert len(inside) > 5
    assert np.flatnonzero(blurred).tolist() == sorted(set(inside))
    begin = np.flatnonzero(np.diff(block, prepend=-1))
    assert np.all(found.direction[~blurred] == long_log.direction[begin][~blurred])


def test_noise_of_a_gauge_at_rest_is_no_movement(one_way):
    """Neither of a unit that is never filled, nor of a strain that is held throughout."""
    random = np.random.default_rng(0)
    empty = np.column_stack([one_way.pressure, random.normal(0.0, 200.0, 8000)])
    held = replace(one_way, strain=0.1 + random.normal(0.0, 5e-5, 8000), pressure=empty,
                   motor_units=('mu1', 'mu2'))
    assert averaged(held, 50)[1].mean() < 0.02
    assert len(thinned(held, 100)[0].trial_names) == 2  # no need of stretches


def test_averages_over_a_step_of_the_pressure_are_in_no_cell(one_way, paper_muscle, monkeypatch):
    """Their mean force is not the force at the mean pressure."""
    step = one_way.pressure.copy()
    step[2003:2005] += [[1e5], [2e5]]
    step[2005:5000] += 2e5
    log = replace(one_way, pressure=step)
    found, blurred = averaged(log, 7)
    assert np.flatnonzero(blurred).tolist() == [287]
    assert len(found) == 716 + 430
    monkeypatch.setattr(settings, 'ROWS', 1143)
    cells = reduce(paper_muscle, log, most=2000)
    assert cells.label[287] == -1
    assert cells.unused['averages over a step of strain or pressure, or over a turn'] == 1


def test_a_block_is_as_wide_as_the_motion_bears(long_log):
    """Within two blocks nine tenths of the rows move by less than a twentieth of the range."""
    width = _widest_block(long_log)
    moved = [np.percentile(np.abs(long_log.strain[2 * w:] - long_log.strain[:-2 * w]), 90)
             for w in (width // 2, width)]
    assert moved[0] <= 0.05 * 0.2 < moved[1]
    fast = replace(long_log, strain=0.1 + 0.1 * np.sin(np.arange(8000.0)))
    assert _widest_block(fast) == 8


def test_a_long_log_is_thinned_and_a_short_one_is_not(one_way):
    """By averages where the motion bears it, else by stretches from all over it too."""
    long_log = one_way
    assert thinned(long_log, 8000)[0] is long_log
    few, _ = thinned(long_log, 2000)
    assert 2000 <= len(few) <= 2004
    assert_allclose(few.strain[1:4], long_log.strain[1:13].reshape(3, 4).mean(axis=1))
    fewest, _ = thinned(long_log, 100)
    assert 80 <= len(fewest) <= 100 + 24
    assert fewest.time.min() < 4.0
    assert fewest.time.max() > 396.0
    still = replace(long_log, time=None)
    assert thinned(still, 100)[0] is still


def test_stretches_are_unbroken_and_from_all_over(long_log):
    """Each begins a trial, and so does a trial within one."""
    found = stretches(long_log, 1200)
    assert len(found) == 1200
    step = np.diff(found.time)
    inside = np.diff(found.trial) == 0
    assert_allclose(step[inside], 0.05)
    assert np.all(step[~inside] > 0.0)
    assert found.trial[0] == 0
    assert found.trial.max() + 1 == len(found.trial_names)
    assert 12 <= len(found.trial_names) <= 13
    assert found.time[0] == long_log.time[0]
    assert found.time[-1] == long_log.time[-1]
    assert stretches(long_log, 6400) is long_log


def test_cells_of_a_log_know_their_time_trial_direction_and_speed(sweeps, paper_muscle):
    """Means of their rows; a speed is no less than what counts as rest."""
    data = sweeps(paper_muscle.with_effect('coulomb_friction'), cycles=2)
    cells = reduce(paper_muscle, data, most=150)
    assert len(cells) <= 150
    for k in (0, 40, len(cells) - 1):
        rows = cells.label == k
        assert cells.time[k] == pytest.approx(data.time[rows].mean())
        assert cells.strain[k] == pytest.approx(data.strain[rows].mean())
        assert cells.pressure[k] == pytest.approx(data.pressure[rows].mean(axis=0))
        assert cells.trial[k] == data.trial[rows][0]
        assert cells.direction[k] == np.sign(data.strain_rate[rows].mean())
        assert cells.speed[k] == pytest.approx(np.log(abs(data.strain_rate[rows].mean())))
    rates = np.exp(cells.speed)
    assert rates.min() >= 0.02 * np.percentile(rates, 89)
    assert cells.strain_range == pytest.approx(0.24)
    assert cells.pressure_range == pytest.approx([413.7e3])
    assert cells.force_sd == pytest.approx(np.std(cells.force))
    assert cells.largest_force == np.abs(cells.force).max()
    assert cells.noise == pytest.approx(0.6, rel=0.15)
    assert cells.both_ways


def test_every_row_is_in_one_cell_and_cells_are_means_of_their_rows(problem):
    """Counts sum to the rows, and each cell's force is the mean of its rows."""
    cells, _, _ = problem
    kept = cells.label >= 0
    assert cells.count.sum() == kept.sum()
    k = int(np.argmax(cells.count))
    rows = cells.label == k
    assert cells.force[k] == pytest.approx(cells.data.force[rows].mean())
    assert len(np.unique(cells.data.trial[rows])) == 1
    assert len(np.unique(cells.data.direction[rows])) == 1


def test_a_small_map_is_taken_row_by_row(paper_muscle):
    """With fewer rows than cells nothing is averaged, and nothing is left out."""
    strain = np.tile(np.linspace(0, 0.2, 8), 6)
    pressure = np.repeat(np.linspace(0, 400e3, 6), 8)
    force = paper_muscle.force(strain, pressure[:, None])
    cells = reduce(paper_muscle, build('map', strain, pressure, force))
    assert len(cells) == 48
    np.testing.assert_allclose(cells.force, force)
    assert cells.time is None
    assert not cells.both_ways


def test_rows_of_two_muscles_by_turns_are_no_spikes(make_sweeps, paper_muscle):
    """Repeats agree, neighbours do not: a spike is far off beside its neighbours' scatter."""
    one, two = make_sweeps(cycles=2), make_sweeps(
        paper_muscle.with_parameters({'geometry.radius': 5.4e-3}), cycles=2)
    force = np.where(np.arange(len(one)) % 2 == 0, one.force, two.force)
    both = reduce(paper_muscle, replace(one, force=force))
    assert 'spikes' not in both.unused
    single = one.force.copy()
    single[500] += 60.0
    assert reduce(paper_muscle, replace(one, force=single)).unused['spikes'] == 1


@pytest.mark.parametrize('gauge', [
    lambda held: held, lambda held: 5e-4 * np.round(held / 5e-4)], ids=['noise', 'steps'])
def test_no_row_is_lost_to_the_noise_of_a_gauge_that_stands_still(gauge, paper_muscle):
    """Held at one strain, 200 s of filling and venting: stays follow the pressure alone."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 200.0, 0.1)
    strain = gauge(0.1 + 2e-4 * rng.standard_normal(len(time)))
    pressure = 2e5 - 1.5e5 * np.cos(2.0 * np.pi * time / 40.0) + 500.0 * rng.standard_normal(
        len(time))
    data = build('log', strain, pressure[:, None], 1e-4 * pressure, None, time)
    cells = reduce(paper_muscle, data, most=150)
    np.testing.assert_array_equal(cells.label < 0, unknown_direction(data))
    assert np.median(cells.count) > 10
    widths = [np.ptp(data.pressure[cells.label == k]) for k in range(len(cells))]
    assert max(widths) < 0.1 * 3e5


def test_a_stay_ends_where_a_unit_of_a_bundle_moves_on():
    """One unit is held, the other goes up in ten levels: no stay has rows of two levels."""
    rng = np.random.default_rng(0)
    muscle = load_model('spie2021')
    level = np.repeat(np.arange(10), 50)
    pressure = np.column_stack([np.full(500, 3.4e5), 3e4 * level]) + 300.0 * rng.standard_normal(
        (500, 2))
    data = build('log', np.full(500, 0.1), pressure, 10.0 + 5.0 * level, None,
                 0.1 * np.arange(500.0))
    cells = reduce(muscle, data, most=100)
    assert (cells.label[1:] >= 0).all()
    assert all(len(np.unique(level[cells.label == k])) == 1 for k in range(len(cells)))
    assert len(cells) <= 40  # each level is reached and held



def test_the_row_with_which_a_trial_begins_is_in_no_cell(sweeps, paper_muscle):
    """How the muscle came there is in no row; a trial of one row has nothing else and stays."""
    data = sweeps(paper_muscle.with_effect('coulomb_friction'))
    assert (reduce(paper_muscle, data).label[data.start] == -1).all()
    one = unknown_direction(data.select(np.r_[True, np.zeros(len(data) - 1, bool)]))
    assert one.tolist() == [False]
    assert unknown_direction(data).sum() == len(data.trial_names)


def test_rows_at_a_turning_point_are_in_no_cell_but_a_hold_is(paper_muscle):
    """Where the rate of a slow swing is within its noise; a rest of 2 s at the top is a rest."""
    time = np.arange(0.0, 12.0, 0.01)
    phase = np.interp(time, [0, 6, 8, 12], [0, 6.75, 6.75, 11.25])
    strain = 0.1 + 0.1 * np.sin(2.0 * np.pi * phase / 3.0)
    strain = strain + 5e-5 * np.random.default_rng(0).standard_normal(len(time))
    data = build('log', strain, np.full((len(time), 1), 2e5), 50.0 - 100.0 * strain, None, time)
    out = time[unknown_direction(data)][1:]
    turns = np.interp([0.75, 2.25, 3.75, 5.25, 8.25, 9.75, 11.25], phase, time)
    near = np.abs(out[:, None] - [*turns, 6.0, 8.0])  # the rate is smoothed over the hold's ends
    assert near.min(axis=1).max() < 0.1
    assert near.min(axis=0).max() < 0.1
    assert reduce(paper_muscle, data).label[(time > 6.2) & (time < 7.8)].min() >= 0


def test_friction_is_named_in_a_long_log_that_ends_where_the_motion_turns(paper_muscle):
    """One row there with the wrong sign of the friction made a law of other shape win."""
    time, random = 0.01 * np.arange(9000), np.random.default_rng(4)
    phase = 2.0 * np.pi * time / 15.0
    strain, pressure = 0.1 * (1.0 - np.cos(phase)), 1e5 * (1.0 + np.floor(time / 30.0))
    force = paper_muscle.force(strain, pressure[:, None]) - 4.0 * np.sign(np.sin(phase))
    result = diagnose(paper_muscle, build(
        'sines', strain + random.normal(0.0, 8e-5, 9000), pressure,
        force + random.normal(0.0, 0.4, 9000), None, time), choices=Choices(most=1))
    assert result.verdict == 'missing_effect'
    assert result.shapes == ('coulomb_friction',)


def test_averaging_takes_vectors_and_columns_alike(problem):
    """A matrix of columns is averaged column by column."""
    cells, _, _ = problem
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((len(cells.data), 3))
    together = cells.mean(columns)
    for k in range(3):
        np.testing.assert_allclose(together[:, k], cells.mean(columns[:, k]))


def test_each_row_that_is_not_used_is_counted_once_by_its_reason(make_sweeps, paper_muscle):
    """Spikes, rows of unknown direction, and those of visits that are too many."""
    data = make_sweeps()
    force = data.force.copy()
    force[[20, 420]] += 60.0
    cells = reduce(paper_muscle, replace(data, force=force), most=60)
    spiky, turning, further = cells.unused.values()
    assert list(cells.unused)[2] == 'from visits beyond a sample of 60'
    known = np.count_nonzero(unknown_direction(cells.data))
    assert (spiky, turning) == (2, known)
    assert spiky + turning + further == np.count_nonzero(cells.label < 0)
    assert list(reduce(paper_muscle, data, most=10 ** 6).unused.values()) == [known]


def test_the_first_row_after_a_step_between_two_rows_is_a_cell(paper_muscle):
    """No other row hides what a fast lag does there; a ramp of few rows is no step."""
    clock = 0.1 * np.arange(400)
    pressure = 1e3 * (30.0 + 200.0 * (clock > 10.0) + 150.0 * (clock > 25.0))
    held = build('held', np.full(400, 0.1), pressure, np.full(400, 5.0), np.arange(400) // 200,
                 clock)
    assert np.flatnonzero(jumped(held)).tolist() == [101, 251]
    label = reduce(paper_muscle, held).label
    assert all(np.sum(label == label[row]) == 1 for row in (101, 251))
    ramps = build('ramps', np.full(400, 0.1), 1e5 + 3e4 * np.abs(np.arange(400) % 20 - 10.0),
                  np.full(400, 5.0), np.arange(400) // 50, clock)
    assert not jumped(ramps).any()
    assert not jumped(build('map', 0.1 + 0.01 * np.arange(400.0) % 0.2, pressure,
                            np.full(400, 5.0))).any()


def test_a_creep_is_not_called_a_lag_of_the_line(paper_muscle):
    """
    The pressure steps between rows 0.1 s apart, and 7 % of it creep with three times.

    A lag of 4 ms made one row wrong by as much as the next, so that their mean was right.
    """
    local = np.arange(1000) % 1000
    pressure = np.tile(1e3 * (30.0 + 170.0 * (local >= 50) + 250.0 * (local >= 450)
                              - 420.0 * (local >= 850)), 4)
    trial = np.repeat(np.arange(4), 1000)
    felt = 0.93 * pressure
    for size, tau in ((0.021, 1.0), (0.028, 6.0), (0.021, 30.0)):
        felt = felt + size * _lagged(pressure, 0.1 / tau, trial)
    strain = 0.02 + 0.06 * trial
    noise = 0.5 * np.random.default_rng(2).normal(size=len(trial))
    gauge = pressure + 300.0 * np.random.default_rng(3).normal(size=len(trial))
    force = paper_muscle.force(strain, felt[:, None]) + noise
    data = build('steps', strain, gauge, force, trial, 0.1 * np.arange(4000) + 5.0 * trial)
    result = diagnose(paper_muscle, data, choices=Choices(most=2))
    assert 'pressure_creep' in result.effects
    assert 'pressure_line_lag' not in result.effects


def _lagged(values, share, trial):
    """Return a first-order lag that starts anew in each trial."""
    parts = [lfilter([1.0 - np.exp(-share)], [1.0, -np.exp(-share)], values[trial == k],
                     zi=[np.exp(-share) * values[trial == k][0]])[0] for k in np.unique(trial)]
    return np.concatenate(parts)
