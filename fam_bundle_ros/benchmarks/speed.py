# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Rows of `fam_bundle bench` and the measurement of their times.

Every figure has a peer, an alternative measured in the same run, and a target. The rows are in the
modules ``speed_*``.
"""

from collections.abc import Callable, Iterable
import cProfile
from dataclasses import dataclass, field
import json
import os
from pathlib import Path
import platform
import pstats
import resource
import subprocess
import sys
import time
from typing import Any

from fam_bundle_ros import kernels
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.processes import environment

#: Column titles of `Figure.cells`.
FIGURE_HEAD = ('what', 'measured', 'unit', 'peer value', 'peer', 'ratio', 'target', '')


class Skipped(Exception):
    """A row that cannot be measured, for the reason in the text."""


@dataclass(frozen=True)
class Figure:
    """One measured number."""

    #: Which case of the row.
    what: str
    value: float
    unit: str
    #: Name of the peer; empty for none.
    peer: str = ''
    #: The peer's number, in the same unit and from the same run.
    beside: float | None = None
    #: Target of value/beside, or of the value itself without a peer.
    reach: float | None = None
    #: Whether the target is a lower limit.
    at_least: bool = False
    note: str = ''

    @property
    def ratio(self) -> float | None:
        """Value divided by the peer's."""
        return None if not self.beside else self.value / self.beside

    @property
    def reached(self) -> bool | None:
        """Whether the target is reached; None without a target."""
        if self.reach is None:
            return None
        found = self.value if self.ratio is None else self.ratio
        return found >= self.reach if self.at_least else found <= self.reach

    @property
    def cells(self) -> tuple[Any, ...]:
        """Row of a table under `FIGURE_HEAD`."""
        target = '' if self.reach is None else (
            f"{'at least' if self.at_least else 'at most'} {self.reach:g}")
        verdict = {True: 'reached', False: 'not reached', None: ''}[self.reached]
        return (self.what, self.value, self.unit, self.beside, self.peer, self.ratio, target,
                verdict)

    def to_json(self) -> dict[str, Any]:
        """Return the fields, ratio and verdict."""
        return {**self.__dict__, 'ratio': self.ratio, 'reached': self.reached}


@dataclass(frozen=True)
class Row:
    """A family of figures."""

    #: For ``--only``.
    name: str
    what: str
    #: Called with the share of the usual work (1; small in tests); may raise `Skipped`.
    measure: Callable[[float], list[Figure]]
    #: Returns as text where the time is spent; called when a target is not reached.
    where: Callable[[float], str] | None = None
    #: Takes minutes: measured only when it is named.
    long: bool = False


@dataclass
class Result:
    """Result of a row: its figures, or why there are none, and where the time is spent."""

    row: Row
    figures: list[Figure] = field(default_factory=list)
    skipped: str = ''
    where: str = ''
    seconds: float = 0.0

    @property
    def remarks(self) -> list[str]:
        """Why there are no figures, notes on figures, and where the time is spent."""
        found = [f'not measured: {self.skipped}'] if self.skipped else []
        found += [f'{figure.what}: {figure.note}' for figure in self.figures if figure.note]
        if self.where:
            found.append(f'time spent in: {self.where}')
        return found

    def to_json(self) -> dict[str, Any]:
        """Return all of it for ``json.dump``."""
        return {'name': self.row.name, 'what': self.row.what, 'skipped': self.skipped,
                'where': self.where, 'seconds': self.seconds,
                'figures': [figure.to_json() for figure in self.figures]}


def choose(rows: Iterable[Row], only: Iterable[str]) -> list[Row]:
    """Return the named rows, all but the long ones without names; InputError for other names."""
    by_name = {row.name: row for row in rows}
    names = list(only)
    for name in names:
        if name not in by_name:
            raise InputError(f"--only: '{name}' is not a row; expected some of "
                             f"{', '.join(by_name)}")
    return [by_name[name] for name in names] or [row for row in by_name.values() if not row.long]


def run(row: Row, scale: float = 1.0) -> Result:
    """Measure a row with a share ``scale`` of the usual amount of work."""
    result, begin = Result(row), time.perf_counter()
    try:
        result.figures = row.measure(scale)
        if row.where is not None and any(each.reached is False for each in result.figures):
            result.where = row.where(scale)
    except Skipped as reason:
        result.skipped = str(reason)
    result.seconds = time.perf_counter() - begin
    return result


def machine() -> dict[str, Any]:
    """Return a description of the machine."""
    engine = kernels.numba()
    return {'cores': os.cpu_count(), 'machine': platform.machine(),
            'system': platform.system(), 'python': platform.python_version(),
            'numba': None if engine is None else engine.__version__,
            'load': os.getloadavg()[0]}


# --- taking times ------------------------------------------------------------------------------

def best(call: Callable[[], Any], budget: float = 0.5, least: int = 3) -> float:
    """Return the shortest CPU time of a call, s; see `paired`."""
    return paired([call], budget, least)[0]


def paired(calls: list[Callable[[], Any]], budget: float = 0.5, least: int = 3) -> list[float]:
    """
    Return the shortest CPU time of each call, s, as other programs can only lengthen it.

    Parameters
    ----------
    calls : list of callable
        Called alternately, under the same load of the machine; each is called once before.
    budget : float, s
        Wall time for repeats.
    least : int
        Smallest number of repeats.
    """
    shortest = [float('inf')] * len(calls)
    for call in calls:
        call()
    end, count = time.perf_counter() + budget, 0
    while count < least or time.perf_counter() < end:
        count += 1
        for k, call in enumerate(calls):
            begin = time.process_time()
            call()
            shortest[k] = min(shortest[k], time.process_time() - begin)
    return shortest


def children() -> float:
    """Return the CPU time of all processes that this one has started, s."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def elsewhere(function: str, *arguments: Any, plain: bool = False, **keywords: Any) -> Any:
    """
    Call a function in a fresh process and return its result.

    Parameters
    ----------
    function : str
        ``package.module:name``; arguments and result must be serialisable as JSON.
    plain : bool
        Without numba.

    Raises
    ------
    Skipped
        When the function fails; the text is the last line of its error.
    """
    module, _, name = function.partition(':')
    code = (f'import json, sys; from {module} import {name} as call; '
            'given = json.loads(sys.argv[1]); '
            'print(chr(10) + json.dumps(call(*given[0], **given[1])))')
    variables = environment() | ({kernels.PLAIN_VARIABLE: '1'} if plain else {})
    done = subprocess.run([sys.executable, '-c', code, json.dumps([arguments, keywords])],
                          capture_output=True, text=True, env=variables, check=False)
    if done.returncode:
        raise Skipped(f'{name}: {(done.stderr.strip().splitlines() or ["no reason given"])[-1]}')
    return json.loads(done.stdout.strip().splitlines()[-1])


# --- profiles ----------------------------------------------------------------------------------

def where_of(call: Callable[[], Any]) -> str:
    """Return the functions in which a call spends most of its CPU time, with their shares."""
    profiler = cProfile.Profile(time.process_time)
    profiler.enable()
    call()
    profiler.disable()
    return shares(pstats.Stats(profiler))


def shares(stats: pstats.Stats, top: int = 4) -> str:
    """
    Return where the time of a profile was spent, as ``model/bundle.py 31 %, ...``.

    Time in C functions is assigned to the calling file; a library is one entry.
    """
    spent: dict[str, float] = {}
    for (file, _, _), (_, _, own, _, callers) in stats.stats.items():  # type: ignore[attr-defined]
        if file != '~':
            spent[_place(file)] = spent.get(_place(file), 0.0) + own
            continue
        for (caller, _, _), numbers in callers.items():
            spent[_place(caller)] = spent.get(_place(caller), 0.0) + numbers[2]
    total = sum(spent.values()) or 1.0
    order = sorted(spent.items(), key=lambda item: -item[1])[:top]
    return ', '.join(f'{name} {100.0 * value / total:.0f} %' for name, value in order)


def _place(file: str) -> str:
    parts = Path(file).parts
    if kernels.PACKAGE in parts:
        last = len(parts) - 1 - parts[::-1].index(kernels.PACKAGE)
        return '/'.join(parts[last + 1:])
    if 'site-packages' in parts:
        return parts[parts.index('site-packages') + 1]
    return 'Python'
