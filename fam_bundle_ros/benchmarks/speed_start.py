# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Row of the start: time until a process has imported, shown its help, or started a node."""

from functools import cache
import importlib.util
import re
import subprocess
import sys
import tempfile

from fam_bundle_ros.benchmarks.speed import children, Figure, Row
from fam_bundle_ros.processes import environment

#: Targets: import, s more than `import numpy`; help, s; node, relative to `import rclpy`.
REACH_IMPORT, REACH_HELP, REACH_NODE = 0.05, 0.3, 1.3
_UP = 'from rclpy.context import Context\nc = Context()\nc.init()\n'
_EMPTY = f"""{_UP}from fam_bundle_ros.nodes.empty import empty_node
empty_node('pressure_pid_mu1', 1, False, c, 'bench')
"""
_NODE = f"""{_UP}from fam_bundle_ros.nodes.pressure_pid import PressurePidNode
PressurePidNode(1, context=c, namespace='bench')
"""
#: Ends the process at once, as the shutdown of rclpy is not measured.
_END = '\nimport os\nos._exit(0)'


def seconds(programs: list[str], repeats: int) -> list[float]:
    """
    Return the shortest CPU time, s, of a new Python process with each program, alternately.

    On an idle machine it is also the wall time, as a start does not wait. The first run of each is
    not counted, so that bytecode exists as after any first start.
    """
    taken: dict[str, list[float]] = {program: [] for program in programs}
    for program in programs * (repeats + 1):
        begin = children()
        subprocess.run([sys.executable, '-c', program + _END], check=True,
                       env=_environment(), capture_output=True)
        taken[program].append(children() - begin)
    return [min(taken[program][1:]) for program in programs]


@cache
def _bytecode() -> tempfile.TemporaryDirectory[str]:
    """Return a folder for the bytecode of all starts; it is removed with this process."""
    return tempfile.TemporaryDirectory(prefix='fam_bundle_')


def _environment() -> dict[str, str]:
    """Return the environment of a process that keeps its bytecode in our folder."""
    return {key: value for key, value in environment().items()
            if key != 'PYTHONDONTWRITEBYTECODE'} | {'PYTHONPYCACHEPREFIX': _bytecode().name}


def measure(scale: float) -> list[Figure]:
    """Return the times of imports, help and a node."""
    helped = 'from fam_bundle_ros.cli import main\nmain(["--help"])'
    ros = importlib.util.find_spec('rclpy') is not None
    programs = ['import numpy', 'import fam_bundle_ros', 'import fam_bundle_ros.model', helped,
                *(['import rclpy', _EMPTY, _NODE] if ros else [])]
    numpy, package, model, shown, *nodes = seconds(programs, max(round(8 * scale), 1))
    figures = [
        Figure('import fam_bundle_ros', package - numpy, 's more than import numpy',
               reach=REACH_IMPORT, note=f'{package:.3f} s, import numpy {numpy:.3f} s'),
        Figure('import fam_bundle_ros.model', model - numpy, 's more than import numpy',
               reach=REACH_IMPORT, note=f'{model:.3f} s'),
        Figure('fam_bundle --help', shown, 's', reach=REACH_HELP)]
    if ros:
        rclpy, empty, node = nodes
        figures += [
            Figure('a pressure_pid up', node, 's', 'import rclpy', rclpy, REACH_NODE,
                   note=f'the same node empty takes {empty / rclpy:.2f} times import rclpy'),
            Figure('a pressure_pid up', node, 's', 'the same node empty', empty, REACH_NODE)]
    return figures


def where(scale: float) -> str:
    """Return which imports of a node take longest, and its construction."""
    timed = _NODE.replace('PressurePidNode(1', 'import time\nt = time.perf_counter()\n'
                          'PressurePidNode(1') + '\nprint(time.perf_counter() - t, flush=True)'
    for _ in range(2):
        done = subprocess.run([sys.executable, '-X', 'importtime', '-c', timed + _END],
                              check=True, env=_environment(), capture_output=True, text=True)
    spent: dict[str, float] = {}
    for own, name in re.findall(r'import time:\s+(\d+) \|\s+\d+ \|\s+(\S+)', done.stderr):
        package = name.partition('.')[0]
        group = package if package in ('rclpy', 'numpy', 'scipy', 'pint', 'yaml', 'numba',
                                       'fam_bundle_ros') else (
            'messages' if package.endswith('_msgs') or package.endswith('_interfaces')
            else 'other modules')
        spent[group] = spent.get(group, 0.0) + 1e-6 * float(own)
    order = sorted(spent.items(), key=lambda item: -item[1])[:5]
    words = [f'{name} {1e3 * value:.0f} ms' for name, value in order]
    return (f"a pressure_pid: imports of {', '.join(words)}; the node itself "
            f'{1e3 * float(done.stdout):.0f} ms')


ROWS = (Row('start', 'until a process is ready', measure, where),)
