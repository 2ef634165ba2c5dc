# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The command `benchmark-faults`: which faults controllers detect, and the pressure until then."""

from collections.abc import Callable
import os
from pathlib import Path
from typing import Annotated, Any
from uuid import uuid4

import typer

from fam_bundle_ros.cli.bench_commands import pick
from fam_bundle_ros.cli.common import (
    counter,
    JsonFile,
    Names,
    save_json,
    SchedulerOption,
    table,
    WorkersOption,
    wrote,
)
from fam_bundle_ros.errors import InputError


def benchmark_faults(
    faults: Annotated[str, typer.Option(help='Names separated by commas, all, or none.')] = 'all',
    phases: Names = 'all',
    policies: Names = 'all',
    work: Annotated[float, typer.Option(help='Minutes of operation without a fault, to count '
                                        'false alarms.', min=0.0)] = 4.0,
    ros: Annotated[bool, typer.Option('--ros', help='Also kill, stop and restart each node, one '
                                      'process each (some minutes).')] = False,
    seed: Annotated[int, typer.Option(help="Seed of the sensors' noise.", min=0)] = 1,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    listed: Annotated[bool, typer.Option('--list', help='List the faults and exit.')] = False,
    out: Annotated[Path | None, typer.Option('--out', '-o', metavar='FILE', help='Also write the '
                                             'page (Markdown).')] = None,
    json_file: JsonFile = None,
) -> None:
    """
    Inject every fault into the simulated rig; report which are detected, and the pressure.

    Every fault in every phase under every policy, through the nodes in lock-step, about 2 s per
    run; the worst fault is listed first. The JSON has `conditions`, `faults` and `sound` (a line
    each), `rows` (one per run) and `processes` (with --ros).
    """
    from fam_bundle_ros.benchmarks import faults as benchmark
    from fam_bundle_ros.report import fault_tables as tables
    if listed:
        table(('fault', ''), [(name, fault.text) for name, fault in benchmark.EVERY.items()])
        return
    chosen = [] if faults == 'none' else pick(faults, benchmark.EVERY, '--faults')
    policy_names = pick(policies, benchmark.POLICIES, '--policies')
    cases = [*benchmark.cases_of(chosen, pick(phases, benchmark.PHASES, '--phases'),
                                 policy_names, seed),
             *benchmark.work_cases(work, policy_names[-1], seed)]
    if not cases:
        raise InputError('--faults none and --work 0: nothing to run')
    with counter('benchmark-faults') as tick:
        rows = _run_cases(cases, workers, scheduler, tick)
    result = _result_of(cases, rows)
    table(tables.FAULT_HEAD, [tables.fault_cells(line) for line in result['faults']],
          title=f'{len(rows)} runs, the worst fault first', numeric=range(1, 13))
    table(tables.SOUND_HEAD, [tables.sound_cells(line) for line in result['sound']],
          numeric=range(1, 5))
    if ros:
        # with shared memory, files of killed nodes would finally disconnect the other nodes
        os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
        from fam_bundle_ros.nodes.fault_processes import run_processes
        with counter('nodes killed and stopped') as tick:
            result['processes'] = run_processes(tick)
        table(tables.PROCESS_HEAD, [tables.process_cells(row) for row in result['processes']],
              title='one process per node, in wall time', numeric=(3, 4, 5, 6))
    if out is not None:
        from fam_bundle_ros.atomic import write_whole
        write_whole(out, tables.markdown(result))
        wrote(out)
    save_json(json_file, result)


def run_case(case: Any) -> dict[str, Any]:
    """Run a case through the nodes and judge it; called in worker processes."""
    from fam_bundle_ros.benchmarks import fault_verdicts, faults
    from fam_bundle_ros.benchmarks.plants import paper_bundle
    from fam_bundle_ros.nodes.fault_run import run_with_faults
    model, rig = paper_bundle(2), faults.rig_of(case)
    record = run_with_faults(
        model, faults.trajectory_of(case, model), rig,
        {**faults.node_parameters(case), 'publish_clock': False}, enable_at=case.enable_at,
        lock_step=case.lock_step, rate=faults.RATE, seed=case.seed,
        # a namespace each, as workers share a domain and may be threads of one process
        namespace=f'/faults_{uuid4().hex}')
    return fault_verdicts.judge(case, record, fault_verdicts.Limits.of(model, rig))


def _run_cases(cases: list[Any], workers: int | None, scheduler: str | None,
               progress: Callable[[int, int, str], None]) -> list[dict[str, Any]]:
    """Return the row of each case: those in lock-step run in parallel, the others singly."""
    from fam_bundle_ros.campaign.pool import as_done
    rows: dict[Any, dict[str, Any]] = {}

    def done(case: Any, row: dict[str, Any]) -> None:
        rows[case] = row
        progress(len(rows), len(cases), str(case))

    parallel = [case for case in cases if case.lock_step]
    for place, row in as_done(run_case, parallel, workers, scheduler):
        done(parallel[place], row)
    # in wall time nothing else may run, as a busy machine delays the nodes
    for case in cases:
        if not case.lock_step:
            done(case, run_case(case))
    return [rows[case] for case in cases]


def _result_of(cases: list[Any], rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return conditions, a line for each fault (worst first) and all rows."""
    from fam_bundle_ros.benchmarks import fault_verdicts, faults
    from fam_bundle_ros.benchmarks.plants import paper_bundle
    limits = fault_verdicts.Limits.of(paper_bundle(2), faults.rig_of(cases[0]))
    lines = fault_verdicts.summarise(rows)
    return {
        'conditions': {
            'supply': faults.SUPPLY / 1e3, 'trip': float(limits.trip.max()) / 1e3,
            'pressure': float(limits.pressure.max()) / 1e3,
            'relief': fault_verdicts.RELIEF / 1e3,
            'rate': faults.RATE, 'lasts': faults.REPAIR - faults.ONSET,
            'pressed': faults.PRESSED - faults.ONSET,
            'phases': sorted({case.phase for case in cases} - {faults.WORK},
                             key=faults.PHASES.index),
            'policies': sorted({case.policy for case in cases}, key=faults.POLICIES.index)},
        'faults': [line for line in lines if line['fault'] not in faults.SOUND],
        'sound': [line for line in lines if line['fault'] in faults.SOUND], 'rows': rows}
