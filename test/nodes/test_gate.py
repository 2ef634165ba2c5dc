# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Lock-step gate, without ROS."""

from fam_bundle_ros.nodes.gate import Gate


def test_gate_opens_only_when_all_stamps_agree():
    """An old value never answers a new stamp."""
    gate = Gate('ab')
    assert not gate.put('a', 1, 'x')
    assert gate.put('b', 1, 'y')
    assert not gate.put('b', 2, 'y')
    assert gate.missing == ['a']
    assert gate.value('a') is None


def test_gate_opens_again_for_a_repeated_stamp():
    """Who asks again is answered again: a lost answer must not stop the loop."""
    gate = Gate('ab')
    gate.put('a', 1, 'x')
    gate.put('b', 1, 'y')
    assert gate.put('a', 1, 'x')


def test_lost_channel_is_not_waited_for_until_it_returns():
    """After giving up, the rest goes on alone; a message brings the channel back."""
    gate = Gate('ab')
    gate.put('a', 1, 'x')
    gate.put('b', 1, 'y')
    gate.put('a', 2, 'x')
    assert gate.give_up() == ['b']
    assert gate.put('a', 3, 'x')
    assert not gate.put('b', 1, 'late')
    assert not gate.put('a', 4, 'x')
    assert gate.put('b', 4, 'y')


def test_gate_begins_anew_when_time_goes_back():
    """A simulator that was started again sends small stamps."""
    gate = Gate('ab')
    gate.put('a', 90, 'x')
    gate.put('b', 90, 'y')
    assert not gate.put('a', 1, 'x')
    assert gate.put('b', 1, 'y')
    assert gate.stamp == 1
