# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The plant simulator on a real graph."""

import math
import time

from geometry_msgs.msg import WrenchStamped
import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.plant_simulator import PlantSimulator

from .whole_bundle import values_of


def command(graph, unit):
    """Return a function that sends a valve command with a stamp."""
    publisher = graph.probe.create_publisher(JointState, interface.valve_topic(unit),
                                             interface.PUBLISH)
    return lambda stamp, value: publisher.publish(interface.valve_message(stamp, unit, value))


def drive(graph, units, value):
    """In lock-step: answer every pressure with a valve command."""
    for unit in range(1, units + 1):
        send = command(graph, unit)

        def answer(message, unit=unit, send=send):
            stamp = interface.stamp_ns(message.header.stamp)
            send(stamp, value(unit, stamp * 1e-9))
        graph.probe.create_subscription(FluidPressure, interface.pressure_topic(unit), answer,
                                        interface.LOCK_STEP)


@pytest.fixture
def rig(graph, bare):
    """Return a function that adds a simulator in lock-step with our pacer."""
    def start(**overrides):
        return graph.add(PlantSimulator(
            context=graph.context, script=graph.pacer, overrides={
                **bare, 'lock_step': True,
                **{name.replace('__', '.'): value for name, value in overrides.items()}}))
    return start


def test_sensors_come_in_the_right_types_and_units(graph, bare):
    """Force in N on the load cell's frame, strain and contraction in m, pressures absolute."""
    rig = graph.add(PlantSimulator(context=graph.context, overrides=bare))
    force = graph.listen('force', WrenchStamped)
    strain = graph.listen('strain', JointState)
    pressure = graph.listen('mu2/pressure', FluidPressure)
    supply = graph.listen('supply/pressure', FluidPressure)
    graph.until(lambda: min(map(len, (force, strain, pressure, supply))) > 5, 'sensors')
    assert force[-1].header.frame_id == 'load_cell'
    assert force[-1].wrench.force.x == pytest.approx(rig.rig.truth.force, abs=0.01)
    assert list(strain[-1].name) == ['contraction', 'strain']
    assert strain[-1].position[1] == pytest.approx(0.1)
    assert strain[-1].position[0] == pytest.approx(0.1 * rig.rig.length)
    assert pressure[-1].fluid_pressure == pytest.approx(101325.0, abs=60.0)
    assert supply[-1].fluid_pressure == pytest.approx(601325.0, rel=0.01)
    stamps = [interface.stamp_ns(m.header.stamp) for m in force]
    assert min(b - a for a, b in zip(stamps, stamps[1:])) == 5_000_000


def test_lock_step_waits_for_every_command(graph, bare):
    """Time stands still until each motor unit's command carries the sample's stamp."""
    rig = graph.add(PlantSimulator(context=graph.context, overrides={**bare, 'lock_step': True}))
    first, second = command(graph, 1), command(graph, 2)
    pressure = graph.listen('mu1/pressure', FluidPressure)
    graph.until(lambda: pressure, 'the first sample')
    stamp = interface.stamp_ns(pressure[-1].header.stamp)
    first(stamp, 1.0)
    second(stamp - 1, 1.0)
    graph.spin(0.1)
    assert rig.rig.readings.time == 0.0
    second(stamp, 0.0)
    graph.until(lambda: rig.rig.readings.time > 0.0, 'the step')
    assert rig.rig.readings.time == pytest.approx(0.005)
    assert rig.rig.truth.pressure[0] > rig.rig.truth.pressure[1]
    first(stamp, 1.0)
    second(stamp, 1.0)
    graph.spin(0.1)
    assert rig.rig.readings.time == pytest.approx(0.005)


def test_lock_step_begins_only_once_supply_enable_was_heard(graph, quiet):
    """What a controller sent before it knew the simulator is lost; the supply would stay shut."""
    rig = graph.add(PlantSimulator(context=graph.context, overrides={**quiet, 'lock_step': True}))
    drive(graph, 2, lambda unit, t: 0.0)
    graph.spin(0.5)
    assert rig.rig.readings.time == 0.0
    graph.enable_supply(rig, True)
    graph.until(lambda: rig.rig.readings.time > 0.0, 'the first step')


def test_lock_step_is_the_clock(graph, rig):
    """/clock carries the stamp of each sample, so that use_sim_time works for everyone."""
    clock = graph.listen('/clock', Clock)
    force = graph.listen('force', WrenchStamped)
    rig = rig()
    drive(graph, 2, lambda unit, t: 0.0)
    graph.advance(rig, 0.1)
    times = {interface.stamp_ns(m.clock) for m in clock}
    assert {interface.stamp_ns(m.header.stamp) for m in force[-10:]} <= times


def test_lost_motor_unit_is_vented_and_the_rest_goes_on(graph, rig):
    """In lock-step a PID that died must not stop the others, nor keep its air."""
    rig = rig(lock_step_timeout=0.3)
    alive = [True]
    send = command(graph, 2)
    drive(graph, 1, lambda unit, t: 0.08)

    def answer(message):
        if alive[0]:
            send(interface.stamp_ns(message.header.stamp), 0.08)
    graph.probe.create_subscription(FluidPressure, 'mu2/pressure', answer, interface.LOCK_STEP)
    graph.advance(rig, lambda: rig.rig.truth.pressure.min() > 50e3, 'pressure')
    alive[0] = False
    graph.advance(rig, lambda: rig.rig.truth.pressure[1] < 5e3, 'mu2 vented')
    assert rig.rig.truth.pressure[0] > 50e3


@pytest.mark.parametrize('ahead', [0, 3_600_000_000_000])
def test_wall_time_vents_without_fresh_commands(graph, bare, ahead):
    """A PID that falls silent leaves no valve open, nor does one whose clock (ns) ran ahead."""
    rig = graph.add(PlantSimulator(context=graph.context, overrides=bare))
    send = command(graph, 1)
    graph.until(lambda: (send(graph.probe.now_ns() + ahead, 0.1),
                         rig.rig.truth.pressure[0] > 100e3)[1], 'pressure')
    for _ in range(10):
        send(graph.probe.now_ns() + ahead, 0.0)
        graph.spin()
    assert rig.rig.truth.pressure[0] > 50e3
    graph.until(lambda: rig.rig.truth.pressure[0] < 5e3, 'vented')
    assert not rig.rig.e_stopped


def test_machine_that_is_too_slow_vents_nothing(graph, bare, monkeypatch):
    """The rig falls behind the clock for as long as it takes, and says so; commands stay fresh."""
    # Sooner than the 10 s behind that the clock may be before it must have been set.
    monkeypatch.setattr('fam_bundle_ros.nodes.plant_simulator._SET', 400_000_000)
    pacer = graph.pacer
    pacer.condition = lambda: False
    pacer.before = lambda rig, time_, period: time.sleep(3.0 * period)
    rig = graph.add(PlantSimulator(context=graph.context, script=pacer, overrides={
        **bare, 'command_timeout': 0.3, 'patience': 0.3}))
    states = graph.diagnostics('plant_simulator')
    drive(graph, 2, lambda unit, t: 0.01 * unit)
    graph.until(lambda: rig._behind > 900_000_000, 'the lag')
    commands = [tuple(commands) for _, _, commands in pacer.log]
    begin = commands.index((0.01, 0.02))
    assert set(commands[begin:]) == {(0.01, 0.02)}
    graph.until(lambda: 's behind the clock' in states[-1].message, 'diagnostics')
    assert states[-1].level == b'\x01'


def test_a_simulator_that_was_held_up_before_anybody_used_it_is_on_time(graph, bare):
    """A machine that is busy while everything starts does not make all samples late for good."""
    ticks = []
    pacer = graph.pacer
    pacer.condition = lambda: False
    pacer.before = lambda rig, time_, period: (ticks.append(time_),
                                               time.sleep(0.5 if len(ticks) == 5 else 0.0))
    rig = graph.add(PlantSimulator(context=graph.context, script=pacer, overrides=bare))
    graph.until(lambda: len(ticks) > 20, 'the samples after it')
    assert rig._behind < 100_000_000


def test_stale_command_is_refused(graph, bare):
    """A command stamped long ago does not open a valve, however late it arrives."""
    rig = graph.add(PlantSimulator(context=graph.context, overrides=bare))
    pressure = graph.listen('mu1/pressure', FluidPressure)
    send = command(graph, 1)
    graph.until(lambda: pressure, 'samples')
    end = time.monotonic() + 0.4
    graph.until(lambda: (send(graph.probe.now_ns() - 500_000_000, 1.0),
                         time.monotonic() > end)[1], 'some time')
    assert rig.rig.truth.pressure[0] < 1e3
    assert rig._refused > 0


def test_starts_stopped_and_runs_after_reset(graph, rig):
    """As on rigs: valves do nothing before e_stop_reset."""
    rig = rig(start_stopped=True)
    stop = graph.listen('e_stop', Bool, interface.LATCHED)
    drive(graph, 2, lambda unit, t: 0.1)
    graph.until(lambda: stop, 'the latched message')
    graph.advance(rig, 0.2)
    assert stop[-1].data is True
    assert rig.rig.truth.pressure.max() < 1e3
    assert graph.call(Trigger, 'e_stop_reset').success
    graph.advance(rig, lambda: rig.rig.truth.pressure.max() > 50e3, 'pressure')
    graph.until(lambda: stop[-1].data is False, 'the message')


def test_e_stop_is_latched_and_vents(graph, rig):
    """e_stop_trigger lets the air out whatever is commanded; `reset` does not take it back."""
    rig = rig()
    drive(graph, 2, lambda unit, t: 0.1)
    graph.advance(rig, lambda: rig.rig.truth.pressure.min() > 100e3, 'pressure')
    assert graph.call(Trigger, 'e_stop_trigger').success
    graph.advance(rig, lambda: rig.rig.truth.pressure.max() < 5e3, 'vented')
    assert graph.call(Trigger, 'reset').success
    late = graph.listen('e_stop', Bool, interface.LATCHED)
    graph.until(lambda: late, 'the latched message')
    assert late[-1].data is True


def test_over_pressure_stops_the_rig(graph, rig):
    """A motor unit above the trip pressure stops the rig; reset waits until it is low."""
    rig = rig(trip_pressure=200e3)
    drive(graph, 2, lambda unit, t: 0.3)
    graph.advance(rig, lambda: rig.rig.e_stopped, 'the stop')
    assert 'above the trip' in rig.rig.e_stopped
    answer = graph.call(Trigger, 'e_stop_reset')
    assert not answer.success
    assert 'above 200 kPa' in answer.message
    graph.advance(rig, 0.3)
    assert graph.call(Trigger, 'e_stop_reset').success


def test_tare_and_reset(graph, rig):
    """Tare zeroes the force reading; reset goes back to the start while time goes on."""
    rig = rig()
    force = graph.listen('force', WrenchStamped)
    drive(graph, 2, lambda unit, t: 0.3 if t < 0.06 else 0.0)
    graph.advance(rig, 0.2)
    assert force[-1].wrench.force.x > 20.0
    answer = graph.call(Trigger, 'tare')
    assert answer.success
    assert 'kPa, and what that pulls reads as 0 N now' in answer.message
    graph.advance(rig, 0.05)
    assert abs(force[-1].wrench.force.x) < 1.0
    before = interface.stamp_ns(force[-1].header.stamp)
    assert graph.call(Trigger, 'reset').success
    assert rig.rig.truth.pressure.max() == 0.0
    assert 'kPa' not in graph.call(Trigger, 'tare').message
    graph.pacer.time = 0.0
    graph.advance(rig, 0.05)
    assert interface.stamp_ns(force[-1].header.stamp) == before + 10 * 5_000_000


def test_faults_show_on_the_topics(graph, bare):
    """nan, frozen and silent channels, switched while it runs."""
    graph.add(PlantSimulator(context=graph.context, overrides={**bare, 'rate': 100.0}))
    force = graph.listen('force', WrenchStamped)
    graph.until(lambda: len(force) > 3, 'force')
    assert graph.set('plant_simulator', faults__nan='force')[0].successful
    graph.until(lambda: math.isnan(force[-1].wrench.force.x), 'nan')
    assert graph.set('plant_simulator', faults__nan='', faults__silent='force')[0].successful
    graph.spin(0.1)
    count = len(force)
    graph.spin(0.2)
    assert len(force) == count


def test_stuck_valve_and_leak_act_on_the_air(graph, rig):
    """A stuck valve keeps filling, a leak empties."""
    rig = rig(faults__stuck_valve='mu1=0.2')
    drive(graph, 2, lambda unit, t: 0.0)
    graph.advance(rig, lambda: rig.rig.truth.pressure[0] > 100e3, 'pressure')
    assert graph.set('plant_simulator', faults__stuck_valve='',
                     faults__leak='mu1=0.05')[0].successful
    graph.advance(rig, lambda: rig.rig.truth.pressure[0] < 10e3, 'the leak')


@pytest.mark.parametrize('lock_step', [False, True], ids=['wall time', 'lock-step'])
def test_fault_clear_repairs_everything_at_once(graph, quiet, rig, lock_step):
    """The service takes back every fault, says which, and the parameters show it."""
    faults = {'faults.gain': 'force=2', 'faults.burst': 'mu2', 'faults.supply': 0.5,
              'faults.late': 'all=0.05'}
    node = rig(**faults) if lock_step else graph.add(PlantSimulator(
        context=graph.context, overrides={**quiet, **faults}))
    answer = graph.call(Trigger, 'fault/clear')
    assert answer.success
    assert answer.message.startswith('repaired: ')
    for word in ('force gain 2', 'mu2 burst', 'supply x0.5', 'mu1/pressure late 0.05'):
        assert word in answer.message
    assert node.faults.text == node.rig.faults.text == ''
    assert node.get_parameter('faults.gain').value == ''
    assert graph.call(Trigger, 'fault/clear').message == 'nothing was broken'


def test_late_messages_come_late_with_the_stamp_of_their_reading(graph, quiet):
    """In wall time a late channel comes a second after the others of the same sample."""
    node = graph.add(PlantSimulator(context=graph.context, overrides={
        **quiet, 'rate': 50.0, 'faults.late': 'force=1.0'}))
    force, strain = graph.listen('force', WrenchStamped), graph.listen('strain', JointState)
    graph.until(lambda: len(force) > 3, 'force')
    stamps = {interface.stamp_ns(each.header.stamp) for each in strain}
    newest = interface.stamp_ns(force[-1].header.stamp)
    assert newest in stamps
    assert max(stamps) - newest > 900_000_000
    # The rig itself is sound: only messages are late.
    assert node.rig.faults.text == ''


def test_lost_messages_are_missing_and_the_others_come(graph, quiet):
    """Of half of the messages of a channel nothing is sent; the rig itself is sound."""
    node = graph.add(PlantSimulator(context=graph.context, overrides={
        **quiet, 'rate': 100.0, 'faults.lost': 'force=0.5'}))
    force, strain = graph.listen('force', WrenchStamped), graph.listen('strain', JointState)
    graph.until(lambda: len(strain) > 150, 'strain')
    assert node.rig.faults.text == ''
    assert 0.3 < len(force) / len(strain) < 0.7


@pytest.mark.parametrize(('name', 'value', 'text'), [
    ('faults__nan', 'foo', "faults.nan names 'foo'; expected force, strain"),
    ('faults__leak', 'mu1', 'expected for example mu2=0.5'),
    ('faults__leak', 'mu1=0', 'leak of mu1 is 0; expected a time constant above 0 s'),
    ('faults__gain', 'force', "'force'; expected for example force=0.5"),
    ('faults__burst', 'mu1=2', 'expected for example mu1'),
    ('faults__units', 'force=psi', "units of force is 'psi'; expected kN"),
    ('faults__exchanged_valves', 'mu1=mu7', "names 'mu7'; expected mu1, mu2"),
    ('faults__stuck_valve', 'mu3=0.1', "'mu3'; expected mu1, mu2"),
    ('faults__stuck_valve', 'mu1=x', 'expected for example mu1=0.3'),
    ('command_timeout', 99.0, 'out of range'),
    ('rate', 100.0, 'read-only'),
])
def test_change_that_makes_no_sense_is_refused(graph, bare, name, value, text):
    """The answer of set_parameters says what was expected; the old value stays."""
    graph.add(PlantSimulator(context=graph.context, overrides=bare))
    result = graph.set('plant_simulator', **{name: value})[0]
    assert not result.successful
    assert text in result.reason


def test_diagnostics_say_that_it_is_simulated(graph, bare):
    """Once a second: simulated, waiting for whom, faults."""
    graph.add(PlantSimulator(context=graph.context, overrides={
        **bare, 'faults.noise_factor': 2.0}))
    states = graph.diagnostics('plant_simulator')
    graph.until(lambda: states, 'diagnostics')
    status = states[0]
    assert status.hardware_id == 'simulated'
    assert 'mu1: WAITING for valve commands' in status.message
    assert 'noise x2' in status.message
    # A busy machine may be slower.
    assert 50.0 < float(values_of(status)['sample rate']) < 220.0


def test_dynamometer_follows_a_profile(graph, rig, tmp_path):
    """load.profile imposes a strain over time."""
    file = tmp_path / 'pull.yaml'
    file.write_text('format: fam-bundle-trajectory/1\nquantity: strain\n'
                    'points: [[0 s, 0 %], [0.5 s, 10 %]]\n')
    rig = rig(load__strain=0.0, load__profile=str(file))
    drive(graph, 2, lambda unit, t: 0.0)
    graph.advance(rig, 0.25)
    assert rig.rig.truth.strain == pytest.approx(0.2 * graph.pacer.time, abs=1e-6)


def test_supply_is_open_only_by_leave(graph, quiet):
    """Never heard, false, or silent for supply_timeout: no air, and what is in goes out."""
    rig = graph.add(PlantSimulator(context=graph.context, overrides=quiet))
    supply = graph.listen('supply/pressure', FluidPressure)
    send = command(graph, 1)

    def fill(enough=lambda: False):
        send(graph.probe.now_ns(), 0.1)
        return enough()
    end = time.monotonic() + 0.5
    graph.until(lambda: fill(lambda: time.monotonic() > end), 'some time')
    assert rig.rig.truth.pressure[0] < 1e3
    assert supply[-1].fluid_pressure == pytest.approx(101325.0, abs=20e3)

    def filled():
        graph.enable_supply(rig, True)
        return fill(lambda: rig.rig.truth.pressure[0] > 100e3)
    graph.until(filled, 'pressure')
    # What was said last counts for half a second.
    graph.until(lambda: fill(lambda: rig.rig.truth.pressure[0] < 5e3), 'vented in silence')
    graph.until(filled, 'pressure')
    graph.enable_supply(rig, False)
    graph.until(lambda: fill(lambda: rig.rig.truth.pressure[0] < 5e3), 'vented')
    assert not rig.rig.e_stopped
