# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Shipped files are found by name, and only shipped files."""

import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.resources import config_names, config_path


def test_config_path_finds_what_ships():
    """A data file is found by its name below config/."""
    path = config_path('data/dmsp20_static_map.csv')
    assert path.is_absolute()
    assert path.is_file()


def test_config_path_of_an_unknown_name_fails():
    """An unknown name is answered with the names that there are."""
    with pytest.raises(InputError, match=r'data/spring\.csv: no such .* dmsp20_static_map\.csv'):
        config_path('data/spring.csv')


@pytest.mark.parametrize('name', ['../setup.py', '/etc/passwd', 'data/../../setup.py'])
def test_config_path_that_leads_out_fails(name):
    """A name that leads out of config/ is refused even though the file exists."""
    with pytest.raises(InputError, match='no such file ships'):
        config_path(name)


def test_config_names_lists_a_folder():
    """The names of a folder come sorted; a folder that does not exist has none."""
    assert 'dmsp20_static_map.csv' in config_names('data')
    assert list(config_names()) == sorted(config_names())
    assert config_names('nowhere') == ()
