# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands that measure the package: `benchmark-control`, `benchmark-discovery`, `bench`."""

from collections.abc import Callable
from pathlib import Path
import time
from typing import Annotated, Any

import typer

from fam_bundle_ros.cli.common import (
    console,
    JsonFile,
    model_path,
    notes,
    open_model,
    progress_bar,
    save_json,
    table,
    wrote,
)
from fam_bundle_ros.errors import InputError

PANEL = 'Benchmarks'


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    app.command('benchmark-control', rich_help_panel=PANEL)(benchmark_control)
    app.command('benchmark-discovery', rich_help_panel=PANEL)(benchmark_discovery)
    app.command('bench', rich_help_panel=PANEL)(bench)


def benchmark_control(
    trajectories: Annotated[str, typer.Option(help='Names with commas between, or all.')] = 'all',
    plants: Annotated[str, typer.Option(help='Names with commas between, or all.')] = 'all',
    controllers: Annotated[str, typer.Option(help='policy/scheme with commas between, or all.'
                                             )] = 'all',
    seed: Annotated[int, typer.Option(help="Seed of the sensors' noise.")] = 1,
    workers: Annotated[int | None, typer.Option(help='Processes; all cores by default.',
                                                min=1)] = None,
    ros: Annotated[bool, typer.Option(help='Also run one row over ROS in lock-step.')] = True,
    out: Annotated[Path | None, typer.Option('--out', '-o', metavar='FILE', help='Also write the '
                                             'page (HTML).')] = None,
    json_file: JsonFile = None,
) -> None:
    """Run every policy and scheme on the same trajectories and plants."""
    from fam_bundle_ros.benchmarks import control
    from fam_bundle_ros.report.control_pages import benchmark_page, verdicts
    chosen = _pick(trajectories, control.TRAJECTORIES, '--trajectories')
    kinds = _pick(plants, control.PLANTS, '--plants')
    pairs = _pick(controllers, [f'{p}/{s}' for p, s in control.CONTROLLERS], '--controllers')
    with progress_bar('benchmark-control') as tick:
        result = control.run_benchmark(
            [pair for pair in control.CONTROLLERS if '/'.join(pair) in pairs], chosen, kinds,
            seed, workers=workers,
            progress=lambda done, every, what: tick(done / every, what))
    table(('figure', 'value', 'to reach', ''), verdicts(result.summary), numeric=(1,),
          title='reversal_aware, worst trajectory')
    saved = {name: entry for name, entry in result.summary['by_trajectory'].items()
             if entry.get('air_saving') is not None}
    if saved:
        table(('trajectory', 'air saved (%)', 'at most (%)', 'a liquid would save (%)',
               'air over least'),
              [(name, *(None if entry.get(key) is None else 100.0 * entry[key] for key in
                        ('air_saving', 'air_saving_bound', 'liquid_saving')),
                entry.get('air_over_least')) for name, entry in saved.items()],
              title='against all on', numeric=(1, 2, 3, 4))
    console.print(f'{len(result.rows)} runs; chatter in '
                  f'{sum(row["chatter"] for row in result.rows)}')
    for name, sentences in result.summary['not_reached'].items():
        console.print(f'not reached on {name}: ' + '; '.join(sentences), highlight=False)
    over_ros = _over_ros(seed) if ros else []
    if over_ros:
        table(('ramp, reversal_aware, orderly', 'rms (N)', 'largest (N)', 'switches', 'air (mg)'),
              [(row['through'], row['tracking_rms'], row['largest_error'], row['switches'],
                1e6 * row['air_mass']) for row in over_ros], numeric=(1, 2, 3, 4))
    if out is not None:
        from fam_bundle_ros.report.page import write_page
        shipped = control.MODEL.rpartition('/')[2].removesuffix('.yaml')
        write_page(out, benchmark_page(result, open_model(shipped), seed, over_ros,
                                       [('model file', model_path(shipped))]))
        wrote(out)
    save_json(json_file, {**result.to_json(), 'over_ros': over_ros})


def benchmark_discovery(
    cases: Annotated[int, typer.Option(help='Cases per kind of data and set.', min=1)] = 150,
    sets: Annotated[str, typer.Option(help='Sets of cases with commas between, or all.')] = 'all',
    workers: Annotated[int | None, typer.Option(help='Processes; all cores by default.',
                                                min=1)] = None,
    against: Annotated[bool, typer.Option('--against', help='LASSO and pysindy STLSQ on the same '
                                          'cases (extras).')] = False,
    json_file: JsonFile = None,
) -> None:
    """Hide effects in simulated data and count how often `diagnose` names them."""
    from fam_bundle_ros.benchmarks import discovery
    chosen = _pick(sets, discovery.SETS, '--sets')
    with progress_bar('benchmark-discovery') as tick:
        result = discovery.benchmark(cases, chosen, workers,
                                     lambda done, every: tick(done / every, f'{done} of {every}'))
    table(('measure', 'cases', 'value', 'target', ''),
          [(row['measure'], row['cases'], f'{row["value"]:.3f}',
            f'{"≥" if row["at_least"] else "≤"} {row["target"]:.3g}',
            '' if row['met'] else 'missed') for row in result['table']], numeric=(1, 2))
    if result['calibration']:
        table(('probability claimed', 'right', 'cases'),
              [(f'{row["claimed"]:.2f}', f'{row["right"]:.2f}', int(row['cases']))
               for row in result['calibration']], numeric=(0, 1, 2))
    if result['confusion']:
        table(('hidden', 'answered instead (times)'),
              [(truth, ', '.join(f'{answer} {count}' for answer, count in answers.items()))
               for truth, answers in result['confusion'].items()], title='where it went wrong')
    if against:
        from fam_bundle_ros.benchmarks.discovery_against import against as others
        result['against'] = others(cases)
        table(('method', 'figures'), [(name, ', '.join(f'{key} {value}' for key, value in
                                                       row.items()))
                                      for name, row in result['against'].items()])
    save_json(json_file, result)


def bench(
    samples: Annotated[str, typer.Option(help='Lengths of the logs for `diagnose`, with commas '
                                         'between; empty for none.')] = '10000,24000,100000',
    json_file: JsonFile = None,
) -> None:
    """Measure how fast the parts run on this machine."""
    rows = [(name, *figures) for name, figures in _speeds().items()]
    for length in _lengths(samples):
        with notes.status(f'diagnose, {length} samples'):
            rows.append((f'diagnose, {length} samples', _diagnose_seconds(length), 's',
                         'whole catalogue, one core, friction hidden'))
    table(('what', 'time', 'unit', 'of'), rows, numeric=(1,))
    save_json(json_file, {name: {'value': value, 'unit': unit, 'of': of}
                          for name, value, unit, of in rows})


def _lengths(text: str) -> list[int]:
    try:
        found = [int(part) for part in text.split(',') if part.strip()]
    except ValueError as error:
        raise InputError(f"--samples: '{text}' is not a list of whole numbers") from error
    if any(not 100 <= length <= 2_000_000 for length in found):
        raise InputError(f"--samples: '{text}'; expected numbers from 100 to 2000000")
    return found


def _diagnose_seconds(length: int) -> float:
    """Return the time that `diagnose` takes on a simulated log of loops at seven isobars."""
    import numpy as np

    from fam_bundle_ros.discovery import diagnose
    from fam_bundle_ros.discovery.measurement import build
    from fam_bundle_ros.model import Bundle, Motion
    paper = open_model('spie2021')
    model = Bundle('one_muscle', paper.motor_units[:1], paper.effects)
    time_s = 0.01 * np.arange(length)
    turn = 2.0 * np.pi * 14.0 * np.arange(length) / length
    level = np.minimum(7 * np.arange(length) // length, 6)
    pressure = 50e3 * (1.0 + level)[:, None]
    strain = 0.1 - 0.1 * np.cos(turn)
    rate = np.gradient(strain, time_s)
    truth = model.with_effect('coulomb_friction')
    noise = np.random.default_rng(0).normal(0.0, 0.8, length)
    force = truth.simulate(Motion(strain, pressure, rate, time_s)).sum(axis=-1) + noise
    data = build('log', strain, pressure, force, level.tolist(), time_s, ['mu1'])
    begin = time.process_time()
    diagnose(model, data)
    return time.process_time() - begin


def _over_ros(seed: int) -> list[dict[str, Any]]:
    """Return one run of the benchmark by calls and over ROS in lock-step, at the same rate."""
    from fam_bundle_ros.benchmarks.control_metrics import metrics
    from fam_bundle_ros.benchmarks.control_trajectories import make_trajectory
    from fam_bundle_ros.control import PidGains
    from fam_bundle_ros.plant import RigConfig
    from fam_bundle_ros.simulation import ClosedLoop, pid_config
    try:
        from fam_bundle_ros.nodes.session import run_trajectory
    except ModuleNotFoundError as error:
        notes.print(f'no row over ROS: {error.name} is not there')
        return []
    bundle, rig, period = open_model('spie2021'), RigConfig(), 2e-3
    # The gains that the benchmark has, and in both the rate that all nodes share.
    gains, config = PidGains(), pid_config(rig, period)
    trajectory = make_trajectory('ramp', bundle)
    with notes.status('one row over ROS, lock-step'):
        logs = {'Python calls': ClosedLoop(bundle, rig=rig, period=period, pid_period=period,
                                           gains=gains, pid=config, seed=seed).run(trajectory),
                'ROS 2 topics': run_trajectory(
                    bundle, trajectory, rig=rig, rate=1.0 / period, seed=seed, log_level='warn',
                    overrides={'gains.p': gains.p, 'gains.i': gains.i, 'gains.d': gains.d,
                               'quiet_error': config.quiet_error,
                               'transport_delay': config.transport_delay})}
    return [{'policy': 'reversal_aware', 'scheme': 'orderly', 'trajectory': 'ramp',
             'plant': 'nominal', **metrics(log, bundle, rig, search=False), 'through': through}
            for through, log in logs.items()]


def _speeds() -> dict[str, tuple[float, str, str]]:
    import numpy as np

    from fam_bundle_ros.control import (
        Allocator,
        ControllerConfig,
        Instant,
        Measurement,
        RecruitmentController,
        Reference,
    )
    from fam_bundle_ros.model import Motion
    from fam_bundle_ros.plant import Rig, RigConfig
    from fam_bundle_ros.workbench import drawings
    from fam_bundle_ros.workbench.cases import load_example
    from fam_bundle_ros.workbench.session import Session
    bundle = open_model('spie2021').with_effect('coulomb_friction')
    strain, pressure = 0.1, np.array([3e5, 1e5])
    state = bundle.start_state()
    count = 1_000_000
    wave = np.linspace(0.0, 200.0, count)
    motion = Motion(0.1 + 0.05 * np.sin(wave), np.broadcast_to(pressure, (count, 2)).copy(),
                    0.05 * np.cos(wave), 1e-3 * np.arange(count))
    rig = Rig(bundle, RigConfig(), seed=0)
    controller = RecruitmentController(bundle, ControllerConfig())
    measured = Measurement(60.0, strain, 0.0, pressure)
    asked = Reference('force', 60.0, 0.0)
    session = Session()
    session.open(load_example('hidden_friction'))
    allocator = Allocator(bundle)
    return {
        'one tick of the model': (1e6 * _seconds(
            lambda: bundle.step(state, 2e-3, strain, pressure)), 'µs', 'two motor units'),
        'a logged sample': (1e9 * _seconds(lambda: bundle.simulate(motion), 0.0) / count, 'ns',
                            'a million at once'),
        'one tick of the rig': (1e6 * _seconds(lambda: rig.step([0.1, 0.0], 2e-3)), 'µs',
                                '2 ms of simulated time'),
        'the inverse of the model': (1e6 * _seconds(
            lambda: allocator.curves(Instant(0.16)).fill(60.0, (0, 1))), 'µs',
            'a force and strain to two pressures'),
        'one tick of the recruitment controller': (1e6 * _seconds(
            lambda: controller.update(4e-3, measured, asked)), 'µs', 'reversal aware'),
        'a figure of the workbench': (1e3 * _seconds(
            lambda: drawings.for_page(drawings.main_figure(session), dark=True)), 'ms',
            'curves of an example, without the browser'),
    }


def _seconds(call: Callable[[], Any], budget: float = 0.4) -> float:
    """Return the median time of a call."""
    times: list[float] = []
    end = time.perf_counter() + budget
    while not times or time.perf_counter() < end:
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return sorted(times)[len(times) // 2]


def _pick(text: str, known: Any, option: str) -> list[str]:
    if text == 'all':
        return list(known)
    names = [name.strip() for name in text.split(',')]
    for name in names:
        if name not in known:
            raise InputError(f"{option}: '{name}' is not known; expected all, or some of "
                             f'{", ".join(known)}')
    return names
