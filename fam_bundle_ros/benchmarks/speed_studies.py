# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows of whole studies: the control benchmark, and `diagnose` on long logs."""

import time

import numpy as np

from fam_bundle_ros.benchmarks import control
from fam_bundle_ros.benchmarks.plants import paper_bundle
from fam_bundle_ros.benchmarks.speed import children, Figure, Row, where_of
from fam_bundle_ros.model import Bundle, Motion

#: Target of the control benchmark on two cores, s.
REACH_CONTROL = 600.0
#: Lengths of the logs for `diagnose`.
SAMPLES = (10_000, 24_000, 100_000)


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


ROWS = (
    Row('diagnose', '`diagnose` on a log of one muscle', diagnoses),
    Row('benchmark-control', 'the control benchmark', control_benchmark, where_control, long=True),
)
