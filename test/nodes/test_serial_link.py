# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The port of serial_rig: opened again when lost, never in the way of the caller."""

import os
import pty
import queue
import socket
import threading
import tty

import pytest

pytest.importorskip('rclpy', reason='rclpy is not installed')
pytest.importorskip('serial', reason='pyserial is not installed')

from fam_bundle_ros.nodes.serial_link import SerialLink

PATIENCE = 15.0


class Watched:
    """A link and what it has told."""

    def __init__(self, url):
        self.events = queue.Queue()
        self.link = SerialLink(url, 115200, self.events.put, 0.05)
        self.link.start()

    def next(self, *kinds):
        """Return the next event, which must be of one of these kinds."""
        event = self.events.get(timeout=PATIENCE)
        assert event.kind in kinds, event
        return event

    def skip_to(self, kind):
        """Return the next event of a kind."""
        while True:
            event = self.events.get(timeout=PATIENCE)
            if event.kind == kind:
                return event


@pytest.fixture
def watch():
    """Return a function that starts a link; it is closed in the end."""
    started = []

    def start(url):
        started.append(Watched(url))
        return started[-1]
    yield start
    for each in started:
        each.link.close()


@pytest.fixture
def ends():
    """Yield both ends of a serial line."""
    far, near = pty.openpty()
    tty.setraw(near)
    yield far, near
    for end in (far, near):
        try:
            os.close(end)
        except OSError:
            pass


def test_events_come_in_order(watch, ends):
    """Opened, data as they come, lost with the reason, then attempts that fail."""
    far, near = ends
    watched = watch(os.ttyname(near))
    watched.next('open')
    os.write(far, b'abc')
    data = b''
    while data != b'abc':
        data += watched.next('data').data
    # the other end stays open: else another process may get a terminal of this name
    os.close(far)
    assert watched.next('lost').reason
    assert watched.next('failed').reason
    assert not watched.link.write(b'x')


def test_server_that_comes_back_is_found(watch):
    """A connection that the other side closes is lost, and made again."""
    with socket.create_server(('127.0.0.1', 0)) as server:
        watched = watch(f'socket://127.0.0.1:{server.getsockname()[1]}')
        for _ in range(2):
            peer, _ = server.accept()
            watched.skip_to('open')
            peer.close()
            watched.next('lost')


def test_small_lines_are_not_held_back(watch):
    """TCP sends a command at once, not when the one before is acknowledged."""
    with socket.create_server(('127.0.0.1', 0)) as server:
        watched = watch(f'socket://127.0.0.1:{server.getsockname()[1]}')
        with server.accept()[0]:
            watched.next('open')
            with socket.socket(fileno=os.dup(watched.link._port.fileno())) as same:
                assert same.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


@pytest.mark.parametrize('size', [100, 100_000], ids=['line by line', 'in the middle of a line'])
def test_full_port_refuses_at_once_and_takes_the_farewell_later(watch, ends, size):
    """Nobody reads: lines are refused, not waited for; a line cut in half spoils no other."""
    far, near = ends
    watched = watch(os.ttyname(near))
    watched.next('open')
    line = b'x' * (size - 1) + b'\n'
    taken = refused = 0
    # a busy kernel may make room once more after the first refusal
    while refused < 2:
        accepted = watched.link.write(line)
        taken, refused = taken + accepted, 0 if accepted else refused + 1
        assert taken < 10_000
    got = []

    def read():
        try:
            while data := os.read(far, 4096):
                got.append(data)
                if data.endswith(b'bye\n'):
                    return
        except OSError:
            pass
    reader = threading.Thread(target=read)
    reader.start()
    watched.link.close(b'bye\n')
    reader.join(PATIENCE)
    lines = b''.join(got).split(b'\n')
    assert lines[-2:] == [b'bye', b'']
    assert lines.count(line[:-1]) == taken


def test_second_program_cannot_open_the_port(watch, ends):
    """Two on one board would each get half of the lines."""
    _, near = ends
    watch(os.ttyname(near)).next('open')
    assert 'lock' in watch(os.ttyname(near)).next('failed').reason


def test_port_without_a_file_works_too(watch):
    """Some of the ports of pyserial (RFC 2217, loop://) cannot be waited for by select."""
    watched = watch('loop://')
    watched.next('open')
    assert watched.link.write(b'abc\n')
    data = b''
    while not data.endswith(b'abc\n'):
        data += watched.next('data').data


def test_close_ends_the_thread(watch):
    """Also while the port cannot be opened."""
    watched = watch('/nowhere/tty')
    watched.next('failed')
    watched.link.close(b'bye\n')
    assert not watched.link._thread.is_alive()
