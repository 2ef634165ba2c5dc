# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands that measure the package: `benchmark-control`, `benchmark-discovery`, `bench`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from fam_bundle_ros.cli.common import (
    console,
    counter,
    JsonFile,
    Names,
    notes,
    PageFile,
    progress_bar,
    save_json,
    save_page,
    SchedulerOption,
    table,
    WorkersOption,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.resources import config_path


def benchmark_control(
    plants: Names = 'all',
    trajectories: Names = 'all',
    units: Annotated[str, typer.Option(help='Numbers of motor units: 2, 3, 6, separated by '
                                       'commas, or all.')] = 'all',
    controllers: Annotated[str, typer.Option(
        help='Run in addition to reversal_aware and equal_pressure: names separated by commas, '
        'all, or none. Only by name: diagnosed, with the model that diagnose makes of 60 s of the '
        'plant (up to two minutes for each).')] = 'all',
    full: Annotated[bool, typer.Option('--full', help='Every combination, not only every pair: '
                                       'minutes with --controllers none, else longer.')] = False,
    seeds: Annotated[str, typer.Option(help="Seeds of the sensors' noise, separated by commas."
                                       )] = '1',
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    ros: Annotated[bool, typer.Option(help='Also run one row over ROS in lock-step.')] = True,
    out: PageFile = None,
    json_file: JsonFile = None,
) -> None:
    """
    Compare the controller with one equal pressure and a PI, on plants that differ from its model.

    By default every pair of plant, trajectory, number of units and further controller occurs, in
    a few minutes. The worst plant is listed first. The JSON has `rows` (one per run), `summary`
    (`figures`, `plants`, `diagnosed`, `not_reached`) and `over_ros`.
    """
    from fam_bundle_ros.benchmarks import control
    from fam_bundle_ros.report import control_pages as pages
    known = [str(n) for n in control.UNITS]
    others = {'none': [], 'all': list(control.OTHERS)}.get(controllers)
    if others is None:
        others = pick(controllers, (*control.OTHERS, control.DIAGNOSED), '--controllers')
    cases = control.cases_of(
        pick(plants, control.PLANTS, '--plants'),
        pick(trajectories, control.TRAJECTORIES, '--trajectories'),
        [int(n) for n in pick(units, known, '--units')], others, _whole(seeds), full)
    with counter('benchmark-control') as tick:
        result = control.run_benchmark(cases, workers, scheduler=scheduler, progress=tick)
    table(pages.PLANT_HEAD, [pages.plant_cells(line) for line in result.summary['plants']],
          title='reversal_aware and equal_pressure, the worst plant first',
          numeric=tuple(range(1, len(pages.PLANT_HEAD))))
    if lines := result.summary['diagnosed']:
        table(pages.DIAGNOSED_HEAD, [pages.diagnosed_cells(line) for line in lines],
              title='reversal_aware with the model that diagnose makes of a minute of the plant',
              numeric=tuple(range(1, len(pages.DIAGNOSED_HEAD) - 1)))
    table(pages.FIGURE_HEAD, [pages.figure_cells(figure) for figure in result.summary['figures']],
          title=f'{len(cases)} cases, {len(result.rows)} runs, {result.seconds:.0f} s',
          numeric=(1, 2, 3))
    for sentence in result.summary['not_reached']:
        console.print(f'not reached: {sentence}', highlight=False)
    over_ros = _over_ros(cases[0].seed) if ros else []
    if over_ros:
        table(('ramp_20, reversal_aware', 'rms (N)', 'largest (N)', 'switches', 'air (mg)'),
              [(row['through'], row['tracking_rms'], row['largest_error'], row['switches'],
                1e6 * row['air_mass']) for row in over_ros], numeric=(1, 2, 3, 4))
    if out is not None:
        from fam_bundle_ros.benchmarks.plants import MODEL, paper_bundle
        save_page(out, pages.benchmark_page(result, paper_bundle(2), seeds, over_ros,
                                            [('model file', config_path(MODEL))]))
    save_json(json_file, {**result.to_json(), 'over_ros': over_ros})


def benchmark_discovery(
    cases: Annotated[int, typer.Option(help='Cases per kind of data and set.', min=1)] = 150,
    sets: Annotated[str, typer.Option(help='Sets of cases separated by commas, or all.')] = 'all',
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    against: Annotated[bool, typer.Option('--against', help='Also run LASSO (scikit-learn) and '
                                          'STLSQ (pysindy) on the same cases.')] = False,
    real: Annotated[Path | None, typer.Option(
        '--real', metavar='FOLDER', help='Use measured muscles instead, each NAME.csv with its '
        'NAME.model.yaml, scored on held-out rows.', exists=True, file_okay=False)] = None,
    json_file: JsonFile = None,
) -> None:
    """
    Hide effects in simulated data and count how often `diagnose` names them.

    With --real on measured muscles: inner strain levels, isobars or trials are held out, and the
    recommended model is scored on them and compared with a six-parameter empirical form fitted to
    the same rows. The JSON has `rows` and `summary`.
    """
    if real is not None:
        _benchmark_real(real, workers, scheduler, json_file)
        return
    from fam_bundle_ros.benchmarks import discovery
    chosen = pick(sets, discovery.SETS, '--sets')
    if against:
        from fam_bundle_ros.benchmarks import discovery_against
        discovery_against.methods()  # a missing package must be found before hours of work
    with counter('benchmark-discovery') as tick:
        result = discovery.benchmark(cases, chosen, workers, scheduler=scheduler, progress=tick)
    table(('measure', 'cases', 'value', 'target', ''),
          [(row['measure'], row['cases'], f'{row["value"]:.3f}',
            f'{"≥" if row["at_least"] else "≤"} {row["target"]:.3g}',
            '' if row['met'] else 'missed') for row in result['table']], numeric=(1, 2))
    if result['calibration']:
        table(('stated probability', 'correct', 'cases'),
              [(f'{row["claimed"]:.2f}', f'{row["right"]:.2f}', int(row['cases']))
               for row in result['calibration']], numeric=(0, 1, 2))
    if result['confusion']:
        table(('hidden', 'named instead (times)'),
              [(truth, ', '.join(f'{answer} {count}' for answer, count in answers.items()))
               for truth, answers in result['confusion'].items()], title='wrong answers')
    if against:
        result['against'] = discovery_against.against(cases)
        table(('method', 'figures'), [(name, ', '.join(f'{key} {value}' for key, value in
                                                       row.items()))
                                      for name, row in result['against'].items()])
    save_json(json_file, result)


def _benchmark_real(folder: Path, workers: int | None, scheduler: str | None,
                    json_file: Path | None) -> None:
    from fam_bundle_ros.benchmarks import discovery_real
    with counter('benchmark-discovery') as tick:
        result = discovery_real.benchmark(folder, workers, scheduler=scheduler, progress=tick)
    table(('measurement', 'held out', 'verdict', 'effects', 'error (N)', 'effects alone (N)',
           'empirical (N)', 'ratio'),
          [(row['data'], row['away'], row['verdict'].replace('_', ' '), ', '.join(row['effects']),
            row['held_out_N'], row['physics_N'], row['empirical_N'], f'{row["ratio"]:.2f}')
           for row in result['rows']], numeric=(4, 5, 6, 7),
          title='Error on held-out rows, worst first')
    found = result['summary']
    console.print(f'effects named on {found["named"]} of {found["splits"]} splits; error relative '
                  f"to the empirical form's: median {found['median']:.2f}, worst "
                  f'{found["worst"]:.2f}; effects alone: median {found["median_physics"]:.2f}, '
                  f'worst {found["worst_physics"]:.2f}')
    for name, families in found['always'].items():
        console.print(f'named, or tied with a named effect, on every split of {name}: '
                      f'{", ".join(families) or "none"}')
    save_json(json_file, result)


def bench(
    only: Annotated[list[str] | None, typer.Option('--only', metavar='NAME', help='Rows by name, '
                                                   'separated by commas or --only again.')] = None,
    listed: Annotated[bool, typer.Option('--list', help='List the rows and exit.')] = False,
    scale: Annotated[float, typer.Option(help='Share of the usual work; small for a quick test.',
                                         min=0.001, max=10.0)] = 1.0,
    warm: Annotated[bool, typer.Option('--warm', help='Only fill the cache of compiled code, '
                                       'without measuring.')] = False,
    out: PageFile = None,
    json_file: JsonFile = None,
) -> None:
    """
    Measure the speed of the parts, in comparison with other packages and with targets.

    Without --only all rows but the long ones, about four minutes. The JSON has `machine`, `scale`
    and `rows`; a row has `name`, `skipped` (why it was not measured), `where` (the time is spent,
    if a target is missed) and `figures` with `what`, `value`, `unit`, `peer`, `beside` (the peer's
    value), `ratio`, `reach` (the target) and `reached`.
    """
    from fam_bundle_ros.benchmarks import speed
    from fam_bundle_ros.benchmarks.speed_rows import ROWS, warm_up
    if warm:
        warm_up()
        return
    if listed:
        table(('row', 'what', ''), [(row.name, row.what, 'long: only when named' if row.long
                                     else '') for row in ROWS])
        return
    names = [name.strip() for text in only or [] for name in text.split(',') if name.strip()]
    chosen = speed.choose(ROWS, names)
    results: list[speed.Result] = []
    with progress_bar('bench') as tick:
        for row in chosen:
            tick(len(results) / len(chosen), row.name)
            results.append(speed.run(row, scale))
    table(('row', *speed.FIGURE_HEAD),
          [cells for result in results for cells in _cells(result)], numeric=(2, 4, 6, 7))
    for result in results:
        for line in result.remarks:
            console.print(f'{result.row.name}: {line}', highlight=False, style='dim')
    machine = speed.machine()
    if out is not None:
        from fam_bundle_ros.report.control_pages import bench_page
        save_page(out, bench_page(results, machine))
    save_json(json_file, {'machine': machine, 'scale': scale,
                          'rows': [result.to_json() for result in results]})


def _cells(result: Any) -> list[tuple[Any, ...]]:
    """Return a row of the table for each figure."""
    if result.skipped:
        return [(result.row.name, 'not measured', *[''] * 7)]
    return [(result.row.name, *('' if cell is None else cell for cell in figure.cells))
            for figure in result.figures]


def _over_ros(seed: int) -> list[dict[str, Any]]:
    """Return one run of the benchmark by calls and over ROS in lock-step, at the same rate."""
    from fam_bundle_ros.benchmarks.control_metrics import metrics
    from fam_bundle_ros.benchmarks.control_trajectories import make_trajectory
    from fam_bundle_ros.benchmarks.plants import paper_bundle
    from fam_bundle_ros.control import PidGains
    from fam_bundle_ros.plant import RigConfig
    from fam_bundle_ros.simulation import ClosedLoop, pid_config
    try:
        from fam_bundle_ros.nodes.session import run_trajectory
    except ModuleNotFoundError as error:
        notes.print(f'no row over ROS: {error.name} is not installed')
        return []
    bundle, rig, period = paper_bundle(2), RigConfig(), 2e-3
    # The gains of the benchmark, and in both runs the common rate of the nodes.
    gains, config = PidGains(), pid_config(rig, period)
    trajectory = make_trajectory('ramp_20', bundle)
    with notes.status('one row over ROS, lock-step'):
        logs = {'Python calls': ClosedLoop(bundle, rig=rig, period=period, pid_period=period,
                                           gains=gains, pid=config, seed=seed).run(trajectory),
                'ROS 2 topics': run_trajectory(
                    bundle, trajectory, rig=rig, rate=1.0 / period, seed=seed, log_level='warn',
                    overrides={'gains.p': gains.p, 'gains.i': gains.i, 'gains.d': gains.d,
                               'quiet_error': config.quiet_error,
                               'transport_delay': config.transport_delay})}
    return [{'controller': 'reversal_aware', 'trajectory': 'ramp_20', 'plant': 'nominal',
             **metrics(log, bundle, rig), 'through': through}
            for through, log in logs.items()]


def pick(text: str, known: Any, option: str) -> list[str]:
    """Return the names in a comma-separated text, or all known ones; InputError for others."""
    if text == 'all':
        return list(known)
    names = [name.strip() for name in text.split(',')]
    for name in names:
        if name not in known:
            raise InputError(f"{option}: '{name}' is not known; expected all, or some of "
                             f'{", ".join(known)}')
    return names


def _whole(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(',')]
    except ValueError:
        raise InputError(f"--seeds: '{text}' is not a list of whole numbers; expected for "
                         'example 1,2,3') from None
