# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows of single ticks, without numba as in a node: controller, allocation, rig, pressure loop."""

from collections.abc import Callable
from typing import Any

import numpy as np

from fam_bundle_ros.benchmarks.plants import paper_bundle
from fam_bundle_ros.benchmarks.speed import best, elsewhere, Figure, Row, where_of
from fam_bundle_ros.benchmarks.speed_loop import case
from fam_bundle_ros.control import (
    Allocator,
    ControllerConfig,
    Instant,
    Measurement,
    PidGains,
    PressurePid,
    RecruitmentController,
    Reference,
)
from fam_bundle_ros.plant import Rig, RigConfig
from fam_bundle_ros.simulation import pid_config

#: Targets without numba, us.
REACH_CONTROLLER, REACH_ALLOCATION = 150.0, 60.0
_MODULE = 'fam_bundle_ros.benchmarks.speed_ticks'
_PERIOD = 2e-3


def _controller(ticks: int) -> tuple[Callable[..., Any], list[tuple[Measurement, Reference]]]:
    bundle = paper_bundle(2)
    loop, trajectory = case(bundle, ticks * _PERIOD)
    log = loop.run(trajectory)
    rate = np.gradient(log.strain, _PERIOD)
    inputs = [(Measurement(log.force[k], log.strain[k], rate[k], log.pressure[k]),
               Reference('strain', trajectory.value(k * _PERIOD), trajectory.rate(k * _PERIOD)))
              for k in range(len(log.time))]
    return RecruitmentController(bundle, ControllerConfig()).update, inputs


def microseconds(ticks: int, budget: float) -> dict[str, float]:
    """Return us per tick, in this process: controller, allocation, rig, pressure loop."""
    return {name: 1e6 * best(call, budget) / ticks for name, call in _work(ticks).items()}


def shares_of(ticks: int) -> str:
    """Return where controller and allocation spend their time, in this process."""
    work = _work(ticks)
    return '; '.join(f'{name}: {where_of(work[name])}' for name in ('controller', 'allocation'))


def _work(ticks: int) -> dict[str, Callable[[], None]]:
    """Return for each part a function that runs a number of ticks."""
    tick, inputs = _controller(ticks)

    def control() -> None:
        for measured, reference in inputs:
            tick(_PERIOD, measured, reference)

    rig = Rig(paper_bundle(2), RigConfig(), seed=0)

    def simulate() -> None:
        for k in range(ticks):
            rig.step([0.3 if k % 100 < 50 else -0.3, 0.0], _PERIOD)

    loop = PressurePid(PidGains(), pid_config(RigConfig(), _PERIOD))

    def regulate() -> None:
        for k in range(ticks):
            loop.update(1e5 + 50.0 * k, 1e5 + 49.0 * k, _PERIOD)

    six = Allocator(paper_bundle(6))
    top = float(six.curves(Instant(0.12)).top[-1])

    def allocate() -> None:
        for k in range(ticks):
            six.curves(Instant(0.12 + 1e-5 * k)).fill(top * (k + 1) / (ticks + 1), range(6))

    return {'controller': control, 'allocation': allocate, 'rig': simulate, 'pid': regulate}


def measure(scale: float) -> list[Figure]:
    """Return us per tick without numba."""
    found = elsewhere(f'{_MODULE}:microseconds', max(int(500 * scale), 10), 0.5 * scale,
                      plain=True)
    return [Figure('recruitment controller, 2 units', found['controller'], 'µs',
                   reach=REACH_CONTROLLER, note='mean over a strain sine with a mass'),
            Figure('allocation to 6 units', found['allocation'], 'µs', reach=REACH_ALLOCATION,
                   note='curves of the tick and their inverse'),
            Figure('rig, 2 units', found['rig'], 'µs', note='2 ms of simulated time'),
            Figure('pressure loop', found['pid'], 'µs')]


def where(scale: float) -> str:
    """Return where controller and allocation spend their time."""
    return elsewhere(f'{_MODULE}:shares_of', max(int(500 * scale), 10), plain=True)


ROWS = (Row('ticks', 'one tick in a node, without numba', measure, where),)
