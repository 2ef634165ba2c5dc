# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Faults of a simulated rig: instruments, messages, valves, muscles, supply.

`Faults` is the user's description, `FaultRecord` the same for kernels. The compiled closed loop
and the simulator over ROS take the same faults. Only the simulator has messages, on which
`silent`, `late` and `lost` act; in the closed loop a missing reading is repeated, and a late one
is delayed.
"""

from collections.abc import Iterable
import copy
from dataclasses import dataclass, field, fields
import math
from typing import Any

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant.sensors import channel_names

#: s: time constant with which a torn muscle loses its gauge pressure.
BURST_TIME = 0.01
#: Factor on a reading that a driver sends in this unit instead of the SI unit.
UNITS: dict[str, dict[str, float]] = {
    'pressure': {'kPa': 1e-3, 'MPa': 1e-6, 'bar': 1e-5, 'mbar': 1e-2, 'psi': 1.0 / 6894.757},
    'force': {'kN': 1e-3, 'kgf': 1.0 / 9.80665, 'lbf': 1.0 / 4.448222},
    'strain': {'percent': 100.0},
}


@dataclass
class Faults:
    """
    The present faults; they may change at any time. Motor units count from 0.

    Channels are 'force', 'strain', 'supply', 'mu1/pressure', ... Faults of a reading act on
    the reading without faults, in the order below.
    """

    #: Instruments exchanged: pairs of channels.
    exchanged: dict[str, str] = field(default_factory=dict)
    #: s, delay of a reading, which has the present stamp.
    delay: dict[str, float] = field(default_factory=dict)
    #: A reading is sent in this unit instead of Pa, N or 1 (`UNITS`).
    units: dict[str, str] = field(default_factory=dict)
    #: Factor on a reading; offset; offset per second; offset of one reading every 0.1 s.
    gain: dict[str, float] = field(default_factory=dict)
    offset: dict[str, float] = field(default_factory=dict)
    drift: dict[str, float] = field(default_factory=dict)
    spike: dict[str, float] = field(default_factory=dict)
    #: Channels that show nan; that repeat their last reading.
    dropout: set[str] = field(default_factory=set)
    frozen: set[str] = field(default_factory=set)
    #: Channels that show their last reading with their noise, as behind a plugged port.
    plugged: set[str] = field(default_factory=set)
    #: Highest reading, the end of a sensor's range, to which its noise is added.
    range_end: dict[str, float] = field(default_factory=dict)
    #: Factor on the noise of every channel.
    noise_factor: float = 1.0
    #: Messages: channels that are not sent; delay in s, with the stamp of the reading; share
    #: that is lost.
    silent: set[str] = field(default_factory=set)
    late: dict[str, float] = field(default_factory=dict)
    lost: dict[str, float] = field(default_factory=dict)
    #: Spool position (-1..1) of stuck valves; None: the present position.
    stuck_valve: dict[int, float | None] = field(default_factory=dict)
    #: Opening (0..1) through which supply air constantly leaks into a unit.
    leaking_valve: dict[int, float] = field(default_factory=dict)
    #: Valves with the opposite sign of the command; pairs of valves with exchanged commands.
    reversed_valve: set[int] = field(default_factory=set)
    exchanged_valves: dict[int, int] = field(default_factory=dict)
    #: Time constant in s of the decay of a chamber's gauge pressure.
    leak: dict[int, float] = field(default_factory=dict)
    #: Motor units with a torn muscle: a leak of `BURST_TIME`.
    burst: set[int] = field(default_factory=set)
    #: Supply pressure over its set point: 0 for a detached hose, above 1 for a failed regulator.
    supply: float = 1.0

    def clear(self) -> None:
        """Remove all faults."""
        self.__dict__.update(Faults().__dict__)

    def without_messages(self) -> 'Faults':
        """Return the faults without those of messages, which another process sends."""
        rest = copy.deepcopy(self)
        rest.silent, rest.late, rest.lost = set(), {}, {}
        return rest

    @property
    def text(self) -> str:
        """The present faults as text; empty without faults."""
        parts = []
        for item in fields(self):
            value, name = getattr(self, item.name), item.name.replace('_', ' ')
            if item.name in ('noise_factor', 'supply'):
                if value != 1.0:
                    parts.append(f"{'noise' if item.name == 'noise_factor' else name} x{value:g}")
            else:
                parts += [_sentence(item.name, name, key, value) for key in sorted(value)]
        return ', '.join(parts)


def _sentence(field_name: str, name: str, key: Any, value: Any) -> str:
    """Return one fault as text."""
    what = key if isinstance(key, str) else f'mu{key + 1}'
    number = value[key] if isinstance(value, dict) else None
    if isinstance(number, int) and field_name == 'exchanged_valves':
        number = f'mu{number + 1}'
    number = f'{number:g}' if isinstance(number, float) else number
    return f'{what} {name}' if number is None else f'{what} {name} {number}'


@dataclass
class FaultRecord:
    """Faults for kernels: one value per motor unit, then one per channel."""

    #: 1/s, decay rate of the gauge pressure, including the leak of the plant's own model.
    leak: list[float]
    #: Position of a stuck valve, infinity for its position when the fault begins; nan for a
    #: moving valve.
    stuck: list[float]
    #: Opening through which supply air leaks in.
    seep: list[float]
    #: Index of the command that a valve receives, and the factor on it.
    command_of: list[int]
    command_sign: list[float]
    #: Regulator pressure over its set point.
    supply: float
    #: Whether any of the following is a fault.
    spoilt: bool
    #: 1 for a channel without a reading; 1 for one that repeats its last; share of repeats.
    lost: list[int]
    held: list[int]
    skipped: list[float]
    #: 1 for a channel that repeats its last reading with noise; highest reading without noise.
    plugged: list[int]
    range_end: list[float]
    #: Index of the channel that is shown, delay (s), and the longest delay.
    reading_of: list[int]
    delay: list[float]
    longest: float
    gain: list[float]
    offset: list[float]
    drift: list[float]
    spike: list[float]
    #: Factor on the noise of every channel.
    noise_factor: float


def fault_record(faults: Faults, leak: float, units: int) -> FaultRecord:
    """
    Return the record for kernels.

    Parameters
    ----------
    leak : float, 1/s
        Leak of every chamber without a fault.
    units : int
        Number of motor units.

    Raises
    ------
    InputError
        When a fault has an unknown motor unit or channel, or a value out of range.
    """
    check_faults(faults, units)
    names = channel_names(units)

    def each(values: dict[str, float], sound: float) -> list[float]:
        return [float(values.get(name, sound)) for name in names]

    delay = [max(faults.delay.get(name, 0.0), faults.late.get(name, 0.0)) for name in names]
    stuck = {unit: math.inf if position is None else float(position)
             for unit, position in faults.stuck_valve.items()}
    return FaultRecord(
        leak=[leak + (1.0 / faults.leak[i] if i in faults.leak else 0.0)
              + (1.0 / BURST_TIME if i in faults.burst else 0.0) for i in range(units)],
        stuck=[stuck.get(i, math.nan) for i in range(units)],
        seep=[float(faults.leaking_valve.get(i, 0.0)) for i in range(units)],
        command_of=_exchange(range(units), faults.exchanged_valves),
        command_sign=[-1.0 if i in faults.reversed_valve else 1.0 for i in range(units)],
        supply=float(faults.supply), spoilt=any((
            faults.dropout, faults.frozen, faults.silent, faults.late, faults.lost,
            faults.exchanged, faults.delay, faults.units, faults.gain, faults.offset,
            faults.drift, faults.spike, faults.plugged, faults.range_end)),
        lost=[int(name in faults.dropout) for name in names],
        held=[int(name in faults.frozen or name in faults.silent) for name in names],
        skipped=each(faults.lost, 0.0),
        plugged=[int(name in faults.plugged) for name in names],
        range_end=each(faults.range_end, math.inf),
        reading_of=[names.index(name) for name in _exchange(names, faults.exchanged)],
        delay=[float(value) for value in delay], longest=float(max(delay)),
        gain=[float(faults.gain.get(name, 1.0)) * _in_unit(name, faults.units.get(name))
              for name in names],
        offset=each(faults.offset, 0.0), drift=each(faults.drift, 0.0),
        spike=each(faults.spike, 0.0), noise_factor=float(faults.noise_factor))


def check_faults(faults: Faults, units: int) -> None:
    """Check names and values of the faults; InputError names fault, value and expected one."""
    names = channel_names(units)
    for item in fields(faults):
        value = getattr(faults, item.name)
        if isinstance(value, float | int):
            if not 0.0 <= value < math.inf:
                raise InputError(f'fault {item.name} is {value:g}; expected a number from 0')
            continue
        by_unit = 'int' in str(item.type)
        keys = set(value) | (set(value.values()) if item.name.startswith('exchanged') else set())
        for key in sorted(keys, key=str):
            if by_unit and key not in range(units):
                raise InputError(f'fault {item.name} of motor unit {key}; '
                                 f'there are 0 to {units - 1}')
            if not by_unit and key not in names:
                raise InputError(f"fault {item.name}: no sensor channel '{key}'; "
                                 f"there are {', '.join(names)}")
        if isinstance(value, dict):
            for key, number in value.items():
                _check_value(item.name, key, number)


#: Least and largest value of a fault, and the range as text.
_RANGES = {
    'stuck_valve': (-1.0, 1.0, '-1 to 1'), 'leaking_valve': (0.0, 1.0, '0 to 1'),
    'lost': (0.0, 1.0, 'a share from 0 to 1'), 'delay': (0.0, 60.0, '0 to 60 s'),
    'late': (0.0, 60.0, '0 to 60 s'),
    'leak': (1e-6, math.inf, 'a time constant above 0 s'),
}


def _check_value(name: str, key: Any, value: Any) -> None:
    what = key if isinstance(key, str) else f'mu{key + 1}'
    if name.startswith('exchanged'):
        if value == key:
            raise InputError(f'fault {name} of {what}: with itself; expected another one')
    elif name == 'units':
        _in_unit(key, value)
    elif value is not None:
        low, high, words = _RANGES.get(name, (-math.inf, math.inf, 'a number'))
        if not (math.isfinite(value) and low <= value <= high):
            raise InputError(f'fault {name} of {what} is {value:g}; expected {words}')


def _in_unit(channel: str, unit: str | None) -> float:
    """Return the factor of a unit on the readings of a channel."""
    if unit is None:
        return 1.0
    kind = channel if channel in UNITS else 'pressure'
    if unit not in UNITS[kind]:
        raise InputError(f"fault units of {channel} is '{unit}'; expected "
                         f"{', '.join(UNITS[kind])}")
    return UNITS[kind][unit]


def _exchange(names: Iterable[Any], pairs: dict[Any, Any]) -> list[Any]:
    """Return the partner of each name, or the name itself."""
    found = {name: name for name in names}
    for one, other in pairs.items():
        found[one], found[other] = found[other], found[one]
    return list(found.values())
