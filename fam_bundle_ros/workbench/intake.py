# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Reads measurements and models from files that a browser uploads.

No path comes from the browser: a file's name is only displayed, its content is stored temporarily
in a private folder under a fixed name, and model files that refer to other files are refused.
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

#: Largest upload, bytes; larger logs are read by the command line.
MAX_UPLOAD = 100 << 20
_MAX_MODEL = 1 << 20
_MODELS = ('.yaml', '.yml')
#: Accepted file name endings.
TAKEN = (*SUFFIXES, *_MODELS)


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


def is_model(name: str) -> bool:
    """Return whether a file is a model by its ending, else data; InputError for other endings."""
    suffix = Path(label(name)).suffix.lower()
    if suffix not in TAKEN:
        raise InputError(f"{label(name)}: its ending '{suffix}' is not known; expected a "
                         f"measurement ({', '.join(SUFFIXES)}) or a model file "
                         f"({', '.join(_MODELS)})")
    return suffix in _MODELS


@contextmanager
def _stored(shown: str, content: bytes) -> Iterator[Path]:
    """Provide a private file with an upload's content; errors name it as the user does."""
    suffix = Path(shown).suffix.lower()
    with tempfile.TemporaryDirectory(prefix='fam_bundle_upload_') as folder:
        path = Path(folder) / f'upload{suffix if suffix in SUFFIXES else ".csv"}'
        path.write_bytes(content)
        try:
            yield path
        except InputError as error:
            raise InputError(str(error).replace(str(path), shown).replace(path.name, shown)
                             ) from None


def incoming_from_bytes(name: str, content: bytes) -> Incoming:
    """
    Return an uploaded file with its table, before the user has checked the columns.

    The ending of its name determines the kind of file. InputError, with that name, if it is not a
    table.
    """
    shown = label(name)
    _limit(shown, content, MAX_UPLOAD)

    def read_bag(rest_length: float | None) -> Measurement:
        with _stored(shown, content) as path:
            return read_measurement(path, rest_length=rest_length, name=shown)

    if Path(shown).suffix.lower() in ('.mcap', '.db3'):
        return Incoming(shown, 'your own file', read_bag=read_bag)
    with _stored(shown, content) as path:
        return incoming_from_path(path, shown)


def incoming_from_path(path: Path, name: str = '') -> Incoming:
    """Return a file of this machine with its table; InputError if it is not a table."""
    shown = name or path.name
    file = '' if name else str(path)
    if is_bag(path):
        return Incoming(shown, 'your own file', read_bag=lambda rest: read_measurement(
            path, rest_length=rest, name=shown), file=file)
    return Incoming(shown, 'your own file', replace(read_table(path), name=shown),
                    sha256=file_digest(path), file=file)


def model_from_bytes(name: str, content: bytes) -> Bundle:
    """
    Return the model that an uploaded model file describes; InputError for a bad one.

    Models that name other files (a measured table, Python) are refused: those are read only where
    the user starts the workbench with ``--model``.
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
