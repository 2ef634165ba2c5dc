# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Errors that come from how the data were taken are told as such."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.artefacts import _contradictions, _drifts, drift, returning
from fam_bundle_ros.discovery.cells import negligible, reduce
from fam_bundle_ros.discovery.covariance import Hyper
from fam_bundle_ros.discovery.diagnose import diagnose
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.discovery.verdict import remaining_discrepancy

#: An artefact is told whatever else is tried.
ALONE = Choices(most=1)


def swing(size, period=2.2):
    """Return a force of the rig that swings by ``size`` N, by default every 2.2 s."""
    return lambda strain, pressure, way, time: size * np.sin(2.0 * np.pi * time / period)


def test_what_changes_with_time_only_is_the_drift(make_sweeps, paper_muscle):
    """Where the joint fit has a slow part; an error over the strain is none."""
    cells = reduce(paper_muscle, make_sweeps(), most=60)
    search = Search(Options(paper_muscle, cells, Choices()))
    fitter, fit = search.fitter, search.fit(search.options.own)
    slow = 6.0 * np.sin(cells.time / 33.0)
    wave = 2.0 * np.sin(30.0 * cells.strain)
    both = Hyper(even=11, strain=3, pressure=1, slow=11, tau=2)
    drifting = replace(fit, hyper=both, residual=slow)
    size = drift(fitter.covariance, drifting)
    assert size == pytest.approx(np.sqrt(np.mean(slow ** 2)), rel=0.2)
    assert drift(fitter.covariance, replace(fit, hyper=both, residual=wave)) < 0.5
    assert drift(fitter.covariance, replace(drifting, hyper=both._replace(slow=0))) == 0.0
    # what comes back with the strain is none, though time alone could follow it
    alone = both._replace(even=0)
    returning = replace(fit, hyper=alone, residual=6.0 * np.sin(10.0 * cells.strain))
    assert drift(fitter.covariance, returning) < 0.4 * rms(returning.residual)
    assert drift(fitter.covariance, replace(drifting, hyper=alone)) == pytest.approx(size, rel=0.3)

    assert [each.words.split(' within')[0] for each in _drifts(fitter, drifting)] == [
        f'the error drifts by {size:.2g} N rms']
    # a share of the largest force that no gauge shows is none
    assert [*_drifts(fitter, replace(drifting, residual=0.9 * negligible(cells) / size * slow))
            ] == []


def test_what_a_function_of_time_follows_but_comes_back_is_left(make_sweeps, paper_muscle):
    """The discrepancy of a set has it, and not what differs from visit to visit."""
    cells = reduce(paper_muscle, make_sweeps(), most=60)
    search = Search(Options(paper_muscle, cells, Choices()))
    fit = replace(search.fit(search.options.own), hyper=Hyper(slow=11, tau=1))
    covariance = search.fitter.covariance
    wave = replace(fit, residual=20.0 * np.sin(30.0 * cells.strain))
    slow = replace(fit, residual=20.0 * np.sin(cells.time / 33.0))
    assert returning(covariance, wave) > 10.0 > 2.0 * returning(covariance, slow)
    assert remaining_discrepancy(covariance, wave, wave).smooth == pytest.approx(
        returning(covariance, wave))
    without = replace(wave, hyper=Hyper(even=1))
    assert returning(covariance, without) == 0.0


@pytest.mark.parametrize('smaller', [1.0, 0.97])
def test_two_muscles_in_one_map_contradict_each_other(paper_muscle, smaller):
    """Every strain and pressure twice, row by row; a radius 3 % smaller is seen."""
    strain, pressure = (grid.ravel() for grid in np.meshgrid(
        np.linspace(0.0, 0.24, 13), np.linspace(69e3, 345e3, 5)))
    size = paper_muscle.motor_units[0].geometry.radius
    forces = [bundle.force(strain, pressure[:, None]) for bundle in (
        paper_muscle, paper_muscle.with_parameters({'geometry.radius': smaller * size}))]
    force = np.stack(forces, -1).ravel() + np.random.default_rng(1).normal(0.0, 0.3, 130)
    both = build('two', np.repeat(strain, 2), np.repeat(pressure, 2)[:, None], force)
    found = diagnose(paper_muscle, both, choices=ALONE)
    said = found.summary.startswith('rows of the same strain, pressure and direction differ by')
    assert said == (smaller < 1.0)
    assert found.verdict == ('unexplained' if smaller < 1.0 else 'adequate')


@pytest.mark.parametrize('seed', range(4))
def test_rows_of_a_noisy_map_do_not_contradict_each_other(paper_muscle, seed):
    """Every strain and pressure twice, with noise of 1.2 % of the largest force."""
    strain, pressure = (np.repeat(grid.ravel(), 2) for grid in np.meshgrid(
        np.linspace(0.0, 0.24, 13), np.linspace(69e3, 345e3, 5)))
    force = paper_muscle.force(strain, pressure[:, None])
    noise = 0.012 * force.max() * np.random.default_rng(seed).standard_normal(len(force))
    cells = reduce(paper_muscle, build('noisy', strain, pressure[:, None], force + noise))
    search = Search(Options(paper_muscle, cells, Choices()))
    assert not [*_contradictions(search.fitter, search.fit(search.options.own))]


def test_vibration_of_the_rig_is_no_noise_and_no_effect(make_sweeps, paper_muscle):
    """Three times the noise, but less than a hundredth of the largest force."""
    found = diagnose(paper_muscle, make_sweeps(extra=swing(2.5)), choices=ALONE)
    assert found.verdict == 'unexplained'
    assert not found.effects
    assert found.summary.startswith('the force swings by 2.5 N with a period of 2.2 s')
    assert found.next_experiment.startswith('log the load cell at rest')


def test_vibration_beside_an_effect_is_a_caution(make_sweeps, paper_muscle):
    """The effect is named, and the answer is partial."""
    def extra(strain, pressure, way, time):
        return swing(2.5)(strain, pressure, way, time) - 9.0 * way
    found = diagnose(paper_muscle, make_sweeps(extra=extra), choices=ALONE)
    assert found.verdict == 'partial'
    assert found.effects == ('coulomb_friction',)
    assert any('with a period of 2.2 s' in words for words in found.artefacts)


def test_a_vibration_is_found_where_no_place_was_visited_twice(make_sweeps, paper_muscle):
    """The discrepancy could follow it there, as a function of strain and pressure."""
    data = make_sweeps(cycles=1, extra=swing(2.5, 4.1))
    found = diagnose(paper_muscle, data.select(data.trial < 3), choices=ALONE)
    assert found.summary.startswith('the force swings by 2.6 N with a period of 4.1 s')


def test_vibration_is_told_beside_a_shape_that_no_effect_has(make_sweeps, paper_muscle):
    """What the discrepancy explains by strain and pressure is not held against it."""
    def extra(strain, pressure, way, time):
        return swing(2.5)(strain, pressure, way, time) + 9.0 * np.sin(25.0 * strain)
    found = diagnose(paper_muscle, make_sweeps(extra=extra), choices=ALONE)
    assert any('with a period of 2.2 s' in words for words in found.artefacts)


def test_a_vibration_hidden_in_the_noise_is_not_told(make_sweeps, paper_muscle):
    """Less than half of the noise of a row."""
    assert not diagnose(paper_muscle, make_sweeps(extra=swing(0.35)), choices=ALONE).artefacts
