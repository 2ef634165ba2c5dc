# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The live ROS graph as a measurement: what the rig's topics say for some seconds.

ROS stays out of this process: the command ``fam_bundle record`` listens in one of its own, and its
bag is read like any other.
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

#: What is taken of the live graph: seconds, and of which bundle.
SECONDS, NAMESPACE = 20.0, '/bundle'


def available() -> bool:
    """Return whether this Python has ROS."""
    return find_spec('rclpy') is not None


def check_namespace(name: str) -> None:
    """Raise InputError for a name that is no ROS namespace."""
    if not re.fullmatch(r'(/[A-Za-z_]\w*){1,8}', name):
        raise InputError(f"namespace '{name[:60]}': expected a ROS name such as /bundle")


async def end(process: asyncio.subprocess.Process | None, patience: float) -> None:
    """End a process as Ctrl-C does; kill it where it has not ended after ``patience`` seconds."""
    if process is None or process.returncode is not None:
        return
    process.send_signal(signal.SIGINT)
    try:
        await asyncio.wait_for(process.wait(), patience)
    except TimeoutError:
        process.kill()
        await process.wait()


async def record() -> Measurement:
    """Return what a bundle says for `SECONDS`; InputError where nothing is heard."""
    with tempfile.TemporaryDirectory(prefix='fam_bundle_live_') as folder:
        bag = Path(folder) / 'bag'
        process = await asyncio.create_subprocess_exec(
            sys.executable, '-m', 'fam_bundle_ros.cli', 'record', str(bag), '--seconds',
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
