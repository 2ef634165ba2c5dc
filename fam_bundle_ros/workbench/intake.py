# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What a browser sends in -> a measurement or a model.

Nothing that comes from a browser names a place on the disk: a file's name is a label, its content
lies for a moment in a private folder under a name of our own, and model files that would read
other files are refused.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath, PureWindowsPath
import re
import tempfile

import yaml

from fam_bundle_ros.data import Measurement, read_measurement
from fam_bundle_ros.data.formats import is_bag, read_table, SUFFIXES
from fam_bundle_ros.data.measurement import file_digest
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, catalogue, loads_model
from fam_bundle_ros.workbench.incoming import Incoming

__all__ = ['DATA_SUFFIXES', 'MAX_UPLOAD', 'MODEL_SUFFIXES', 'incoming_from_bytes',
           'incoming_from_path', 'label', 'measurement_from_bytes', 'model_from_bytes', 'what_is']

#: Largest file that the page takes, bytes; larger logs are read by the command line.
MAX_UPLOAD = 100 << 20
_MAX_MODEL = 1 << 20
DATA_SUFFIXES = SUFFIXES
MODEL_SUFFIXES = ('.yaml', '.yml')


def label(name: str) -> str:
    r"""
    Return a file's name as a harmless label.

    Examples
    --------
    >>> label('../../etc/passwd'), label('C:\\logs\\run 1.csv'), label('')
    ('passwd', 'run 1.csv', 'upload')
    """
    last = PureWindowsPath(PurePosixPath(name.replace('\0', '')).name).name
    return re.sub(r'[^\w .()+-]', '_', last)[:80].strip(' .') or 'upload'


def what_is(name: str) -> str:
    """Return 'data' or 'model' by the ending of a file's name; InputError for any other."""
    suffix = Path(label(name)).suffix.lower()
    if suffix in DATA_SUFFIXES:
        return 'data'
    if suffix in MODEL_SUFFIXES:
        return 'model'
    raise InputError(f"{label(name)}: its ending '{suffix}' is not known; expected a measurement "
                     f"({', '.join(DATA_SUFFIXES)}) or a model file ({', '.join(MODEL_SUFFIXES)})")


def measurement_from_bytes(name: str, content: bytes, *, rest_length: float | None = None,
                           ) -> Measurement:
    """
    Return the measurement that an uploaded CSV or bag holds.

    Parameters
    ----------
    name : str
        As the browser gave it; used as a label, and its ending as the kind of file.
    content : bytes
    rest_length : float, m, optional
        Needed where the file gives contractions as lengths.

    Raises
    ------
    InputError
        For what cannot be read; the message names the file as the user knows it.
    """
    shown = label(name)
    _limit(shown, content, MAX_UPLOAD)
    with _stored(shown, content) as path:
        return read_measurement(path, rest_length=rest_length, name=shown)


@contextmanager
def _stored(shown: str, content: bytes) -> Iterator[Path]:
    """Lend a private file with an upload's content; errors speak of it by the user's name."""
    suffix = Path(shown).suffix.lower()
    with tempfile.TemporaryDirectory(prefix='fam_bundle_upload_') as folder:
        path = Path(folder) / f'upload{suffix if suffix in DATA_SUFFIXES else ".csv"}'
        path.write_bytes(content)
        try:
            yield path
        except InputError as error:
            raise InputError(str(error).replace(str(path), shown).replace(path.name, shown)
                             ) from None


def incoming_from_bytes(name: str, content: bytes) -> Incoming:
    """
    Return an uploaded file with its table, before it is told what each column is.

    Raises
    ------
    InputError
        For a file that is no table; the message names it as the user knows it.
    """
    shown = label(name)
    _limit(shown, content, MAX_UPLOAD)
    if Path(shown).suffix.lower() in ('.mcap', '.db3'):
        return Incoming(shown, 'your own file', read_bag=lambda rest: measurement_from_bytes(
            name, content, rest_length=rest))
    with _stored(shown, content) as path:
        return incoming_from_path(path, shown)


def incoming_from_path(path: Path, name: str = '') -> Incoming:
    """Return a file of this machine with its table; InputError where it is none."""
    shown = name or path.name
    if is_bag(path):
        return Incoming(shown, 'your own file', read_bag=lambda rest: read_measurement(
            path, rest_length=rest, name=shown))
    return Incoming(shown, 'your own file', replace(read_table(path), name=shown),
                    sha256=file_digest(path))


def model_from_bytes(name: str, content: bytes) -> Bundle:
    """
    Return the model that an uploaded model file describes.

    Raises
    ------
    InputError
        For a bad model file, and for one that names other files (a measured table, Python): those
        are read only where the user starts the workbench with ``--model``.
    """
    shown = label(name)
    _limit(shown, content, _MAX_MODEL)
    try:
        text = content.decode('utf-8')
    except UnicodeDecodeError:
        raise InputError(f'{shown}: not a text file; expected a model file (YAML)') from None
    _refuse_tables(shown, text)
    with tempfile.TemporaryDirectory(prefix='fam_bundle_upload_') as folder:
        return loads_model(text, shown, Path(folder), allow_python=False)


def _limit(shown: str, content: bytes, most: int) -> None:
    if len(content) > most:
        raise InputError(f'{shown}: {len(content) / 1e6:.0f} MB; expected at most '
                         f'{most / 1e6:.0f} MB here (use fam_bundle diagnose for larger files)')


def _refuse_tables(shown: str, text: str) -> None:
    try:
        events = yaml.parse(text, Loader=yaml.SafeLoader)
        readers = {name for name, law in catalogue.available().items() if law.load is not None}
        named = next((event.value for event in events if isinstance(event, yaml.ScalarEvent)
                      and event.value in readers), None)
    except yaml.YAMLError:
        return  # the model reader says what is wrong, with its line
    if named:
        raise InputError(f'{shown}: {named} names a table on the disk, which an uploaded '
                         'file may not; start with fam_bundle workbench --model instead')
