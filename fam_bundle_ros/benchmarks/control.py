# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The control benchmark: our controller and one equal pressure, on plants that are not its model.

A case is (plant, trajectory, units, other, seed): `reversal_aware`, `equal_pressure` and one
``other`` controller on the same trajectory. By default the cases cover every pair of values, with
``full`` every combination. Plants are in `plants`, gains at equal margins in `margins`, figures
in `control_metrics`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
import random
import time
from typing import Any

from fam_bundle_ros.benchmarks.control_metrics import (
    compared,
    least_air_of,
    one_unit_is_enough,
    row_of,
)
from fam_bundle_ros.benchmarks.control_summary import summarise
from fam_bundle_ros.benchmarks.control_trajectories import is_strain, make_trajectory, TRAJECTORIES
from fam_bundle_ros.benchmarks.margins import (
    baseline_gains,
    CONTROLLERS,
    loop_of,
    our_margin,
)
from fam_bundle_ros.benchmarks.plant_record import diagnosed_model
from fam_bundle_ros.benchmarks.plants import (
    model_error,
    model_of,
    plant_of,
    PLANTS,
    UNITS,
)
from fam_bundle_ros.campaign.pool import as_done
from fam_bundle_ros.control.baselines import BaselineConfig
from fam_bundle_ros.simulation import Log

#: Controllers in addition to the two of every case; ``no_feedback`` runs on the nominal plant.
OTHERS = tuple(CONTROLLERS)[2:-2]
#: Ours with the model that `diagnose` makes of a record; runs only if it is named.
DIAGNOSED = 'diagnosed'
OURS, BESIDE = tuple(CONTROLLERS)[:2]
#: Runs whose logs are returned for the plots: (plant, trajectory, units).
SHOWN = (('everything', 'ramp_20', 2), ('everything', 'moved', 2), ('everything', 'sine_0.5', 2),
         ('nominal', 'ramp_20', 2))


@dataclass(frozen=True)
class Case:
    """A case: our controller, equal pressure and ``others`` on one plant and trajectory."""

    plant: str
    trajectory: str
    units: int
    others: tuple[str, ...]
    seed: int = 1

    def __str__(self):
        return f'{self.plant} {self.trajectory}, {self.units} units'


@dataclass(frozen=True)
class ControlBenchmark:
    """Result of `run_benchmark`."""

    #: One per run, SI units; see `control_metrics`.
    rows: list[dict[str, Any]]
    #: See `control_summary.summarise`.
    summary: dict[str, Any]
    #: Those of `SHOWN`, by (controller, trajectory, plant).
    logs: dict[tuple[str, str, str], Log]
    #: Wall time.
    seconds: float

    def to_json(self) -> dict[str, Any]:
        """Return rows and summary for ``json.dump``."""
        return {'rows': self.rows, 'summary': self.summary, 'seconds': self.seconds}


def cases_of(plants: Sequence[str] = tuple(PLANTS), trajectories: Sequence[str] = TRAJECTORIES,
             units: Sequence[int] = UNITS, others: Sequence[str] = OTHERS,
             seeds: Sequence[int] = (1,), full: bool = False) -> list[Case]:
    """
    Return the cases of a benchmark, with ``no_feedback`` on the nominal plant.

    ``full``: every other controller on every combination of plant, trajectory and units; else a
    pairwise cover of the factors.
    """
    if full or not others:
        chosen = [(p, t, n, tuple(others)) for p in plants for t in trajectories for n in units]
    else:
        chosen = [(p, t, n, (other,)) for p, t, n, other in pairwise(
            [plants, trajectories, units, others])]
    return [Case(p, t, n, (*more, 'no_feedback') if p == 'nominal' else more, seed)
            for seed in seeds for p, t, n, more in chosen]


def run_case(case: Case) -> tuple[list[dict[str, Any]], dict[tuple[str, str, str], Log]]:
    """
    Run a case with each of its controllers: ours, then equal pressure, then the others.

    Returns rows, and logs by (controller, trajectory, plant).
    """
    model, plant = model_of(case.plant, case.units), plant_of(case.plant, case.units)
    trajectory = make_trajectory(case.trajectory, model, plant,
                                 long=case.plant == 'noise' and case.trajectory == 'dwell_edge')
    common = {'plant': case.plant, 'trajectory': case.trajectory, 'units': case.units,
              'seed': case.seed, 'model_error': model_error(case.plant, case.units),
              'one_unit': one_unit_is_enough(trajectory, model, plant)}
    logs, rows = {}, []
    for name in dict.fromkeys((OURS, BESIDE, *case.others)):
        controller, gains = CONTROLLERS[name], BaselineConfig()
        if controller.baseline:
            gains = baseline_gains(case.plant, case.units, name, trajectory.kind)
        better = diagnosed_model(case.plant, case.units) if name == DIAGNOSED else None
        loop = loop_of(case.plant, case.units, controller, gains, case.seed, model=better)
        logs[name] = loop.run(trajectory)
        rows.append({'controller': name, **common, **row_of(logs[name], plant, loop.rig_config)})
        if better:
            rows[-1]['model'] = [effect.name for effect in better.effects]
            rows[-1]['model_error'] = model_error(case.plant, case.units, better)
        if controller.baseline:
            rows[-1]['gains'] = [getattr(gains, f'{trajectory.kind}_{part}')
                                 for part in ('gain', 'integral')] + [gains.filter_time]
    for row in rows:
        row.update(compared(logs[row['controller']], logs[OURS], logs[BESIDE]))
    if case.plant == 'nominal' and case.units == 2:
        rows[0]['air_over_least'] = rows[0]['air_mass'] / least_air_of(logs[OURS], model)
    rows[0]['gain_margin'] = our_margin(case.plant, case.units, trajectory.kind)
    return rows, {(name, case.trajectory, case.plant): log for name, log in logs.items()}


def run_benchmark(cases: Sequence[Case], workers: int | None = None,
                  progress: Callable[[int, int, str], None] | None = None,
                  scheduler: str | None = None) -> ControlBenchmark:
    """
    Run cases on all cores; the rows are in the order of the cases.

    Parameters
    ----------
    cases : sequence of Case
        See `cases_of`.
    workers : int, optional
        Processes; all cores by default.
    progress : callable, optional
        Called with the number of cases done, the number of cases, and the last one.
    scheduler : str, optional
        Address of a Dask scheduler whose workers run the cases.
    """
    begin = time.perf_counter()
    # Cases of one plant go to one worker, which computes gains and margins once.
    groups: dict[tuple[str, bool], list[Case]] = {}
    for case in cases:
        groups.setdefault((case.plant, is_strain(case.trajectory)), []).append(case)
    found: dict[Case, list[dict[str, Any]]] = {}
    logs: dict[tuple[str, str, str], Log] = {}
    # A narrow line needs small steps, about four times as many.
    order = sorted(groups.values(), key=lambda group: -len(group) * (
        4.0 if PLANTS[group[0].plant].rig.chamber.line_volume > 0.0 else 1.0))
    for place, result in as_done(_run_group, order, workers, scheduler):
        for case, (rows, kept) in zip(order[place], result):
            found[case] = rows
            logs.update(kept)
        if progress:
            progress(len(found), len(cases), str(order[place][-1]))
    rows = [row for case in cases for row in found[case]]
    return ControlBenchmark(rows, summarise(rows), logs, time.perf_counter() - begin)


def _run_group(group):
    """Run cases in a worker; return only the logs that are plotted, as they are large."""
    out = []
    for case in group:
        rows, logs = run_case(case)
        wanted = (case.plant, case.trajectory, case.units) in SHOWN
        out.append((rows, logs if wanted else {}))
    return out


def pairwise(factors: Sequence[Sequence[Any]]) -> list[tuple[Any, ...]]:
    """
    Return cases, with one value of each factor, that cover every pair of values.

    Greedy: of several random candidates, the one with most pairs not covered yet. The two longest
    factors determine the smallest number of cases.

    Examples
    --------
    >>> len(pairwise([['a', 'b', 'c'], [1, 2, 3], ['x', 'y']]))
    9
    """
    chance = random.Random(0)
    missing = {((i, a), (j, b)) for i, j in combinations(range(len(factors)), 2)
               for a in factors[i] for b in factors[j]}
    cases = []
    while missing:
        begun = min(missing, key=repr)
        tries = []
        for _ in range(12):
            case: list[Any] = [None] * len(factors)
            for i, value in begun:
                case[i] = value
            order = [i for i in range(len(factors)) if case[i] is None]
            chance.shuffle(order)
            for i in order:
                values = list(factors[i])
                chance.shuffle(values)
                case[i] = max(values, key=lambda value: len(
                    missing & _pairs([*case[:i], value, *case[i + 1:]])))
            tries.append(tuple(case))
        best = max(tries, key=lambda case: len(missing & _pairs(case)))
        missing -= _pairs(best)
        cases.append(best)
    return cases


def _pairs(case: Sequence[Any]) -> set[tuple[tuple[int, Any], ...]]:
    """Return the pairs of (factor, value) that a case covers; None is no value."""
    return set(combinations([(i, value) for i, value in enumerate(case) if value is not None], 2))
