# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Rows over ROS: the bundle's nodes compared with empty nodes in the same graph.

Each graph runs in processes of its own, called by name, as only `fam_bundle_ros.nodes` uses ROS.
"""

from functools import partial
import importlib.util
from pathlib import Path
import pstats
from statistics import median
import tempfile
from typing import Any

from fam_bundle_ros.benchmarks.speed import elsewhere, Figure, Row, shares, Skipped

#: Targets of the median latency relative to empty nodes: one process, one process per node.
REACH_ONE, REACH_MANY = 1.15, 1.3
#: Targets relative to empty nodes: steps per second in lock-step, answered samples at 1 kHz.
REACH_STEPS, REACH_FAST = 0.7, 0.95
_MEASURE = 'fam_bundle_ros.nodes.latency:measure'


def pair(scale: float, graph: str = 'bundle', **case: Any) -> tuple[dict, dict]:
    """Return the figures of a graph and of the empty one: medians over alternating blocks."""
    if importlib.util.find_spec('rclpy') is None:
        raise Skipped('rclpy is not installed')
    seconds, blocks = max(2.5 * scale, 0.2), 3 if scale >= 1.0 else 1
    found: dict[str, list[dict[str, float]]] = {'empty': [], graph: []}
    for _ in range(blocks):
        for name, rows in found.items():
            rows.append(elsewhere(_MEASURE, name, seconds=seconds, **case))
    ours, empty = ({key: median(row[key] for row in found[name]) for key in found[name][0]}
                   for name in (graph, 'empty'))
    return ours, empty


def latencies(scale: float) -> list[Figure]:
    """Return the median time from sample to last valve command."""
    cases: tuple[tuple[str, float, dict[str, Any]], ...] = (
        ('one process, 200 Hz', REACH_ONE, {'rate': 200.0}),
        ('one process, 500 Hz', REACH_ONE, {'rate': 500.0}),
        ('one process per node, 200 Hz', REACH_MANY, {'rate': 200.0, 'processes': True}))
    figures = []
    for what, reach, case in cases:
        ours, empty = pair(scale, **case)
        figures.append(Figure(
            what, 1e6 * ours['median'], 'µs', 'empty nodes', 1e6 * empty['median'], reach,
            note=f"p99 {1e6 * ours['p99']:.0f} and {1e6 * empty['p99']:.0f} µs; CPU "
            f"{100 * ours['cpu']:.0f} and {100 * empty['cpu']:.0f} %; {ours['answered']:.0f} and "
            f"{empty['answered']:.0f} answers/s"))
    return figures


def kilohertz(scale: float) -> list[Figure]:
    """Return how many samples per second three pressure loops answer at 1 kHz."""
    ours, empty = pair(scale, 'pids', rate=1000.0, units=3)
    return [Figure('3 pressure loops among empty nodes, 1 kHz', ours['answered'], 'answers/s',
                   'empty nodes', empty['answered'], REACH_FAST, True,
                   f"median {1e6 * ours['median']:.0f} and {1e6 * empty['median']:.0f} µs")]


def lock_step(scale: float) -> list[Figure]:
    """Return steps per second in lock-step, all nodes in one process."""
    ours, empty = pair(scale, lock_step=True)
    return [Figure('one process', ours['answered'], 'steps/s', 'empty nodes', empty['answered'],
                   REACH_STEPS, True)]


def where(scale: float, **case: Any) -> str:
    """Return where the process of all nodes spends its CPU time."""
    with tempfile.TemporaryDirectory(prefix='fam_bundle_') as folder:
        path = Path(folder) / 'profile'
        elsewhere(_MEASURE, 'bundle', seconds=max(3.0 * scale, 0.2), profile=str(path), **case)
        text = shares(pstats.Stats(str(path)), 6)
    return text.replace('nodes/latency.py', 'the executor')


ROWS = (
    Row('latency', 'sensor to valve over ROS', latencies, where),
    Row('kilohertz', 'pressure loops at 1 kHz over ROS', kilohertz),
    Row('lock-step', 'lock-step over ROS', lock_step, partial(where, lock_step=True)),
)
