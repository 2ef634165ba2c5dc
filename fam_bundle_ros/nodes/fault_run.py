# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
One run with a fault, through the nodes on real ROS, and its record.

The same nodes as the executables, in one process. In lock-step, time is that of the stamps, and
the run is the same each time; faults of messages (late, lost) need wall time.
"""

from collections.abc import Mapping, Sequence
import math
from typing import Any

import numpy as np
from std_srvs.srv import SetBool

from fam_bundle_ros.model import Bundle
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.plant_simulator import PlantSimulator
from fam_bundle_ros.nodes.pressure_pid import PressurePidNode
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode
from fam_bundle_ros.nodes.session import run_trajectory
from fam_bundle_ros.plant import RigConfig
from fam_bundle_ros.simulation import Trajectory

#: In wall time the rig does not wait for the nodes; in lock-step a silent channel is soon lost.
_SIMULATED = {'monitor': False, 'lock_step_timeout': 0.4, 'patience': 0.0}
#: The default watchdogs; `run_trajectory` has longer ones for busy machines.
_AS_SHIPPED = {'sensor_timeout': 0.1, 'setpoint_timeout': 0.2, 'command_timeout': 0.1}


class Observer:
    """
    Records the true state of the rig and the states of the nodes after each step of the rig.

    The service `enable` is called at ``enable_at``, a time of the trajectory in s, if it is given.
    """

    def __init__(self, enable_at: float | None = None) -> None:
        self._enable_at = enable_at
        self._client: Any = None
        #: Answer of `enable`; empty before the call.
        self.enable = ''
        self._rows: list[tuple[Any, ...]] = []
        self._begin: float | None = None

    def __call__(self, time: float, simulator: PlantSimulator, nodes: Sequence[BundleNode],
                 commands: list[float]) -> None:
        """Record a row; called as a `session.Watch`."""
        rig = simulator.rig
        truth = rig.truth
        if not math.isfinite(time):
            # In wall time the rig runs before the trajectory begins.
            return
        if self._begin is None:
            self._begin = time - rig.state.time
            if self._enable_at is not None:
                self._client = simulator.create_client(SetBool, interface.ENABLE)
        if self._enable_at is not None and time >= self._enable_at:
            self._enable_at = None
            self._client.call_async(SetBool.Request(data=True)).add_done_callback(self._answered)
        guards = [node._guard.now for node in nodes
                  if isinstance(node, RecruitmentNode | PressurePidNode)]
        states = tuple(f'{now.state.value} {now.cause}'.strip() for now in guards)
        # The rig's own clock: the trajectory's clock stands still while its generator is delayed.
        self._rows.append((self._begin + rig.state.time, truth.pressure, truth.force,
                           truth.strain, tuple(commands), rig.state.air.dumping, states))

    def _answered(self, future: Any) -> None:
        self.enable = 'accepted' if future.result().success else 'refused'

    def record(self) -> dict[str, Any]:
        """Return time, pressure, force, strain, command, cut and states, one row a step."""
        time, pressure, force, strain, command, cut, states = zip(*self._rows)
        return {'time': np.array(time), 'pressure': np.array(pressure), 'force': np.array(force),
                'strain': np.array(strain), 'command': np.array(command), 'cut': np.array(cut),
                'states': list(states), 'enable': self.enable}


def run_with_faults(model: Bundle, trajectory: Trajectory, rig: RigConfig,
                    overrides: Mapping[str, Any], *, enable_at: float | None = None,
                    lock_step: bool = True, rate: float = 200.0,
                    seed: int = 0, namespace: str = interface.NAMESPACE,
                    domain: int | None = None) -> dict[str, Any]:
    """
    Run a trajectory with its faults through the nodes, whose parameters ``overrides`` are.

    Return the `Observer.record`, with ``reference`` (T,) and its ``kind``. ``enable_at`` is that
    of the `Observer`; the rate is in Hz.
    """
    observer = Observer(enable_at)
    run_trajectory(model, trajectory, rig=rig, rate=rate, seed=seed, lock_step=lock_step,
                   overrides={**_SIMULATED, **_AS_SHIPPED, **overrides}, watch=observer,
                   namespace=namespace, domain=domain, log_level='fatal')
    record = observer.record()
    record['reference'] = np.array([trajectory.value(max(t, 0.0)) for t in record['time']])
    record['kind'] = trajectory.kind
    return record
