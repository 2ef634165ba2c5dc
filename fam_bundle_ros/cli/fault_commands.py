# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The command `benchmark-faults`: which faults controllers detect, and the pressure until then."""

import os
from pathlib import Path
from typing import Annotated

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
    from fam_bundle_ros.cli.fault_work import result_of, run_cases
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
        rows = run_cases(cases, workers, tick, scheduler)
    result = result_of(cases, rows)
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
