# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A slip of unit or sign is told as what it is, and nothing is told where there is none."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build, Taken
from fam_bundle_ros.data.unit_slips import slips
from fam_bundle_ros.units import si_factor


@pytest.fixture
def told(sweeps, muscle):
    """Return what is said of the sweeps after a change of them."""
    def say(**changes):
        data = sweeps()
        data = replace(data, **{key: factor * getattr(data, key) if np.isscalar(factor) else
                                factor(getattr(data, key)) for key, factor in changes.items()})

        def predict(measurement):
            return muscle(measurement.strain, measurement.pressure[:, 0])
        return slips(predict, data, data.force - predict(data))
    return say


@pytest.mark.parametrize(('unit', 'taken'), [('lbf', 'N'), ('N', 'lbf'), ('kgf', 'N'),
                                             ('N', 'kgf')])
def test_a_force_in_another_unit_is_told(told, sweeps, unit, taken):
    """Of numbers in one unit that were read as another; what would be left is 0.6 N of noise."""
    share = 60.0 / np.sqrt(np.mean(sweeps().force ** 2))
    words, = told(force=si_factor(taken, 'N') / si_factor(unit, 'N'))
    assert words.startswith(f'with a force in {unit}, not in {taken} the model would be off by ')
    assert float(words.partition('(')[2].split()[0]) == pytest.approx(share, abs=0.6)
    assert float(words.partition('off by ')[2].split()[0]) == pytest.approx(0.6, rel=0.1)


@pytest.mark.parametrize(('unit', 'taken'), list(permutations(('psi', 'kPa', 'bar'), 2)))
def test_a_pressure_in_another_unit_is_told(told, unit, taken):
    """What would be left is the noise of 0.6 N, beside what there is now; or the model's error."""
    factor = si_factor(taken, 'Pa') / si_factor(unit, 'Pa')
    begin = f'with pressures in {unit}, not in {taken} the model would be off'
    words, = told(pressure=factor)
    assert words.startswith(begin)
    assert float(words.partition('off by ')[2].split()[0]) == pytest.approx(0.6, rel=0.1)
    words, = told(pressure=factor, force=lambda force: force + 20.0)
    assert words.startswith(begin)


@pytest.mark.parametrize(('named', 'why', 'told_of'), [
    ('kPa', '', True), ('bar', '', False), ('PSI', '', False), ('Pa', 'Pa guessed', True)])
def test_a_unit_that_the_file_does_not_name_was_not_confused(told, named, why, told_of):
    """Numbers in psi under [kPa], or no unit, are a slip; under [bar] the error is the model's."""
    column = Taken('p', 'pressure', named, why=why)
    assert bool(told(pressure=1.0 / 6.894757, taken=lambda _: (column,))) == told_of


def test_a_sign_and_an_absolute_pressure_are_told(told):
    """Tension read as negative; a gauge whose lowest reading is the atmosphere."""
    assert told(force=-1.0)[0].startswith('with the sign of the force turned round')
    # by a poor model too: 40 N off, a third of the force
    assert told(force=lambda force: 40.0 - force)[0].startswith('with the sign of the force')
    absolute, = told(pressure=lambda gauge: gauge + 101325.0)
    assert absolute.startswith('with pressures that are absolute, not gauge')


def test_columns_that_are_exchanged_or_turned_round_are_told(told, sweeps):
    """Force and pressure in each other's place, in N and kPa; a length that grows when shorter."""
    data = sweeps()
    words, = told(force=lambda _: 1e-3 * data.pressure[:, 0],
                  pressure=lambda _: 1e3 * data.force[:, None])
    assert words.startswith('with force and pressure exchanged the model would be off by')
    words, = told(strain=lambda strain: strain.max() + strain.min() - strain)
    assert words.startswith('with the strain turned round (positive when shorter)')


def test_a_clock_in_another_unit_is_told_by_a_strain_that_no_muscle_reaches():
    """0.2 of strain within 2 s, the seconds read as milliseconds; at the right clock nothing."""
    time = 0.01 * np.arange(400)
    strain = 0.1 - 0.1 * np.cos(np.pi * time)

    def told_at(clock):
        data = build('sweep', strain, np.full(400, 5e4), np.full(400, 50.0), time=clock)
        return slips(lambda _: data.force, data, np.zeros(400))
    assert told_at(time) == ()
    words, = told_at(1e-3 * time)
    assert 'faster than any muscle (10 1/s): in which unit is the time?' in words


def test_what_is_no_slip_is_not_told(told):
    """Data as they are, a force off by a third, an offset: no other unit makes them fit."""
    assert told(force=1.0) == ()
    assert told(force=1.3) == ()
    assert told(force=lambda force: force + 40.0) == ()
    assert told(pressure=2.0) == ()
