# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The worker process: runs one long job, reports its progress and its result.

Started by `jobs` as ``python -m fam_bundle_ros.workbench.worker``; takes a pickled job on standard
input and writes pickled messages, each preceded by its length, to standard output. Both ends
belong to this package: data from a browser is never unpickled.
"""

from collections.abc import Callable
import pickle
import struct
import sys
from typing import Any

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.processes import own_stdout

#: Format of the length that precedes a message.
LENGTH = struct.Struct('>Q')

Progress = Callable[[float, str], None]


def diagnose_job(progress: Progress, model: Any, data: Any, choices: Any = None) -> Any:
    """Return the `Diagnosis` of a model on a measurement."""
    from fam_bundle_ros.discovery.diagnose import diagnose
    return diagnose(model, data, choices=choices, progress=progress)


def refit_job(progress: Progress, model: Any, data: Any, since: Any) -> Any:
    """
    Return a model with changed effects and all parameters refitted, and its held-out error, N.

    All rows are fitted; without effects the model's own parameters are recalibrated.
    """
    from fam_bundle_ros.discovery.add import add_effect
    names = ', '.join((*(effect.name for effect in since.added), *since.replaced.values()))
    progress(0.3, f'refitting with {names}' if names else 'refitting the parameters of the model')
    added = add_effect(model, list(since.added), data, replacing=since.replaced,
                       removing=since.removed)
    return added.model, added.held_out_N


def trial_job(progress: Progress, old: Any, new: Any, seconds: float) -> Any:
    """Return the `ControllerTrial` of two models on the simulated rig."""
    from fam_bundle_ros.workbench.trial import controller_trial
    return controller_trial(old, new, seconds, progress)


def main() -> None:
    """Run the job given on standard input."""
    out = own_stdout('wb')

    def send(kind: str, content: Any) -> None:
        message = pickle.dumps((kind, content))
        out.write(LENGTH.pack(len(message)) + message)
        out.flush()

    try:
        job, arguments = pickle.load(sys.stdin.buffer)
        send('result', job(lambda share, words: send('progress', (share, words)), *arguments))
    except InputError as error:
        send('input_error', str(error))
    except Exception as error:  # the page must show every failure
        send('failed', f'{type(error).__name__}: {error}')


if __name__ == '__main__':
    main()
