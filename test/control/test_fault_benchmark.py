# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the safety benchmark calls safe, harmless, unsafe and a false alarm."""

import math

import numpy as np
import pytest

from fam_bundle_ros.benchmarks import faults
from fam_bundle_ros.benchmarks.fault_verdicts import judge, Limits, summarise
from fam_bundle_ros.benchmarks.faults import Case, ONSET
from fam_bundle_ros.plant import Faults
from fam_bundle_ros.plant.faults import fault_record
from fam_bundle_ros.report.fault_tables import markdown

BROKEN = Case('mu1 pressure frozen', 'ramp', 'neglect')
SOUND = Case('nothing', 'ramp', 'neglect')
LIMITS = Limits(np.array([400e3, 400e3]), np.array([450e3, 450e3]), 300.0, (0.0, 0.3))
DT = 0.01


def run(events=(), kind='force', end=4.5):
    """
    Return a record: regulating at 200 kPa, and from a time on what the events say.

    An event is (time, changes) of pressure, force, strain, command (of both valves), cut, state.
    """
    rows = {'pressure': (200e3, 200e3), 'force': 100.0, 'strain': 0.1, 'command': (0.0, 0.0),
            'cut': False, 'states': ('ACTIVE', 'ACTIVE')}
    times = np.arange(-0.5, end, DT) + DT
    record = {name: [] for name in rows}
    pending = sorted(events, key=lambda event: event[0])
    for time in times:
        while pending and pending[0][0] <= time + 1e-9:
            rows = rows | pending.pop(0)[1]
        for name, value in rows.items():
            record[name].append(value)
    found = {name: value if name == 'states' else np.array(value)
             for name, value in record.items()}
    return {**found, 'time': times, 'reference': np.full(len(times), 100.0), 'kind': kind}


VENT = {'command': (-1.0, -1.0)}
LATCH = {'states': ('NO_RESPONSE', 'ACTIVE')}


def test_fault_that_nobody_notices_and_that_changes_nothing_is_harmless():
    """Within all limits and without a notice: harmless, with what the task lost."""
    row = judge(BROKEN, run([(1.0, {'force': 130.0}), (2.0, {'force': 100.0})]), LIMITS)
    assert row['verdict'] == 'harmless'
    assert (row['detected'], row['time_to_detect'], row['time_to_safe']) == (False, None, None)
    assert row['force_error'] == pytest.approx(30.0)


def test_noticed_and_vented_is_safe_with_times_from_the_fault():
    """Times count from the fault; valves that exhaust before a notice are the task's own."""
    row = judge(BROKEN, run([(0.1, VENT), (0.2, {'command': (0.0, 0.0)}),
                             (ONSET + 0.3, LATCH), (ONSET + 0.34, VENT)]), LIMITS)
    assert row['verdict'] == 'safe'
    assert row['noticed'] == 'NO_RESPONSE'
    assert row['time_to_detect'] == pytest.approx(0.3, abs=1.1 * DT)
    assert row['time_to_safe'] == pytest.approx(0.34, abs=1.1 * DT)


@pytest.mark.parametrize('change', [
    {'pressure': (200e3, 460e3)}, {'force': 310.0}, {'strain': 0.3}],
    ids=['pressure', 'force', 'strain'])
def test_leaving_a_limit_is_unsafe_though_it_was_noticed(change):
    """No notice makes good for a pressure, force or strain that left its limits once."""
    events = [(ONSET + 0.1, change), (ONSET + 0.2, LATCH | VENT | {
        'pressure': (0.0, 0.0), 'force': 0.0, 'strain': 0.0})]
    assert judge(BROKEN, run(events), LIMITS)['verdict'] == 'unsafe'
    before = [(0.1, change), (0.5, {'pressure': (200e3, 200e3), 'force': 100.0, 'strain': 0.1})]
    assert judge(BROKEN, run(before), LIMITS)['verdict'] == 'harmless'


@pytest.mark.parametrize(('late', 'change', 'verdict'), [
    (0.02, VENT, 'safe'), (0.02, {'cut': True}, 'safe'), (0.2, VENT, 'unsafe'),
    (0.02, {'command': (-1.0, 0.5)}, 'unsafe')],
    ids=['all exhaust', 'supply cut', 'late', 'one unit goes on'])
def test_latch_must_make_the_whole_bundle_safe_at_once(late, change, verdict):
    """All valves exhaust or the supply is cut within 50 ms of a latch."""
    row = judge(BROKEN, run([(1.5, LATCH), (1.5 + late, change)]), LIMITS)
    assert row['verdict'] == verdict


def test_air_after_a_latch_without_enable_is_unsafe():
    """Pressure that comes back by itself is what a latch is there to prevent."""
    back = [(1.5, LATCH | VENT), (3.5, {'states': ('ACTIVE', 'ACTIVE'), 'command': (0.4, 0.0)})]
    row = judge(BROKEN, run(back), LIMITS)
    assert (row['came_back'], row['verdict']) == (True, 'unsafe')
    shut = [(1.5, LATCH | VENT), (3.5, {'cut': True, 'command': (0.4, 0.0)})]
    assert not judge(BROKEN, run(shut), LIMITS)['came_back']


@pytest.mark.parametrize(('lasts', 'back'), [(0.5, False), (2.2, True)])
def test_only_a_short_loss_may_end_by_itself(lasts, back):
    """A vent without latch may end by itself within `resume_within`, not after it."""
    events = [(1.0, VENT | {'states': ('ACTIVE', 'SENSOR')}),
              (1.0 + lasts, {'states': ('ACTIVE', 'ACTIVE'), 'command': (0.4, 0.4)})]
    assert judge(BROKEN, run(events), LIMITS)['came_back'] == back


@pytest.mark.parametrize(('pressure', 'answer', 'verdict'), [
    (420e3, 'accepted', 'unsafe'), (420e3, 'refused', 'safe'), (300e3, 'accepted', 'safe')])
def test_enable_must_be_refused_while_a_unit_is_above_the_trip(pressure, answer, verdict):
    """What comes back after `enable` is allowed; what it may be called on is not anything."""
    case = Case('mu1 valve reversed', 'enabled', 'neglect')
    record = run([(1.5, LATCH | VENT | {'pressure': (pressure, 0.0)}),
                  (faults.PRESSED + 0.1, {'states': ('ACTIVE', 'ACTIVE'), 'command': (0.4, 0.0)})])
    row = judge(case, {**record, 'enable': answer}, LIMITS)
    assert (row['verdict'], row['came_back'], row['enable']) == (verdict, False, answer)
    alone = judge(Case('mu1 valve reversed', 'ramp', 'neglect'), record, LIMITS)
    assert alone['came_back']


def test_notice_of_nothing_is_a_false_alarm():
    """Where nothing is wrong any state but ACTIVE counts, from the start of the log."""
    assert judge(SOUND, run(), LIMITS)['verdict'] == 'quiet'
    for state in ('HOLD', 'LATCHED LATE'):
        row = judge(SOUND, run([(0.2, {'states': (state, 'ACTIVE')}),
                                (0.3, {'states': ('ACTIVE', 'ACTIVE')})]), LIMITS)
        assert (row['verdict'], row['noticed']) == ('false alarm', state)


def test_worst_fault_comes_first_with_the_worst_of_its_runs():
    """Unsafe before safe, the higher pressure first; times and pressures are the largest."""
    high = run([(1.0, {'pressure': (600e3, 0.0)})])
    higher = run([(1.0, {'pressure': (650e3, 0.0)})])
    slow, quick = (run([(ONSET + t, LATCH | VENT)]) for t in (0.5, 0.1))
    cases = [('force nan', slow), ('force nan', quick), ('mu1 burst', high),
             ('mu1 leaks', run()), ('mu1 leaks', higher)]
    lines = summarise(judge(Case(name, 'ramp', 'neglect'), record, LIMITS)
                             for name, record in cases)
    assert [line['fault'] for line in lines] == ['mu1 leaks', 'mu1 burst', 'force nan']
    assert (lines[0]['runs'], lines[0]['unsafe'], lines[0]['harmless']) == (2, 1, 1)
    assert lines[0]['pressure'] == 650e3
    assert lines[2]['time_to_detect'] == pytest.approx(0.5, abs=1.1 * DT)


def test_limit_is_the_trip_and_what_flows_in_and_never_above_the_relief(paper_bundle):
    """Two control periods at full opening above the trip; at most where a relief valve opens."""
    rig = faults.rig_of(BROKEN)
    quick, slow = (Limits.of(paper_bundle, rig, rate) for rate in (2000.0, 200.0))
    assert quick.trip == pytest.approx([1.15 * 344.7e3] * 2)
    # From 396 kPa in 1 ms at some 10 to 30 MPa/s.
    assert np.all((quick.pressure > quick.trip + 10e3) & (quick.pressure < quick.trip + 30e3))
    assert slow.pressure == pytest.approx([500e3] * 2)


@pytest.mark.parametrize('phase', [*faults.PHASES, faults.WORK])
def test_phase_asks_for_what_the_bundle_can_do_and_says_how_fast(paper_bundle, phase):
    """The rate is the slope of the reference, which stays within the reach of the bundle."""
    seconds = 25.0 if phase == faults.WORK else faults.END
    plan = faults.trajectory_of(Case('nothing', phase, 'neglect', 1, seconds), paper_bundle)
    times = np.arange(0.0013, plan.duration, 0.01)
    slope = np.array([(plan.value(t + 1e-6) - plan.value(t - 1e-6)) / 2e-6 for t in times])
    rate = np.array([plan.rate(t) for t in times])
    assert rate == pytest.approx(slope, rel=1e-3, abs=1e-3 * max(1.0, abs(slope).max()))
    values = np.array([plan.value(t) for t in times])
    reach = (float(paper_bundle.force(0.1, paper_bundle.max_pressure)) if plan.kind == 'force'
             else 0.2)
    assert 0.0 < values.min()
    assert values.max() < 0.9 * reach


def test_every_fault_strikes_in_every_phase_and_is_repaired(paper_bundle):
    """200 runs and more in lock-step; each has its fault for longer than a loss may last."""
    cases = faults.cases_of(list(faults.FAULTS), faults.PHASES, faults.POLICIES)
    assert len({str(case) for case in cases}) == len(cases) >= 200
    assert all(case.lock_step for case in cases)
    for case in cases:
        plan = faults.trajectory_of(case, paper_bundle)
        (begin, broken), (end, repaired) = plan.faults
        assert broken != Faults() == repaired
        assert end - begin > faults.RESUME_WITHIN
        fault_record(broken, 0.0, 2)


def test_page_has_every_fault_and_says_what_the_words_mean():
    """The Markdown has a row for each fault, and the conditions of the runs."""
    rows = [judge(BROKEN, run([(1.0, {'pressure': (600e3, 0.0)})]), LIMITS),
            judge(SOUND, run(), LIMITS)]
    lines = summarise(rows)
    page = markdown({
        'conditions': {'supply': 600.0, 'trip': 396.0, 'pressure': 500.0, 'relief': 500.0,
                       'rate': 200.0, 'lasts': 2.5, 'pressed': 1.5, 'phases': ['ramp'],
                       'policies': ['neglect']},
        'faults': [lines[0]], 'sound': [lines[1]], 'rows': rows})
    assert '| mu1 pressure frozen | 1 | 1 | 0 | 0 | 0 | – | – | 600 |' in page
    assert '| nothing | 1 | 0 |' in page
    assert '`fam_bundle benchmark-faults --policies neglect --out docs/results/faults.md`' in page
    assert '600 kPa and neither a trip' in page
    assert math.isclose(page.count('\n| ---'), 2)
