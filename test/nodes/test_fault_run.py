# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs with faults through the nodes: as without ROS, and what is noted of them."""

import numpy as np
import pytest

from fam_bundle_ros.benchmarks import faults
from fam_bundle_ros.benchmarks.fault_verdicts import judge, Limits
from fam_bundle_ros.benchmarks.faults import Case, ONSET
from fam_bundle_ros.nodes import fault_processes
from fam_bundle_ros.nodes.fault_run import run_with_faults
from fam_bundle_ros.nodes.session import run_trajectory
from fam_bundle_ros.plant import Dynamometer, Faults, RigConfig, SensorConfig
from fam_bundle_ros.simulation import ClosedLoop, Trajectory

IDEAL = RigConfig(sensors=SensorConfig.ideal())


@pytest.mark.parametrize('broken', [Faults(burst={0}), Faults(supply=0.0, stuck_valve={0: 1.0})],
                         ids=['burst', 'no supply'])
def test_faults_strike_over_ros_as_they_do_without(domain_id, paper_bundle, broken):
    """A trajectory's fault acts in the same tick and on the same physics in both."""
    plan = Trajectory('hold', 'force', 0.6, lambda t: 40.0, lambda t: 0.0, Dynamometer(0.1),
                      prepare=0.3, faults=((0.5, broken),))
    ros = run_trajectory(paper_bundle, plan, rig=IDEAL, domain=domain_id,
                         overrides={'stuck_time': 0.0, 'monitor': False})
    library = ClosedLoop(paper_bundle, rig=IDEAL, period=5e-3, pid_period=5e-3).run(plan)
    strikes = np.searchsorted(ros.time, 0.5 + 1e-9)
    same = slice(strikes + 2)
    assert ros.pressure[same, 0] == pytest.approx(library.pressure[same, 0], rel=0.02, abs=2e3)
    assert ros.pressure[strikes - 1, 0] > 100e3
    assert abs(ros.pressure[strikes + 5, 0] - ros.pressure[strikes - 1, 0]) > 50e3


@pytest.mark.parametrize(('fault', 'phase', 'verdict'), [
    ('mu1 pressure nan', 'ramp', 'safe'), ('mu1 valve stuck open', 'transition', 'safe'),
    ('nothing', 'ramp', 'quiet')])
def test_run_is_judged_by_what_is_true_at_the_rig(domain_id, paper_bundle, fault, phase, verdict):
    """
    A reading of nan is noticed at once and vented; where nothing is wrong nobody notices.

    A valve that hangs open at the top is found at once, and the supply cut with that answer.
    """
    case = Case(fault, phase, 'reversal_aware')
    rig = faults.rig_of(case)
    record = run_with_faults(paper_bundle, faults.trajectory_of(case, paper_bundle), rig,
                             faults.node_parameters(case), seed=1, domain=domain_id)
    row = judge(case, record, Limits.of(paper_bundle, rig))
    assert row['verdict'] == verdict
    if fault == 'nothing':
        assert row['force_error'] < 5.0
        return
    assert row['time_to_detect'] < 0.05
    assert row['time_to_safe'] < 0.5
    after = record['time'] > ONSET + 1.0
    assert record['pressure'][after].max() < 5e3


def test_somebody_calls_enable_while_the_fault_is_there(domain_id, paper_bundle):
    """A pressure that drifted past the trip unseen is not enabled: the force tells."""
    case = Case('mu1 pressure drifts by -50 kPa/s', 'enabled', 'reversal_aware')
    rig = faults.rig_of(case)
    record = run_with_faults(paper_bundle, faults.trajectory_of(case, paper_bundle), rig,
                             faults.node_parameters(case), enable_at=case.enable_at,
                             domain=domain_id)
    assert record['enable'] == 'refused'
    assert record['time'][-1] == pytest.approx(faults.END)
    row = judge(case, record, Limits.of(paper_bundle, rig))
    assert row['verdict'] == 'safe'


def test_controller_that_is_killed_leaves_no_pressure_and_is_seen(domain_id, monkeypatch):
    """Five processes, one of them killed: valves exhaust by themselves, and the row says when."""
    for name, seconds in {'_WATCHED': 0.8, '_STEADY': 0.2, '_ANSWERED': 0.2}.items():
        monkeypatch.setattr(fault_processes, name, seconds)
    row, = fault_processes.run_processes(nodes=['recruitment_controller'], events=['killed'],
                                         domain=domain_id)
    assert row['verdict'] == 'safe'
    assert 0.0 < row['time_to_safe'] < 5.0
    assert not row['came_back']
    assert row['enable'] in ('not there', 'no answer')
    assert 50e3 < row['pressure'] < 450e3
