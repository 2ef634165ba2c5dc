# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Run a diagnosis in a separate process, so that the calling program is not blocked.

`Worker` starts the process, ``python -m fam_bundle_ros.discovery.worker``, and is polled for its
progress. The process reads a pickled job from standard input and writes lines of JSON to standard
output, at lower priority. It exits when its standard input is closed, so it always ends with the
program that started it.
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

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.protocol import save_protocol
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.errors import InputError, system_errors
from fam_bundle_ros.jsonfile import write_json
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.processes import environment, own_stdout

__all__ = ['Done', 'Worker']

#: Increase of the nice value of the process.
_NICE = 5


@dataclass(frozen=True)
class Done:
    """
    Result of a diagnosis in a separate process.

    Attributes
    ----------
    error : str
        Why it failed; empty if it succeeded.
    text : str
        The JSON of `Diagnosis`, with ``file``, ``model_file`` and ``protocol_file`` (the next
        experiment; empty if that is not a force test).
    file, model_file : str
        Path of this JSON, and of the recommended model.
    """

    error: str = ''
    text: str = ''
    file: str = ''
    model_file: str = ''


class Worker:
    """
    One diagnosis that runs in a separate process.

    Parameters
    ----------
    model : Bundle
    data : Measurement
    folder : path
        Folder of the result; made if it does not exist.
    name : str
        Name of the files, without suffix.
    choices : Choices, optional

    Attributes
    ----------
    share : float
        Progress, 0 to 1.
    words : str
        The current step.
    """

    def __init__(self, model: Bundle, data: Measurement, folder: str | Path, name: str,
                 choices: Choices | None = None):
        self.share, self.words = 0.0, 'starting'
        self._files = Path(folder) / f'{name}.json', Path(folder) / f'{name}.model.yaml'
        job = pickle.dumps((model, data, *map(str, self._files), choices))
        # a new session, so that Ctrl-C in a terminal reaches only the calling program
        self._process = subprocess.Popen(
            [sys.executable, '-m', 'fam_bundle_ros.discovery.worker'], env=environment(),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._out = self._process.stdout
        os.set_blocking(self._out.fileno(), False)
        self._said = b''
        # in a thread: the job is larger than a pipe's buffer, so writing blocks until it is read
        self._feeder = threading.Thread(target=self._feed, args=(job,), daemon=True)
        self._feeder.start()

    def poll(self) -> Done | None:
        """Return the result, or None while the process runs; does not block."""
        ended = self._process.poll() is not None
        while part := self._out.read(1 << 16):
            self._said += part
        *lines, self._said = self._said.split(b'\n')
        for line in lines:
            message = json.loads(line)
            if 'error' in message:
                return self._end(Done(error=message['error']))
            if message['share'] >= 1.0:
                file, model_file = self._files
                return self._end(Done('', file.read_text(encoding='utf-8'), str(file),
                                      str(model_file)))
            self.share, self.words = message['share'], message['words']
        if ended:
            return self._end(Done(error='the worker process ended without a result'))
        return None

    def kill(self) -> None:
        """Kill the process and close its streams."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._out):
            if stream is not None:
                try:
                    stream.close()
                except OSError:
                    pass  # the job was still being written

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
            pass  # the process has ended; `poll` reports it


def run(model: Bundle, data: Measurement, file: str, model_file: str,
        choices: Choices | None, tell: Any) -> None:
    """
    Diagnose, and write the recommended model, the next experiment and last the result.

    Parameters
    ----------
    file, model_file : str
        Paths of the result and the recommended model.
    tell : callable
        Called with the progress, 0 to 1, and the current step.

    Raises
    ------
    InputError
        For bad data, or if a file cannot be written.
    """
    from fam_bundle_ros.discovery.diagnose import diagnose
    found = diagnose(model, data, choices=choices,
                     progress=lambda share, words: tell(0.99 * share, words))
    with system_errors(Path(file).parent, 'cannot be made'):
        Path(file).parent.mkdir(parents=True, exist_ok=True)
    found.recommended.save(model_file)
    protocol = ''
    if found.next_protocol is not None:
        protocol = str(Path(file).with_suffix('.protocol.yaml'))
        save_protocol(found.next_protocol, protocol)
    write_json(file, {**found.to_dict(), 'file': file, 'model_file': model_file,
                      'protocol_file': protocol})


def main() -> None:
    """Run the job from standard input."""
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
    except Exception as error:  # report every failure to the calling program
        out.write(json.dumps({'error': f'{type(error).__name__}: {error}'}) + '\n')


if __name__ == '__main__':
    main()
