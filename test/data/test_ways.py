# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Static maps with a column of force for each way of the loop."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.errors import InputError

STRAIN = np.linspace(0.0, 0.2, 21)
LEVELS = (1e5, 3e5)
LOOP = 2.0


def expected(muscle):
    """Return the rows of pressure, strain and force, sorted."""
    rows = [(level, strain, muscle(strain, level) + way) for way in (-LOOP, LOOP)
            for level in LEVELS for strain in STRAIN]
    return np.array(sorted(rows))


@pytest.mark.parametrize('words', [('up', 'down'), ('Belastung', 'Entlastung'),
                                   ('(inflation)', '(deflation)')])
def test_a_force_for_each_way(muscle, words):
    """Two columns of force that differ in the way are two trials, not a choice of one."""
    pressure, strain = (each.ravel() for each in np.meshgrid(LEVELS, STRAIN, indexing='ij'))
    force = muscle(strain, pressure)
    data = read_measurement({'p [Pa]': pressure, 'strain': strain,
                             f'Force {words[0]} [N]': force - LOOP,
                             f'Force {words[1]} [N]': force + LOOP})
    found = np.array(sorted(zip(data.pressure[:, 0], data.strain, data.force)))
    assert np.allclose(found, expected(muscle))
    assert len(data.trial_names) == 2


def test_a_force_for_each_way_and_pressure(muscle):
    """The columns of a map, '1 bar up', '1 bar down'."""
    data = read_measurement({'strain': STRAIN, **{
        f'{level / 1e5:.0f} bar {word} [N]': muscle(STRAIN, level) + way
        for level in LEVELS for word, way in (('up', -LOOP), ('down', LOOP))}})
    found = np.array(sorted(zip(data.pressure[:, 0], data.strain, data.force)))
    assert np.allclose(found, expected(muscle))


def test_other_columns_of_two_words_are_asked(log):
    """With a clock they are two sensors; a third without a word counts more than both."""
    time, strain, pressure, force = log
    columns = {'strain': strain, 'p [Pa]': pressure, 'Force up [N]': force,
               'Force down [N]': force + 1.0}
    with pytest.raises(InputError, match='both may be force'):
        read_measurement({'time [s]': time, **columns})
    assert np.allclose(read_measurement({**columns, 'Force [N]': force - 1.0}).force, force - 1.0)
