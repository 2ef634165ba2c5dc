# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A board of the serial rig as its documentation describes it, on a pseudo terminal or TCP."""

import os
import pty
import socket
import time
import tty

START = time.monotonic_ns() // 1000


class Pty:
    """The far end of a serial port that can be unplugged."""

    def __init__(self, folder):
        self._link = folder / 'ttyACM0'
        self.url = str(self._link)
        self.plug()

    def plug(self):
        self._far, self._near = pty.openpty()
        tty.setraw(self._near)
        os.set_blocking(self._far, False)
        self._link.symlink_to(os.ttyname(self._near))

    def unplug(self):
        # The name goes first: the system soon gives the number of the terminal to another one.
        self._link.unlink()
        os.close(self._far)
        os.close(self._near)
        self._far = None

    def read(self):
        return self._try(lambda: os.read(self._far, 4096))

    def write(self, data):
        self._try(lambda: os.write(self._far, data))

    def _try(self, act):
        try:
            return act() if self._far is not None else b''
        except OSError:
            return b''

    def close(self):
        if self._far is not None:
            self.unplug()


class Tcp:
    """A board with a network connection."""

    def __init__(self, folder):
        self._port = 0
        self._listener = self._peer = None
        self.plug()
        self.url = f'socket://127.0.0.1:{self._port}'

    def plug(self):
        self._listener = socket.create_server(('127.0.0.1', self._port))
        self._listener.setblocking(False)
        self._port = self._listener.getsockname()[1]

    def unplug(self):
        for end in (self._listener, self._peer):
            if end:
                end.close()
        self._listener = self._peer = None

    def _connected(self):
        if self._peer is None and self._listener is not None:
            try:
                self._peer, _ = self._listener.accept()
                self._peer.setblocking(False)
            except BlockingIOError:
                pass
        return self._peer

    def read(self):
        try:
            return self._connected().recv(4096) if self._connected() else b''
        except OSError:
            return b''

    def write(self, data):
        try:
            if self._connected():
                self._peer.send(data)
        except OSError:
            pass

    close = unplug


def crc(body):
    """CRC-16/CCITT-FALSE bit by bit, as a microcontroller does it."""
    value = 0xFFFF
    for byte in body:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x1021 if value & 0x8000 else value << 1) & 0xFFFF
    return value


def line(body):
    """Return a body with its checksum, as a line."""
    return b'%s*%04X\n' % (body.encode(), crc(body.encode()))


class FakeBoard:
    """A microcontroller as docs/how_to/serial_rig.md describes it, with valves and two muscles."""

    def __init__(self, port, units=2):
        self.port = port
        self.units = units
        self.version = 1
        self.button = self.silent = self.deaf = False
        #: What becomes of each line on its way to the host.
        self.mangle = lambda data: data
        self.force = 12.5
        self.supply_text = '600.0'
        self.over_pressure = False
        #: s without a valid command after which it cuts the air.
        self.patience = 0.2
        self.begin()

    def begin(self):
        """Power on."""
        self.number = 0
        self._rest = b''
        self._last = self._valid = time.monotonic()
        self.pressure = [0.0] * self.units
        self.valves = [-1000] * self.units
        self.command = 0
        self.supply = False
        self.why = 2
        self.heard, self.greetings = [], 0
        self.times = {}

    def ticks(self):
        # Not far from where 32 bit wrap.
        return (time.monotonic_ns() // 1000 + 2**32 - 3_000_000 - START) % 2**32

    def step(self):
        now = time.monotonic()
        if not self.deaf:
            *lines, self._rest = (self._rest + self.port.read()).split(b'\n')
            for each in filter(None, lines):
                self._take(each, now)
        if now - self._valid > self.patience:
            self._cut(2)
        self._flow(min(now - self._last, 0.02))
        self._last = now
        if not self.silent:
            self.send()

    def send(self):
        ticks = self.ticks()
        self.times[self.number] = ticks
        readings = ','.join(f'{value:.3f}' for value in self.pressure)
        data = line(f'S,{self.number},{ticks},{self.command},{int(self.button)},{self.why},'
                    f'{self.force},{10.0},{self.supply_text},{readings}')
        self.number += 1
        data = self.mangle(data)
        if data:
            self.port.write(data)

    def _take(self, data, now):
        body, _, check = data.rpartition(b'*')
        if check != b'%04X' % crc(body):
            return
        kind, *fields = body.decode().split(',')
        if kind == 'H':
            self.greetings += 1
            self.port.write(line(f'H,{self.version},{self.units},fake'))
            return
        number, ticks, supply, stop, *valves = map(int, fields)
        assert kind == 'C'
        assert len(valves) == self.units
        assert all(-1000 <= valve <= 1000 for valve in valves)
        self.heard.append((number, ticks, supply, stop, valves))
        if not stop and (self.ticks() - ticks) % 2**32 > 200_000:
            return
        self.command, self._valid = number, now
        if stop or not supply:
            self._cut(1)
        else:
            self.supply, self.why, self.valves = True, 0, valves
        if self.button:
            self._cut(3)
        self.over_pressure &= not stop
        if self.over_pressure:
            self._cut(4)

    def _cut(self, why):
        self.supply, self.why, self.valves = False, why, [-1000] * self.units

    def _flow(self, dt):
        for i, valve in enumerate(self.valves):
            goal = 400.0 * self.supply if valve > 0 else 0.0
            self.pressure[i] += (goal - self.pressure[i]) * min(abs(valve) * 1e-3 * dt / 0.05, 1.0)
