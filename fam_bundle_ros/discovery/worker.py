# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A diagnosis in a process of its own, for a program that must not stand still meanwhile.

`Worker` starts it and is asked now and then how far it is; ``python -m
fam_bundle_ros.discovery.worker`` is the process. It takes a pickled job on standard input and
writes lines of JSON on standard output. It ends with the program that started it, however that
ends, since its standard input is closed then; it works at a lower priority.
"""

from dataclasses import dataclass
import json
import os
from pathlib import Path
import pickle
import subprocess
import sys
import threading
from typing import Any

from fam_bundle_ros.atomic import write_whole
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.protocol import save_protocol
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.processes import environment, own_stdout

__all__ = ['Done', 'Worker']

#: Steps of priority that the work stands back behind whoever started it.
_NICE = 5


@dataclass(frozen=True)
class Done:
    """
    How a diagnosis ended.

    Attributes
    ----------
    error : str
        Why there is none; empty where there is one.
    text : str
        The JSON of `Diagnosis`, with ``file``, ``model_file`` and ``protocol_file`` (the next
        experiment; empty where it is no force test).
    file, model_file : str
        The same as a file, and the model that it recommends.
    """

    error: str = ''
    text: str = ''
    file: str = ''
    model_file: str = ''


class Worker:
    """
    One diagnosis that runs elsewhere.

    Parameters
    ----------
    model : Bundle
    data : Measurement
    folder : path
        Where its answer goes; made where it is not there.
    name : str
        Of the files, without suffix.
    choices : Choices, optional

    Attributes
    ----------
    share : float
        How far it is, 0 to 1.
    words : str
        With what it is busy.
    """

    def __init__(self, model: Bundle, data: Measurement, folder: str | Path, name: str,
                 choices: Choices | None = None):
        self.share, self.words = 0.0, 'starting'
        self._files = Path(folder) / f'{name}.json', Path(folder) / f'{name}.model.yaml'
        job = pickle.dumps((model, data, *map(str, self._files), choices))
        # a session of its own: Ctrl-C in a terminal is for who started it
        self._process = subprocess.Popen(
            [sys.executable, '-m', 'fam_bundle_ros.discovery.worker'], env=environment(),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._out = self._process.stdout
        os.set_blocking(self._out.fileno(), False)
        self._said = b''
        # more than a pipe holds: it would stand still until the process has started
        self._feeder = threading.Thread(target=self._feed, args=(job,), daemon=True)
        self._feeder.start()

    def poll(self) -> Done | None:
        """Return how it ended, None while it runs; never waits."""
        ended = self._process.poll() is not None
        while part := self._out.read(1 << 16):
            self._said += part
        *lines, self._said = self._said.split(b'\n')
        for line in lines:
            told = json.loads(line)
            if 'error' in told:
                return self._end(Done(error=told['error']))
            if told['share'] >= 1.0:
                file, model_file = self._files
                return self._end(Done('', file.read_text(encoding='utf-8'), str(file),
                                      str(model_file)))
            self.share, self.words = told['share'], told['words']
        if ended:
            return self._end(Done(error='the worker process ended without an answer'))
        return None

    def kill(self) -> None:
        """End it at once."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._out):
            if stream is not None:
                try:
                    stream.close()
                except OSError:
                    pass  # it was in the middle of being written

    def _end(self, done: Done) -> Done:
        self.kill()
        return done

    def _feed(self, job: bytes) -> None:
        stdin = self._process.stdin
        assert stdin is not None
        try:
            stdin.write(len(job).to_bytes(8, 'big') + job)
            stdin.flush()
        except (OSError, ValueError):
            pass  # it has ended; `poll` says so


def run(model: Bundle, data: Measurement, file: str, model_file: str,
        choices: Choices | None, tell: Any) -> None:
    """
    Diagnose, and write recommended model, next experiment and answer, the answer last.

    Raises
    ------
    InputError
        Where the data do not do or a file cannot be written.
    """
    from fam_bundle_ros.discovery.diagnose import diagnose
    found = diagnose(model, data, choices=choices,
                     progress=lambda share, words: tell(0.99 * share, words))
    try:
        Path(file).parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f'{Path(file).parent}: cannot be made ({error.strerror})') from error
    found.recommended.save(model_file)
    protocol = ''
    if found.next_protocol is not None:
        protocol = str(Path(file).with_suffix('.protocol.yaml'))
        save_protocol(found.next_protocol, protocol)
    told = {**json.loads(found.to_json()), 'file': file, 'model_file': model_file,
            'protocol_file': protocol}
    write_whole(file, json.dumps(told, indent=1))


def main() -> None:
    """Do the job on standard input."""
    out = own_stdout()

    def tell(share: float, words: str) -> None:
        out.write(json.dumps({'share': share, 'words': words}) + '\n')

    os.nice(_NICE)
    source = sys.stdin.buffer
    size = int.from_bytes(source.read(8), 'big')
    job = source.read(size)
    if len(job) < size or not size:
        return

    def end_with_starter() -> None:
        source.read(1)
        os._exit(1)

    threading.Thread(target=end_with_starter, daemon=True).start()
    try:
        model, data, file, model_file, choices = pickle.loads(job)
        run(model, data, file, model_file, choices, tell)
        tell(1.0, 'done')
    except InputError as error:
        out.write(json.dumps({'error': str(error)}) + '\n')
    except Exception as error:  # the one who asked must hear something, whatever went wrong
        out.write(json.dumps({'error': f'{type(error).__name__}: {error}'}) + '\n')


if __name__ == '__main__':
    main()
