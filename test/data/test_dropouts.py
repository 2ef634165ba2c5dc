# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Readings that a sensor lost are said: a diagnosis would name effects for them."""

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build


@pytest.fixture
def noisy(log):
    """Return the channels of a log with noise, and a function that makes a measurement of them."""
    time, strain, pressure, force = log
    rng = np.random.default_rng(3)
    channels = {'strain': strain, 'pressure': pressure + 300.0 * rng.standard_normal(len(time)),
                'force': force + 0.3 * rng.standard_normal(len(time))}

    def said(**changed):
        read = {**channels, **changed}
        return ' '.join(build('log', read['strain'], read['pressure'], read['force'],
                              time=time).notes)
    return channels, said


@pytest.mark.parametrize(('label', 'rows', 'words'), [
    ('force', slice(235, 238), 'force jumps to 0 N and back in 3 rows (first row 236)'),
    ('pressure', [30, 31, 100, 200], 'pressure jumps to 0 kPa and back in 4 rows (first row 31)')])
def test_a_sensor_that_reads_zero_for_a_while_is_said(noisy, label, rows, words):
    """The reading jumps to zero and back, while the other channels do not jump."""
    channels, said = noisy
    lost = channels[label].copy()
    lost[rows] = 0.0
    assert words in said(**{label: lost})


def test_readings_lost_where_a_trial_begins_are_lost(noisy, log):
    """The step from the trial before is no jump; that back to the readings is."""
    channels, _ = noisy
    lost, trial = channels['force'].copy(), np.repeat([0, 1, 2], 80)
    lost[[30, 31, 80, 81, 160]] = 0.0
    notes = build('log', channels['strain'], channels['pressure'], lost, trial, log[0]).notes
    assert 'force jumps to 0 N and back in 5 rows (first row 31)' in ' '.join(notes)


def test_a_trial_at_one_force_hangs_from_a_weight(noisy, log):
    """Its muscle moves and the force stays; in a part of a trial that would be a stuck sensor."""
    channels, _ = noisy
    force = channels['force'].copy()
    force[80:160] = force[80]
    said = [' '.join(build('log', channels['strain'], channels['pressure'], force,
                           np.repeat([0, 1, 2], ends), log[0]).notes)
            for ends in ([80, 80, 80], [60, 100, 80])]
    assert ['is constant' in notes for notes in said] == [False, True]


def test_a_muscle_that_is_vented_loses_no_reading(noisy, muscle):
    """The force falls with the pressure, so no reading is reported as lost."""
    channels, said = noisy
    pressure = channels['pressure'].copy()
    pressure[20:30] = 0.0
    assert 'lost' not in said(pressure=pressure, force=muscle(channels['strain'], pressure))


@pytest.mark.parametrize(('force', 'stuck'), [
    (lambda force, rows: np.where(rows, force[100], force), True),  # the last reading again
    (lambda force, rows: 20.0 * np.round(force / 20.0), False),     # a coarse converter
    (lambda force, rows: force, False)])
def test_a_force_that_stands_still_while_the_muscle_moves_is_said(noisy, force, stuck):
    """Not reported if the converter is so coarse that equal readings are usual."""
    channels, said = noisy
    rows = (np.arange(240) >= 100) & (np.arange(240) < 125)
    notes = said(force=force(channels['force'], rows))
    assert ('is constant' in notes) == stuck
    assert ('N from row 101 to 125 while the muscle moves' in notes) == stuck


@pytest.mark.parametrize('step', [0.0, 20.0])
def test_a_cell_that_stops_within_the_slowest_sweep_is_said(muscle, step):
    """No step of that sweep is among the faster half; a coarse cell may stay there by chance."""
    lengths = [0.2, 0.15, 0.2, 0.07]
    strain = np.concatenate([0.5 * top * (1.0 - np.cos(np.linspace(0.0, 2.0 * np.pi, 150)))
                             for top in lengths])
    pressure = np.repeat([3e5, 2e5, 4e5, 6e4], 150)
    force = muscle(strain, pressure) + 0.3 * np.random.default_rng(1).standard_normal(600)
    stuck = np.where(np.arange(600) >= 460, force[460], force)
    if step:
        force = stuck = step * np.round(force / step)
    whole, lost = (' '.join(build('log', strain, pressure, each, time=0.1 * np.arange(600)).notes)
                   for each in (force, stuck))
    assert 'is constant' not in whole
    assert ('N from row 461 to 600 while the muscle moves' in lost) == (step == 0.0)


@pytest.mark.parametrize('sign', [1, -1])
def test_a_force_beyond_the_range_of_its_sensor_is_said(noisy, sign):
    """Its largest value comes back at several visits, all others differ; below may be a floor."""
    channels, said = noisy
    words = f'the force is exactly {sign * 150} N, its largest, in 31 rows (first row 161)'
    notes = said(force=sign * np.minimum(channels['force'], 150.0))
    assert words in notes
    assert 'is constant' not in notes
    assert words in said(force=sign * np.clip(channels['force'], 25.0, 150.0))


@pytest.mark.parametrize('make', [
    lambda strain: (10.0 * np.round(20.0 * (0.2 - strain)), strain),
    lambda strain: (100.0 * np.clip(1.5 - strain / 0.1, 0.0, 1.0), np.clip(strain, 0.05, 0.2)),
    lambda strain: (np.repeat([20.0, 100.0, 20.0, 100.0], 60), strain),
    lambda strain: (np.tile(np.repeat([20.0, 60.0, 100.0], [5, 5, 30]), 6), strain)],
    ids=['a coarse cell', 'a muscle that is held twice', 'two weights that hang in turn',
         'a force that is held in most rows'])
def test_a_largest_force_that_comes_back_may_be_right(log, make):
    """Other forces repeat as often, or the strain does not change, or it is that of a trial."""
    force, strain = make(log[1])
    notes = build('log', strain, log[2], force, np.repeat([0, 1, 2, 3], 60), log[0]).notes
    assert 'its largest' not in ' '.join(notes)


def test_a_vented_muscle_may_read_one_force(noisy):
    """It is slack: its force is zero at every strain, as often as the cell's offset stays."""
    channels, said = noisy
    vented = (np.arange(240) >= 100) & (np.arange(240) < 125)
    assert 'is constant' not in said(pressure=np.where(vented, 0.0, channels['pressure']),
                                     force=np.where(vented, 0.0, channels['force']))


def test_the_largest_steps_of_a_short_log_are_no_lost_readings(muscle):
    """Twelve rows in which the muscle is vented once: pressure and force fall together."""
    strain, pressure = np.linspace(0.1, 0.12, 12), np.full(12, 200e3)
    pressure[5:7] = 0.0
    notes = build('log', strain, pressure, muscle(strain, pressure), time=np.arange(12.0)).notes
    assert not any('lost' in note for note in notes)


def test_a_force_of_a_muscle_that_is_held_may_stand_still(noisy):
    """An isometric log between whose levels nothing changes has lost no reading."""
    _, said = noisy
    level = np.repeat([20.0, 50.0, 90.0], 80)
    assert 'is constant' not in said(strain=np.full(240, 0.1), pressure=1e4 * level, force=level)


@pytest.mark.parametrize('force', [
    lambda t: 0.5 * np.round(4.0 * np.random.default_rng(1).standard_normal(len(t))),
    lambda t: np.where(t == 50, 30.0, np.where(t == 150, 40.0, 0.0)),
    lambda t: np.repeat([10.0, 20.0, 30.0, 20.0, 10.0], [50, 40, 40, 40, 70])],
    ids=['a coarse and noisy cell', 'a slack muscle that is pulled twice', 'steps up and down'])
def test_what_is_no_dropout_is_not_said(noisy, force):
    """Jumps as large as all others, a value held most of the time, and one that is passed."""
    _, said = noisy
    assert 'jumps to' not in said(force=force(np.arange(240)))


def test_a_sweep_in_even_steps_loses_no_reading_at_its_turn(muscle):
    """Steps of a slow log are equal but for the last digits; each trial turns at one strain."""
    rng = np.random.default_rng(1)
    once = 18.0 * (1.0 - np.abs(1.0 - np.arange(20) / 10.0))
    strain, pressure = np.tile(1e-3 * once / 0.09, 3), np.repeat([200e3, 400e3, 300e3], 20)
    steps = np.abs(np.diff(strain[:20]))
    assert steps[9:11].min() > np.delete(steps, [9, 10]).max()  # by a last digit
    notes = build('log', strain, pressure, muscle(strain, pressure) + rng.normal(0, 0.2, 60),
                  np.repeat([0, 1, 2], 20), np.arange(60.0)).notes
    assert not any('lost' in note for note in notes)
