# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Effects of the model file that a rig hides in its muscles, its air and its gauges."""

from dataclasses import replace
import math

import numpy as np
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, loads_model, Motion
from fam_bundle_ros.plant import SensorConfig
from fam_bundle_ros.plant.rig import _dependences

from .rigs import drive, IDEAL, make


def test_plant_and_record_give_the_same_force(bundle):
    """Stepped in the rig or computed over its record, effects with memory give one force."""
    model = (bundle.with_effect('viscoelastic_relaxation').with_effect('presliding_hysteresis')
             .with_effect('pressure_line_lag'))
    rig = make(model)
    rows = []
    for k in range(300):
        rig.impose_strain(0.1 + 0.05 * math.sin(k / 20.0), 3.0)
        rig.step([0.15 * math.sin(k / 15.0), 0.1], 1e-3)
        truth = rig.truth
        rows.append((truth.time, truth.strain, truth.strain_rate, truth.force, *truth.pressure))
    rows = np.array(rows)
    motion = Motion(strain=rows[:, 1], pressure=np.maximum(rows[:, 4:], 0.0),
                    strain_rate=rows[:, 2], time=rows[:, 0])
    assert model.simulate(motion).sum(axis=-1) == pytest.approx(rows[:, 3], abs=1e-6)


def test_hidden_effect_is_one_line_in_the_model_file(bundle, repository):
    """A model file with friction and a load cell bias gives a rig that shows both."""
    text = (repository / 'config/models/spie2021_plain.yaml').read_text()
    hidden = loads_model(text + '  - coulomb_friction: {force: 5 N}\n'
                                '  - force_sensor_bias: {bias: 3 N}\n')
    rig, plain = make(hidden), make(bundle)
    for r in (rig, plain):
        drive(r, [250e3, 50e3], 0.3)
    assert rig.readings.force - rig.truth.force == pytest.approx(3.0)
    for r in (rig, plain):
        r.impose_strain(0.12, 0.05)
        r.step([0.0, 0.0], 0.1)
    # Each of the two muscles rubs with 5 N against the shortening.
    assert rig.truth.force == pytest.approx(plain.truth.force - 10.0, abs=0.1)


def test_gauges_err_as_the_model_file_says(bundle):
    """Gain and offset of every gauge effect are in the readings, and not in the truth."""
    model = bundle
    for name, values in {'force_sensor_gain': {'gain': 0.1}, 'force_sensor_bias': {'bias': 2.0},
                         'force_sensor_drift': {'rate': 0.9},
                         'pressure_sensor_gain': {'gain': -0.05},
                         'pressure_sensor_bias': {'bias': 3e3},
                         'strain_sensor_offset': {'offset': 0.01}}.items():
        model = model.with_effect(name, **values)
    rig = make(model)
    drive(rig, [250e3, 50e3], 0.3)
    truth, shown = rig.truth, rig.readings
    assert truth.time == pytest.approx(0.3)
    force, strain, pressure = model.readings(truth.force, truth.strain, truth.pressure, truth.time)
    assert (shown.force, shown.strain) == pytest.approx((force, strain), rel=1e-12)
    assert shown.pressure == pytest.approx(pressure, rel=1e-12)
    assert shown.supply == truth.supply
    assert truth.force == pytest.approx(float(bundle.force(0.1, truth.pressure)), rel=1e-9)


@pytest.mark.parametrize('lag', [0.02, -0.02])
def test_a_lag_of_the_strain_is_behind_the_force_or_before_it(bundle, lag):
    """At 0.05 1/s the late channel shows what was 20 ms ago: the strain, or all the others."""
    rig, speed = make(bundle.with_effect('strain_sensor_lag', lag=lag)), 0.05
    for k in range(200):
        before = rig.truth.force
        rig.impose_strain(0.1 + 1e-3 * speed * k, speed)
        rig.step([0.0, 0.0], 1e-3)
    slope = (rig.truth.force - before) / 1e-3
    strain_late, force_late = max(lag, 0.0), max(-lag, 0.0)
    assert rig.truth.strain - rig.readings.strain == pytest.approx(strain_late * speed, rel=0.01,
                                                                   abs=1e-9)
    assert rig.truth.force - rig.readings.force == pytest.approx(force_late * slope, rel=0.05,
                                                                 abs=1e-9)


def test_rig_solves_only_for_what_its_plant_depends_on(bundle):
    """Rate and swelling are solved for where a force knows the rate, a volume the pressure."""
    record = make(bundle).record
    assert not record.rate_matters
    assert not record.swells
    assert make(bundle.with_effect('viscous_damping')).record.rate_matters


def test_leak_in_the_model_file_empties_a_closed_chamber(bundle):
    """The leak effect acts on every chamber with its time constant."""
    rig = make(bundle.with_effect('leak', time_constant=2.0))
    drive(rig, [250e3, 100e3], 0.5)
    rig.step([0.0, 0.0], 0.05)
    before = rig.truth.pressure
    rig.step([0.0, 0.0], 1.0)
    assert rig.truth.pressure == pytest.approx(before * math.exp(-0.5), rel=1e-6)


def test_supply_droop_in_the_model_file_lowers_the_manifold(bundle):
    """While a unit fills, the manifold dips further with the effect than without."""
    lowest = []
    for model in (bundle, bundle.with_effect('supply_droop', resistance=2e7)):
        rig = make(model)
        lowest.append(min(rig.step([0.5, 0.5], 1e-3).supply for _ in range(20)))
    assert lowest[1] < lowest[0] - 5e3


def test_leak_fault_comes_on_top_of_the_model_s_leak(bundle):
    """Two leaks of 2 s empty a chamber as one of 1 s does."""
    rig = make(bundle.with_effect('leak', time_constant=2.0))
    drive(rig, [250e3, 100e3], 0.5)
    rig.faults.leak[0] = 2.0
    rig.step([0.0, 0.0], 0.05)
    before = rig.truth.pressure
    rig.step([0.0, 0.0], 0.5)
    assert rig.truth.pressure == pytest.approx(before * np.exp([-0.5, -0.25]), rel=1e-6)


def test_tare_zeroes_the_force_reading(bundle):
    """After tare the force reading has no mean, and the truth is as before."""
    rig = make(bundle.with_effect('force_sensor_bias', bias=4.0),
               sensors=SensorConfig(force_bias=2.0))
    rig.tare()
    force = [rig.step([0.0, 0.0], 1e-3).force for _ in range(500)]
    assert abs(np.mean(force)) < 0.2
    assert rig.truth.force == pytest.approx(float(bundle.force(0.1, [0.0, 0.0])))


def test_tare_zeroes_whatever_the_gauge_makes_of_the_force(bundle):
    """Gain, offset and drift of the plant's gauge under pressure, at any time."""
    model = bundle.with_effect('force_sensor_bias', bias=4.0).with_effect(
        'force_sensor_gain', gain=0.1).with_effect('force_sensor_drift', rate=0.5)
    rig = make(model, sensors=replace(IDEAL, force_bias=2.0))
    drive(rig, [250e3, 80e3], 1.0)
    assert abs(rig.step([0.0, 0.0], 1e-3).force) > 50.0
    rig.tare()
    assert abs(rig.step([0.0, 0.0], 1e-3).force) < 0.05


def test_other_muscles_of_the_rig_have_its_motor_units_and_length(bundle):
    """What is changed is the model; strain and pressures stay."""
    rig = make(bundle)
    drive(rig, [250e3, 80e3], 0.5)
    before = rig.truth.pressure.copy()
    weak = bundle.with_effect('coulomb_friction', force=3.0)
    rig.change_bundle(weak)
    rig.step([0.0, 0.0], 1e-3)
    assert rig.truth.pressure == pytest.approx(before, rel=1e-3)
    assert rig.bundle is weak
    alone = Bundle('one', bundle.motor_units[:1], bundle.effects)
    with pytest.raises(InputError, match='1 motor units of 127 mm; the rig has 2 of 127 mm'):
        rig.change_bundle(alone)
    longer = bundle.with_parameters({'geometry.length': 0.2})
    with pytest.raises(InputError, match='2 motor units of 200 mm; the rig has 2 of 127 mm'):
        rig.change_bundle(longer)


def test_a_drag_that_acts_under_pressure_alone_is_a_drag(bundle):
    """And without one the force knows no rate; the volume knows the pressure where braids give."""
    assert _dependences(bundle, bundle.model()) == (False, False)
    drag = loads_model("""
        format: fam-bundle-model/1
        motor_units:
          - geometry: {radius: 6.35 mm, length: 127 mm, braid_angle: 33 deg,
                       wall_thickness: 1.59 mm}
        effects:
          - my_drag: {expression: "-k * strain_rate * max(pressure - p0, 0)", place: loss,
                      parameters: {k: 0.02 N*s/kPa, p0: 80 kPa}}
        """).effects[0]
    dragged, soft = bundle.with_effect(drag), bundle.with_effect('braid_elasticity')
    assert _dependences(dragged, dragged.model()) == (True, False)
    assert _dependences(soft, soft.model()) == (False, True)
