# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Pytest plugin of mutants.py: whose lines run, and how much each test and fixture computes.

Seconds are those of this process on a core, whatever else the machine does. Lines that a fixture
runs for a whole module belong to the fixture, and so to every test that uses it; coverage alone
would give them to none.
"""

import inspect
import json
import os
from pathlib import Path
import signal
from time import process_time

import coverage
from coverage import collector, control, inorout, sqldata
import pytest

_seconds, _fixtures, _failed = {}, {}, set()
_now = ''
#: s; a test that computes for longer is given up, and so is a fixture.
_LONGEST = float(os.environ['MUTANTS_LONGEST'])
#: What coverage calls while it traces.
_COVERAGE = {inspect.getfile(module) for module in (collector, control, inorout, sqldata)}


def pytest_sessionstart():
    """Say what ends a test."""
    signal.signal(signal.SIGPROF, _end)


def _end(number, frame):
    """Let the test fail; not from within coverage, which would keep its lock for ever."""
    while frame:
        if frame.f_code.co_filename in _COVERAGE:
            signal.setitimer(signal.ITIMER_PROF, 0.01)
            return
        frame = frame.f_back
    pytest.fail(f'takes over {_LONGEST:g} s')


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Lines run from here on are those of this test."""
    result = yield from _as(item.nodeid)
    definitions = item._fixtureinfo.name2fixturedefs
    _fixtures[item.nodeid] = sorted({_name(chosen[-1]) for chosen in definitions.values()
                                     if _shared(chosen[-1])})
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup():
    """Let a fixture that computes for too long fail, and each test that uses it."""
    return (yield from _limited())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call():
    """Let a test that computes for too long fail."""
    return (yield from _limited())


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef):
    """Lines run in a fixture of more than one test are the fixture's."""
    if _shared(fixturedef):
        return (yield from _as(_name(fixturedef)))
    return (yield)


def pytest_runtest_logreport(report):
    """Only a test that passes can notice a fault."""
    if report.outcome != 'passed':
        _failed.add(report.nodeid)


def pytest_sessionfinish():
    """Write the tests that passed, with what they use, and the seconds of each."""
    Path(os.environ['MUTANTS_TRACE']).write_text(json.dumps({
        'tests': {test: used for test, used in _fixtures.items() if test not in _failed},
        'seconds': _seconds}))


def _as(name):
    """Run what a hook wraps in a context of coverage of this name; then go back."""
    global _now
    before, began = _now, process_time()
    inner = sum(_seconds.values())
    _now = name
    coverage.Coverage.current().switch_context(name)
    try:
        return (yield)
    finally:
        _now = before
        coverage.Coverage.current().switch_context(before)
        # Without the fixtures made meanwhile, which have a time of their own.
        _seconds[name] = process_time() - began - (sum(_seconds.values()) - inner)


def _limited():
    signal.setitimer(signal.ITIMER_PROF, _LONGEST)
    try:
        return (yield)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _shared(fixturedef):
    return fixturedef.scope != 'function'


def _name(fixturedef):
    return f'{fixturedef.baseid}::fixture {fixturedef.argname}'
