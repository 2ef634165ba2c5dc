# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Demands below what the model gives at the bottoms of the branches."""

import math

import pytest

from fam_bundle_ros.control import Measurement, RecruitmentController, Reference
from fam_bundle_ros.control.curves import line_at, reach_below
from fam_bundle_ros.control.inverse import lower, Shares
from fam_bundle_ros.model import Bundle, catalogue

DT = 4e-3


def test_the_branch_goes_on_below_its_bottom_along_its_line(made):
    """1 mN/Pa above a bottom at 50 kPa, -4 N: on that line it is at -54 N when empty."""
    table = made()
    assert reach_below(table, 0) == pytest.approx(50.0)
    assert line_at(table, 0, 25e3) == pytest.approx(-29.0)
    assert line_at(table, 0, 50e3) == pytest.approx(-4.0)
    table.useful[0] = 0
    assert reach_below(table, 0) == 0.0


@pytest.mark.parametrize(('missing', 'pressures', 'left'), [
    (3.0, (50e3, 50e3), 3.0), (-50.0, (50e3, 25e3), 0.0), (-100.0, (50e3, 0.0), 0.0),
    (-125.0, (25e3, 0.0), 0.0), (-160.0, (0.0, 0.0), -10.0)])
def test_the_last_unit_is_lowered_first(made, missing, pressures, left):
    """Until it is empty, then the one before; what both cannot give is missing still."""
    table = made()
    shares = Shares([50e3, 50e3], [-4.0, -4.0], missing)
    lower(table, [0, 1], 2, shares)
    assert shares.pressure == pytest.approx(pressures)
    assert shares.missing == pytest.approx(left)
    assert sum(shares.force) == pytest.approx(-8.0 + min(missing, 0.0) - min(left, 0.0))
    assert table.lowered == [int(pressures[0] < 50e3), int(pressures[1] < 50e3)]


@pytest.mark.parametrize('lowest', [12.0, 2.0])
def test_a_bundle_that_pulls_more_than_its_model_at_the_bottom_comes_down_gently(
        paper_bundle, lowest):
    """
    Muscles without push-back, pulling where the model says that they push, are lowered.

    Neither is vented at once, whether the last one must be empty for the demand or not.
    """
    controller = RecruitmentController(paper_bundle)

    def truth(pressure):
        return 1.7e-4 * sum(pressure) - 6.0
    pressure, before, states = [0.0, 0.0], None, []
    for k in range(round(9.0 / DT)):
        wanted = min(5.0 + 20.0 * k * DT, 60.0) if k * DT < 4.0 else max(
            60.0 - 20.0 * (k * DT - 4.0), lowest)
        rate = 0.0 if wanted in (60.0, lowest) else 20.0 if k * DT < 4.0 else -20.0
        force = truth(pressure)
        command = controller.update(DT, Measurement(force, 0.16, 0.0, pressure),
                                    Reference('force', wanted, rate))
        if k * DT > 4.5:
            assert abs(force - before) < 0.5
            states.append(command.state)
        before = force
        # As pressure loops: a lag of a few samples.
        pressure = [p + 0.5 * (q - p) for p, q in zip(pressure, command.pressure)]
    assert truth(pressure) == pytest.approx(lowest, abs=0.3)
    assert min(states) >= 1


@pytest.mark.parametrize('vented', [0.0, 1.0, 6.0])
@pytest.mark.parametrize('strain', [0.05, 0.16, 0.2])
def test_a_demand_that_the_vented_bundle_meets_switches_nothing_on(paper_bundle, strain, vented):
    """
    Muscles that push back less than their model, or a load cell with an offset, at zero force.

    The last unit is released once, without a bump: in RS0 there is no error left.
    """
    controller = RecruitmentController(paper_bundle)
    pressure, states = [0.0, 0.0], []
    for k in range(round(10.0 / DT)):
        time = k * DT
        wanted, rate = (5.0 + 20.0 * time, 20.0) if time < 2.5 else (55.0, 0.0)
        if time > 4.0:
            wanted, rate = max(55.0 - 20.0 * (time - 4.0), 0.0), -20.0
        force = 1.7e-4 * sum(pressure) + vented
        rate = rate if wanted > 0.0 else 0.0
        command = controller.update(DT, Measurement(force, strain, 0.0, pressure),
                                    Reference('force', wanted, rate))
        if time > 6.0:
            assert abs(force - max(wanted, vented)) < 1.0
            states.append(command.state)
        pressure = [p + 0.5 * (q - p) for p, q in zip(pressure, command.pressure)]
    assert states[-1] == 0
    assert states == sorted(states, reverse=True)


@pytest.mark.parametrize('onset', [0.0, 60e3, 100e3])
@pytest.mark.parametrize('strain', [0.12, 0.16])
def test_a_muscle_that_pulls_before_its_model_does_is_not_switched_for_ever(
        paper_bundle, strain, onset):
    """
    On slack ends MU2 pulls from a lower pressure than its model; the demand is 2 N beyond RS1.

    In RS2 the feedback hides that RS1 does not have the force: MU2 is released once and brought
    back, both slowly, and then no more. With a fast return the force was 14 to 28 N too large.
    """
    model = Bundle('slack', paper_bundle.motor_units, [
        *(each for each in paper_bundle.effects if each.name != 'resistive_buckling'),
        catalogue.get('tendon_slack')()])
    controller, limit = RecruitmentController(model), paper_bundle.max_pressure[0]

    def truth(pressure):
        first = model.unit_forces(strain, [pressure[0], 0.0])[0]
        return 0.9 * float(first) + 2.7e-4 * max(pressure[1] - onset, 0.0)
    wanted, pressures, states = truth([limit, 0.0]) + 2.0, [[0.0, 0.0]] * 3, []
    for k in range(round(12.0 / DT)):
        share = min(0.5 + 0.5 * k * DT, 1.0)
        late = pressures[-3]
        command = controller.update(DT, Measurement(truth(late), strain, 0.0, late), Reference(
            'force', share * wanted, 0.5 * wanted if share < 1.0 else 0.0))
        pressures.append([p + 0.4 * (q - p) for p, q in zip(pressures[-1], command.pressure)])
        if k * DT > 1.5:
            assert truth(late) == pytest.approx(wanted, abs=2.5 if k * DT < 8.0 else 0.1)
            states.append(command.state)
    assert sum(a > b for a, b in zip(states, states[1:])) <= 1
    assert set(states[-round(4.0 / DT):]) == {2}


def test_a_lowered_unit_whose_bottom_is_gone_may_read_less_than_nothing(paper_bundle):
    """The strain falls to where the model has no push-back, and the empty unit reads -0.5 kPa."""
    controller = RecruitmentController(paper_bundle)
    for _ in range(50):
        controller.update(DT, Measurement(20.0, 0.16, 0.0, [30e3, 0.0]),
                          Reference('force', 5.0))
    assert controller.memory.table.lowered[0] == 1
    for _ in range(50):
        command = controller.update(DT, Measurement(0.1, -0.005, 0.0, [-500.0, -500.0]),
                                    Reference('force', 30.0))
    assert command.pressure[0] > 0.0
    assert math.isfinite(command.demand)
