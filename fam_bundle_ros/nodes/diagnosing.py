# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Service ``diagnose`` of the model monitor: discovery on the memory, and its result.

A diagnosis runs in a process of its own. Its result is published latched on ``model/diagnosis``
and written to a folder with the recommended model. That model is the candidate: every ten seconds
a thread compares its error on the memory with the present model's, and locates the latter.
"""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from std_msgs.msg import String

from fam_bundle_ros.atomic import write_whole
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.discovery.worker import Done, Worker
from fam_bundle_ros.errors import InputError, system_errors
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.live_model import error_on, failure_words, LiveModel, ModelWatch
from fam_bundle_ros.nodes.models import bundle_from
from fam_bundle_ros.told import number

#: Periods of polling the worker, and of comparing candidate and present model, s.
_POLL, _LOOK = 0.2, 10.0
#: What the files of a diagnosis take at most, bytes.
_ROOM = 1 << 18


@dataclass(frozen=True)
class Candidate:
    """A model that may replace the present one."""

    file: str
    #: None where it cannot be read.
    bundle: Bundle | None
    #: Rms force error of the candidate and of the present model, on the memory, N.
    error: float
    present: float
    #: Why it may not be applied; empty where it may.
    refusal: str

    def to_dict(self) -> dict[str, Any]:
        """Return what goes out as JSON."""
        return {'file': self.file, 'error_N': self.error, 'present_N': self.present,
                'refusal': self.refusal}


class Diagnosing:
    """
    Runs diagnoses for a node with the parameters ``diagnosis_folder`` and ``diagnosis_effects``.

    ``changed`` is called when `state` changes.
    """

    def __init__(self, node: Any, watch: ModelWatch, changed: Callable[[], None]):
        self._node, self._watch, self._changed = node, watch, changed
        self._worker: Worker | None = None
        self._candidate: Candidate | None = None
        self._file = self._failure = ''
        self._thread = ThreadPoolExecutor(1, 'model_monitor')
        self._look: Future[tuple[str, Candidate | None]] | None = None
        self._send = node.sender(interface.MODEL_DIAGNOSIS, String, interface.text_message,
                                 interface.LATCHED)
        node.trigger(interface.DIAGNOSE, self._diagnose)
        node.every(_POLL, self._poll)
        node.every(_LOOK, self.look_closer)

    @property
    def state(self) -> dict[str, Any]:
        """Return progress of the diagnosis, why the last one failed, and the candidate."""
        worker, candidate = self._worker, self._candidate
        return {'diagnosing': worker and {'share': worker.share, 'words': worker.words},
                'failure': self._failure, 'candidate': candidate and candidate.to_dict()}

    def ready(self, file: str) -> LiveModel | None:
        """Return the compiled candidate if it comes from this file, else None."""
        found = self._candidate
        return LiveModel(found.bundle) if found and found.file == file and found.bundle else None

    def look_closer(self) -> None:
        """Compare the models in the thread, if there is a candidate or the model fails."""
        holds = self._watch.holding.holds
        if holds:
            self._watch.where = ''
        if self._look is None and (self._file or not holds):
            self._look = self._thread.submit(look_closer, self._watch, self._file,
                                             self._candidate)

    def forget(self) -> None:
        """Drop the candidate after a change of the model: it was compared with the old one."""
        self._file, self._candidate, self._look = '', None, None

    def stop(self) -> None:
        """End the worker and the thread."""
        if self._worker:
            self._worker.kill()
            self._worker = None
        self._thread.shutdown(wait=True, cancel_futures=True)

    # --- the worker ----------------------------------------------------------------------------

    def _diagnose(self) -> str:
        try:
            return self._start()
        except InputError as error:
            self._node.get_logger().warning(f'no diagnosis: {error}')
            raise

    def _start(self) -> str:
        if self._worker:
            raise InputError('a diagnosis is at work already '
                             f'({100 * self._worker.share:.0f} %): wait for model/diagnosis')
        data = self._watch.memory.measurement(self._watch.since, self._node.get_namespace())
        folder = Path(self._node.p['diagnosis_folder']).expanduser().absolute()
        _refuse_unwritable(folder)
        name = f'{datetime.now():%Y%m%d_%H%M%S_%f}'[:-3]
        self._worker = Worker(self._watch.bundle, data, folder, name,
                              Choices(most=self._node.p['diagnosis_effects']))
        self._failure = ''
        self._changed()
        return (f'diagnosing {self._watch.bundle.name} on {len(data)} rows of the memory; the '
                'answer comes on model/diagnosis, a failure on model/state')

    def _poll(self) -> None:
        self._collect()
        if self._worker is None:
            return
        done = self._worker.poll()
        if done is not None:
            self._worker = None
            self._take(done)
        self._changed()

    def _take(self, done: Done) -> None:
        self._failure = done.error
        if done.error:
            self._node.get_logger().error(f'the diagnosis failed: {done.error}')
            return
        self._node.get_logger().info(f'diagnosis: {done.file}')
        self._file, self._candidate = done.model_file, None
        self._send(done.text)
        self.look_closer()

    # --- the thread ----------------------------------------------------------------------------

    def _collect(self) -> None:
        """Take the result of the thread."""
        if self._look is None or not self._look.done():
            return
        found, self._look = self._look, None
        try:
            self._watch.where, self._candidate = found.result()
        except InputError:
            return  # the memory is too short yet
        if self._file and self._candidate is None:
            # the diagnosis ended while the thread was at work
            self.look_closer()
        self._changed()


def _refuse_unwritable(folder: Path) -> None:
    """Refuse a folder that cannot be made or is full: minutes of work would be lost."""
    with system_errors(folder, 'cannot be made'):
        folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / '.room', bytes(_ROOM)).unlink()


def look_closer(watch: ModelWatch, file: str, before: Candidate | None
                ) -> tuple[str, Candidate | None]:
    """
    Return where the present model fails, and its comparison with a candidate, on the memory.

    ``file`` is that of the candidate, empty for none; ``before`` the result of the last
    comparison.
    """
    since, present = watch.since, watch.bundle
    data = watch.memory.measurement(since)
    where = '' if watch.holding.holds else failure_words(present, data)
    if not file:
        return where, None
    return where, candidate_on(data, present, file, before)


def candidate_on(data: Measurement, present: Bundle, file: str, before: Candidate | None = None
                 ) -> Candidate:
    """
    Return the comparison of a model file with the present model on data.

    The model of ``before``, the last comparison, is used again.
    """
    try:
        bundle = before.bundle if before and before.bundle else bundle_from(file)
        old, new = error_on(present, data), error_on(bundle, data)
    except InputError as error:
        return Candidate(file, None, 0.0, 0.0, str(error))
    if before is None:
        # the first step compiles the model: not when it is applied
        LiveModel(bundle).step(0.0, float(data.strain[0]), data.pressure[0].tolist(), 0.0)
    refusal = '' if new < old else (
        f'{bundle.name} predicts the memory no better: {number(new)} N against {number(old)} N of '
        f'{present.name}')
    return Candidate(file, bundle, new, old, refusal)
