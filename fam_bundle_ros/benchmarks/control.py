# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Every policy and scheme on the same trajectories and plants: what each part of control buys.

`run_benchmark` runs them on both cores and returns one row per run and a summary for
``reversal_aware``; trajectories are in `control_trajectories`, figures in `control_metrics`.
"""

from collections.abc import Callable, Iterable
from concurrent.futures import as_completed, ProcessPoolExecutor
from dataclasses import dataclass, replace
import os
from typing import Any

from fam_bundle_ros.benchmarks.control_metrics import metrics, summarise
from fam_bundle_ros.benchmarks.control_trajectories import make_trajectory, TRAJECTORIES
from fam_bundle_ros.control.controller import ControllerConfig
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, load_model
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.simulation import ClosedLoop, Log

MODEL = 'models/spie2021.yaml'

#: Policy and scheme of every controller: with all units on there is nothing to recruit.
CONTROLLERS = (
    ('neglect', 'orderly'), ('hysteresis', 'orderly'), ('reversal_aware', 'orderly'),
    ('neglect', 'batch'), ('hysteresis', 'batch'), ('reversal_aware', 'batch'),
    ('reversal_aware', 'all_on'),
)
PLANTS = ('nominal', 'resistive_50_more', 'friction', 'mu1_10_weaker', 'noise_doubled')
#: Runs whose logs are handed back for the plots: (policy, scheme, trajectory, plant).
SHOWN = tuple((policy, 'orderly', 'ramp', 'nominal')
              for policy in ('neglect', 'hysteresis', 'reversal_aware')) + (
    ('neglect', 'orderly', 'dwell_edge', 'noise_doubled'),
    ('reversal_aware', 'orderly', 'dwell_edge', 'noise_doubled'),
    ('reversal_aware', 'orderly', 'arm_spline', 'nominal'),
    ('reversal_aware', 'all_on', 'arm_spline', 'nominal'),
    ('reversal_aware', 'orderly', 'load_step', 'nominal'),
)
#: And runs whose air is compared.
COMPARED = tuple(('reversal_aware', scheme, trajectory, 'nominal')
                 for trajectory in TRAJECTORIES for scheme in ('orderly', 'all_on'))


@dataclass(frozen=True)
class ControlBenchmark:
    """
    What `run_benchmark` found.

    Attributes
    ----------
    rows : list of dict
        One per run, SI units; see `control_metrics.metrics`.
    summary : dict
        For ``reversal_aware``; see `control_metrics.summarise`.
    logs : dict
        Those of `SHOWN` and `COMPARED`, by (policy, scheme, trajectory, plant), for plots.
    """

    rows: list[dict[str, Any]]
    summary: dict[str, Any]
    logs: dict[tuple[str, str, str, str], Log]

    def to_json(self) -> dict[str, Any]:
        """Return rows and summary for ``json.dump``."""
        return {'rows': self.rows, 'summary': self.summary}


def plant_of(bundle: Bundle, name: str) -> tuple[Bundle, float]:
    """
    Return a plant and the factor on its sensors' noise; the controller keeps ``bundle``.

    Raises
    ------
    InputError
        For a name that is not in `PLANTS`.
    """
    if name == 'nominal':
        return bundle, 1.0
    if name == 'resistive_50_more':
        effect = bundle.effect('resistive_buckling')
        more = {f'resistive_buckling.{key}': 1.5 * effect.values[key]
                for key in ('euler_load', 'pressure_share', 'hinge_moment', 'hinge_share')}
        return bundle.with_parameters(more), 1.0
    if name == 'friction':
        return bundle.with_effect('coulomb_friction', force=3.0), 1.0
    if name == 'mu1_10_weaker':
        first, *others = bundle.motor_units
        thinner = replace(first.geometry, radius=first.geometry.radius * 0.9 ** 0.5,
                          wall_thickness=first.geometry.wall_thickness * 0.9 ** 0.5)
        return Bundle(bundle.name, [replace(first, geometry=thinner), *others],
                      bundle.effects), 1.0
    if name == 'noise_doubled':
        return bundle, 2.0
    raise InputError(f"plant is '{name}'; expected one of {', '.join(PLANTS)}")


def run_case(policy: str, scheme: str, trajectory: str, plant: str, seed: int = 1,
             bundle: Bundle | None = None) -> tuple[dict[str, Any], Log]:
    """
    Run one case.

    Parameters
    ----------
    policy, scheme, trajectory, plant : str
        See `CONTROLLERS`, `TRAJECTORIES`, `PLANTS`.
    seed : int
    bundle : Bundle, optional
        The controller's model; that of the paper by default.

    Returns
    -------
    row : dict
    log : Log
    """
    bundle = bundle or load_model(config_path(MODEL))
    true_bundle, noise = plant_of(bundle, plant)
    loop = ClosedLoop(true_bundle, bundle, ControllerConfig(policy=policy, scheme=scheme),
                      noise_factor=noise, seed=seed)
    log = loop.run(make_trajectory(trajectory, bundle, long=plant == 'noise_doubled'))
    row = {'policy': policy, 'scheme': scheme, 'trajectory': trajectory, 'plant': plant}
    search = plant == 'nominal' and bundle.n == 2
    return {**row, **metrics(log, true_bundle, loop.rig_config, search)}, log


def run_benchmark(controllers: Iterable[tuple[str, str]] = CONTROLLERS,
                  trajectories: Iterable[str] = TRAJECTORIES,
                  plants: Iterable[str] = PLANTS, seed: int = 1, bundle: Bundle | None = None,
                  complete: bool = False, workers: int | None = None,
                  progress: Callable[[int, int, str], None] | None = None
                  ) -> ControlBenchmark:
    """
    Run every controller on every trajectory and plant.

    Parameters
    ----------
    controllers : iterable of (policy, scheme)
    trajectories, plants : iterable of str
        Subsets, for a quick look.
    seed : int
    bundle : Bundle, optional
        The controller's model; that of the paper by default.
    complete : bool
        Batch recruitment on every plant too, not on the nominal one only: half as long again.
    workers : int, optional
        Processes; all cores by default.
    progress : callable, optional
        Called with runs done, runs in all, and what was done last.

    Returns
    -------
    ControlBenchmark
        Rows in the order of the arguments, whatever ended first.
    """
    controllers, trajectories = list(controllers), list(trajectories)
    cases = [(policy, scheme, trajectory, plant) for plant in plants
             for trajectory in trajectories for policy, scheme in controllers
             if complete or scheme != 'batch' or plant == PLANTS[0]]
    found: dict[tuple, dict[str, Any]] = {}
    logs: dict[tuple[str, str, str, str], Log] = {}
    workers = workers or os.cpu_count() or 1
    with ProcessPoolExecutor(max_workers=workers) as pool:
        pending = {pool.submit(_run, case, seed, bundle): case for case in cases}
        for done in as_completed(pending):
            case = pending[done]
            found[case], log = done.result()
            if log is not None:
                logs[case] = log
            if progress:
                progress(len(found), len(cases), ' '.join(case))
    rows = [found[case] for case in cases]
    return ControlBenchmark(rows, summarise(rows), logs)


def _run(case, seed, bundle):
    """Run a case in a worker; bring the log only where it is wanted, it is large."""
    policy, scheme, trajectory, plant = case
    row, log = run_case(policy, scheme, trajectory, plant, seed, bundle)
    return row, log if case in SHOWN + COMPARED else None
