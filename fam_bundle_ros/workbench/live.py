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

#: Longest recording, s.
LONGEST = 600.0


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


async def record(seconds: float, namespace: str = '/bundle') -> Measurement:
    """
    Return what the topics of a rig or of the simulator said for so many seconds.

    Raises
    ------
    InputError
        For a bad namespace or time, or where nothing was heard.
    """
    if not 1.0 <= seconds <= LONGEST:
        raise InputError(f'recording time is {seconds:g} s; expected 1 to {LONGEST:g} s')
    check_namespace(namespace)
    with tempfile.TemporaryDirectory(prefix='fam_bundle_live_') as folder:
        bag = Path(folder) / 'bag'
        process = await asyncio.create_subprocess_exec(
            sys.executable, '-m', 'fam_bundle_ros.cli', 'record', str(bag), '--seconds',
            f'{seconds:g}', '--namespace', namespace, stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.PIPE)
        try:
            _, said = await asyncio.wait_for(process.communicate(), seconds + 30.0)
        except TimeoutError:
            raise InputError('the recording did not end; is ROS running?') from None
        finally:
            if process.returncode is None:
                process.kill()
        if process.returncode != 0 or not bag.exists():
            last = said.decode(errors='replace').strip().splitlines()[-1:] or ['']
            raise InputError(f'nothing was recorded from {namespace}: '
                             f'{last[0].removeprefix("fam_bundle: ") or "no topics were heard"}')
        measured = await asyncio.to_thread(read_measurement, bag, name=f'live {namespace}')
    return measured
