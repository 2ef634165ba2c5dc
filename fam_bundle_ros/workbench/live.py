# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The live ROS graph as a measurement: the rig's topics recorded for some seconds.

This process does not use ROS: the command ``fam_bundle record`` runs in a process of its own, and
its bag is read like any other.
"""

import asyncio
from importlib.util import find_spec
from pathlib import Path
import re
import signal
import sys
import tempfile

from fam_bundle_ros.discovery import Measurement, read_measurement
from fam_bundle_ros.errors import InputError

#: Duration of the recording, s, and namespace of the bundle.
SECONDS, NAMESPACE = 20.0, '/bundle'


def available() -> bool:
    """Return whether this Python has ROS."""
    return find_spec('rclpy') is not None


def check_namespace(name: str) -> None:
    """Raise InputError for a name that is not a ROS namespace."""
    if not re.fullmatch(r'(/[A-Za-z_]\w*){1,8}', name):
        raise InputError(f"namespace '{name[:60]}': expected a ROS name such as /bundle")


async def end(process: asyncio.subprocess.Process | None, patience: float) -> None:
    """End a process as Ctrl-C does; kill it if it has not ended after ``patience`` (s)."""
    if process is None or process.returncode is not None:
        return
    process.send_signal(signal.SIGINT)
    try:
        await asyncio.wait_for(process.wait(), patience)
    except TimeoutError:
        process.kill()
        await process.wait()


async def record() -> Measurement:
    """Return a recording of `SECONDS` of a bundle; InputError if there are no messages."""
    with tempfile.TemporaryDirectory(prefix='fam_bundle_live_') as folder:
        bag = Path(folder) / 'bag'
        process = await asyncio.create_subprocess_exec(
            sys.executable, '-m', 'fam_bundle_ros', 'record', str(bag), '--seconds',
            f'{SECONDS:g}', '--namespace', NAMESPACE, stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.PIPE)
        try:
            _, said = await asyncio.wait_for(process.communicate(), SECONDS + 30.0)
        except TimeoutError:
            raise InputError('the recording did not end; is ROS running?') from None
        finally:
            if process.returncode is None:
                process.kill()
        if process.returncode != 0 or not bag.exists():
            last = said.decode(errors='replace').strip().splitlines()[-1:] or ['']
            raise InputError(f'nothing was recorded from {NAMESPACE}: '
                             f'{last[0].removeprefix("fam_bundle: ") or "no topics were heard"}')
        return await asyncio.to_thread(read_measurement, bag, name=f'live {NAMESPACE}')
