# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Change the model of the recruitment controller while it runs: apply_model, restore_model.

``model/state`` of the model monitor names the model that a diagnosis recommends, with a refusal if
it does not predict the memory better. That model is read, checked and compiled in a thread at
once, so that the change itself takes less than a tick; ``model/applied`` names the file in use.
"""

from collections.abc import Callable
from dataclasses import dataclass
import json
from threading import Thread
from typing import Any

import numpy as np
from rclpy.parameter import Parameter
from std_msgs.msg import String

from fam_bundle_ros.control import ControllerConfig, Measurement, RecruitmentController, Reference
from fam_bundle_ros.control.rate import RateState
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.models import bundle_from

#: Duration of the cross-fade from the old model's setpoints to the new one's, s.
_FADE = 0.3


@dataclass
class Prepared:
    """A model that is ready, or the reason why it is not; both empty during preparation."""

    bundle: Bundle | None = None
    refusal: str = ''


class ModelSwap:
    """
    Holds the models that the controller may change to while it is active.

    The node has the parameter ``model``; ``present`` returns the present bundle, ``config`` the
    present settings of the controller.
    """

    def __init__(self, node: Any, present: Callable[[], Bundle],
                 config: Callable[[], ControllerConfig]):
        self._node, self._present, self._config = node, present, config
        self._prepared: dict[str, Prepared] = {}
        #: Files that were in use before, the most recent one last.
        self._before: list[str] = []
        self._candidate = self._refusal = self._at_work = ''
        #: Setpoints at the change (Pa), their offset from the new model's (Pa), time left (s).
        self._last: list[float] = []
        self._offset: list[float] | None = None
        self._left = 0.0
        self._rate: RateState | None = None
        self._send = node.sender(interface.MODEL_APPLIED, String, interface.text_message,
                                 interface.LATCHED)
        node.subscribe(interface.MODEL_STATE, String, self._on_state, interface.LATCHED)
        node.trigger(interface.APPLY_MODEL, self._apply)
        node.trigger(interface.RESTORE_MODEL, self._restore)

    def bundle(self, model: str) -> Bundle | None:
        """Return the bundle of a model file that is ready; None for any other."""
        prepared = self._prepared.get(model)
        return prepared.bundle if prepared else None

    def faded(self, setpoints: list[float], dt: float) -> list[float]:
        """Return setpoints (Pa) without a jump at a change of the model."""
        if self._left <= 0.0:
            return setpoints
        if self._offset is None:
            self._offset = [old - new for old, new in zip(self._last, setpoints)]
        share, self._left = self._left / _FADE, self._left - dt
        limits = self._present().max_pressure.tolist()
        return [min(max(value + share * offset, 0.0), limit)
                for value, offset, limit in zip(setpoints, self._offset, limits)]

    def go_on(self, controller: RecruitmentController) -> None:
        """
        Hand the state of the strain-rate estimator to a controller that was just enabled.

        A controller that was off starts from the measured pressures, without a cross-fade.
        """
        if self._node.command is None:
            self._left, self._rate = 0.0, None
        if self._rate is not None:
            controller.memory.rate, self._rate = self._rate, None

    # --- inside --------------------------------------------------------------------------------

    def _on_state(self, message: String) -> None:
        try:
            state = json.loads(message.data)
            candidate, work = state.get('candidate') or {}, state.get('diagnosing') or {}
            file, refusal = str(candidate.get('file', '')), str(candidate.get('refusal', ''))
            share = 100.0 * float(work.get('share', 0.0))
        except (ValueError, TypeError, AttributeError) as error:
            raise InputError(f'{message.data[:40]!r} is not a message of a model monitor'
                             ) from error
        self._candidate, self._refusal = file, refusal
        self._at_work = (f'a diagnosis is at work ({share:.0f} %): wait for model/diagnosis'
                         if work else '')
        if file and file not in self._prepared:
            self._prepared[file] = Prepared()
            Thread(target=self._prepare, args=(file, self._config()), daemon=True).start()

    def _prepare(self, file: str, config: ControllerConfig) -> None:
        """Read a file and run the controller on it once, in a thread, to compile the model."""
        try:
            bundle = bundle_from(file)
            controller = RecruitmentController(bundle, config)
            vented = Measurement(0.0, 0.1, 0.0, np.zeros(bundle.n))
            controller.enable(vented)
            for reference in (Reference('force', 1.0), Reference('strain', 0.1)):
                controller.update(1e-3, vented, reference)
        except InputError as error:
            self._prepared[file] = Prepared(refusal=str(error))
        except Exception as error:  # an error in a thread would be lost
            self._prepared[file] = Prepared(refusal=f'{file}: {type(error).__name__}: {error}')
        else:
            self._prepared[file] = Prepared(bundle)

    def _apply(self) -> str:
        file = self._candidate
        prepared = self._prepared.get(file, Prepared())
        if not file:
            why = self._at_work or 'there is no model to apply: call diagnose first'
        elif file == self._node.p['model']:
            why = f'{file} is in use already'
        elif prepared.bundle is None:
            why = prepared.refusal or f'{file} is being prepared: try again in a second'
        else:
            why = self._refusal
        if why:
            raise self._refused(why)
        before, bundle = self._node.p['model'], self._present()
        said = self._change(file)
        self._prepared[before] = Prepared(bundle)
        self._before.append(before)
        return said

    def _restore(self) -> str:
        if not self._before:
            raise self._refused('no model was applied: there is none to go back to')
        said = self._change(self._before[-1])
        self._before.pop()
        return said

    def _change(self, file: str) -> str:
        before = self._present().name
        self._last, self._offset = list(self._node.setpoints), None
        rate = self._node.controller.memory.rate
        (result,) = self._node.set_parameters([Parameter('model', value=file)])
        if not result.successful:
            raise self._refused(result.reason)
        self._left, self._rate = _FADE, rate
        self._send(file)
        said = f'{self._present().name} is in use now instead of {before} ({file})'
        self._node.get_logger().info(said)
        return said

    def _refused(self, why: str) -> InputError:
        """Log why the model is not changed; return the error with this reason."""
        self._node.get_logger().warning(f'model not changed: {why}')
        return InputError(why)
