# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Fixtures that every test may use.

rclpy is imported by the fixtures that need it, so that tests of the library run without ROS.
"""

from contextlib import contextmanager, suppress
from dataclasses import is_dataclass
import fcntl
import gc
from importlib import import_module
import os
from pathlib import Path
import pickle
import pkgutil
import shutil
import tempfile

from hypothesis import settings
import pytest

# In CI the same examples each time: a failure there must be the change's own. Elsewhere new ones.
# No example has a deadline: the machine may be busy.
settings.register_profile('own', deadline=None)
settings.register_profile('ci', derandomize=True, deadline=None)
settings.load_profile('ci' if os.environ.get('CI') else 'own')

# All are read when rclpy or a message is first imported, in this process or in one it starts.
# Jazzy's messages check the types of their fields only when asked to.
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'
if os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp') == 'rmw_fastrtps_cpp':
    # The profile keeps to this machine; LOCALHOST would bring shared memory back.
    os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(
        Path(__file__).with_name('fastdds_udp.xml'))
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'SYSTEM_DEFAULT'
else:
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ.setdefault('ROS_LOG_DIR', str(Path(tempfile.gettempdir(), 'fam_bundle_ros_log')))
# The workers of pytest-xdist share the cores; threads of BLAS would only get in their way.
os.environ.setdefault('OMP_NUM_THREADS', '1')

# Above 101 the DDS ports of Linux meet those of outgoing connections.
LARGEST_DOMAIN = 101

# Chromium asks Google for things at every start unless it is told not to.
CHROMIUM_FLAGS = ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
                  '--disable-background-networking', '--disable-component-update',
                  '--disable-sync', '--disable-default-apps', '--disable-domain-reliability']


#: Files that take fifteen seconds or more, the longest first.
LONG = ['discovery/test_diagnose.py', 'nodes/test_safety.py', 'nodes/test_rig_probe.py',
        'workbench/test_browser_live.py', 'workbench/test_browser_story.py',
        'cli/test_cli_rig.py', 'nodes/test_session.py', 'workbench/test_page.py',
        'nodes/test_measuring.py', 'nodes/test_process.py', 'discovery/test_specimens.py',
        'nodes/test_fault_run.py', 'control/test_benchmark.py', 'control/test_recruitment.py',
        'nodes/test_simulator.py', 'nodes/test_recruitment_warnings.py']


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Do not look for garbage among 6000 tests that stay, now or later: seconds of each worker."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items):
    """Begin with the long files: one that comes last keeps one core busy and the other idle."""
    places = {Path(__file__).parent / name: place for place, name in enumerate(LONG)}
    for file in places:
        file.stat()  # raises if it was renamed
    items.sort(key=lambda item: places.get(item.path, len(LONG)))


@pytest.fixture(scope='session')
def repository():
    """Return the root of the source tree."""
    return Path(__file__).resolve().parent.parent


@pytest.fixture(scope='session')
def not_frozen():
    """Return a function from a package to the names of its dataclasses that may change."""
    def names(package):
        modules = [import_module(info.name) for info in
                   pkgutil.walk_packages(package.__path__, f'{package.__name__}.')]
        return {name for module in modules for name, kind in vars(module).items()
                if isinstance(kind, type) and is_dataclass(kind)
                and kind.__module__ == module.__name__ and not kind.__dataclass_params__.frozen}
    return names


@pytest.fixture(scope='session')
def once(tmp_path_factory):
    """Return a function that makes something under a name once for all workers of this run."""
    folder = tmp_path_factory.getbasetemp()
    if 'PYTEST_XDIST_WORKER' in os.environ:
        folder = folder.parent

    def get(name, make):
        path = folder / f'{name}.pickle'
        with (folder / f'{name}.lock').open('w') as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                path.write_bytes(pickle.dumps(make()))
            return pickle.loads(path.read_bytes())
    return get


@pytest.fixture(scope='session')
def map_found(once):
    """Return what discovery says about the measured map that ships, DMSP-20."""
    from fam_bundle_ros.discovery import diagnose, read_measurement
    from fam_bundle_ros.model import load_model
    from fam_bundle_ros.resources import config_path
    return once('map_found', lambda: diagnose(
        load_model(config_path('data/dmsp20_static_map.model.yaml')),
        read_measurement(config_path('data/dmsp20_static_map.csv'))))


@pytest.fixture(scope='session')
def diagnose_map(map_found):
    """Return `diagnose` for the measured map and nothing else: it is computed once for all."""
    from fam_bundle_ros.model import dumps_model

    def diagnose(model, data, progress=None):
        assert dumps_model(model) == dumps_model(map_found.model)
        assert data.sha256 == map_found.measurement.sha256
        if progress:
            progress(0.5, 'as test_diagnose has it')
        return map_found
    return diagnose


@pytest.fixture(scope='session')
def domain_id():
    """
    Return a ROS domain that no other test process on this machine uses.

    It is in ROS_DOMAIN_ID too, for the processes that a test starts. A lock, not the worker's
    number, chooses it: two test runs at once must not hear each other.
    """
    for candidate in range(1, LARGEST_DOMAIN + 1):
        path = Path(tempfile.gettempdir(), f'fam_bundle_ros_domain_{candidate}.lock')
        try:
            lock = path.open('w')
        except PermissionError:
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            continue
        os.environ['ROS_DOMAIN_ID'] = str(candidate)
        yield candidate
        lock.close()
        return
    pytest.fail(f'all {LARGEST_DOMAIN} ROS domains are in use by other test runs')


@pytest.fixture(scope='session')
def prior():
    """
    Return a context in which this process and those that it starts go before what only computes.

    On the computer of a rig they do: the timeouts of nodes are those of the wall clock. Without
    the right to do so all are alike.
    """
    @contextmanager
    def context():
        before = os.getpriority(os.PRIO_PROCESS, 0)
        with suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, 0, before - 10)
        try:
            yield
        finally:
            with suppress(PermissionError):
                os.setpriority(os.PRIO_PROCESS, 0, before)
    return context


@pytest.fixture(autouse=True)
def ahead(request, prior):
    """Let nodes go first, nor wait half a second for the garbage of all tests of this process."""
    if 'domain_id' not in request.fixturenames:
        yield
        return
    gc.disable()
    with prior():
        yield
    gc.enable()


@pytest.fixture
def ros_context(domain_id):
    """Yield a fresh, initialised rclpy context in the worker's own domain."""
    from rclpy.context import Context

    context = Context()
    context.init(domain_id=domain_id)
    yield context
    context.try_shutdown()


def missing(reason):
    """Skip for want of a browser; in continuous integration that is a failure."""
    if os.environ.get('CI'):
        pytest.fail(f'{reason}; in CI browser tests must run')
    pytest.skip(f'{reason}; make browser-test installs it')


@pytest.fixture(scope='module')
def chromium():
    """Yield a headless Chromium (Debian's, or the one that CHROMIUM names)."""
    names = [os.environ.get('CHROMIUM', ''), 'chromium-headless-shell', 'chromium',
             'chromium-browser', 'google-chrome']
    path = next((found for name in names if name and (found := shutil.which(name))), None)
    if path is None:
        missing('no Chromium on this machine')
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing('no playwright in this Python')
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=CHROMIUM_FLAGS)
        yield browser
        browser.close()
