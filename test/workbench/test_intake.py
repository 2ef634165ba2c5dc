# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Uploads become measurements and models, or one clear sentence; none reaches the disk's names."""

from pathlib import Path

import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.workbench import intake

CSV = config_path('data/examples/hidden_friction.csv').read_bytes()
MODEL = config_path('data/examples/hidden_friction.model.yaml').read_bytes()


def read(name, content):
    """Return the measurement of an upload, as the page reads it."""
    return intake.incoming_from_bytes(name, content).measurement()


def test_a_csv_becomes_a_measurement_under_its_own_name():
    """The content is read, the name is a label."""
    data = read('my run.csv', CSV)
    assert (data.name, len(data)) == ('my run.csv', 1260)


def test_a_model_file_becomes_a_model():
    """A model file is read as on the command line."""
    assert intake.model_from_bytes('m.yaml', MODEL).name == 'hidden_friction_start'


@pytest.mark.parametrize('name', ['../../etc/passwd.csv', '/etc/passwd.csv', 'a/../../b.csv',
                                  'C:\\Windows\\x.csv', '\0.csv', '..', '.csv', 'x' * 5000])
def test_a_name_with_a_path_touches_no_such_path(name, tmp_path, monkeypatch):
    """Whatever the name says, only a private folder is written, and it is gone afterwards."""
    monkeypatch.setenv('TMPDIR', str(tmp_path))
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path))
    opened = []
    write = Path.write_bytes
    monkeypatch.setattr(Path, 'write_bytes',
                        lambda self, content: opened.append(self) or write(self, content))
    try:
        read(name, CSV)
    except InputError:
        pass
    assert opened
    for path in opened:
        assert path.resolve().is_relative_to(tmp_path.resolve())
        assert path.name.startswith('upload.')
    assert list(tmp_path.iterdir()) == []


def test_messages_name_the_file_as_the_user_knows_it():
    """An error speaks of the upload's name, never of the server's folders."""
    with pytest.raises(InputError, match='^mine.csv') as error:
        read('mine.csv', b'strain,pressure [kPa],force [N]\n1,2,x\n')
    assert 'tmp' not in str(error.value)
    with pytest.raises(InputError, match='^mine.yaml, line'):
        intake.model_from_bytes('mine.yaml', b'format: fam-bundle-model/1\nname: [')


@pytest.mark.parametrize(('name', 'content'), [
    ('empty.csv', b''), ('image.csv', b'\x89PNG\0\0\0'), ('bag.mcap', b'not a bag'),
    ('bag.db3', b'not a bag'), ('words.csv', b'hello world\n' * 20)])
def test_garbage_fails_with_one_sentence(name, content):
    """What is no measurement is refused as bad input."""
    with pytest.raises(InputError):
        read(name, content)


@pytest.mark.parametrize('key', ['measured_surface', r'"measured\x5fsurface"',
                                 '!!str measured_surface', 'discrepancy_surface'])
def test_a_model_that_reads_tables_fails(key):
    """An uploaded model may not name a file of the server, however the name is spelled."""
    text = MODEL.decode() + f'- {key}: {{table: /etc/passwd}}\n'
    with pytest.raises(InputError, match='table on the disk'):
        intake.model_from_bytes('m.yaml', text.encode())


def test_a_model_with_python_files_fails():
    """An uploaded model runs no Python."""
    with pytest.raises(InputError, match='Python'):
        intake.model_from_bytes('m.yaml', MODEL + b'effect_files: [/tmp/x.py]\n')


def test_too_much_fails(monkeypatch):
    """A file above the limit is refused before it is read."""
    monkeypatch.setattr(intake, 'MAX_UPLOAD', 1000)
    with pytest.raises(InputError, match='at most'):
        read('big.csv', CSV)
    with pytest.raises(InputError, match='at most'):
        intake.model_from_bytes('big.yaml', b'#' * (2 << 20))


def test_the_kind_is_told_by_the_ending():
    """CSV and bags are data, YAML is a model, the rest is refused by name."""
    assert not intake.is_model('A.CSV')
    assert not intake.is_model('x.mcap')
    assert intake.is_model('m.yml')
    with pytest.raises(InputError, match=r'\.exe'):
        intake.is_model('x.exe')
