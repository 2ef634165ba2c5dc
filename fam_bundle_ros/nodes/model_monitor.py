# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Node model_monitor: what the model says the load cell should show, and by how much it is wrong.

Publishes ``model/force`` and ``model/residual`` (measured minus model) for every sample, and on
/diagnostics the residual's rms beside the noise floor that neighbouring samples tell. No verdict:
a residual above the noise says that something is missing, ``fam_bundle diagnose`` says what.
"""

from collections import deque
from collections.abc import Mapping
import math
from typing import Any

from geometry_msgs.msg import WrenchStamped
import numpy as np
from rclpy.context import Context

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.nodes import interface, sensing
from fam_bundle_ros.nodes.base import BundleNode, LISTENER, MODEL
from fam_bundle_ros.nodes.diagnostics import Diagnostics, Report, WARN
from fam_bundle_ros.nodes.models import bundle_from
from fam_bundle_ros.nodes.parameters import Spec, table
from fam_bundle_ros.nodes.process import run
from fam_bundle_ros.nodes.sensing import Sample, Sensing

SPECS = (
    *MODEL, *LISTENER, *sensing.SPECS,
    Spec('window', 5.0, 'time over which residual and noise floor are taken, s', 0.5, 600.0),
    Spec('warn_ratio', 2.0, 'warn when the residual is above the noise floor times this', 1.0,
         100.0, dynamic=True),
)


class LiveModel:
    """
    A model that follows a rig sample by sample.

    Parameters
    ----------
    bundle : Bundle
        Its sensor effects are taken off the readings and put on the force, as in a comparison.
    """

    def __init__(self, bundle: Bundle):
        self.bundle = bundle
        #: s since it was made.
        self._time = 0.0
        self.reset()

    def reset(self) -> None:
        """Begin a new trial."""
        self._state = self.bundle.start_state()

    def step(self, dt: float, strain: float, pressure: list[float], rate: float) -> float:
        """Return the force that the load cell should show now, N; nan for unusable readings."""
        if not math.isfinite(strain + rate + sum(pressure)):
            self.reset()
            return math.nan
        self._time += dt
        strain, felt = self.bundle.felt(strain, np.array(pressure), self._time)
        forces, self._state = self.bundle.step(self._state, dt, strain, felt, rate)
        return float(self.bundle.readings(forces.sum(), strain, felt, self._time)[0])


class ModelMonitor(BundleNode):
    """
    The model monitor.

    Parameters
    ----------
    context : Context, optional
    **keywords
        Of `BundleNode`.
    """

    def __init__(self, *, context: Context | None = None, **keywords: Any):
        super().__init__('model_monitor', SPECS, context=context, **keywords)
        self._live = LiveModel(bundle_from(self.p['model']))
        self._residuals: deque[float] = deque(
            maxlen=max(round(self.p['window'] * self.p['rate']), 50))
        self._stamp = -1
        self._send_model, self._send_residual = (
            self.sender(topic, WrenchStamped, interface.force_writer())
            for topic in (interface.MODEL_FORCE, interface.MODEL_RESIDUAL))
        bundle = self._live.bundle
        self._sensing = Sensing(self, bundle.n, float(bundle.motor_units[0].geometry.length),
                                self._on_sample)
        self.p.on_change(self, self._check, self._change)
        self._diagnostics = Diagnostics(self, self._report)
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
        if math.isfinite(residual):
            self._residuals.append(residual)

    def _check(self, values: Mapping[str, Any]) -> None:
        n, units = bundle_from(values['model']).n, self._live.bundle.n
        if n != units:
            raise InputError(f"{values['model']} has {n} motor units; this bundle has {units}")

    def _change(self, changes: dict[str, Any]) -> None:
        if 'model' in changes:
            self._live = LiveModel(bundle_from(self.p['model']))
            self._residuals.clear()

    def _report(self, report: Report) -> None:
        self._sensing.report(report)
        report.value('model', self._live.bundle.name)
        if len(self._residuals) < 50:
            report.add(WARN, 'WAITING for samples')
            return
        residual = np.array(self._residuals)
        rms, floor = float(np.sqrt(np.mean(residual ** 2))), noise_floor(residual)
        report.value('residual rms, N', rms)
        report.value('residual mean, N', float(residual.mean()))
        report.value('noise floor, N', floor)
        report.value('residual / noise floor', rms / max(floor, 1e-9))
        if rms > self.p['warn_ratio'] * floor + 1e-3:
            report.add(WARN, f'model error {rms:.2f} N rms over a noise floor of {floor:.2f} N')


def noise_floor(residual: np.ndarray) -> float:
    """
    Return the noise of evenly sampled residuals, N, from second differences.

    Slow errors of the model cancel in them; the median keeps switching moments out.
    """
    second = residual[2:] - 2.0 * residual[1:-1] + residual[:-2]
    return float(1.4826 * np.median(np.abs(second - np.median(second))) / math.sqrt(6.0))


def main(args: list[str] | None = None) -> int:
    """Run the node; the exit status."""
    return run(lambda context: [ModelMonitor(context=context)],
               f'{__doc__}\nParameters:\n{table(SPECS)}', args)
