# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows of whole studies: the control benchmark, `diagnose` on long logs, campaigns."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
import os
from pathlib import Path
import resource
import tempfile
import time

import numpy as np

from fam_bundle_ros.benchmarks import control
from fam_bundle_ros.benchmarks.plants import paper_bundle
from fam_bundle_ros.benchmarks.speed import children, Figure, Row, where_of
from fam_bundle_ros.campaign import run_campaign
from fam_bundle_ros.model import Bundle, catalogue, Geometry, Motion, MotorUnit, save_model

#: Target of the control benchmark on two cores, s.
REACH_CONTROL = 600.0
#: Lengths of the logs for `diagnose`.
SAMPLES = (10_000, 24_000, 100_000)
#: Numbers of recordings: for one process, for two processes, and the first ones for comparison.
ALL, SHARED, FEW = 1000, 300, 30
#: Targets: memory (GB), parallel efficiency, cost of a recording relative to the first ones.
REACH_MEMORY, REACH_EFFICIENCY, REACH_COST = 1.0, 0.8, 1.1


def control_benchmark(scale: float) -> list[Figure]:
    """Return the wall time of `benchmark-control` on two cores."""
    cases = control.cases_of()
    cases = cases[:max(round(scale * len(cases)), 1)]
    begin, cpu = time.perf_counter(), children()
    found = control.run_benchmark(cases, workers=2)
    spent = time.perf_counter() - begin
    return [Figure(f'{len(found.rows)} runs', spent, 's on two cores', reach=REACH_CONTROL,
                   note=f'{children() - cpu:.0f} s of CPU time')]


def where_control(scale: float) -> str:
    """Return where one of its runs spends its time."""
    return where_of(lambda: control.run_case(control.Case('nominal', 'sine_0.5', 2, ())))


def diagnoses(scale: float) -> list[Figure]:
    """Return the CPU time of `diagnose` over logs of several lengths."""
    return [Figure(f'{length} samples', diagnose_seconds(length), 's',
                   note='whole catalogue, one core, friction hidden')
            for length in (max(int(n * scale), 1000) for n in SAMPLES)]


def diagnose_seconds(length: int) -> float:
    """Return the time that `diagnose` takes on a simulated log of loops at seven isobars."""
    from fam_bundle_ros.data.measurement import build
    from fam_bundle_ros.discovery import diagnose
    paper = paper_bundle(2)
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


def write_lab(folder: Path, count: int) -> Path:
    """Write small maps of muscles, half of them with dead ends; return the model file."""
    strain, pressure = (each.ravel() for each in np.meshgrid(np.linspace(0.0, 0.2, 5),
                                                             np.linspace(8e4, 4e5, 5)))
    plain = Bundle('lab', [MotorUnit('mu1', 1, Geometry(6e-3, 0.2, np.radians(30.0), 1e-3))],
                   [catalogue.get('mesh')()])
    for number in range(count):
        rng = np.random.default_rng(number)
        truth = plain.with_effect('end_caps', dead_length=16e-3) if number % 2 else plain
        force = truth.force(strain, pressure[:, None]) + rng.normal(0.0, 0.5, len(strain))
        rows = [f'{e:.5f},{p / 1e3:.3f},{f:.3f}' for e, p, f in zip(strain, pressure, force)]
        (folder / f'{number:04d}.csv').write_text(
            '\n'.join(['strain,pressure [kPa],force [N]', *rows]))
    path = folder / 'model.yaml'
    save_model(plain, path)
    return path


def campaign(scale: float) -> list[Figure]:
    """Return the figures of a campaign of small static maps, on one process and on two."""
    count, shared, few = (max(round(scale * each), 2) for each in (ALL, SHARED, FEW))
    with tempfile.TemporaryDirectory(prefix='fam_bundle_') as name:
        folder = Path(name)
        (folder / 'all').mkdir()
        (folder / 'shared').mkdir()
        write_lab(folder / 'all', count)
        model = write_lab(folder / 'shared', shared)
        # in a process of its own, as the memory of this one includes other rows
        with ProcessPoolExecutor(1, get_context('spawn')) as fresh:
            cpu, wall, gigabytes = fresh.submit(_alone, folder / 'all').result()
        begin, load, spent = time.perf_counter(), os.getloadavg()[0], children()
        run_campaign(folder / 'shared', model, folder / 'two', workers=2)
        two, spent = time.perf_counter() - begin, children() - spent
        one = wall[shared - 1]
        figures = [
            Figure(f'one recording of the first {few}', cpu[few - 1] / few, 's of CPU time'),
            Figure(f'one recording of {shared}', cpu[shared - 1] / shared, 's of CPU time',
                   f'one of the first {few}', cpu[few - 1] / few, REACH_COST),
            Figure(f'{count} recordings, one process', gigabytes, 'GB', reach=REACH_MEMORY,
                   note='largest resident memory; the process also starts and imports'),
            Figure(f'{shared} recordings, two processes', one / two / 2.0,
                   'of twice the speed of one', reach=REACH_EFFICIENCY, at_least=True,
                   note=f'{_words(one, two, load)}; their CPU time is {spent:.0f} s, that of one '
                   f'process {cpu[shared - 1]:.0f} s')]
        try:
            from distributed import LocalCluster
        except ImportError:
            return figures
        with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
            begin, load = time.perf_counter(), os.getloadavg()[0]
            run_campaign(folder / 'shared', model, folder / 'dask',
                         scheduler=cluster.scheduler_address)
            dask = time.perf_counter() - begin
        return [*figures, Figure(
            f'{shared} recordings, two Dask workers', one / dask / 2.0,
            'of twice the speed of one', reach=REACH_EFFICIENCY, at_least=True,
            note=_words(one, dask, load))]


def _alone(folder: Path) -> tuple[list[float], list[float], float]:
    """Return CPU and wall time (s) after each recording, and the largest memory (GB)."""
    cpu: list[float] = []
    wall: list[float] = []
    begin, spent = time.perf_counter(), time.process_time()

    def note(done: int, every: int, file: str) -> None:
        cpu.append(time.process_time() - spent)
        wall.append(time.perf_counter() - begin)
    run_campaign(folder, folder / 'model.yaml', folder.parent / 'alone', workers=1, progress=note)
    return cpu, wall, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9


def _words(one: float, two: float, load: float) -> str:
    return (f'{one:.0f} s against {two:.0f} s, which includes the start of both; depends on other '
            f'processes: the load was {load:.1f} on {os.cpu_count()} cores')


ROWS = (
    Row('diagnose', '`diagnose` on a log of one muscle', diagnoses),
    Row('benchmark-control', 'the control benchmark', control_benchmark, where_control, long=True),
    Row('campaign', '`campaign` over many small maps', campaign, long=True),
)
