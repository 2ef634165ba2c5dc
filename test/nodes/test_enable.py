# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a controller waits for before it brings pressure: enable, the stop, and a new reference."""

from geometry_msgs.msg import WrenchStamped
import pytest
from std_msgs.msg import Bool, UInt8
from std_srvs.srv import Trigger
import yaml

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.resources import config_path

from .whole_bundle import hold


def test_switching_on_and_off_makes_no_jump(graph, bundle):
    """Off: pressures ramp down; on again: from the pressures as they are."""
    rig, node = bundle(hold(60.0))
    graph.advance(rig, 1.0)
    assert graph.enable(False).success
    graph.advance(rig, 0.1)
    assert 100e3 < rig.rig.truth.pressure[0] < 250e3
    at = rig.rig.truth.pressure[0]
    assert graph.enable().success
    graph.advance(rig, 0.005)
    graph.advance(rig, 0.005)
    assert node.setpoints[0] == pytest.approx(at, abs=25e3)
    graph.advance(rig, 1.0)
    assert rig.rig.truth.force == pytest.approx(60.0, abs=2.0)


def test_waits_for_enable_and_for_a_reference(graph, bundle):
    """Not enabled, nothing moves; state 0 is published from the start."""
    rig, node = bundle(hold(60.0), start_enabled=False)
    states = graph.listen('recruitment_state', UInt8, interface.LATCHED)
    graph.advance(rig, 0.3)
    assert node._guard.word == 'OFF'
    assert states[0].data == 0
    assert rig.rig.truth.pressure.max() < 1e3
    graph.enable()
    graph.advance(rig, 1.2)
    assert rig.rig.truth.force == pytest.approx(60.0, abs=2.0)


def test_emergency_stop_needs_enable_to_go_on(graph, bundle):
    """After e_stop_reset nothing moves by itself."""
    rig, node = bundle(hold(60.0))
    graph.advance(rig, 0.5)
    graph.call(Trigger, 'e_stop_trigger')
    graph.until(lambda: node._oversight.e_stop.on, 'the stop')
    assert not graph.enable().success
    graph.advance(rig, 0.3)
    graph.call(Trigger, 'e_stop_reset')
    graph.until(lambda: not node._oversight.e_stop.on, 'the reset')
    graph.advance(rig, 0.3)
    assert rig.rig.truth.pressure.max() < 5e3
    assert graph.enable().success
    graph.advance(rig, 1.2)
    assert rig.rig.truth.force == pytest.approx(60.0, abs=2.0)


def disable(graph, node):
    """Switch off by hand."""
    graph.enable(False)


def stop(graph, node):
    """Stop, and take the stop back."""
    graph.call(Trigger, 'e_stop_trigger')
    graph.until(lambda: node._guard.word == 'E_STOP', 'the stop')
    graph.call(Trigger, 'e_stop_reset')
    graph.until(lambda: node._guard.word == 'OFF', 'the reset')


def over_pressure(graph, node):
    """Let a valve hang open for a moment."""
    graph.set('plant_simulator', faults__stuck_valve='mu1=1.0')
    graph.until(lambda: node._guard.latched, 'the latch')
    graph.set('plant_simulator', faults__stuck_valve='')
    graph.until(lambda: max(node._oversight.pressure) < 5e3, 'vented')


def time_out(graph, node):
    """Ask for references that keep coming, for a moment."""
    graph.set('recruitment_controller', reference_timeout=0.2)
    graph.until(lambda: node._guard.word == 'NO_REFERENCE', 'the time-out')
    graph.set('recruitment_controller', reference_timeout=0.0)


@pytest.mark.parametrize('event', [disable, stop, over_pressure, time_out])
def test_old_reference_never_comes_back(graph, live, event):
    """After anything that switched off, enable waits for a reference that is new."""
    rig, node = live(start_enabled=False)
    publisher = graph.probe.create_publisher(WrenchStamped, 'reference/force', 10)
    graph.until(lambda: publisher.get_subscription_count() == 1, 'the node')
    publisher.publish(interface.force_message(1, 60.0))
    graph.until(lambda: node._references.meter.last is not None, 'the reference')
    # One from before the first enable counts; refused while a reading has not come yet.
    graph.until(lambda: graph.enable().success, 'enable')
    graph.until(lambda: rig.rig.truth.force > 40.0, 'force')
    event(graph, node)
    assert graph.enable().success
    graph.until(lambda: rig.rig.truth.pressure.max() < 5e3, 'vented')
    graph.spin(0.5)
    assert rig.rig.truth.pressure.max() < 5e3
    assert node._guard.word == ('NO_REFERENCE' if event is time_out else 'WAITING')
    publisher.publish(interface.force_message(1, 60.0))
    graph.until(lambda: rig.rig.truth.force > 40.0, 'force')


def test_rig_yaml_asks_for_references_that_keep_coming():
    """On a real rig an operator that died leaves no pressure."""
    values = yaml.safe_load(config_path('rig.yaml').read_text())['/**']['ros__parameters']
    assert 0.0 < values['reference_timeout'] <= 5.0


def test_stop_of_one_button_is_not_taken_back_by_another(graph, live):
    """While two publish e_stop, a False may come from the one that knows of no stop."""
    _, node = live()
    states = graph.diagnostics('recruitment_controller')
    button = graph.probe.create_publisher(Bool, 'e_stop', interface.LATCHED)
    graph.until(lambda: graph.probe.count_publishers('/bundle/e_stop') == 2
                and button.get_subscription_count() >= 3, 'the button')
    button.publish(interface.bool_message(True))
    graph.until(lambda: node._oversight.e_stop.on, 'the stop')
    assert graph.call(Trigger, 'e_stop_reset').success
    graph.until(lambda: node._oversight.e_stop.doubt, 'the False of the rig')
    answer = graph.enable()
    assert not answer.success
    assert '2 publishers on e_stop' in answer.message
    graph.until(lambda: any('2 publishers on e_stop' in state.message
                            and state.level == b'\x02' for state in states), 'diagnostics')
    # With one publisher it says what it says.
    graph.probe.destroy_publisher(button)
    graph.until(lambda: graph.probe.count_publishers('/bundle/e_stop') == 1, 'one publisher')
    graph.call(Trigger, 'e_stop_reset')
    graph.until(lambda: not node._oversight.e_stop.on, 'the reset')
    assert graph.enable().success
