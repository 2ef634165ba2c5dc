# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The connection to a microcontroller: handshake, samples and their times, lost lines, time-outs.

No ROS and no serial port: takes bytes, returns samples with their times.
"""

from collections.abc import Callable
from enum import Enum

from fam_bundle_ros.nodes.serial_protocol import (
    BOARD_TIMEOUT,
    BoardSample,
    GarbledLineError,
    Hello,
    LineSplitter,
    read_line,
    VERSION,
    WRAP,
)

#: Time between two handshake requests while the board does not answer, s.
_GREETING = 0.25
#: Time without an acknowledged command after which the board counts as deaf, s: twice its own
#: time-out for commands.
_DEAF = 2.0 * BOARD_TIMEOUT
#: Largest number of commands that wait for an answer.
_OPEN_COMMANDS = 512
#: Largest relative drift between the clocks: 0.5 % for each, as of ceramic resonators.
DRIFT = 0.01


class BoardClock:
    """
    Converts the clock of a board, 32 bit of microseconds, to the clock of this machine.

    A line arrives after its sample was taken, and some lines arrive with hardly any delay. So the
    smallest difference between the two clocks is their offset, and a delayed line still gets the
    right time.

    The estimate is late by the shortest delay of the line, and by up to 1 % of the time since a
    line last came with that delay.

    Examples
    --------
    >>> clock = BoardClock()
    >>> clock.time(1_000_000, 50.0)
    50.0
    >>> round(clock.time(1_010_000, 50.04), 3)   # 30 ms late
    50.01
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start again, after a restart of the board."""
        self._ticks: int | None = None
        self._elapsed = self._offset = 0.0

    def time(self, ticks: int, received: float) -> float:
        """Return when a sample of ``ticks`` (us, modulo 2^32) was taken, s, not after it came."""
        if self._ticks is None:
            self._ticks, self._offset = ticks, received
            return received
        passed = (ticks - self._ticks) % WRAP * 1e-6
        self._ticks = ticks
        self._elapsed += passed
        self._offset = min(received - self._elapsed, self._offset + DRIFT * passed)
        return self._elapsed + self._offset


class Talk(Enum):
    """State of the connection, and why it is not running."""

    CLOSED = 'the port is not open'
    GREETING = 'the board has not answered yet'
    REFUSED = 'the board does not fit'
    RUNNING = ''


class Board:
    """
    State of the connection to a board, which must have a number of motor units.

    Times are of one steady clock, s. After a silence of ``timeout`` the board counts as lost;
    ``on_lost`` is called with the reason when a running board is.
    """

    def __init__(self, units: int, timeout: float, on_lost: Callable[[str], None]):
        self._units = units
        self._timeout = timeout
        self._on_lost = on_lost
        #: Numbers of missing lines, of unreadable lines, of reopened ports, of restarts of the
        #: board, and of samples whose time is not known (see `feed`).
        self.lost = self.garbled = self.reconnects = self.restarts = self.skipped = 0
        #: Why the last garbled line could not be read.
        self.last_garbled = ''
        #: What the board calls itself.
        self.name = ''
        #: Newest time from sending a command to the first sample that acknowledges it, s.
        self.round_trip = 0.0
        #: Newest sample, and when it was taken.
        self.newest: BoardSample | None = None
        self.taken = 0.0
        self._clock = BoardClock()
        self._splitter = LineSplitter()
        self._greeted = float('-inf')
        self._received = self._heard = 0.0
        self._latest = float('-inf')
        self._sent: dict[int, float] = {}
        self._opened = 0
        self._become(Talk.CLOSED)

    @property
    def running(self) -> bool:
        """Whether samples are accepted and commands may be sent."""
        return self.talk is Talk.RUNNING

    # --- what happens --------------------------------------------------------------------------

    def opened(self) -> None:
        """Note that the port is open."""
        self._opened += 1
        self.reconnects = self._opened - 1
        self._splitter = LineSplitter()
        self._begin_anew()
        self._become(Talk.GREETING)

    def closed(self, reason: str) -> None:
        """Note that the port is not, or no longer, open."""
        self._leave(Talk.CLOSED, reason)

    def feed(self, data: bytes, received: float) -> list[tuple[BoardSample, float]]:
        """
        Take bytes; return the samples in them, each with the time when it was taken, s.

        Of the lines that are buffered when the port is opened only the first is used: the time
        between them is not known yet.
        """
        overlong = self._splitter.overlong
        samples = []
        for line in self._splitter.feed(data):
            try:
                said = read_line(line)
                if isinstance(said, Hello):
                    self._greet(said, received)
                elif self.running and self._take(said, received):
                    samples.append((said, self.taken))
            except GarbledLineError as error:
                self.garbled += 1
                self.last_garbled = str(error)
        if self._splitter.overlong > overlong:
            self.garbled += self._splitter.overlong - overlong
            self.last_garbled = 'it is too long'
        return samples

    def sent(self, number: int, now: float) -> None:
        """Record that a command was sent."""
        self._sent[number] = now
        if len(self._sent) > _OPEN_COMMANDS:
            del self._sent[next(iter(self._sent))]

    def greeting_due(self, now: float) -> bool:
        """Return whether to greet the board now."""
        if self.talk in (Talk.CLOSED, Talk.RUNNING) or now - self._greeted < _GREETING:
            return False
        self._greeted = now
        return True

    def check(self, now: float) -> None:
        """Detect a board that has fallen silent; call this often."""
        if self.running and now - self._received > self._timeout:
            self._leave(Talk.GREETING, f'the board was silent for {now - self._received:.2f} s')

    # --- what is known -------------------------------------------------------------------------

    @property
    def deaf(self) -> str:
        """Why the board seems to receive no commands; empty while it acknowledges them."""
        since = self._received - self._heard
        if not self.running or since <= _DEAF:
            return ''
        return f'the board has taken no command for {since:.2f} s'

    def ticks(self, time: float) -> int:
        """Return the board's clock (us) at a time (s), at most that of the newest sample."""
        assert self.newest is not None
        ago = max(round(1e6 * (self.taken - time)), 0)
        return (self.newest.time - ago) % WRAP

    # --- inside --------------------------------------------------------------------------------

    def _become(self, talk: Talk, reason: str = '') -> None:
        self.talk = talk
        #: Why the connection is not running; empty while it is.
        self.reason = reason or talk.value

    def _leave(self, talk: Talk, reason: str) -> None:
        running = self.running
        self._become(talk, reason)
        self._begin_anew()
        if running:
            self._on_lost(reason)

    def _begin_anew(self) -> None:
        self._clock.reset()
        self._sent.clear()
        self._greeted = float('-inf')
        self.newest = None

    def _greet(self, hello: Hello, received: float) -> None:
        if hello.version != VERSION:
            self._leave(Talk.REFUSED, f'the board speaks version {hello.version} of the protocol; '
                        f'expected {VERSION}')
        elif hello.units != self._units:
            self._leave(Talk.REFUSED, f'the board has {hello.units} motor units; expected '
                        f'{self._units} (parameter units)')
        elif not self.running:
            self.name = hello.name
            self._received = self._heard = received
            self._become(Talk.RUNNING)

    def _take(self, sample: BoardSample, received: float) -> bool:
        """Take a sample; return whether it is later than the last one."""
        if len(sample.pressure) != self._units:
            raise GarbledLineError(f'a sample has {len(sample.pressure)} pressures; expected '
                                   f'{self._units}')
        if self.newest is not None:
            step = (sample.number - self.newest.number) % WRAP
            if step == 0:
                raise GarbledLineError(f'sample {sample.number} came twice')
            if step > WRAP // 2:
                self.restarts += 1
                self._leave(Talk.GREETING, 'the board has restarted')
                return False
            self.lost += step - 1
        self._received = received
        answered = self._sent.pop(sample.command, None)
        if answered is not None:
            self._heard = max(self._heard, answered)
            self.round_trip = received - answered
        taken = self._clock.time(sample.time, received)
        self.newest, self.taken = sample, taken
        if taken <= self._latest:
            self.skipped += 1
            return False
        self._latest = taken
        return True
