# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The pressure PID node with the simulated rig."""

import math
import time

import pytest
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
import yaml

from fam_bundle_ros.control import PidConfig, PidGains, PressurePid, tune
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.diagnostics import ERROR, Report, WARN
from fam_bundle_ros.nodes.plant_simulator import PlantSimulator
from fam_bundle_ros.nodes.pressure_pid import PressurePidNode, SPECS
from fam_bundle_ros.resources import config_path


@pytest.fixture
def pair(graph, bare):
    """Return a function: simulator and both PIDs in lock-step, given more parameters."""
    def start(**overrides):
        values = {**bare, 'lock_step': True, 'lock_step_timeout': 0.5,
                  **{name.replace('__', '.'): value for name, value in overrides.items()}}
        rig = PlantSimulator(context=graph.context, script=graph.pacer, overrides=values)
        pids = [PressurePidNode(unit, context=graph.context, overrides=values)
                for unit in (1, 2)]
        graph.add(*pids, rig)
        return rig, pids
    return start


def test_there_is_one_set_of_defaults():
    """Class, node, rig.yaml and what tune gives by default are the same numbers."""
    pytest.importorskip('control')
    gains, config = PidGains(), PidConfig()
    known = {**{f'gains.{name}': value for name, value in vars(gains).items()},
             'quiet_error': config.quiet_error, 'transport_delay': config.transport_delay,
             'supply.pressure': config.supply, 'volume': config.volume,
             'valve.conductance': config.valve.conductance,
             'valve.dead_band': config.valve.dead_band}
    defaults = {spec.name: spec.default for spec in SPECS}
    rig = yaml.safe_load(config_path('rig.yaml').read_text())['/**']['ros__parameters']
    for values in (defaults, rig):
        assert {name: values[name] for name in known} == known
    assert PressurePid().gains == gains
    tuned = tune().gains
    assert (gains.p, gains.i, gains.d) == pytest.approx((tuned.p, tuned.i, tuned.d), rel=2e-3)


def test_pressure_reaches_the_setpoint(graph, pair):
    """Both motor units settle near the setpoint, with noise, after steps up and down."""
    rig, _ = pair(sensors__pressure_noise=350.0)
    graph.answer_pressures(2, lambda unit, t: (200e3 if t < 0.5 else 100e3) / unit)
    graph.advance(rig, 0.45)
    assert rig.rig.truth.pressure == pytest.approx([200e3, 100e3], abs=2.5e3)
    graph.advance(rig, 0.5)
    assert rig.rig.truth.pressure == pytest.approx([100e3, 50e3], abs=2.5e3)
    highest = max(truth.pressure[0] for _, truth, _ in graph.pacer.log)
    assert highest < 1.02 * 200e3


def test_commands_carry_the_stamp_of_the_reading(graph, pair):
    """A rig can tell which reading a command answers."""
    rig, _ = pair()
    commands = graph.listen('mu1/valve_command', JointState)
    graph.answer_pressures(2, lambda unit, t: 50e3)
    graph.advance(rig, 0.2)
    stamps = [interface.stamp_ns(m.header.stamp) for m in commands]
    assert len(stamps) >= 40
    assert stamps == sorted(stamps)
    assert {stamp % 5_000_000 for stamp in stamps} == {0}
    assert list(commands[-1].name) == ['mu1_valve']


def test_vents_when_the_setpoint_stays_away(graph, pair):
    """A recruitment controller that died leaves no pressure behind."""
    rig, _ = pair()
    graph.answer_pressures(2, lambda unit, t: 100e3 if t < 0.3 else None)
    graph.advance(rig, 0.28)
    assert rig.rig.truth.pressure.min() > 90e3
    graph.advance(rig, lambda: rig.rig.truth.pressure.max() < 5e3, 'vented')


def test_nan_shuts_the_valve_then_vents(graph, pair):
    """A pressure that is no number: closed at once, exhaust after hold_time, and back."""
    rig, _ = pair()
    graph.answer_pressures(2, lambda unit, t: 100e3)
    graph.advance(rig, 0.3)
    graph.set('plant_simulator', faults__nan='mu1/pressure')
    count = len(graph.pacer.log)
    graph.advance(rig, 0.4)
    sent = [commands[0] for _, _, commands in graph.pacer.log[count + 1:]]
    # 0.04 s are 8 commands, 0.05 s are 10.
    assert set(sent[:7]) == {0.0}
    assert set(sent[10:]) == {-1.0}
    assert rig.rig.truth.pressure[0] < 5e3
    assert rig.rig.truth.pressure[1] > 90e3
    graph.set('plant_simulator', faults__nan='')
    graph.advance(rig, 0.4)
    assert rig.rig.truth.pressure[0] > 95e3


@pytest.mark.parametrize(('after', 'word'), [
    (20e3, 'UNEXPLAINED_PRESSURE'), (60e3, 'UNEXPLAINED_PRESSURE'), (140e3, 'FROZEN')])
def test_frozen_sensor_is_found_and_vented(graph, pair, after, word):
    """A reading that stands still while the valve is open is not believed, and stays so."""
    rig, pids = pair(sensors__pressure_noise=350.0, trip_pressure=1e6)
    graph.answer_pressures(2, lambda unit, t: 100e3 if t < 0.4 else after)
    graph.advance(rig, 0.35)
    graph.set('plant_simulator', faults__frozen='mu1/pressure')
    graph.advance(rig, lambda: pids[0]._guard.latched, 'the latch', 0.5)
    assert rig.rig.truth.pressure[0] < 396e3
    graph.advance(rig, lambda: rig.rig.truth.pressure[0] < 5e3, 'vented')
    assert pids[0]._guard.word == word
    graph.set('plant_simulator', faults__frozen='')
    graph.advance(rig, 0.5)
    assert pids[0]._guard.latched
    assert rig.rig.truth.pressure[0] < 5e3


def test_pressure_that_no_command_explains_is_latched(graph, pair):
    """A valve that hangs open: it vents, and stays so until somebody enables again."""
    rig, pids = pair(trip_pressure=1e6)
    wanted = [100e3]
    graph.answer_pressures(2, lambda unit, t: wanted[0])
    graph.advance(rig, 0.3)
    graph.set('plant_simulator', faults__stuck_valve='mu1=0.5')
    graph.advance(rig, lambda: pids[0]._guard.latched, 'the latch', 0.1)
    assert pids[0]._guard.word == 'UNEXPLAINED_PRESSURE'
    graph.set('plant_simulator', faults__stuck_valve='')
    graph.advance(rig, lambda: rig.rig.truth.pressure[0] < 5e3, 'vented')
    wanted[0] = 0.0
    graph.advance(rig, 0.3)
    wanted[0] = 100e3
    graph.advance(rig, 0.3)
    assert pids[0]._guard.word == 'UNEXPLAINED_PRESSURE'
    assert rig.rig.truth.pressure[0] < 5e3
    graph.enable_supply(pids[0], False)
    graph.enable_supply(pids[0], True)
    graph.advance(rig, 0.3)
    assert pids[0]._guard.word == 'ACTIVE'
    assert rig.rig.truth.pressure[0] > 90e3


def test_without_permission_for_the_supply_it_vents(graph, pair):
    """supply_enable false is as good as an emergency stop, and nothing is latched by it."""
    rig, pids = pair()
    graph.answer_pressures(2, lambda unit, t: 100e3)
    graph.advance(rig, 0.3)
    graph.enable_supply(pids[0], False)
    graph.advance(rig, 0.05)
    assert graph.pacer.log[-1][2] == [-1.0, -1.0]
    assert pids[0]._guard.word == 'OFF'
    graph.enable_supply(pids[0], True)
    graph.advance(rig, 0.3)
    assert rig.rig.truth.pressure.min() > 90e3


def reported(node):
    """Return what a node says on /diagnostics: level and text."""
    report = Report()
    node._report(report)
    return report.level, '; '.join(report.messages)


def test_pressure_that_does_not_answer_is_vented_and_latched(graph, pair):
    """Air that is let in and not shown, noise or not, is a fault after a quarter of a fill."""
    rig, pids = pair(sensors__pressure_noise=350.0, faults__stuck_valve='mu1=0.0')
    wanted = [0.0]
    graph.answer_pressures(2, lambda unit, t: wanted[0] / unit)
    graph.advance(rig, 1.5)
    # Exhaust at ambient pressure moves nothing and is in order.
    assert [reported(pid) for pid in pids] == [(0, '')] * 2
    wanted[0] = 200e3
    graph.advance(rig, 0.25)
    level, text = reported(pids[0])
    assert level == ERROR
    assert text.startswith('NO_RESPONSE mu1 shows')
    assert 'kPa after air for' in text
    assert graph.pacer.log[-1][2][0] == -1.0
    graph.advance(rig, 0.3)
    assert reported(pids[1]) == (0, '')
    graph.set('plant_simulator', faults__stuck_valve='')
    wanted[0] = 0.0
    graph.advance(rig, 0.1)
    wanted[0] = 200e3
    graph.advance(rig, 0.3)
    assert pids[0]._guard.word == 'NO_RESPONSE'
    graph.enable_supply(pids[0], False)
    graph.enable_supply(pids[0], True)
    graph.advance(rig, 1.5)
    assert [reported(pid) for pid in pids] == [(0, '')] * 2
    assert rig.rig.truth.pressure[0] > 190e3


@pytest.mark.parametrize('shown', [300e3, 800e3])
def test_supply_that_contradicts_its_parameter_latches(graph, pair, shown):
    """Another supply, or another unit: no air is let in, and it says so."""
    _, pids = pair()
    now = time.monotonic()
    pids[0]._air.supply.take(shown)
    for at in (0.0, 0.1, 0.3):
        agrees, cause, reason = pids[0]._air.supply_agrees(now + at)
        assert (agrees, f'shows {shown / 1e3:.0f} kPa' in reason) == (False, True)
    assert cause == 'SUPPLY'
    assert f'shows {shown / 1e3:.0f} kPa, the parameter supply.pressure says' in reason


def test_readings_that_come_in_bursts_open_the_valve_no_wider_than_is_safe(graph):
    """What flows in until the next reading comes does not lead above the trip."""
    # of a machine that does other things too: how soon it exhausts is not what this is about
    node = PressurePidNode(1, context=graph.context, overrides={
        'sensor_timeout': 5.0, 'setpoint_timeout': 5.0, 'clocks_synchronised': False})
    graph.add(node)
    stamp, gap = graph.probe.now_ns(), 0.06
    for k in range(4):
        stamp += round(gap * 1e9)
        time.sleep(gap)
        node._on_setpoint(interface.pressure_message(stamp, 340e3, 101325.0))
        node._on_pressure(interface.pressure_message(stamp, 250e3 + 4e3 * k, 101325.0))
    rate, trip = node.pid.state.shown.expected_rate, 396.4e3
    assert node._command > 0.04
    assert 262e3 + rate * gap < trip


def test_a_drifted_sensor_at_exhaust_is_told_and_no_fault(graph, pair):
    """An empty unit that shows 20 kPa for long can be filled when its turn comes."""
    rig, pids = pair(sensors__pressure_noise=350.0, sensors__pressure_bias=20e3)
    wanted = [0.0]
    graph.answer_pressures(2, lambda unit, t: wanted[0])
    graph.advance(rig, 1.5)
    level, text = reported(pids[0])
    assert level == WARN
    assert 'kPa, setpoint 0 kPa, valve at -1.00 for' in text
    assert graph.pacer.log[-1][2] == [-1.0, -1.0]
    wanted[0] = 100e3
    graph.advance(rig, 0.5)
    assert [reported(pid) for pid in pids] == [(0, '')] * 2
    assert rig.rig.truth.pressure == pytest.approx([80e3, 80e3], abs=2.5e3)


def test_supply_below_the_setpoint_is_told_and_no_fault(graph, pair):
    """A supply that is measured explains why the pressure stands still."""
    rig, pids = pair(supply__pressure=150e3, sensors__pressure_noise=350.0)
    graph.answer_pressures(2, lambda unit, t: 300e3)
    graph.advance(rig, 2.0)
    level, text = reported(pids[0])
    assert level == WARN
    assert text == 'supply at 150 kPa, below the setpoint of 300 kPa'
    assert graph.pacer.log[-1][2][0] > 0.0


def test_a_setpoint_above_the_largest_pressure_is_told(graph, pair):
    """It is limited, as from a node other than ours; the supply is not what is missing."""
    rig, pids = pair(supply__pressure=500e3, sensors__pressure_noise=350.0)
    graph.answer_pressures(2, lambda unit, t: 800e3)
    graph.advance(rig, 2.0)
    assert reported(pids[0]) == (WARN, 'setpoint of 800 kPa is above the largest pressure of mu1, '
                                 '345 kPa, which takes its place')
    assert rig.rig.truth.pressure.max() < 360e3


def test_e_stop_vents(graph, pair):
    """While the emergency stop is on, every command is to exhaust."""
    rig, pids = pair()
    graph.answer_pressures(2, lambda unit, t: 100e3)
    graph.advance(rig, 0.2)
    graph.call(Trigger, 'e_stop_trigger')
    graph.until(lambda: pids[0]._e_stop.on and pids[1]._e_stop.on, 'the message')
    graph.advance(rig, 0.05)
    assert graph.pacer.log[-1][2] == [-1.0, -1.0]
    assert {pid._guard.word for pid in pids} == {'E_STOP'}


def test_gains_are_checked_as_a_set_and_change_while_it_runs(graph, pair):
    """A refused change leaves the old gains; an accepted one acts at once."""
    _, pids = pair()
    node = 'pressure_pid_mu1'
    refused = graph.set(node, anti_windup='clamp')[0]
    assert not refused.successful
    assert 'back_calculation' in refused.reason
    assert not graph.set(node, gains__p=-1.0)[0].successful
    assert not graph.set(node, gains__p=float('nan'))[0].successful
    assert graph.set(node, gains__p=50.0, anti_windup='none')[1].successful
    assert (pids[0].pid.gains.p, pids[0].pid.config.anti_windup) == (50.0, 'none')


def test_a_slow_setpoint_rate_and_zero_gains_do_not_keep_the_air_in(graph, pair):
    """A setpoint of ambient pressure means exhaust: it is what remains without a reference."""
    rig, _ = pair()
    wanted = [200e3]
    graph.answer_pressures(2, lambda unit, t: wanted[0])
    graph.advance(rig, 0.5)
    graph.set('pressure_pid_mu1', setpoint_rate=1e3, gains__p=0.0, gains__i=0.0)
    wanted[0] = 0.0
    graph.advance(rig, 0.5)
    assert rig.rig.truth.pressure.max() < 5e3


@pytest.mark.parametrize('silent', ['pressure', 'setpoint'])
def test_silence_is_vented_in_wall_time(graph, silent):
    """No pressure: the valve is shut, then exhausts; no setpoint: it exhausts."""
    graph.add(PressurePidNode(1, context=graph.context))
    commands = graph.listen('mu1/valve_command', JointState)
    pressure = graph.probe.create_publisher(FluidPressure, 'mu1/pressure', 10)
    setpoint = graph.probe.create_publisher(FluidPressure, 'mu1/pressure_setpoint', 10)

    def feed(fails=''):
        stamp = graph.probe.now_ns()
        if fails != 'pressure':
            pressure.publish(interface.pressure_message(stamp, 100e3 + stamp % 7, 101325.0))
        if fails != 'setpoint':
            setpoint.publish(interface.pressure_message(stamp, 100e3, 101325.0))
        return len(commands) > 20 and commands[-1].effort[0] > -1.0
    graph.until(feed, 'commands')
    count = len(commands)
    graph.until(lambda: (feed(silent), commands[-1].effort[0] == -1.0)[1], 'exhaust')
    assert 0.0 in {m.effort[0] for m in commands[count:]}


@pytest.mark.parametrize(('event', 'state', 'within'), [
    ('stamp', 'SENSOR', 60.0), ('e_stop', 'E_STOP', 0.0), ('pressure', 'OVER_PRESSURE', 0.0),
    ('setpoint', 'NO_SETPOINT', 60.0)])
def test_repeated_stamp_does_not_stop_the_watches(graph, event, state, within):
    """A driver whose stamp is frozen: nothing goes on filling, and every danger is seen."""
    # Only what the case is about may come first.
    patient = {'sensor_timeout': 0.1 if event == 'stamp' else 10.0,
               'setpoint_timeout': 0.2 if event == 'setpoint' else 10.0,
               'clocks_synchronised': False}
    node = PressurePidNode(1, context=graph.context, overrides=patient)
    graph.add(node)
    commands = []
    node._publish = lambda stamp, command: commands.append(command)
    stamp = graph.probe.now_ns()

    def read(at, value=100e3):
        node._on_pressure(interface.pressure_message(at, value, 101325.0))

    def want():
        node._on_setpoint(interface.pressure_message(stamp, 102e3, 101325.0))
    want()
    for k in range(20):
        read(stamp + k * 5_000_000, 100e3 + k)
    assert (node._guard.word, commands[-1] > 0.0) == ('ACTIVE', True)
    begin = time.monotonic()
    if event == 'e_stop':
        node._e_stop.take(Bool(data=True))
        assert commands[-1] == -1.0
    while True:
        if event != 'setpoint':
            want()
        read(stamp + 95_000_000, 990e3 if event == 'pressure' else 100e3)
        if node._guard.word == state or time.monotonic() - begin > within:
            break
        time.sleep(0.005)
    assert (node._guard.word, commands[-1]) == (state, -1.0)
    if event == 'stamp':
        assert 0.0 in commands
        assert 'no new time stamp' in node._guard.now.reason


@pytest.mark.parametrize('noise', [0.0, 400.0])
def test_a_reading_that_stays_near_the_trip_is_tested_by_a_little_exhaust(graph, noise):
    """The loop fills on towards its setpoint; the valve is shut before that can reach the trip."""
    node = graph.add(PressurePidNode(1, context=graph.context, overrides={
        'clocks_synchronised': False, 'sensor_timeout': 10.0, 'setpoint_timeout': 10.0,
        'stuck_time': 60.0}))
    commands, stamp = [], graph.probe.now_ns()
    node._publish = lambda stamp, command: commands.append(command)
    for k in range(400):
        shown = 330e3 + noise * (k % 3 - 1)
        node._on_setpoint(interface.pressure_message(stamp, 344e3, 101325.0))
        node._on_pressure(interface.pressure_message(stamp + k * 5_000_000, shown, 101325.0))
        if node._guard.latched:
            break
        time.sleep(0.005)
    assert (node._guard.word, commands[-1]) == ('FROZEN', -1.0)
    assert 'mu1 shows 330 kPa whether air is let in' in node._guard.now.reason
    pulses = [command for command in commands[:-1] if command < 0.0]
    assert len(pulses) == 2
    assert min(pulses) > -0.5


@pytest.mark.parametrize('spike', [0.15, -0.08, -0.2])
def test_a_spike_of_the_strain_is_no_fault_of_the_pressure(graph, pair, spike):
    """The gas volume does not follow it: nothing latches, and the pressures stay as they are."""
    rig, pids = pair()
    graph.answer_pressures(2, lambda unit, t: 340e3 / unit)
    graph.advance(rig, 1.0)
    count = len(graph.pacer.log)
    graph.set('plant_simulator', faults__spike=f'strain={spike}')
    graph.advance(rig, 0.5)
    assert [pid._guard.word for pid in pids] == ['ACTIVE', 'ACTIVE']
    for _, truth, _ in graph.pacer.log[count:]:
        assert truth.pressure == pytest.approx([340e3, 170e3], abs=2e3)


def test_a_strain_that_jumps_for_good_counts_from_its_second_reading(graph):
    """Strain and velocity of the first are left out: either may be a spike; also after a loss."""
    node = graph.add(PressurePidNode(1, context=graph.context))
    lost, seen = (math.nan, math.nan), []
    for strain, rate in [(0.1, 0.0)] * 5 + [lost, (0.1, 0.0), (0.2, 4.0)] + [(0.2, 0.5)] * 2:
        node._on_strain(interface.strain_message(graph.probe.now_ns(), strain, rate, 0.127))
        seen.append(node._air.strain.value(5.0))
    assert seen[5] == pytest.approx(lost, nan_ok=True)
    assert seen[6:] == [pytest.approx(pair) for pair in [(0.1, 0.0)] * 2 + [(0.2, 0.5)] * 2]


def test_strain_and_supply_expire(graph):
    """Readings that stop coming are replaced by the parameters, and diagnostics say so."""
    node = PressurePidNode(1, context=graph.context, overrides={
        'auxiliary_timeout': 0.4, 'volume': 30e-6, 'supply.pressure': 550e3,
        'sensor_timeout': 5.0, 'setpoint_timeout': 5.0, 'clocks_synchronised': False})
    graph.add(node)
    given = []
    node.pid.update = lambda *values: given.append(values) or 0.0
    stamp = graph.probe.now_ns()
    node._on_setpoint(interface.pressure_message(stamp, 100e3, 101325.0))

    def regulate(k):
        node._on_pressure(interface.pressure_message(stamp + k * 5_000_000, 90e3 + k, 101325.0))
        return given[-1]
    regulate(0)
    assert given[-1][3:] == (None, None, 0.0)
    assert 'any more' not in reported(node)[1]
    node._on_supply(interface.pressure_message(stamp, 600e3, 101325.0))
    node._on_strain(interface.strain_message(stamp, 0.1, 0.02, 0.127))
    _, _, _, supply, volume, flow = regulate(1)
    assert supply == pytest.approx(600e3)
    assert 5e-6 < volume < 40e-6
    assert flow != 0.0
    assert 'any more' not in reported(node)[1]
    time.sleep(0.41)
    assert regulate(2)[3:] == (None, None, 0.0)
    level, text = reported(node)
    assert level == WARN
    assert 'no strain any more: the parameter volume, 3e-05, takes its place' in text
    assert 'no supply any more: the parameter supply.pressure, 550000, takes its place' in text
    assert node.pid.config.volume == 30e-6


def test_motor_unit_that_is_not_there_fails(ros_context):
    """One line names what the model has."""
    with pytest.raises(InputError, match='motor_unit is 3; spie2021 has 2'):
        PressurePidNode(3, context=ros_context)
