# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Files are written whole or not at all."""

import json

import numpy as np
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.report.files import whole, write_json, write_whole


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    """When writing breaks off, the old content stays and no draft is left behind."""
    path = tmp_path / 'result.json'
    write_whole(path, 'old')

    def break_off():
        with whole(path) as draft:
            draft.write_text('half')
            raise RuntimeError('power cut')

    with pytest.raises(RuntimeError):
        break_off()
    assert path.read_text() == 'old'
    assert list(tmp_path.iterdir()) == [path]


def test_json_is_strict(tmp_path):
    """Arrays, numpy numbers and nan come out as JSON that every reader takes."""
    path = write_json(tmp_path / 'a.json', {'x': np.array([1.0, np.nan, np.inf]),
                                            'n': np.int64(3), 'on': np.bool_(False)})
    assert json.loads(path.read_text(), parse_constant=pytest.fail) == {
        'x': [1.0, None, None], 'n': 3, 'on': False}


def test_writing_where_nothing_can_be_written_fails(tmp_path):
    """A folder that is not there, or is a file, is a user's error that names the path."""
    with pytest.raises(InputError, match='absent'):
        write_whole(tmp_path / 'absent' / 'a.txt', 'x')
