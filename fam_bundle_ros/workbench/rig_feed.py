# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A running bundle for the page: newest values, the last seconds, and orders to the bundle.

This process does not use ROS: ``fam_bundle_ros.nodes.live_feed`` listens in a process of its own
and sends lines of JSON; a simulated bundle is a process too. Both end with this process.
"""

import asyncio
from collections import deque
import json
import math
import sys
from typing import Any

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.processes import ENDS_WITH_STDIN, environment
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.workbench import live
from fam_bundle_ros.workbench.measure_run import MeasureRun, Order

#: Time span of the samples that are kept, and window of the tracking error, s.
KEPT, MINUTE = 20.0, 60.0
#: Time-outs of the answer to an order, and of the end of a process, s.
_PATIENCE, _FAREWELL = 8.0, 5.0
#: Largest size of a line, bytes; a diagnosis is long.
_LONGEST = 1 << 24
#: The simulated bundle.
_BRINGUP = f"""{ENDS_WITH_STDIN}
from fam_bundle_ros.nodes.bundle_bringup import main
sys.exit(main())
"""


class Record:
    """Newest records of the feed."""

    def __init__(self) -> None:
        #: Newest of each kind; empty before the first.
        self.graph: dict[str, Any] = {}
        self.state: dict[str, Any] = {}
        self.diagnosis: dict[str, Any] = {}
        #: Of the last `KEPT` seconds, oldest first.
        self.samples: deque[dict[str, Any]] = deque()
        self._tracking: deque[tuple[float, float, int]] = deque()
        self._model = ''

    @property
    def now(self) -> dict[str, Any]:
        """Newest sample; empty before the first."""
        return self.samples[-1] if self.samples else {}

    @property
    def tracking(self) -> float:
        """Rms of reference minus measured over the last minute, or since model or rig changed."""
        count = sum(entry[2] for entry in self._tracking)
        return math.sqrt(sum(entry[1] for entry in self._tracking) / count) if count else math.nan

    def forget_tracking(self) -> None:
        """Start the tracking error anew: the simulated rig is another one from now on."""
        self._tracking.clear()

    def take(self, record: dict[str, Any]) -> None:
        """Take a record of the feed."""
        kind = record.get('kind')
        if kind == 'sample':
            self._sample(record)
        elif kind == 'state':
            self.state = record
            if record.get('file') != self._model:
                # the tracking error restarts with another model
                self._model = str(record.get('file'))
                self._tracking.clear()
        elif kind == 'graph':
            self.graph = record
        elif kind == 'diagnosis':
            self.diagnosis = record

    def _sample(self, record: dict[str, Any]) -> None:
        time = record['time']
        if self.samples and time < self.samples[-1]['time']:
            self.samples.clear()
            self._tracking.clear()
        if self.samples and record.get('reference_kind') != self.now.get('reference_kind'):
            self._tracking.clear()
        self.samples.append(record)
        while time - self.samples[0]['time'] > KEPT:
            self.samples.popleft()
        self._tracking.append((time, record['squares'], record['count']))
        while time - self._tracking[0][0] > MINUTE:
            self._tracking.popleft()


class LiveRig:
    """The processes behind the page "Live", one set for all its tabs."""

    def __init__(self) -> None:
        self.record = Record()
        self.namespace = live.NAMESPACE
        #: Why no messages are received; empty without a failure.
        self.failure = ''
        self.measurement = MeasureRun()
        #: Why a measurement did not begin, or why the bundle is not enabled after it; else empty.
        self.measure_failure = ''
        self._measuring: asyncio.Task[None] | None = None
        self._feed: asyncio.subprocess.Process | None = None
        self._simulation: asyncio.subprocess.Process | None = None
        self._reader: asyncio.Task[None] | None = None
        self._waiting: dict[str, asyncio.Future[dict[str, Any]]] = {}

    @property
    def listening(self) -> bool:
        """Whether the feed runs."""
        return self._feed is not None and self._feed.returncode is None

    @property
    def simulating(self) -> bool:
        """Whether a bundle that was started by this page runs."""
        return self._simulation is not None and self._simulation.returncode is None

    @property
    def simulated(self) -> bool:
        """Whether the bundle is certainly a simulated one."""
        return not self.failure and 'plant_simulator' in self.record.graph.get('nodes', ())

    async def listen(self, namespace: str) -> None:
        """Listen to the bundle of a namespace; InputError for a name that is none."""
        live.check_namespace(namespace)
        if self.listening and namespace == self.namespace:
            return
        await live.end(self._feed, _FAREWELL)
        self.namespace, self.record, self.failure = namespace, Record(), ''
        feed = self._feed = await asyncio.create_subprocess_exec(
            sys.executable, '-m', 'fam_bundle_ros.nodes.live_feed', '--ros-args', '-r',
            f'__ns:={namespace}', env=environment(), stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE, limit=_LONGEST,
            start_new_session=True)
        self._reader = asyncio.create_task(self._read(feed))

    async def simulate(self) -> None:
        """Start a simulated bundle under this namespace."""
        if self.simulating:
            return
        files = [part for name in ('simulation.yaml', 'live.yaml')
                 for part in ('--params-file', str(config_path(name)))]
        self._simulation = await asyncio.create_subprocess_exec(
            sys.executable, '-c', _BRINGUP, '--ros-args', *files, '-r',
            f'__ns:={self.namespace}', env=environment(), stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL,
            start_new_session=True)

    async def stop_simulation(self) -> None:
        """End the simulated bundle that was started by this page."""
        await live.end(self._simulation, _FAREWELL)

    async def order(self, **order: Any) -> str:
        """
        Send an order, in the format of `live_feed`; return the answer.

        InputError with the reason if the order was refused or not answered.
        """
        name = str(order.get('call') or order.get('set'))
        feed = self._feed
        if feed is None or feed.stdin is None or not self.listening:
            raise InputError('the bundle is not connected: reload the page')
        if name in self._waiting:
            raise InputError(f'{name} was ordered already and has not answered yet')
        answer = asyncio.get_running_loop().create_future()
        self._waiting[name] = answer
        try:
            feed.stdin.write((json.dumps(order) + '\n').encode())
            await feed.stdin.drain()
            told = await asyncio.wait_for(answer, _PATIENCE)
        except (TimeoutError, ConnectionError):
            raise InputError(f'{name}: no answer from {self.namespace}') from None
        finally:
            self._waiting.pop(name, None)
        if not told['success']:
            raise InputError(told['message'] or f'{name} was refused')
        return str(told['message'])

    def measure(self, order: Order) -> None:
        """Begin to measure, shown in all tabs; InputError when one is running already."""
        if self._measuring is not None and not self._measuring.done():
            raise InputError('a measurement is running already: stop it first')
        self.measure_failure = ''
        self._measuring = asyncio.create_task(self._measure(order))

    async def close(self) -> None:
        """End all processes; the measurement first, so that it can vent."""
        await self.measurement.stop()
        if self._measuring is not None:
            self._measuring.cancel()
        if self._reader is not None:
            self._reader.cancel()
        await asyncio.gather(*(live.end(process, _FAREWELL)
                               for process in (self._feed, self._simulation)))

    # --- inside --------------------------------------------------------------------------------

    async def _measure(self, order: Order) -> None:
        """Measure; a simulated bundle that was enabled is enabled again afterwards."""
        again = self.simulated and bool(self.record.now.get('supply'))
        try:
            await self.measurement.run(order)
            if again and self.namespace == order.namespace:
                await self.order(call='enable')
        except InputError as error:
            self.measure_failure = str(error)

    async def _read(self, feed: asyncio.subprocess.Process) -> None:
        assert feed.stdout is not None
        assert feed.stderr is not None
        said = asyncio.create_task(feed.stderr.read())
        while line := await feed.stdout.readline():
            record = json.loads(line)
            if record['kind'] == 'answer':
                answer = self._waiting.get(record['name'])
                if answer is not None and not answer.done():
                    answer.set_result(record)
            elif feed is self._feed:
                self.record.take(record)
        last = (await said).decode(errors='replace').strip().splitlines()[-1:] or ['it ended']
        if feed is self._feed:
            self.failure = f'the listener has stopped: {last[0]}'
