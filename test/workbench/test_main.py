# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Starting the workbench: addresses, tokens, files; every mistake is one sentence."""

import socket

import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.workbench.incoming import Incoming
from fam_bundle_ros.workbench.main import first_case, run
from fam_bundle_ros.workbench.session import Session


@pytest.mark.parametrize('host', ['0.0.0.0', '192.168.1.5', '::'])
def test_another_address_without_a_token_fails(host):
    """Other machines are let in only with a token that the user sets."""
    with pytest.raises(InputError, match='token'):
        run(host=host)


@pytest.mark.parametrize('token', ['', 'short', 'with space 123', 'semi;colon12'])
def test_a_weak_token_fails(token):
    """A token is eight letters and digits at least."""
    with pytest.raises(InputError, match='token must be'):
        run(host='0.0.0.0', token=token)


def test_a_busy_port_fails():
    """A port that is taken is said, with what to do."""
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen()
        with pytest.raises(InputError, match='--port'):
            run(port=taken.getsockname()[1])


def test_a_model_without_data_fails():
    """A model alone has nothing to be compared with."""
    with pytest.raises(InputError, match='needs data'):
        first_case(None, 'model.yaml')


def test_a_file_opens_with_its_model():
    """DATA and --model make the first case; without a model the page asks for the muscle."""
    data = config_path('data/examples/bundle_push_back.csv')
    case = first_case(data, config_path('data/examples/bundle_push_back.model.yaml'))
    assert (case.model.name, case.title) == ('bundle_push_back_start', 'bundle_push_back.csv')
    asked = first_case(data, None)
    assert isinstance(asked, Incoming)
    assert asked.muscle.values == {'muscles': '1, 1'}
    assert first_case(None, None) is None


def test_the_printed_command_finds_the_file_of_the_command_line():
    """Also after its columns were asked for: its path, not its name, and what was told of them."""
    data = config_path('data/examples/hidden_friction.csv')
    case = first_case(data, config_path('data/examples/hidden_friction.model.yaml'))
    session = Session()
    source = case.source.again()
    source.told['force'] = 'force [N]'
    session.take(source)
    assert f"--data {data} --columns 'force=force [N]' " in session.command()
