# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Recruitment where RS1 and RS2 overlap: margins, hysteresis, dwelling, look-ahead."""

import numpy as np
import pytest

from fam_bundle_ros.control import (
    Allocator,
    Instant,
    Measurement,
    OuterConfig,
    Reference,
    SwitchingConfig,
)
from fam_bundle_ros.control.recruitment import RecruitmentMachine
from fam_bundle_ros.control.switching import Demand

from .at_once import Bench, DT, OPEN, switches


def ease(bench, low, end, duration):
    """Return the commands of a rise along half a cosine."""
    phase = np.linspace(0.0, np.pi, round(duration / DT))
    force = low + 0.5 * (end - low) * (1.0 - np.cos(phase))
    rate = 0.5 * (end - low) * np.pi / duration * np.sin(phase)
    return [bench.update(*now) for now in zip(force, rate)]


def test_neglect_nets_the_bias_against_forces_that_are_not_below_zero(paper_bundle):
    """A vented bundle that pushes back is believed to give nothing."""
    bench = Bench(paper_bundle, 0.2, policy='neglect')
    bench.controller.update(DT, Measurement(-2.0, 0.2, 0.0, np.zeros(2)), Reference('force', 0.0))
    for _ in range(2000):
        bench.controller.update(DT, Measurement(-2.0, 0.2, 0.0, np.zeros(2)),
                                Reference('force', 0.0))
    observer = bench.controller.outer.observer
    # these pressures follow no command, which is asked for besides
    assert observer.bias + observer.short == pytest.approx(-2.0, abs=0.01)


def test_neglect_dips_where_reversal_aware_does_not(paper_bundle):
    """Without the push-back in its model the controller asks for forces that do not come."""
    bench = Bench(paper_bundle, 0.16, policy='neglect', outer=OPEN)
    bench.hold(30.0, 0.5)
    errors = [bench.bundle.force(0.16, c.pressure) - c.demand
              for c in bench.ramp(30.0, 60.0, 15.0)]
    assert min(errors) < -0.5


@pytest.mark.parametrize('share', [0.0, 0.9, 1.0])
def test_no_chatter_while_dwelling_in_the_overlap(paper_bundle, share):
    """Anywhere in the overlap, with twice the noise of the sensor: at most one switch."""
    bench = Bench(paper_bundle, 0.16, noise=1.8, seed=3)
    level = bench.curves.crossing[1] + share * (bench.curves.top[1] - bench.curves.crossing[1])
    bench.hold(0.5 * level, 0.5)
    commands = bench.ramp(0.5 * level, level, 20.0) + bench.hold(level, 10.0)
    assert np.count_nonzero(switches(commands)) <= 1


def test_neglect_chatters_where_reversal_aware_does_not(paper_bundle):
    """At the limit of RS1 noise alone switches the naive policy to and fro."""
    bench = Bench(paper_bundle, 0.16, noise=0.9, seed=3, policy='neglect')
    level = bench.curves.top[1]
    bench.hold(0.5 * level, 0.5)
    commands = bench.ramp(0.5 * level, level, 20.0) + bench.hold(level, 10.0)
    assert np.count_nonzero(switches(commands)) > 5


def test_a_demand_that_stops_inside_the_overlap_stays_in_the_cheaper_state(paper_bundle):
    """A demand that visibly slows down for the middle of the overlap needs no second unit."""
    bench = Bench(paper_bundle, 0.16, outer=OPEN)
    middle = 0.5 * (bench.curves.crossing[1] + bench.curves.top[1])
    bench.hold(20.0, 0.5)
    for x in np.linspace(0.0, 1.0, 500):
        s = x ** 3 * (10.0 - 15.0 * x + 6.0 * x * x)
        rate = 30.0 * x * x * (1.0 - x) ** 2 * (middle - 20.0) / 2.0
        command = bench.update(20.0 + s * (middle - 20.0), rate)
    assert command.state == 1
    assert command.saturated == ''


@pytest.mark.parametrize('room', [0.06, 1.0])
@pytest.mark.parametrize('duration', [0.8, 3.0, 20.0])
def test_a_demand_that_eases_to_rest_below_the_limit_recruits_nothing(
        paper_bundle, duration, room):
    """Where it slows down is seen: from 20 N on half a cosine, to within 1 N of the limit."""
    bench = Bench(paper_bundle, 0.16, outer=OPEN)
    end = bench.curves.top[1] - room
    commands = bench.hold(20.0, 1.0) + ease(bench, 20.0, end, duration) + bench.hold(end, 1.0)
    assert {c.state for c in commands} == {1}
    assert bench.bundle.force(0.16, bench.pressure) == pytest.approx(end, abs=0.3)


def test_noise_of_the_force_recruits_nothing_just_below_the_limit(paper_bundle):
    """0.9 N of noise, 0.1 N below: what the observer finds in it may be noise."""
    for seed in (2, 9):  # some readings in a row are off to one side
        bench = Bench(paper_bundle, 0.16, noise=0.9, seed=seed, outer=OuterConfig(delay=0.0))
        end = bench.curves.top[1] - 0.1
        bench.ramp(2.0, 30.0, 20.0)
        commands = ease(bench, 30.0, end, 10.0) + bench.hold(end, 8.0)
        assert {c.state for c in commands} == {1}


def test_a_lead_that_is_learnt_is_no_acceleration_of_the_demand(paper_bundle):
    """Half a millisecond more of it at 20 N/s leaves where the demand is heading as it was."""
    heading = []
    for learnt in (0.0, 5e-4):
        bench = Bench(paper_bundle, 0.16, outer=OPEN)
        bench.ramp(10.0, 25.0, 20.0)
        bench.controller.memory.adaptation.lead += learnt
        bench.update(25.1, 20.0)
        demand = bench.controller.memory.demand
        heading.append((demand.rate, demand.acceleration, demand.jerk))
    assert heading[1] == pytest.approx(heading[0], abs=1e-6)
    assert heading[0][0] == pytest.approx(20.0, abs=0.1)


def test_uncertainty_widens_the_margin(paper_bundle):
    """The demand must exceed the limit by more than its own uncertainty, or by what was set."""
    curves = Allocator(paper_bundle).curves(Instant(0.16))
    above = curves.top[1] + 1.0
    for uncertainty, margin, state in ((0.5, None, 2), (2.0, None, 1), (0.0, 2.0, 1)):
        machine = RecruitmentMachine(2, SwitchingConfig(margin=margin))
        machine.reset(1)
        machine.update(DT, curves, Demand(above, uncertainty=uncertainty))
        assert machine.state == state


@pytest.mark.parametrize(('policy', 'wide'), [('reversal_aware', 0.5), ('hysteresis', 0.5),
                                              ('hysteresis', 2.0)])
def test_a_demand_that_comes_and_goes_switches_only_past_both_levels(paper_bundle, policy, wide):
    """Recruits past limit and margin, releases past margin and band below crossing or limit."""
    curves = Allocator(paper_bundle).curves(Instant(0.16))
    dip = curves.dip[curves.order[1]]
    margin, band = 1.0, wide * dip
    released = (curves.crossing[1] - margin - band if policy == 'reversal_aware' else
                curves.top[1] - margin - max(band, dip))
    machine = RecruitmentMachine(2, SwitchingConfig(policy=policy, margin=margin, hysteresis=band))
    machine.reset(1)
    states = []
    for demand in (curves.top[1] + margin - 0.1, curves.top[1] + margin + 0.1, released + 0.1,
                   curves.top[1] + margin + 0.1, released - 0.1):
        for _ in range(int(3.0 / DT)):
            machine.update(DT, curves, Demand(demand))
        states.append(machine.state)
    assert states == [1, 2, 2, 2, 1]


def test_margins_widen_with_the_bias_that_was_found(paper_bundle):
    """A plant that is 20 % weaker than the model leaves the controller less sure."""
    sure, unsure = Bench(paper_bundle, 0.16), Bench(paper_bundle, 0.16)
    unsure.bundle = paper_bundle.with_effect('motor_unit_mismatch', mu2=-0.2)
    margins = [bench.hold(70.0, 8.0)[-1].margins.uncertainty for bench in (sure, unsure)]
    bias = abs(unsure.controller.outer.bias)
    assert bias > 2.0
    assert margins[1] - margins[0] == pytest.approx(0.1 * bias, rel=0.1)


def test_dwell_time_keeps_from_switching_back(paper_bundle):
    """A demand that jumps to and fro is not followed faster than the dwell time."""
    curves = Allocator(paper_bundle).curves(Instant(0.16))
    machine = RecruitmentMachine(2, SwitchingConfig(policy='hysteresis', dwell=0.4))
    machine.reset(1)
    times = []
    for tick in range(1000):
        if machine.update(DT, curves, Demand(20.0 if tick % 2 else 60.0)):
            times.append(tick * DT)
    assert len(times) > 2
    assert min(np.diff(times)) >= 0.4 - DT
