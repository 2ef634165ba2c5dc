# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""In a notebook: names at the top, files that ship by name, results that fit a cell."""

import subprocess
import sys

import numpy as np
import pytest

import fam_bundle_ros
from fam_bundle_ros import compare, load_model, read_measurement
from fam_bundle_ros.errors import InputError


def test_every_name_of_the_package_can_be_had_and_nothing_is_loaded_before():
    """`from fam_bundle_ros import ...` gives them all; the import by itself loads no NumPy."""
    for name in fam_bundle_ros.__all__:
        assert getattr(fam_bundle_ros, name).__name__ == name
        assert name in dir(fam_bundle_ros)
    with pytest.raises(AttributeError, match='nothing'):
        _ = fam_bundle_ros.nothing
    subprocess.run([sys.executable, '-c', 'import fam_bundle_ros, sys\n'
                    'assert "numpy" not in sys.modules'], check=True)


def test_what_ships_is_found_by_its_name():
    """As on the command line; a name that does not ship is told with those that do."""
    assert load_model('spie2021').n == 2
    assert len(read_measurement('dmsp20_static_map')) == 126
    with pytest.raises(InputError, match='models that ship: .*spie2021'):
        load_model('spie2012')
    with pytest.raises(InputError, match='measurements that ship: .*dmsp20_static_map'):
        read_measurement('dmsp')


def test_results_are_a_line_in_a_shell_and_whole_in_a_notebook():
    """No array is printed in full; names from files cannot break out of the page."""
    model, data = load_model('dmsp20_static_map'), read_measurement('dmsp20_static_map')
    result = compare(model.named('<b>'), data)
    for each in (model, data, result):
        assert '\n' not in repr(each)
        assert len(repr(each)) < 200
    assert repr(result).startswith('<Comparison <b> against dmsp20')
    assert '<b>' not in result._repr_html_()
    assert 'by strain' in result._repr_html_()
    html = model._repr_html_()
    assert 'braid angle' in html
    assert all(effect.name in html for effect in model.effects)
    assert np.isfinite(result.error_N)
