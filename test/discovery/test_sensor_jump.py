# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A reading that jumps during a log is told and corrected; what comes gradually is no jump."""

from dataclasses import replace
import re

import numpy as np
import pytest

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.add import add_effect
from fam_bundle_ros.discovery.change_point import two_models
from fam_bundle_ros.discovery.diagnose import diagnose
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.sensor_jump import sensor_jump
from fam_bundle_ros.discovery.settings import Choices


def jumping(data, first, **sizes):
    """Return a log whose readings are larger from row ``first`` on."""
    after = np.arange(len(data)) >= first
    return replace(data, **{name: (getattr(data, name).T + size * after).T
                            for name, size in sizes.items()})


@pytest.mark.parametrize(('quantity', 'size', 'words'), [
    ('force', 5.0, '5 N more'), ('force', -2.0, '2 N less'), ('strain', 4e-3, '0.004 more'),
    ('strain', 0.02, '0.02 more'), ('pressure', 4e3, '4 kPa more')])
@pytest.mark.parametrize(('first', 'place'), [(480, 'trial 6 ('), (680, 's of trial 8')])
def test_a_reading_that_jumps_is_told_with_its_size_and_place(
        searched, make_sweeps, paper_muscle, quantity, size, words, first, place):
    """Between two trials or within one: a load cell that was tared, a clamp that slipped."""
    still = make_sweeps(noise=0.2)
    data = jumping(still, first, **{quantity: size})
    search = searched(paper_muscle, data)
    jump = sensor_jump(search)
    assert jump.quantity == quantity
    assert jump.size == pytest.approx(size, rel=0.02)
    assert jump.begin == pytest.approx(data.time[first], abs=0.3)  # a row
    two = two_models(search)
    assert two is None or two.log_odds < jump.log_odds
    where, _, told = jump.words.partition(' on the ')
    assert place in where
    assert told.startswith(f'{quantity} reads {words} than before')
    left = getattr(jump.undone(data), quantity) - getattr(still, quantity)
    assert np.median(np.abs(left)) < 0.02 * abs(size)


def test_a_log_that_jumps_is_judged_without_the_jump(make_sweeps, paper_muscle):
    """A strain sensor that was zeroed again was taken for another muscle."""
    data = jumping(make_sweeps(), 680, strain=0.01)
    found = diagnose(paper_muscle, data, choices=Choices(most=1))
    assert found.verdict in ('adequate', 'recalibrate')
    assert re.match(r'from .* s of trial 8 on the strain reads 0.01 more', found.summary)
    assert found.error_N['model'] == pytest.approx(0.6, abs=0.1)  # the noise
    assert rms(found.measurement.strain - data.strain) > 5e-3


def test_an_effect_is_found_in_a_log_that_jumps(make_sweeps, paper_muscle):
    """A drift and end caps were named in its place."""
    true = paper_muscle.with_effect('coulomb_friction')
    found = diagnose(paper_muscle, jumping(make_sweeps(true), 480, force=5.0),
                     choices=Choices(most=2))
    assert found.effects == ('coulomb_friction',)
    assert found.verdict == 'partial'
    assert re.match('from trial 6 .* on the force reads 5 N more', found.summary)
    assert any('on the force reads' in note for note in found.notes)
    assert found.error_N['best'] == pytest.approx(0.6, abs=0.1)  # the noise
    assert found.error_N['model'] == pytest.approx(
        rms(found.measurement.force - predict(paper_muscle, found.measurement)))
    added = add_effect(paper_muscle, found, found.measurement)
    assert added.model.effect('coulomb_friction').values['force'] == pytest.approx(
        true.effect('coulomb_friction').values['force'], rel=0.05)


@pytest.mark.parametrize('warm', [5.0, 20.0, 60.0])
def test_a_load_cell_that_warms_up_does_not_jump(searched, make_sweeps, paper_muscle, warm):
    """Its offset comes gradually, in this time (s)."""
    data = make_sweeps(noise=0.2, extra=lambda strain, pressure, way, time: 4.0 * (
        1.0 - np.exp(-time / warm)))
    assert sensor_jump(searched(paper_muscle, data)) is None


@pytest.mark.parametrize('cycles', [1, 2])
def test_an_effect_of_the_pressure_is_no_jump(searched, make_sweeps, paper_muscle, cycles):
    """In isobars run once, in ascending order, the force steps at one time as at one pressure."""
    data = make_sweeps(noise=0.2, cycles=cycles, extra=lambda strain, pressure, way, time: 3.0 * (
        pressure > 2e5))
    assert sensor_jump(searched(paper_muscle, data)) is None


def test_the_jump_is_found_where_the_clock_starts_anew_in_each_trial(searched, make_sweeps,
                                                                     paper_muscle):
    """Its place is then a row, not a time; averaged rows have lost their number."""
    data = jumping(make_sweeps(), 480, force=5.0)
    anew = build('anew', data.strain, data.pressure, data.force, data.trial, data.time % 23.0)
    search = searched(paper_muscle, anew)
    jump = sensor_jump(search)
    assert jump.begin == 480
    thinned = replace(search.options.cells, rows=2 * len(anew))
    search.options = replace(search.options, cells=thinned)
    del search.fitter
    assert sensor_jump(search) is None
