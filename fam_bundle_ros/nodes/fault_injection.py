# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Faults of the simulated rig over ROS: parameters ``faults.*``, service ``fault/clear``, messages.

Faults of instruments, valves and air belong to the rig (`fam_bundle_ros.plant.Faults`). Those of
messages act here, between rig and topics: none sent, sent late, some lost. In lock-step every
node waits for a late or lost message, so the rig delays or repeats the reading instead, as in
the closed loop without ROS.
"""

from collections.abc import Callable, Sequence
import copy
from dataclasses import replace
import heapq
from itertools import count
import random
import time
from typing import Any

from rclpy.parameter import Parameter

from fam_bundle_ros.errors import about, InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.parameters import Spec
from fam_bundle_ros.plant import Faults
from fam_bundle_ros.plant.faults import check_faults, UNITS
from fam_bundle_ros.plant.sensors import channel_names

_CHANNELS = ('channels: force, strain, supply, mu1/pressure, ...; all for every one; several '
             'with commas')
#: Parameter, meaning, example ('' where the parameter lists names only).
_OF_CHANNELS = (
    ('nan', f'show nan, {_CHANNELS}', ''),
    ('frozen', 'repeat their last reading', ''),
    ('plugged', 'show their last reading with its noise, as behind a plugged port', ''),
    ('range_end', "highest reading, the end of the sensor's range", 'mu1/pressure=340e3'),
    ('gain', 'factor on a reading', 'force=0.5'),
    ('offset', 'added to a reading, in its unit', 'mu1/pressure=-50e3'),
    ('drift', 'added to a reading per second', 'mu1/pressure=-20e3'),
    ('spike', 'added to one reading in 0.1 s', 'mu1/pressure=-2e5'),
    ('delay', 'delay of a reading, s, which has the present stamp', 'force=0.1'),
    ('exchanged', 'two channels exchanged', 'mu1/pressure=mu2/pressure'),
    ('units', 'unit in which a reading is sent: '
     + ', '.join(unit for units in UNITS.values() for unit in units), 'mu1/pressure=psi'),
    ('silent', 'nothing is sent', ''),
    ('late', 'delay of a message, s, which keeps the stamp of its reading', 'all=0.3'),
    ('lost', 'share of the messages that is lost', 'force=0.5'),
)
_OF_UNITS = (
    ('stuck_valve', 'valves stuck at their present opening or at a given one', 'mu1=0.3'),
    ('leaking_valve', 'valves that let supply air in, through an opening', 'mu1=0.1'),
    ('reversed_valve', 'valves that exhaust when commanded to fill', ''),
    ('exchanged_valves', 'two valves exchanged', 'mu1=mu2'),
    ('leak', 'leaks with their time constant in s', 'mu2=0.5'),
    ('burst', 'motor units with a torn muscle', ''),
)
#: Field of `Faults`, where the parameter has another name.
_FIELDS = {'nan': 'dropout'}

FAULTS = (
    *(Spec(f'faults.{name}', '', f'{meaning}: {example}' if example else meaning, dynamic=True)
      for name, meaning, example in _OF_CHANNELS),
    *(Spec(f'faults.{name}', '', f"{meaning}: {example or 'mu1'}", dynamic=True)
      for name, meaning, example in _OF_UNITS),
    Spec('faults.noise_factor', 1.0, 'factor on the noise of all instruments', 0.0, 1e3,
         dynamic=True),
    Spec('faults.supply', 1.0, 'share of its set point that the supply gives; 0: the hose is off',
         0.0, 10.0, dynamic=True),
)


def faults_from(values: dict[str, Any], units: int) -> Faults:
    """Return the faults that the parameters describe; InputError for wrong names or values."""
    channels = channel_names(units)
    index = {name: i for i, name in enumerate(interface.unit_names(units))}
    faults = Faults(noise_factor=values['faults.noise_factor'], supply=values['faults.supply'])
    for table, known in ((_OF_CHANNELS, (*channels, 'all')), (_OF_UNITS, tuple(index))):
        for name, _, example in table:
            found: dict[str | int, Any] = {}
            for item, value in _pairs(f'faults.{name}', values[f'faults.{name}'], known, example):
                for each in channels if item == 'all' else (item,):
                    found[index.get(each, each)] = index.get(value, value)
            setattr(faults, _FIELDS.get(name, name), found if example else set(found))
    with about('faults.*'):
        check_faults(faults, units)
    return faults


def _pairs(name: str, text: str, known: Sequence[str], example: str) -> list[tuple[str, Any]]:
    """Return the names in a parameter with their values; None for a name without a value."""
    bare = name == 'faults.stuck_valve'
    found: list[tuple[str, Any]] = []
    for item in filter(None, (part.strip() for part in text.split(','))):
        what, equals, value = (part.strip() for part in item.partition('='))
        if what not in known:
            raise InputError(f"{name} names '{what}'; expected {', '.join(known)}")
        if bool(equals) != bool(example) and not (bare and not equals):
            raise InputError(f"{name} has '{item}'; expected for example {example or known[0]}")
        found.append((what, _value(name, item, value, known, example) if equals else None))
    return found


def _value(name: str, item: str, value: str, known: Sequence[str], example: str) -> Any:
    """Return the value of an item: a number, a unit, or a name of the same kind."""
    if 'exchanged' in name and value not in known:
        raise InputError(f"{name} names '{value}'; expected {', '.join(known)}")
    if 'exchanged' in name or name == 'faults.units':
        return value
    try:
        return float(value)
    except ValueError:
        raise InputError(f"{name} has '{item}'; expected for example {example}") from None


class FaultInjection:
    """
    Applies the faults of the parameters ``faults.*`` to a simulated rig and its messages.

    The node has `FAULTS` among its parameters. ``apply`` gets the `Faults` of the rig, at once and
    at every change.
    """

    def __init__(self, node: BundleNode, units: int, apply: Callable[[Faults], None]):
        self._node, self._units, self._apply = node, units, apply
        self._random = random.Random(0)
        #: Delayed messages: steady time when due (s), sequence number, function that sends.
        self._held: list[tuple[float, int, Callable[[], None]]] = []
        self._number = count()
        self._timer: Any = None
        #: Those of the rig and those of messages.
        self.faults = Faults()
        self.take()
        node.trigger(interface.FAULT_CLEAR, self._clear)

    def check(self, values: dict[str, Any]) -> None:
        """Check the parameters (InputError)."""
        faults_from(values, self._units)

    def take(self) -> None:
        """Apply the present parameters."""
        self.set(faults_from(self._node.p, self._units))

    def set(self, faults: Faults) -> None:
        """Apply other faults than those of the parameters, until a parameter changes."""
        self.faults = faults
        if self._node.lock_step:
            self._apply(replace(copy.deepcopy(self.faults), silent=set()))
        else:
            self._apply(self.faults.without_messages())

    def send(self, channel: str, send: Callable[..., None], *values: Any) -> None:
        """Send a message, or delay or drop it as the faults say."""
        faults = self.faults
        if channel in faults.silent:
            return
        if not self._node.lock_step:
            if self._random.random() < faults.lost.get(channel, 0.0):
                return
            if late := faults.late.get(channel, 0.0):
                heapq.heappush(self._held, (time.monotonic() + late, next(self._number),
                                            lambda: send(*values)))
                if self._timer is None:
                    self._timer = self._node.every(1e-3, self._send_held)
                return
        send(*values)

    def _send_held(self) -> None:
        now = time.monotonic()
        while self._held and self._held[0][0] <= now:
            heapq.heappop(self._held)[2]()
        if not self._held and self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None

    def _clear(self) -> str:
        before = self.faults.text
        # As parameters, so that reading them shows the present state.
        self._node.set_parameters([Parameter(spec.name, value=spec.default) for spec in FAULTS])
        return f'repaired: {before}' if before else 'nothing was broken'
