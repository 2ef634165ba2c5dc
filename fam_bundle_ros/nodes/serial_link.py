# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A serial port or TCP connection that is opened again after it is lost. No ROS.

One thread opens and reads; the caller never waits for the port.
"""

from collections.abc import Callable
from dataclasses import dataclass
import os
import select
import socket
import threading
import time
from typing import Any

from fam_bundle_ros.errors import InputError

#: Longest delay until the thread notices its end, s.
_SLICE = 0.05
#: Time-out of sending the last line, s.
_FAREWELL = 0.2
_CHUNK = 4096


@dataclass(frozen=True)
class Event:
    """An event of the port."""

    #: ``open``, ``data``, ``lost`` (it was open), or ``failed`` (it could not be opened).
    kind: str
    #: Steady time, s.
    time: float
    data: bytes = b''
    #: Of ``lost`` and ``failed``.
    reason: str = ''


class SerialLink:
    """
    Keeps a port open.

    ``url`` is a device such as ``/dev/ttyACM0``, or what pyserial opens, as
    ``socket://host:port``; ``baud`` is for a serial port. ``on_event`` is called with an `Event`
    in the thread of the link. Two attempts to open are ``retry`` (s) apart.
    """

    def __init__(self, url: str, baud: int, on_event: Callable[[Event], None], retry: float):
        self._url = url
        self._baud = baud
        self._on_event = on_event
        self._retry = retry
        self._new_port()
        #: Guards writing against closing.
        self._lock = threading.Lock()
        self._port: Any = None
        self._torn = False
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name='serial_link', daemon=True)

    def start(self) -> None:
        """Begin to open the port."""
        self._thread.start()

    def write(self, line: bytes) -> bool:
        """Send a line if the port takes it at once; return whether it did."""
        with self._lock:
            port = self._port
            if port is None:
                return False
            # After an incomplete line, a line feed first: only the incomplete line is lost.
            data = b'\n' + line if self._torn else line
            try:
                if _has_file(port) and not select.select([], [port], [], 0.0)[1]:
                    return False
                written = port.write(data)
            except Exception:
                # The reading thread gets an error too, and reopens the port.
                return False
            self._torn = written is not None and written < len(data)
            return not self._torn

    def close(self, farewell: bytes = b'') -> None:
        """Send a last line and close the port."""
        end = time.monotonic() + _FAREWELL
        while farewell and self._port is not None and not self.write(farewell):
            if time.monotonic() > end:
                break
            time.sleep(0.005)
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join(2.0 * _FAREWELL)

    def _new_port(self) -> Any:
        """Return a port that is not open yet."""
        try:
            import serial
        except ImportError:
            raise InputError('serial_rig needs pyserial: apt install python3-serial, or '
                             "pip install 'fam_bundle_ros[serial]'") from None
        try:
            port = serial.serial_for_url(self._url, baudrate=self._baud, timeout=0.0,
                                         write_timeout=0.0, do_not_open=True)
        except ValueError as error:
            raise InputError(f"parameter url is '{self._url}'; expected a serial port as "
                             f'/dev/ttyACM0, or socket://host:port ({error})') from None
        # Two programs on one port would each get part of the lines.
        port.exclusive = True
        return port

    def _run(self) -> None:
        while not self._ending.is_set():
            try:
                port = self._new_port()
                port.open()
                _prepare(port)
            except Exception as error:
                # Drivers and URL handlers raise many kinds of errors; the thread must continue.
                self._tell('failed', reason=_reason(error))
                self._ending.wait(self._retry)
                continue
            with self._lock:
                self._port, self._torn = port, True
            self._tell('open')
            reason = 'closed'
            try:
                while not self._ending.is_set():
                    data = _read(port)
                    if data:
                        self._tell('data', data)
            except Exception as error:
                reason = _reason(error)
            with self._lock:
                self._port = None
            try:
                port.close()
            except Exception as error:
                reason += f'; {_reason(error)}'
            self._tell('lost', reason=reason)
            self._ending.wait(self._retry)

    def _tell(self, kind: str, data: bytes = b'', reason: str = '') -> None:
        self._on_event(Event(kind, time.monotonic(), data, reason))


def _read(port: Any) -> bytes:
    """Return the received bytes, after a short wait."""
    if _has_file(port):
        ready = select.select([port], [], [], _SLICE)[0]
        return bytes(port.read(_CHUNK)) if ready else b''
    return bytes(port.read(1) + port.read(port.in_waiting))


def _has_file(port: Any) -> bool:
    try:
        return port.fileno() >= 0
    except (OSError, AttributeError):
        return False


def _prepare(port: Any) -> None:
    if not _has_file(port):
        # `select` does not support such a port: limit the waiting time.
        port.timeout = port.write_timeout = _SLICE
    elif str(port.portstr).startswith('socket:'):
        # Nagle's algorithm would delay commands by 40 ms, and pyserial has no option against it;
        # the duplicated descriptor is the same socket.
        with socket.socket(fileno=os.dup(port.fileno())) as same:
            same.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def _reason(error: Exception) -> str:
    return ' '.join(str(error).split()) or type(error).__name__
