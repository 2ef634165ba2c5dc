# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The line protocol between serial_rig and a microcontroller. No ROS, no port.

Described for users in docs/how_to/serial_rig.md.

A line is ``body*CRC`` and a line feed: comma separated ASCII, and the CRC-16/CCITT-FALSE of the
body in four hexadecimal digits. A line that does not match its CRC or the protocol is garbled and
is not used.
"""

import binascii
from collections.abc import Sequence
from dataclasses import dataclass
import re

#: Version of the protocol. A board with another version gets no commands.
VERSION = 1
#: Time without a valid command after which a board cuts the supply and vents, s.
BOARD_TIMEOUT = 0.2
#: Bytes; a longer line is garbled.
LONGEST = 512
#: Valve command that opens a valve fully.
FULL = 1000
#: Counters and the board's clock have 32 bits.
WRAP = 2**32
#: Code of the board: its own pressure limit was exceeded.
OVER_PRESSURE = 4
#: Why the board keeps the supply shut, by its code.
AIR = {
    0: 'open',
    1: 'shut as commanded',
    2: f'no valid command for {BOARD_TIMEOUT:g} s',
    3: 'stop button',
    OVER_PRESSURE: 'pressure above the limit of the board',
}

_NUMBER = re.compile(r'[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?|nan')
_COUNT = re.compile(r'\d{1,10}')
_FIXED = 9


class GarbledLineError(ValueError):
    """A line that does not conform to the protocol, for the reason in the message."""


@dataclass(frozen=True)
class Hello:
    """The greeting of a board."""

    #: Version of the board's protocol.
    version: int
    #: Number of motor units; 0 if the version differs from `VERSION`.
    units: int
    #: Free text.
    name: str


@dataclass(frozen=True)
class BoardSample:
    """One line of readings, in the units of the board (`Scales.in_si` converts them)."""

    #: Counter of the lines that the board has sent.
    number: int
    #: The board's clock when the sensors were read, us; wraps at 2^32.
    time: int
    #: Number of the last valid command; 0 for none yet.
    command: int
    #: The stop button of the rig.
    stop: bool
    #: 0 while the supply is open, else why it is shut (`AIR`).
    air: int
    #: nan for a sensor that cannot be read.
    force: float
    contraction: float
    #: None where the board does not measure it.
    supply: float | None
    #: One for each motor unit.
    pressure: tuple[float, ...]


def checksum(body: bytes) -> bytes:
    """
    Return the CRC-16/CCITT-FALSE of a body: polynomial 0x1021, start 0xFFFF, four digits.

    Examples
    --------
    >>> checksum(b'123456789')
    b'29B1'
    """
    return b'%04X' % binascii.crc_hqx(body, 0xFFFF)


def frame(body: str) -> bytes:
    """Return a body as a line."""
    data = body.encode('ascii')
    return data + b'*' + checksum(data) + b'\n'


def hello_line() -> bytes:
    """Return the line that asks a board what it is."""
    return frame(f'H,{VERSION}')


def command_line(number: int, time: int, supply: bool, stop: bool,
                 valves: Sequence[float]) -> bytes:
    r"""
    Return a command.

    Parameters
    ----------
    number : int
        Counts commands, from 1.
    time : int, us
        Board time of the sample that the command answers.
    supply : bool
        Open the supply.
    stop : bool
        Emergency stop: supply shut, all valves exhaust, however old the command is.
    valves : sequence of float
        -1 exhaust, 0 closed, 1 fill.

    Examples
    --------
    >>> command_line(7, 1500, True, False, (0.25, -1.0))
    b'C,7,1500,1,0,250,-1000*96B8\n'
    """
    fields = [number % WRAP, time % WRAP, int(supply), int(stop),
              *(round(FULL * valve) for valve in valves)]
    return frame('C,' + ','.join(str(field) for field in fields))


def read_line(line: bytes) -> Hello | BoardSample:
    """Return the content of a line without its end; GarbledLineError if it is not quite one."""
    body, star, crc = line.rpartition(b'*')
    if not star:
        raise GarbledLineError('it has no checksum')
    if crc != checksum(body):
        raise GarbledLineError(f'its checksum is {crc!r}; expected {checksum(body)!r}')
    try:
        kind, *fields = body.decode('ascii').split(',')
    except UnicodeDecodeError:
        raise GarbledLineError('it is not ASCII') from None
    if kind == 'H':
        return _hello(fields)
    if kind == 'S':
        return _sample(fields)
    raise GarbledLineError(f'it begins with {kind!r}; expected H or S')


def _hello(fields: list[str]) -> Hello:
    version = _count(fields[0]) if fields else 0
    if version != VERSION:
        return Hello(version, 0, '')
    if len(fields) != 3:
        raise GarbledLineError(f'a hello has {len(fields)} fields; expected 3')
    return Hello(version, _count(fields[1]), fields[2])


def _sample(fields: list[str]) -> BoardSample:
    if len(fields) < _FIXED:
        raise GarbledLineError(f'a sample has {len(fields)} fields; expected {_FIXED} or more')
    number, time, command, stop, air = (_count(field) for field in fields[:5])
    if stop > 1 or air > 9:
        raise GarbledLineError(f'stop is {stop} and air is {air}; expected 0 or 1, and 0 to 9')
    return BoardSample(number, time, command, bool(stop), air, _number(fields[5]),
                       _number(fields[6]), _number(fields[7]) if fields[7] else None,
                       tuple(_number(field) for field in fields[8:]))


def _count(text: str) -> int:
    if not _COUNT.fullmatch(text) or int(text) >= WRAP:
        raise GarbledLineError(f'{text!r} is not a whole number from 0 to {WRAP - 1}')
    return int(text)


def _number(text: str) -> float:
    # float() alone would accept 1_0, blanks and infinity.
    if not _NUMBER.fullmatch(text):
        raise GarbledLineError(f'{text!r} is not a number')
    return float(text)


class LineSplitter:
    r"""
    Splits the bytes from a port into lines; a line may arrive in several parts.

    Attributes
    ----------
    overlong : int
        Lines that were longer than `LONGEST` and are lost.

    Examples
    --------
    >>> splitter = LineSplitter()
    >>> splitter.feed(b'ab'), splitter.feed(b'c\r\nd')
    ([], [b'abc'])
    """

    def __init__(self) -> None:
        self.overlong = 0
        self._rest = b''
        self._skip = False

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes; return the lines that are complete, without their ends."""
        *lines, self._rest = (self._rest + data).split(b'\n')
        if lines and self._skip:
            # The end of a line whose beginning was dropped.
            del lines[0]
            self._skip = False
        kept = [line.removesuffix(b'\r') for line in lines if len(line) <= LONGEST]
        self.overlong += len(lines) - len(kept)
        if len(self._rest) > LONGEST:
            self.overlong += not self._skip
            self._rest, self._skip = b'', True
        return [line for line in kept if line]
