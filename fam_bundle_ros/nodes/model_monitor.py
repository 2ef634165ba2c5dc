# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Node model_monitor: predicts the reading of the load cell and tests if the model still holds.

Publishes ``model/force`` and ``model/residual`` (measured minus model) for every sample. Keeps a
thinned memory of the last minutes and tests whether the residual exceeds the model's own error and
the noise; the result goes to ``model/state`` (latched JSON) and /diagnostics. Service ``diagnose``
finds on that memory which effect is missing: ``model/diagnosis`` (latched JSON), and a file with
the recommended model. ``apply_model`` of recruitment_controller activates this model, in both
nodes.
"""

from collections.abc import Mapping
from dataclasses import replace
import json
import math
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rclpy.parameter import Parameter
from std_msgs.msg import String

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode, LISTENER, MODEL
from fam_bundle_ros.nodes.diagnosing import Diagnosing
from fam_bundle_ros.nodes.diagnostics import Diagnostics, Report, WARN
from fam_bundle_ros.nodes.live_model import LiveModel, ModelWatch
from fam_bundle_ros.nodes.models import bundle_from
from fam_bundle_ros.nodes.parameters import Spec
from fam_bundle_ros.nodes.process import executable
from fam_bundle_ros.nodes.sensing import Sample, Sensing

SPECS = (
    replace(MODEL, dynamic=True), *LISTENER,
    Spec('window', 60.0, 'window of the rms error, and time without alarm after which the model '
         'holds again, s', 0.5, 600.0),
    Spec('memory', 300.0, 'length of the memory, s', 10.0, 3600.0),
    Spec('false_alarms', 0.1, 'largest rate of false alarms for a model that holds, 1/h', 1e-4,
         60.0),
    Spec('tolerance', -1.0, 'largest tolerated mean error at a state, N; -1: twice the error of '
         'the model file, at least 1 % of the largest force', -1.0, 1e4),
    Spec('diagnosis_folder', 'fam_bundle_diagnoses', 'folder for diagnoses and recommended '
         'models'),
    Spec('diagnosis_effects', 5, 'largest number of effects that a diagnosis adds, replaces or '
         'removes', 1, 5),
)
#: Period of the messages on the state, s.
_PERIOD = 0.5


class ModelMonitor(BundleNode):
    """The model monitor; keywords as of `BundleNode`."""

    def __init__(self, **keywords: Any):
        super().__init__('model_monitor', SPECS, **keywords)
        p = self.p
        self._live = LiveModel(bundle_from(p['model']))
        bundle = self._live.bundle
        self.watch = ModelWatch(bundle, p['window'], p['memory'], p['false_alarms'],
                                p['tolerance'] if p['tolerance'] > 0.0 else None)
        self._stamp = -1
        self._held = True
        self._send_model, self._send_residual = (
            self.sender(topic, WrenchStamped, interface.force_writer())
            for topic in (interface.MODEL_FORCE, interface.MODEL_RESIDUAL))
        self._announce = self.announcer(interface.MODEL_STATE, String, interface.text_message)
        self._diagnosing = Diagnosing(self, self.watch, self._publish_state)
        self._sensing = Sensing(self, bundle.n, bundle.length, self._on_sample)
        self.subscribe(interface.MODEL_APPLIED, String, self._on_applied, interface.LATCHED)
        self.p.on_change(self, self._check, self._change)
        self._diagnostics = Diagnostics(self, self._report)
        self.every(_PERIOD, self._publish_state)
        if self.lock_step:
            self.every(0.5, self._sensing.check_time)

    def _on_sample(self, sample: Sample) -> None:
        if sample.silent or sample.stamp == self._stamp:
            return
        dt = (sample.stamp - self._stamp) * 1e-9
        if self._stamp < 0 or not 0.0 < dt < 1.0:
            self._live.reset()
            dt = 0.0
        self._stamp = sample.stamp
        force = self._live.step(dt, sample.strain, sample.pressure, sample.rate)
        residual = sample.force - force
        self._send_model(sample.stamp, force)
        self._send_residual(sample.stamp, residual)
        self.watch.add(sample.stamp * 1e-9, sample.strain, sample.pressure, sample.force, residual)
        if self._held and not self.watch.holding.holds:
            self.say('model', self.watch.words, 0.0)
            self._diagnosing.look_closer()
            self._publish_state()
        self._held = self.watch.holding.holds

    def stop(self) -> None:
        """End a running diagnosis."""
        self._diagnosing.stop()

    # --- model ---------------------------------------------------------------------------------

    def _on_applied(self, message: String) -> None:
        """Follow the recruitment controller to another model."""
        if message.data != self.p['model']:
            (result,) = self.set_parameters([Parameter('model', value=message.data)])
            if not result.successful:
                raise InputError(result.reason)

    def _check(self, values: Mapping[str, Any]) -> None:
        if values['model'] == self.p['model'] or self._diagnosing.ready(values['model']):
            return
        n, units = bundle_from(values['model']).n, self._live.bundle.n
        if n != units:
            raise InputError(f"{values['model']} has {n} motor units; this bundle has {units}")

    def _change(self, changes: dict[str, Any]) -> None:
        if 'model' in changes:
            model = self.p['model']
            self._live = self._diagnosing.ready(model) or LiveModel(bundle_from(model))
            self.watch.change(self._live.bundle)
            self._diagnosing.forget()
            self._publish_state()

    # --- output --------------------------------------------------------------------------------

    def _publish_state(self) -> None:
        self._announce(json.dumps({**self.watch.state(), 'file': self.p['model'],
                                   **self._diagnosing.state}))

    def _report(self, report: Report) -> None:
        self._sensing.report(report)
        watch = self.watch
        report.value('model', watch.bundle.name)
        if not math.isfinite(watch.noise):
            report.add(WARN, 'WAITING for samples')
            return
        report.value('residual rms, N', watch.error)
        report.value('noise floor, N', watch.noise)
        report.value('tolerance, N', watch.holding.tolerance)
        report.value('memory, s', watch.memory.seconds)
        report.value('holds', watch.holding.holds)
        if watch.holding.holds:
            report.value('judgement', watch.words)
        else:
            report.add(WARN, watch.words)


main = executable(ModelMonitor, __doc__, SPECS)
