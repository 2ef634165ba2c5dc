# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The closed loop, compiled and plain: the same numbers whatever happens in it."""

import copy
from dataclasses import fields, is_dataclass
from functools import reduce
import math
import subprocess
import sys

import numpy as np
import pytest

from fam_bundle_ros import kernels
from fam_bundle_ros.control import (
    ControllerConfig,
    LoadModel,
    OuterConfig,
    PressurePid,
    RecruitmentController,
)
from fam_bundle_ros.control.signals import Measurement, Reference
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant import (
    Arm,
    ChamberConfig,
    Dynamometer,
    Faults,
    ForeignPlant,
    MassSpring,
    Rig,
    RigConfig,
    SensorConfig,
    SeriesSpringMass,
    SupplyConfig,
    ValveConfig,
)
from fam_bundle_ros.plant.motion import OVER_PRESSURE
from fam_bundle_ros.simulation import ClosedLoop, Run, Trajectory

needs_numba = pytest.mark.skipif(kernels.numba() is None, reason='numba is not installed')


def path(times, values, kind='force', load=None, **more):
    """Return a trajectory along straight lines."""
    def value(t):
        return float(np.interp(t, times, values))
    more.setdefault('prepare', 0.5)
    return Trajectory('path', kind, times[-1], value, lambda t: 0.0,
                      load or Dynamometer(strain=0.16), **more)


def wave(t):
    """Return a force that crosses the overlap both ways."""
    return 37.0 - 25.0 * math.cos(3.0 * t)


LOAD = LoadModel(table=((0.0, 5.0), (0.1, 30.0), (0.2, 60.0)), inertia=0.3, damping=3.0)
MEMORY = ('coulomb_friction', 'viscoelastic_relaxation', 'temperature')
STEADY = path([0.0, 0.4, 0.8], [20.0, 45.0, 45.0])
CASES = {
    'overlap': (Trajectory('wave', 'force', 2.5, wave, lambda t: 75.0 * math.sin(3.0 * t),
                           Dynamometer(0.16), prepare=0.5), (), {}),
    'neglect': (STEADY, (), {'controller': ControllerConfig(policy='neglect')}),
    'hysteresis, batch': (STEADY, (), {'controller': ControllerConfig(
        policy='hysteresis', scheme='batch')}),
    'all on': (STEADY, ('viscoelastic_relaxation',), {'controller': ControllerConfig(
        scheme='all_on')}),
    'own order and limits': (STEADY, (), {'controller': ControllerConfig(
        order=(1, 0), max_pressure=(300e3, 250e3))}),
    'feedback alone': (STEADY, (), {'controller': ControllerConfig(
        outer=OuterConfig(feed_forward=False))}),
    'feed-forward alone': (STEADY, (), {'controller': ControllerConfig(
        outer=OuterConfig(feedback=False))}),
    'gain and load': (path([0.0, 1.0], [0.06, 0.1], 'strain', MassSpring(mass=4.0)), (), {
        'controller': ControllerConfig(outer=OuterConfig(force_gain=1.0, bias_time=0.15),
                                       load=LOAD)}),
    'past the free strain': (path([0.0, 1.0], [30.0, 30.0],
                                  imposed=lambda t: 0.16 + 0.1 * math.sin(5.0 * t)), (), {}),
    'model with memory': (STEADY, MEMORY, {'model': MEMORY}),
    'imposed strain': (path([0.0, 1.0], [30.0, 30.0],
                            imposed=lambda t: 0.14 + 0.03 * math.sin(5.0 * t)),
                       ('presliding_hysteresis', 'pressure_line_lag'), {}),
    'load change': (path([0.0, 1.0], [0.08, 0.08], 'strain', MassSpring(mass=4.0, damping=40.0),
                         events=((0.5, {'mass': 3.0}),)), ('coulomb_friction',), {}),
    'series spring': (path([0.0, 1.0], [0.06, 0.1], 'strain', SeriesSpringMass(mass=2.0)),
                      ('leak', 'supply_droop'), {}),
    'lost readings': (path([0.0, 1.5], [0.05, 0.1], 'strain', Arm(), faults=(
        (0.2, Faults(dropout={'mu1/pressure'})), (0.5, Faults(noise_factor=3.0)),
        (0.8, Faults(dropout={'force'})))), ('force_sensor_bias', 'strain_sensor_offset'),
        {'rig': RigConfig(sensors=SensorConfig(dropout=0.02))}),
    'held readings': (STEADY, (), {'rig': RigConfig(sensors=SensorConfig(
        dropout=0.2, on_dropout='hold')), 'noise_factor': 2.0}),
    'late and narrow': (path([0.0, 0.4, 0.8], [20.0, 45.0, 15.0]), (), {'rig': RigConfig(
        valve=ValveConfig(delay=4e-3, hysteresis=0.03, dead_band=0.07),
        chamber=ChamberConfig(tube_volume=7e-6, line_volume=3e-6, line_conductance=5e-9),
        sensors=SensorConfig(delay=5e-3, force_lag=4e-3, pressure_lag=2e-3, strain_lag=1e-3))}),
    'equal pressure': (STEADY, (), {'controller': ControllerConfig(scheme='equal_pressure'),
                                    'deviation': (1.5, 30.0)}),
    'threshold': (path([0.0, 0.5, 1.0], [0.05, 0.12, 0.05], 'strain',
                       MassSpring(mass=4.0, damping=40.0)), ('coulomb_friction',),
                  {'controller': ControllerConfig(scheme='threshold')}),
    'stuck and tripped': (path([0.0, 1.0], [20.0, 40.0], faults=(
        (0.1, Faults(leak={1: 0.2}, stuck_valve={1: None})),
        (0.4, Faults(stuck_valve={0: 0.9})))), (),
        {'rig': RigConfig(supply=SupplyConfig(pressure=700e3))}),
    'wrong readings': (path([0.0, 1.6], [20.0, 45.0], faults=(
        (0.1, Faults(gain={'force': 0.8}, offset={'mu1/pressure': 2e3}, drift={'strain': -0.01})),
        (0.4, Faults(spike={'mu1/pressure': -40e3}, delay={'mu2/pressure': 0.03}, silent={'force'},
                     lost={'strain': 0.5, 'supply': 0.5})),
        (0.8, Faults(exchanged={'mu1/pressure': 'mu2/pressure'}, units={'supply': 'bar'},
                     late={'force': 0.25})),
        (1.2, Faults(frozen={'mu2/pressure'}, drift={'strain': 0.01})))), (), {}),
    'broken valves': (path([0.0, 1.2], [20.0, 45.0], faults=(
        (0.1, Faults(reversed_valve={1}, leaking_valve={0: 0.02})),
        (0.4, Faults(exchanged_valves={0: 1}, burst={0})),
        (0.8, Faults(supply=0.0)))), (), {}),
}


def numbers(item, name=''):
    """Return every number of a state by its name."""
    if is_dataclass(item):
        return {k: v for field in fields(item)
                for k, v in numbers(getattr(item, field.name), f'{name}.{field.name}').items()}
    if isinstance(item, list):
        return {k: v for i, each in enumerate(item)
                for k, v in numbers(each, f'{name}[{i}]').items()}
    return {name: float(item)}


@needs_numba
@pytest.mark.parametrize('case', CASES)
def test_compiled_loop_is_the_plain_one(paper_bundle, case):
    """Log, decisions and every number of the state at the end agree to 1e-9."""
    trajectory, effects, options = CASES[case]
    options = dict(options)
    plant, model = (reduce(lambda bundle, name: bundle.with_effect(name), names, paper_bundle)
                    for names in (effects, options.pop('model', ())))
    plain, quick = (Run(ClosedLoop(plant, model, seed=3, compiled=compiled, **options),
                        trajectory) for compiled in (False, True))
    for run in (plain, quick):
        run.advance(run.ticks)
    state = copy.deepcopy(plain.state)
    kernels.unpack(quick.state, state)
    expected, found = numbers(plain.state), numbers(state)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9, nan_ok=True)
    one, other = plain.log(), quick.log()
    for field in fields(one):
        values = getattr(one, field.name)
        if isinstance(values, np.ndarray) and values.dtype.kind == 'f':
            assert getattr(other, field.name) == pytest.approx(values, rel=1e-9, abs=1e-9,
                                                               nan_ok=True)
    assert one.decisions == other.decisions
    assert one.saturated.tolist() == other.saturated.tolist()
    if case == 'stuck and tripped':
        assert plain.state.rig.reason == OVER_PRESSURE
        assert one.pressure[-1].max() < 5e3
    if case == 'overlap':
        assert set(one.state) == {1, 2}
    if case == 'past the free strain':
        assert one.pressure[:, 0].min() < 1e3 < one.pressure[:, 0].max()
    if case == 'lost readings':
        assert any('no usable reading' in text for _, text in one.decisions)


def test_loop_is_its_classes_stepped_one_by_one(paper_bundle):
    """Rig, controller and pressure loops as the nodes use them give the log of the loop."""
    def imposed(t):
        return 0.13 + 0.03 * math.cos(6.0 * t)
    trajectory = Trajectory('parts', 'force', 0.6, wave, lambda t: 75.0 * math.sin(3.0 * t),
                            imposed=imposed)
    loop = ClosedLoop(paper_bundle, seed=5, noise_factor=0.5, compiled=False)
    log = loop.run(trajectory)
    load = Dynamometer(strain=0.16)
    rig = Rig(paper_bundle, RigConfig(load=load), 5, Faults(noise_factor=0.5))
    controller = RecruitmentController(paper_bundle, ControllerConfig())
    pids = [PressurePid(loop.gains, loop.pid_config) for _ in range(2)]
    readings = rig.readings
    for k in range(150):
        t = k * 4e-3
        command = controller.update(4e-3, Measurement(
            readings.force, readings.strain, readings.strain_rate, readings.pressure),
            Reference('force', wave(t), 75.0 * math.sin(3.0 * t)))
        target = imposed(t + 4e-3)
        rig.impose_strain(target, abs(target - rig.truth.strain) / 4e-3)
        for _ in range(2):
            volume = paper_bundle.gas_volume(readings.strain) + 5e-6
            swept = paper_bundle.gas_volume_slope(readings.strain) * readings.strain_rate
            valves = [pid.update(float(p), float(m), 2e-3, readings.supply, float(v), float(q))
                      for pid, p, m, v, q in zip(pids, command.pressure, readings.pressure,
                                                 volume, swept)]
            readings = rig.step(valves, 2e-3)
        truth, margins = rig.truth, command.margins
        row = [truth.time, wave(t + 4e-3), command.demand, truth.strain, truth.force,
               truth.supply, *truth.pressure, *command.pressure, *valves, command.state,
               *command.share, margins.limit - margins.width, margins.limit, rig.air_mass,
               rig.work]
        found = [log.time[k], log.reference[k], log.demand[k], log.strain[k], log.force[k],
                 log.supply[k], *log.pressure[k], *log.setpoint[k], *log.command[k],
                 log.state[k], *log.share[k], *log.overlap[k], log.air[k], log.work[k]]
        assert found == pytest.approx(row, rel=1e-9, abs=1e-12, nan_ok=True)


@pytest.mark.parametrize('compiled', [False, pytest.param(True, marks=needs_numba)])
def test_foreign_plant_is_held_on_its_force(paper_bundle, compiled):
    """A bellows that shares nothing with the laws is brought to the force that is asked."""
    def force(unit, strain, strain_rate, pressure):
        return 2.4e-4 * pressure[unit] * (1.0 - 2.0 * strain) - 5.0 * strain_rate

    def volume(strain, pressure, unit):
        return 10e-6 + 30e-6 * strain + 4e-12 * pressure[unit]

    plant = ForeignPlant(force, volume, paper_bundle.length, [344e3, 344e3])
    log = ClosedLoop(plant, paper_bundle, seed=2, compiled=compiled).run(
        path([0.0, 4.0], [30.0, 30.0], load=Dynamometer(0.12), prepare=1.0))
    assert abs(np.mean(log.error[-250:])) < 0.3


def test_plant_that_cannot_be_compiled_runs_plain(paper_bundle):
    """Python that numba does not know is run as it is, unless compiled code was asked for."""
    table = {'slope': 2e-4}
    plant = ForeignPlant(lambda unit, pressure: table['slope'] * pressure[unit],
                         lambda strain: 1e-5, 0.127, [3e5, 3e5])
    loop = ClosedLoop(plant, paper_bundle)
    assert not Run(loop, STEADY).compiled
    loop.compiled = True
    with pytest.raises(kernels.NotCompiled):
        Run(loop, STEADY)


def test_run_can_be_taken_piece_by_piece(paper_bundle):
    """A run in pieces, with its progress told, gives the log of one in a go."""
    told = []
    whole = ClosedLoop(paper_bundle, seed=4).run(STEADY, progress=told.append)
    run = Run(ClosedLoop(paper_bundle, seed=4), STEADY)
    while run.done < run.ticks:
        run.advance(min(run.done + 7, run.ticks))
    assert run.log().force.tobytes() == whole.force.tobytes()
    assert told == pytest.approx([-0.5, 256 * 4e-3 - 0.5])


def test_noise_of_the_loop_is_that_of_the_rig(paper_bundle):
    """A noise factor among the faults multiplies the readings' noise."""
    shown = []
    for faults in ((), ((0.0, Faults(noise_factor=3.0)),)):
        run = Run(ClosedLoop(paper_bundle, seed=4, noise_factor=2.0, compiled=False),
                  path([0.0, 0.4], [20.0, 20.0], faults=faults))
        errors = []
        while run.done < run.ticks:
            run.advance(run.done + 1)
            errors.append(run.state.measured.force - run.state.rig.force)
        shown.append(np.std(errors[-100:]))
    assert shown[0] == pytest.approx(1.8, rel=0.2)
    assert shown[1] == pytest.approx(5.4, rel=0.2)


@pytest.mark.parametrize(('trajectory', 'word'), [
    (path([0.0, 0.2], [20.0, 20.0], events=((0.1, {'mass': 3.0}),)), 'cannot change mass'),
    (path([0.0, 0.2], [20.0, 20.0], faults=((0.1, Faults(leak={5: 1.0})),)), 'motor unit 5'),
    (path([0.0, 0.2], [20.0, 20.0], imposed=lambda t: 0.1 + 3.0 * t), 'strain is 0.508'),
])
def test_trajectory_that_cannot_be_run_fails(paper_bundle, trajectory, word):
    """What the rig cannot do is refused before the run begins."""
    with pytest.raises(InputError, match=word):
        Run(ClosedLoop(paper_bundle), trajectory)


def test_foreign_plant_without_a_model_fails():
    """A controller needs a bundle to invert."""
    plant = ForeignPlant(lambda strain: 1.0, lambda strain: 1e-5, 0.127, [3e5])
    with pytest.raises(InputError, match='model='):
        ClosedLoop(plant)


def test_numba_is_imported_only_when_a_loop_is_compiled():
    """Importing the simulation, and a rig's step, leave numba alone."""
    code = ('import sys; from fam_bundle_ros.simulation import ClosedLoop; '
            'from fam_bundle_ros.plant import Rig; '
            'from fam_bundle_ros.model import load_model; '
            'from fam_bundle_ros.resources import config_path; '
            'Rig(load_model(config_path("models/spie2021.yaml"))).step([0.1, 0.1], 2e-3); '
            'sys.exit("numba" in sys.modules)')
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0


def test_other_units_take_over_what_a_low_supply_does_not_give(paper_bundle):
    """A unit that cannot reach its setpoint is no transient: the error goes within ten seconds."""
    low = RigConfig(supply=SupplyConfig(pressure=300e3))
    level = 0.95 * paper_bundle.force(0.16, paper_bundle.max_pressure * np.array([1.0, 0.0]))
    log = ClosedLoop(paper_bundle, rig=low, seed=1).run(
        path([0.0, 1.0, 14.0], [0.5 * level, level, level]))
    last = log.time > log.time[-1] - 1.0
    assert log.pressure[last, 0].max() < 301e3
    assert abs(np.mean(log.error[last])) < 0.3


@needs_numba
def test_muscles_that_pull_from_a_lower_pressure_on_than_their_model_do_not_swing(paper_bundle):
    """
    A slow sine about the limit of one unit, with softer rubber: MU2 comes and goes calmly.

    The push-back that is learnt becomes small. With a curve as flat as that, MU2 swung across
    20 kPa at 12 Hz, some 450 kPa of travel in three seconds instead of 70.
    """
    soft = paper_bundle.with_parameters({'bladder_elasticity.c10': 60e3})
    wide, omega = 8.0, 2.0 * math.pi * 0.15
    level = float(paper_bundle.unit_forces(0.1, paper_bundle.max_pressure)[0])
    log = ClosedLoop(soft, paper_bundle).run(Trajectory(
        'slow sine', 'force', 25.0, lambda t: level + wide * math.sin(omega * t),
        lambda t: wide * omega * math.cos(omega * t), Dynamometer(0.1)))
    late = log.time > 16.0
    assert log.state[late].max() == 2
    assert np.abs(np.diff(log.setpoint[late, 1])).sum() < 350e3
    assert np.sqrt(np.mean(log.error[late] ** 2)) < 0.8


@pytest.mark.parametrize('period', [4e-3, 10e-3, 20e-3])
def test_a_ramp_is_followed_at_any_rate_of_the_controller(paper_bundle, period):
    """A setpoint that is held for a sample is half of it late; the feed-forward knows."""
    loop = ClosedLoop(paper_bundle, seed=1, noise_factor=0.0, period=period)
    log = loop.run(Trajectory('ramp', 'force', 1.5, lambda t: 10.0 + 40.0 * max(t, 0.0),
                              lambda t: 40.0 if t > 0.0 else 0.0, Dynamometer(0.1), prepare=0.5))
    assert abs(np.mean(log.error[log.time > 0.5])) < 0.3
