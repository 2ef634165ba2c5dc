# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
How pressure loops report their state to the recruitment controller.

Every pressure loop publishes ``mu<i>/pid_state`` on every change and 20 times a second:
one word of `State`, followed by cause and reason if there are any: ``LATCHED OVER_PRESSURE: mu1 at
410 kPa, above 396 kPa``.
"""

from collections.abc import Callable
from functools import partial
import time

from std_msgs.msg import String

from fam_bundle_ros.control.safety import Change, LostTime, State
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode

#: Period of the messages while the state does not change, s.
PERIOD = 0.05
#: Cause of a pressure loop that vents in an emergency stop.
STOPPED = 'E_STOP'
#: States of a pressure loop in which its motor unit is vented because something is wrong.
TROUBLE = ('SENSOR', 'NO_SETPOINT', STOPPED)


def state_text(change: Change) -> str:
    """
    Return the text of a state, as published.

    Examples
    --------
    >>> state_text(Change(0.0, State.HOLD, 'SENSOR', 'mu1 pressure is nan'))
    'HOLD SENSOR: mu1 pressure is nan'
    """
    text = f'{change.state.value} {change.cause}'.strip()
    return f'{text}: {change.reason}' if change.reason else text


def read_state(text: str) -> tuple[str, str, str]:
    """Return state, cause and reason of a text of `state_text`."""
    head, _, reason = text.partition(': ')
    state, _, cause = head.partition(' ')
    return state, cause, reason


class LoopState:
    """Publishes the state of a pressure loop."""

    def __init__(self, node: BundleNode, unit: int):
        self._send = node.sender(interface.pid_state_topic(unit), String, interface.text_message,
                                 interface.LATCHED)
        self._text = ''
        if not node.lock_step:
            # In the executor of the control loop, so that a loop that hangs is silent.
            node.every(PERIOD, lambda: self._send(self._text))

    def say(self, change: Change) -> None:
        """Publish a change of state."""
        self._text = state_text(change)
        self._send(self._text)


class PressureLoops:
    """
    Receives the states of the pressure loops of all motor units.

    ``on_latched`` is called with cause and reason when a loop latches.
    """

    def __init__(self, node: BundleNode, units: int, on_latched: Callable[[str, str], None]):
        self._on_latched = on_latched
        self._lock_step = node.lock_step
        self._states = [('', '', '')] * units
        self._heard: list[float | None] = [None] * units
        #: Time for which each loop has vented because of its own sensor or setpoint.
        self.trouble = [LostTime() for _ in range(units)]
        for unit in range(units):
            node.subscribe(interface.pid_state_topic(unit + 1), String, partial(self._take, unit),
                           interface.LATCHED if node.lock_step else interface.REPEATED)

    def _take(self, unit: int, message: String) -> None:
        now = time.monotonic()
        self._heard[unit] = now
        before, self._states[unit] = self._states[unit], read_state(message.data)
        state, cause, reason = self._states[unit]
        if state == State.LATCHED.value and before[0] != state:
            self._on_latched(cause, reason)

    def latched(self, unit: int) -> str:
        """Return why a loop is latched; empty when it is not."""
        state, cause, reason = self._states[unit]
        return f'{cause}: {reason}' if state == State.LATCHED.value else ''

    def stopped(self, unit: int) -> bool:
        """Return whether a loop vents in an emergency stop."""
        return self._states[unit][:2] == (State.VENT.value, STOPPED)

    def silent(self, patience: float) -> list[int]:
        """Return the motor units (from 0) whose loops were silent for ``patience`` (s)."""
        if self._lock_step:
            # In lock-step time stands still without the loops, and a lost unit is vented.
            return []
        now = time.monotonic()
        return [unit for unit, heard in enumerate(self._heard)
                if heard is None or now - heard > patience]

    def excuse(self, seconds: float) -> None:
        """Exclude a time (s) in which this process itself stood still from the silence."""
        self._heard = [None if heard is None else heard + seconds for heard in self._heard]

    def troubled(self, patience: float) -> str:
        """Return which loop has vented by itself for ``patience`` (s) in total, and why."""
        now = time.monotonic()
        for unit, (state, cause, reason) in enumerate(self._states):
            lost = state == State.VENT.value and cause in TROUBLE
            if self.trouble[unit].see(now, lost, patience):
                return f'mu{unit + 1} is vented by its pressure loop, {cause}: {reason}'
        return ''
