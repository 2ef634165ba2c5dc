# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows of the closed loop: against real time, with and without numba, and against ODE solvers."""

from dataclasses import replace
import math
import time
from typing import Any

import numpy as np

from fam_bundle_ros import kernels
from fam_bundle_ros.benchmarks import speed_peers
from fam_bundle_ros.benchmarks.control_trajectories import make_trajectory
from fam_bundle_ros.benchmarks.margins import CONTROLLERS as NAMED
from fam_bundle_ros.benchmarks.plants import paper_bundle
from fam_bundle_ros.benchmarks.speed import best, elsewhere, Figure, Row, where_of
from fam_bundle_ros.control import ControllerConfig
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import MassSpring, RigConfig
from fam_bundle_ros.simulation import ClosedLoop, Trajectory

#: Targets of the speed on one core, relative to real time, by number of motor units.
REACH = {2: 300.0, 6: 100.0}
REACH_PLAIN, REACH_PEERS = 10.0, 100.0
#: A force reference on a dynamometer, and a strain reference with an arm.
TRAJECTORIES = ('sine_0.5', 'arm')
#: Policy and scheme of every controller with a model.
CONTROLLERS = tuple((each.policy, each.scheme) for name, each in NAMED.items()
                    if not each.baseline and each.feedback and each.told_load)
#: Tolerances of the peers, from loose to tight.
_TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
_FINE = 1e-8
_PERIOD = 2e-3


def speeds(units: int, scale: float = 1.0, controllers: Any = CONTROLLERS,
           trajectories: Any = TRAJECTORIES, budget: float = 0.2, least: int = 3
           ) -> dict[str, float]:
    """
    Return the speed of the closed loop, relative to real time, by ``policy/scheme/trajectory``.

    Parameters
    ----------
    units : int
        2 or 6.
    scale : float
        Share of each trajectory that is run.
    controllers : sequence of (policy, scheme)
    budget, least : float, s, and int
        See `best`.
    """
    bundle, found = paper_bundle(units), {}
    for name in trajectories:
        trajectory = make_trajectory(name, bundle)
        trajectory = replace(trajectory, duration=max(0.1, scale * trajectory.duration),
                             prepare=scale * trajectory.prepare)
        for policy, scheme in controllers:
            loop = ClosedLoop(bundle, controller=ControllerConfig(policy=policy, scheme=scheme),
                              seed=1)
            seconds = best(lambda: loop.run(trajectory), budget, least)  # noqa: B023
            found[f'{policy}/{scheme}/{name}'] = (
                trajectory.prepare + trajectory.duration) / seconds
    return found


def against_real_time(scale: float) -> list[Figure]:
    """Return the speed of the slowest controller for 2 and 6 units, with and without numba."""
    figures = []
    for units in REACH:
        if kernels.numba() is not None:
            figures.append(_slowest(f'{units} units, compiled', speeds(units, scale),
                                    REACH[units]))
        figures.append(_slowest(
            f'{units} units, no numba',
            elsewhere('fam_bundle_ros.benchmarks.speed_loop:speeds', units, 0.2 * scale,
                      plain=True, budget=0.0, least=2), REACH_PLAIN))
    return figures


def _slowest(what: str, found: dict[str, float], reach: float) -> Figure:
    name = min(found, key=lambda key: found[key])
    return Figure(what, found[name], 'x real time', reach=reach, at_least=True,
                  note=f'slowest: {name}; fastest of {len(found)}: {max(found.values()):.0f} x')


def where(scale: float) -> str:
    """Return where a run of the slower trajectory spends its time."""
    bundle = paper_bundle(2)
    loop = ClosedLoop(bundle, seed=1)
    trajectory = replace(make_trajectory(TRAJECTORIES[1], bundle), duration=8.0 * scale)
    loop.run(trajectory)
    return where_of(lambda: loop.run(trajectory))


def case(bundle: Bundle, duration: float) -> tuple[ClosedLoop, Trajectory]:
    """Return a loop with one valve command per tick, and a strain trajectory with 4 kg."""
    load = MassSpring(mass=4.0, damping=40.0, stiffness_against=500.0)
    turn = 2.0 * math.pi

    def value(t: float) -> float:
        return 0.04 * (1.0 - math.cos(turn * t))

    def rate(t: float) -> float:
        return 0.04 * turn * math.sin(turn * t)
    return (ClosedLoop(bundle, rig=RigConfig(load=load), period=_PERIOD, pid_period=_PERIOD,
                       seed=1), Trajectory('sine', 'strain', duration, value, rate, load))


def against_solvers(scale: float) -> list[Figure]:
    """
    Return the speed of the whole loop, compared with ODE solvers on its plant alone.

    The solvers get the loop's valve commands, and the loosest tolerance at which they are as
    accurate as the loop, relative to a fine solution.
    """
    bundle = paper_bundle(2)
    duration = max(0.5 * scale, 0.02)
    loop, trajectory = case(bundle, duration)
    log = loop.run(trajectory)
    long = replace(trajectory, duration=20.0 * duration)
    ours = long.duration / best(lambda: loop.run(long), 0.5, least=1)
    plant = speed_peers.Plant(bundle, replace(loop.rig_config, load=trajectory.load))
    reference = speed_peers.replay(plant, log.command, _PERIOD, _FINE)
    own = speed_peers.errors(np.column_stack([log.strain, log.pressure]), reference)
    figures = []
    for name, solve in (('solve_ivp (LSODA)', speed_peers.replay),
                        ('python-control input_output_response', speed_peers.respond)):
        for tolerance in _TOLERANCES:
            begin = time.process_time()
            found = solve(plant, log.command, _PERIOD, tolerance)
            spent = time.process_time() - begin
            theirs = speed_peers.errors(found, reference)
            if theirs.strain <= own.strain and theirs.pressure <= own.pressure:
                break
        figures.append(Figure(
            '2 units, 4 kg in motion', ours, 'x real time', name, duration / spent, REACH_PEERS,
            True, f'errors: loop {own}; {name.split()[0]} {theirs} at rtol {tolerance:.0e}'))
    return figures


ROWS = (
    Row('loop', 'closed loop with every controller, one core, against real time',
        against_real_time, where),
    Row('solvers', 'closed loop, compared with ODE solvers on the plant only', against_solvers,
        where),
)
