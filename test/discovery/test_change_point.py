# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A log of two muscles is told as such, and what drifts or wears is not taken for it."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.change_point import two_models
from fam_bundle_ros.discovery.diagnose import diagnose
from fam_bundle_ros.discovery.sensor_jump import sensor_jump
from fam_bundle_ros.discovery.settings import Choices

SLIGHTER = {'geometry.radius': 5.8e-3}
WORDS = 'one model for the rows before'


def exchanged(make_sweeps, paper_muscle, first):
    """Return sweeps of which the rows from ``first`` on are those of a slighter muscle."""
    one, two = make_sweeps(), make_sweeps(paper_muscle.with_parameters(SLIGHTER), seed=1)
    return replace(one, force=np.where(np.arange(len(one)) < first, one.force, two.force))


def test_a_muscle_that_was_exchanged_is_told_and_no_effect_is_named(make_sweeps, paper_muscle):
    """From the second cycle on; time alone would make it softening and a drift."""
    found = diagnose(paper_muscle, exchanged(make_sweeps, paper_muscle, 480),
                     choices=Choices(most=1))
    assert found.verdict == 'unexplained'
    assert found.effects == ()
    assert found.summary.startswith(f'{WORDS} trial 6 (')
    left = found.summary.partition('leave ')[2].partition(' N and')[0]
    assert float(left) == pytest.approx(0.6, abs=0.2)  # the noise
    assert found.next_experiment == 'diagnose the rows before and after this by themselves'
    assert max(entry.probability for entry in found.ranking) <= 0.5


@pytest.mark.parametrize(('first', 'place'), [(160, 'trial run2 ('), (240, 'trial run3 ('),
                                              (280, 's of trial run3'), (880, 'trial run11 (')])
def test_the_place_of_the_exchange_is_told(searched, make_sweeps, paper_muscle, first, place):
    """By the file's name of the trial; also within a trial, and before the last one."""
    data = exchanged(make_sweeps, paper_muscle, first)
    data = replace(data, trial_names=tuple(f'run{k}' for k in range(12)))
    words = two_models(searched(paper_muscle, data)).artefact.words
    assert words.startswith(WORDS)
    where = words[len(WORDS) + 1:].partition(', and')[0]
    assert place in where
    if 's of' in where:
        assert float(where.split()[0]) == pytest.approx(data.time[first], abs=1.5)


def test_the_place_is_told_where_the_clock_starts_anew_in_each_trial(searched, make_sweeps,
                                                                     paper_muscle):
    """The log is in the order of its rows."""
    data = exchanged(make_sweeps, paper_muscle, 480)
    data = build('anew', data.strain, data.pressure, data.force, data.trial, data.time % 23.0)
    assert np.all(np.diff(data.time)[np.diff(data.trial) > 0] < 0.0)
    assert two_models(
        searched(paper_muscle, data)).artefact.words.startswith(f'{WORDS} trial 6 (')


@pytest.mark.parametrize('effects', [
    (), ('coulomb_friction',), ('force_sensor_drift',), ('softening',)])
def test_one_muscle_is_not_told_as_two(searched, make_sweeps, paper_muscle, effects):
    """Effects that are in the log explain it better, those that change with time too."""
    true = paper_muscle
    for name in effects:
        true = true.with_effect(name)
    search = searched(paper_muscle, make_sweeps(true), *effects)
    assert two_models(search) is None
    assert sensor_jump(search) is None


def test_damping_of_isobars_first_slow_and_then_fast_is_no_second_muscle(searched, make_sweeps,
                                                                         paper_muscle):
    """Two discrepancies, one for each speed, may follow it better than one, but not without."""
    true = paper_muscle.with_effect('viscous_damping', coefficient=1500.0)
    slow, fast = make_sweeps(true, cycles=1, speed=0.01), make_sweeps(true, cycles=1, speed=0.1)
    both = build('both', np.append(slow.strain, fast.strain),
                 np.concatenate([slow.pressure, fast.pressure]), np.append(slow.force, fast.force),
                 np.append(slow.trial, fast.trial + 6),
                 np.append(slow.time, fast.time + slow.time[-1] + 3.0))
    assert two_models(searched(paper_muscle, both)) is None  # one discrepancy is enough
    search = searched(paper_muscle, both, 'viscous_damping')
    assert two_models(search) is None
    search.fits = {names: replace(fit, evidence=fit.evidence - 300.0)
                   for names, fit in search.fits.items()}
    assert two_models(search) is None
    search.fits = {names: replace(fit, white_evidence=fit.white_evidence - 900.0)
                   for names, fit in search.fits.items()}
    assert two_models(search) is not None


def test_a_map_without_time_and_a_short_log_have_no_change(searched, make_sweeps, paper_muscle):
    """Rows of a map have no order; a model is not determined by fewer rows than parameters."""
    data = exchanged(make_sweeps, paper_muscle, 480)
    assert two_models(searched(paper_muscle, data)) is not None
    assert two_models(searched(paper_muscle, replace(data, time=None))) is None
    few = data.select(np.isin(np.arange(len(data)), range(477, 485)))
    assert two_models(searched(paper_muscle, few)) is None


def test_another_muscle_is_no_jump_of_a_reading(searched, make_sweeps, paper_muscle):
    """A constant explains part of it, two models explain it all."""
    search = searched(paper_muscle, exchanged(make_sweeps, paper_muscle, 480))
    jump = sensor_jump(search)
    assert jump is None or jump.log_odds < two_models(search).log_odds
