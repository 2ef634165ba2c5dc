# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Online adaptation over ROS: services to reset and save it, a topic and a report in words."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from std_msgs.msg import String

from fam_bundle_ros.control import RecruitmentController
from fam_bundle_ros.control.adaptation import forget_adaptation
from fam_bundle_ros.control.learnt import adapted_bundle, FITS, learnt_words, wrong_model
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.modelfile import save_model
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.diagnostics import Report, WARN

#: Period of the messages, s.
_PERIOD = 1.0


class Adaptation:
    """Publishes and saves what the controller that ``controller`` returns has learnt."""

    def __init__(self, node: Any, controller: Callable[[], RecruitmentController]):
        self._node, self._controller = node, controller
        announce = node.announcer(interface.ADAPTATION, String, interface.text_message)
        node.trigger(interface.ADAPTATION_RESET, self._reset)
        node.trigger(interface.ADAPTATION_SAVE, self._save)
        node.every(_PERIOD, lambda: announce(self.words()))

    def words(self) -> str:
        """Return what was learnt, as text."""
        controller = self._controller()
        names = [unit.name.upper() for unit in controller.bundle.motor_units]
        return '; '.join(learnt_words(controller.settings.adaptation,
                                      controller.memory.adaptation, names))

    def report(self, report: Report) -> None:
        """Add to the node's diagnostics."""
        controller = self._controller()
        report.value('adaptation', self.words())
        doubt = wrong_model(controller.settings.adaptation, controller.memory.adaptation)
        if doubt:
            report.add(WARN, doubt)

    def _reset(self) -> str:
        controller, before = self._controller(), self.words()
        forget_adaptation(controller.settings.adaptation, controller.memory.adaptation)
        return f'forgotten: {before}'

    def _save(self) -> str:
        controller, words = self._controller(), self.words()
        if words == FITS:
            raise InputError(f'{words}: nothing was learnt that could be saved')
        # Not beside the model: the folder of shipped models may be read-only.
        model = Path(self._node.p['model'])
        path = Path(self._node.p['adaptation_file'] or f'{model.stem}_adapted.yaml').absolute()
        save_model(adapted_bundle(controller.bundle, controller.memory.adaptation), path)
        return f'{path}: {words}'
