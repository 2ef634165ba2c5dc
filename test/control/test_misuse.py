# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Settings and calls that make no sense: one sentence with the name, the value and what fits."""

import math

import numpy as np
import pytest

from fam_bundle_ros.control import (
    allocate,
    ControllerConfig,
    LoadModel,
    Measurement,
    OuterConfig,
    PidConfig,
    RecruitmentController,
    Reference,
    SwitchingConfig,
    tune,
)
from fam_bundle_ros.control.allocation import Allocator
from fam_bundle_ros.control.loop_tuning import tune_strain
from fam_bundle_ros.errors import InputError

VENTED = Measurement(0.0, 0.1, 0.0, np.zeros(2))


@pytest.mark.parametrize(('make', 'words'), [
    *((lambda name=name: PidConfig(**{name: 0.0}), f'{name} is 0.0; expected more than 0')
      for name in ('tracking_time', 'volume', 'supply', 'ambient', 'setpoint_rate',
                   'setpoint_bandwidth')),
    *((lambda name=name: PidConfig(**{name: -1e-3}), f'{name} is -0.001; expected 0 or more')
      for name in ('transport_delay', 'quiet_error', 'filter_time', 'flow_lag', 'reach')),
    (lambda: PidConfig(anti_windup='some'), "anti_windup is 'some'; expected one of"),
    *((lambda name=name: OuterConfig(**{name: 0.0}), f'{name} is 0.0; .* more than 0 s')
      for name in ('bias_time', 'filter_time', 'fade_time')),
    (lambda: OuterConfig(bias_time=math.inf), 'bias_time is inf; expected a finite number'),
    (lambda: OuterConfig(delay=math.inf), 'delay is inf; expected a finite number, 0 or more'),
    *((lambda name=name: LoadModel(**{name: math.nan}), f'{name} of the load is nan; expected a')
      for name in ('force', 'stiffness', 'inertia', 'damping')),
    *((lambda name=name: LoadModel(**{name: -1.0}), f'{name} of the load is -1.0; .* 0 or more')
      for name in ('inertia', 'damping')),
    *((lambda table=table: LoadModel(table=table), 'finite numbers, and strains that rise')
      for table in (((0.1, 5.0), (0.0, 1.0)), ((0.1, 5.0), (0.1, 6.0)), ((0.0, math.inf),))),
    *((lambda name=name: OuterConfig(**{name: math.nan}), f'{name} is nan; .* 0 or more')
      for name in ('force_gain', 'force_integral', 'strain_gain', 'strain_integral',
                   'strain_damping', 'strain_reach', 'still', 'lead_time', 'delay',
                   'gain_error')),
    (lambda: OuterConfig(reading_share=1.1), 'reading_share is 1.1; expected 0 to 1'),
    (lambda: OuterConfig(feed_forward=False, feedback=False), 'are both off; expected one'),
    *((lambda name=name: SwitchingConfig(**{name: -0.1}), f'{name} is -0.1; expected 0 or more')
      for name in ('dwell', 'rest_time', 'absence_time', 'rest_rate', 'horizon', 'margin',
                   'hysteresis')),
    (lambda: SwitchingConfig(crossing_rate=0.0), 'crossing_rate is 0.0; expected more than 0'),
    (lambda: SwitchingConfig(policy='brave'), "policy is 'brave'; expected one of neglect"),
    *((lambda name=name: ControllerConfig(**{name: -1.0}), f'{name} is -1.0; expected 0 or more')
      for name in ('hold_time', 'still')),
    (lambda: ControllerConfig(scheme='any'), "scheme is 'any'; expected one of orderly"),
])
def test_a_setting_out_of_its_range_is_refused_by_name(make, words):
    """With the value that was given, and what is expected."""
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize(('act', 'words'), [
    (lambda b: allocate(b, 50.0, 0.1, 2, scheme='equal_pressure'),
     "scheme is 'equal_pressure'; expected one of orderly, batch, all_on"),
    (lambda b: allocate(b, 50.0, 0.1, 3), 'state is 3; expected 0 to 2'),
    (lambda b: allocate(b, 50.0, 0.1, -1), 'state is -1; expected 0 to 2'),
    (lambda b: Allocator(b, max_pressure=[3e5]), 'expected 2 positive values in Pa'),
    (lambda b: Allocator(b, max_pressure=[3e5, 0.0]), 'expected 2 positive values in Pa'),
    (lambda b: RecruitmentController(b).update(0.01, Measurement(0.0, 0.1, 0.0, np.zeros(3)),
                                               Reference('force', 1.0)),
     '3 pressures; expected 2'),
    (lambda b: RecruitmentController(b).update(0.01, VENTED, Reference('stiffness', 1.0)),
     "kind is 'stiffness'; expected force or strain"),
    (lambda b: tune_strain(b, LoadModel(force=10.0)), 'inertia of the load is 0; expected more'),
    (lambda b: tune(sample_period=0.0), 'and a spool frequency above 0 .* got 0.0'),
])
def test_a_call_that_makes_no_sense_is_refused(paper_bundle, act, words):
    """A state or pressures that this bundle has not, a scheme that inverts no model."""
    with pytest.raises(InputError, match=words):
        act(paper_bundle)


@pytest.mark.parametrize('step', [math.inf, -math.inf, math.nan, 0.0])
def test_a_time_step_that_is_none_changes_nothing(paper_bundle, step):
    """A caller whose last time was -inf at first: the command stays, and later ones are sound."""
    one, other = RecruitmentController(paper_bundle), RecruitmentController(paper_bundle)
    force = Reference('force', 20.0)
    assert not one.update(step, VENTED, force).pressure.any()
    for _ in range(5):
        assert (one.update(0.01, VENTED, force).pressure
                == other.update(0.01, VENTED, force).pressure).all()


def test_a_load_that_hangs_by_a_table_is_held_by_what_the_table_says():
    """Between its points in a line, beyond its ends constant; else force and stiffness."""
    table = LoadModel(force=99.0, table=((0.0, 10.0), (0.1, 30.0)))
    assert [table.holding_force(e) for e in (-0.1, 0.05, 0.2)] == [10.0, 20.0, 30.0]
    assert LoadModel(force=5.0, stiffness=100.0).holding_force(0.1) == 15.0
    assert table.known
    assert not LoadModel().known
