# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs the cases of the safety benchmark: those in lock-step in parallel, the others singly."""

from collections.abc import Callable, Sequence
from typing import Any
from uuid import uuid4

from fam_bundle_ros.benchmarks import fault_verdicts as verdicts
from fam_bundle_ros.benchmarks import faults
from fam_bundle_ros.benchmarks.faults import Case
from fam_bundle_ros.campaign.pool import as_done
from fam_bundle_ros.model import load_model
from fam_bundle_ros.resources import config_path

_MODEL = 'models/spie2021_plain.yaml'


def run_case(case: Case) -> dict[str, Any]:
    """Run a case through the nodes and judge it."""
    from fam_bundle_ros.nodes.fault_run import run_with_faults
    model, rig = load_model(config_path(_MODEL)), faults.rig_of(case)
    record = run_with_faults(
        model, faults.trajectory_of(case, model), rig,
        # A namespace each: workers share a domain, and may be threads of one process.
        {**faults.node_parameters(case), 'publish_clock': False}, enable_at=case.enable_at,
        lock_step=case.lock_step,
        rate=faults.RATE, seed=case.seed, namespace=f'/faults_{uuid4().hex}')
    return verdicts.judge(case, record, verdicts.Limits.of(model, rig))


def run_cases(cases: Sequence[Case], workers: int | None = None,
              progress: Callable[[int, int, str], None] = lambda done, every, what: None,
              scheduler: str | None = None) -> list[dict[str, Any]]:
    """
    Return the row of each case, in their order.

    Parameters
    ----------
    cases : sequence of Case
    workers : int, optional
        Processes for the cases in lock-step; all cores by default, this process alone with 1.
    progress : callable
        Called with the number of cases done, the number of cases, and the last one.
    scheduler : str, optional
        Address of a Dask scheduler for the cases in lock-step; its workers need ROS.
    """
    rows: dict[Case, dict[str, Any]] = {}

    def done(case: Case, row: dict[str, Any]) -> None:
        rows[case] = row
        progress(len(rows), len(cases), str(case))

    quick = [case for case in cases if case.lock_step]
    for place, row in as_done(run_case, quick, workers, scheduler):
        done(quick[place], row)
    # In wall time nothing else may run, as a busy machine delays the nodes.
    for case in cases:
        if case not in rows:
            done(case, run_case(case))
    return [rows[case] for case in cases]


def result_of(cases: Sequence[Case], rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return conditions, a line for each fault (worst first) and all rows."""
    model = load_model(config_path(_MODEL))
    limits = verdicts.Limits.of(model, faults.rig_of(cases[0]))
    sound = {case.fault for case in cases if case.sound}
    lines = verdicts.summarise(rows)
    return {
        'conditions': {
            'supply': faults.SUPPLY / 1e3, 'trip': float(limits.trip.max()) / 1e3,
            'pressure': float(limits.pressure.max()) / 1e3, 'relief': verdicts.RELIEF / 1e3,
            'rate': faults.RATE, 'lasts': faults.REPAIR - faults.ONSET,
            'pressed': faults.PRESSED - faults.ONSET,
            'phases': sorted({case.phase for case in cases} - {faults.WORK},
                             key=faults.PHASES.index),
            'policies': sorted({case.policy for case in cases}, key=faults.POLICIES.index)},
        'faults': [line for line in lines if line['fault'] not in sound],
        'sound': [line for line in lines if line['fault'] in sound], 'rows': list(rows)}
