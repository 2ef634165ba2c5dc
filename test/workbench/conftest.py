# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of the workbench share: sessions, a page without a browser, a real browser."""

from contextlib import contextmanager
import os
from pathlib import Path
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import pytest

from fam_bundle_ros.discovery import Choices
from fam_bundle_ros.discovery.diagnose import diagnose
from fam_bundle_ros.workbench.cases import load_example
from fam_bundle_ros.workbench.changes import Since
from fam_bundle_ros.workbench.session import Session

# Writes down every address outside this machine that the server process turns to.
WATCH_NETWORK = """
import os, sys
def hook(event, arguments):
    if event == 'socket.getaddrinfo':
        host = arguments[0]
    elif event == 'socket.connect' and isinstance(arguments[1], tuple):
        host = arguments[1][0]
    else:
        return
    if host not in (None, '', 'localhost', '127.0.0.1', '::1', b'127.0.0.1', '0.0.0.0'):
        with open(os.environ['FAM_BUNDLE_OUTSIDE'], 'a') as log:
            log.write(f'{event} {host}\\n')
sys.addaudithook(hook)
"""


@pytest.fixture(scope='session')
def anyio_backend():
    """Run async tests on asyncio."""
    return 'asyncio'


@pytest.fixture
def session():
    """Return a session with the hidden-friction example open."""
    made = Session()
    made.open(load_example('hidden_friction'))
    return made


@pytest.fixture(scope='session')
def friction_found(once):
    """Return what discovery says about the hidden-friction example, where it needs one effect."""
    case = load_example('hidden_friction')
    return once('friction_found', lambda: diagnose(case.model, case.data, choices=Choices(most=1)))


@pytest.fixture
def with_friction(session):
    """Return the session after the friction that is in its data was added, without a refit."""
    from fam_bundle_ros.model import catalogue
    effect = catalogue.get('coulomb_friction')(force=6.66)
    session.advance('+ coulomb_friction', session.now.model.with_effect(effect), 0.61,
                    Since((effect,)), 'coulomb_friction')
    return session


@contextmanager
def serving(folder, repository, *arguments):
    """Run the command `workbench` in a process of its own; yield its address."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        port = probe.getsockname()[1]
    (folder / 'sitecustomize.py').write_text(WATCH_NETWORK)
    paths = [str(folder), str(repository), os.environ.get('PYTHONPATH', '')]
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(p for p in paths if p),
                   'FAM_BUNDLE_OUTSIDE': str(folder / 'outside.log')}
    # NiceGUI behaves otherwise when it finds itself in pytest
    environment.pop('PYTEST_CURRENT_TEST', None)
    log = (folder / 'server.log').open('w')
    process = subprocess.Popen(
        [sys.executable, '-m', 'fam_bundle_ros', 'workbench', '--no-show', '--port',
         str(port), *arguments], env=environment, stdout=log, stderr=subprocess.STDOUT,
        cwd=folder)
    address = f'http://127.0.0.1:{port}/'
    try:
        for _ in range(1200):
            try:
                urllib.request.urlopen(address, timeout=5).close()
                break
            except urllib.error.HTTPError:
                break
            except OSError:
                if process.poll() is not None:
                    pytest.fail((folder / 'server.log').read_text())
                time.sleep(0.1)
        yield address
    finally:
        process.send_signal(signal.SIGINT)
        status = process.wait(60)
        log.close()
    assert status == 0, 'Ctrl-C must end the workbench with status 0'


@pytest.fixture(scope='module')
def server(tmp_path_factory, repository):
    """Yield the address of a running workbench; fail when it turned to the outside."""
    folder = tmp_path_factory.mktemp('server')
    with serving(folder, repository) as address:
        yield address
    outside = folder / 'outside.log'
    assert not outside.exists(), outside.read_text()
    assert 'Traceback' not in (folder / 'server.log').read_text()


class Watched:
    """A page of the browser that remembers what went wrong and what left the machine."""

    def __init__(self, browser, address, **options):
        self.context = browser.new_context(**{
            'viewport': {'width': 1280, 'height': 720}, 'accept_downloads': True,
            # without a graphics card, drawing what moves is half the work of these tests
            'reduced_motion': 'reduce', **options})
        self.page = self.context.new_page()
        self.wrong, self.outside = [], []
        self.page.on('console', self._heard)
        self.page.on('pageerror', lambda error: self.wrong.append(f'page error: {error}'))
        # listened to and not routed: a routed browser keeps no file of the page for the next one
        self.context.on('request', self._asked)
        self.page.set_default_timeout(60_000)
        self.address = address

    def _heard(self, message):
        if message.type in ('error', 'warning'):
            self.wrong.append(f'{message.type}: {message.text}')

    def _asked(self, request):
        if not request.url.startswith((self.address, 'data:', 'blob:')):
            self.outside.append(request.url)

    def open(self, path=''):
        """Go to the page and wait for its first button."""
        self.page.goto(self.address + path)
        self.page.wait_for_selector('main button')
        return self.page

    def click(self, mark):
        """Click what carries a mark."""
        self.page.click(f'[data-mark="{mark}"]')

    def drawn(self):
        """Wait until traces are on the screen."""
        self.page.wait_for_selector('.plot .trace, .plot .hm')

    def close(self):
        """Close, and say what went wrong."""
        self.context.close()
        assert self.wrong == []
        assert self.outside == []


@pytest.fixture
def watched(chromium, server):
    """Return a function that opens watched pages; they are checked at the end."""
    pages = []

    def make(**options):
        pages.append(Watched(chromium, server, **options))
        return pages[-1]

    yield make
    for page in pages:
        page.close()


@pytest.fixture(scope='session')
def pictures():
    """Return where screenshots go: docs/images with `make browser-test`, else None."""
    named = os.environ.get('FAM_BUNDLE_SCREENSHOTS')
    return Path(named) if named else None
