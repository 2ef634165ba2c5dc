# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Runs nodes in a process: start, spin, vent, end.

Signals only set a flag. rclpy's own handlers would shut the context down before the last vent
command could be published, and an exception inside a callback could interrupt a node midway.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import faulthandler
from functools import partial
import gc
import os
import signal
import sys
import threading
import time
from types import FrameType
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.logging import get_logger_effective_level, set_logger_level
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.parameters import Spec, table
from fam_bundle_ros.processes import variables

#: Longest delay until a signal is noticed, s: in an infinite wait EventsExecutor ignores signals.
SLICE = 0.1
#: Time-out for the delivery of all last messages together, s; subscribers may have ended.
FAREWELL = 0.3
#: Time after a first signal within which a second one counts as the same, s.
PATIENCE = 2.0

#: Time after which a process that has been asked to end does so in any case, s.
END = 15.0

NodeFactory = Callable[[Context], Sequence[BundleNode]]


@contextmanager
def ros_context(domain: int | None = None, log_level: str = 'info', alone: bool = False
                ) -> Iterator[Context]:
    """
    Yield a context for nodes of this process, and shut it down at the end.

    With ``alone``, the nodes are visible to each other only, so that a simulated run cannot move a
    real rig of the same names.
    """
    context, level = Context(), get_logger_effective_level('')
    with variables(**{'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF'} if alone else {}):
        context.init(args=['--ros-args', '--log-level', log_level], domain_id=domain)
    try:
        yield context
    finally:
        context.try_shutdown()
        # It is that of the process: later nodes would be as silent.
        set_logger_level('', level)


class Spinner:
    """
    An EventsExecutor with one or more nodes, spun in bounded slices.

    `close` stops and destroys the nodes in the order in which they are given.
    """

    def __init__(self, context: Context, nodes: Sequence[BundleNode]):
        self.context = context
        self.nodes = list(nodes)
        self.executor: Executor = EventsExecutor(context=context)
        self._slice: Future = Future(executor=self.executor)
        self._deadline = 0.0
        for node in self.nodes:
            self.executor.add_node(node)
        # The executor checks its own time-out only when no event is pending, which never happens
        # in lock-step.
        self.nodes[0].every(0.5 * SLICE, self._check)

    def spin(self, seconds: float = SLICE) -> None:
        """Process events for some time (s), or until `interrupt`."""
        self._slice = Future(executor=self.executor)
        self._deadline = time.monotonic() + seconds
        self.executor.spin_until_future_complete(self._slice, timeout_sec=seconds)

    def until(self, done: Callable[[], bool], seconds: float,
              ended: Callable[[], bool] = lambda: False) -> bool:
        """Spin until ``done`` or ``ended``, for some time (s) at most; return whether done."""
        deadline = time.monotonic() + seconds
        while not done() and time.monotonic() < deadline and not ended():
            self.spin(0.02)
        return done()

    def interrupt(self) -> None:
        """End the present `spin` once the present callback is done."""
        if not self._slice.done():
            self._slice.set_result(None)

    def close(self) -> None:
        """Let every node publish its safe state, then destroy the nodes; the context is kept."""
        for node in self.nodes:
            self._try(node, node.stop)
        deadline = time.monotonic() + FAREWELL
        for node in self.nodes:
            self._try(node, partial(node.flush, deadline))
        self.executor.shutdown()
        for node in self.nodes:
            node.destroy_node()

    @staticmethod
    def _try(node: BundleNode, action: Callable[[], None]) -> None:
        """Act; log an error, so that the other nodes are still vented."""
        try:
            action()
        except Exception as error:
            node.get_logger().error(f'while it ended: {type(error).__name__}: {error}')

    def _check(self) -> None:
        if time.monotonic() >= self._deadline:
            self.interrupt()


class StopSignals:
    """
    Context manager that notes SIGINT, SIGTERM, and SIGHUP unless that is ignored (nohup).

    One Ctrl-C may arrive twice (from the terminal and from launch); only a later second signal
    raises KeyboardInterrupt.

    Parameters
    ----------
    restore : bool
        Whether to restore the previous handlers at the end. A program that is about to exit must
        not restore them: a late signal would change its exit status.
    """

    def __init__(self, restore: bool = True) -> None:
        self.received = False
        self._restore = restore
        self._first = 0.0
        # Python delivers signals to the main thread only; in other threads the caller must stop.
        self._able = threading.current_thread() is threading.main_thread()
        self._before: dict[int, Any] = {}

    def __enter__(self) -> 'StopSignals':
        self._install(self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler if self._restore else signal.SIG_IGN)

    def ignore(self) -> None:
        """Ignore signals while the nodes are stopped."""
        self._install(signal.SIG_IGN)

    def _install(self, handler: Any) -> None:
        if self._able:
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                # After nohup it is ignored, so that the process survives its terminal.
                if number == signal.SIGHUP and signal.getsignal(number) == signal.SIG_IGN:
                    continue
                before = signal.signal(number, handler)
                self._before.setdefault(number, before)

    def _note(self, number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        if not self.received:
            self._first = now
        elif now - self._first > PATIENCE:
            raise KeyboardInterrupt
        self.received = True


def executable(make: Callable[..., BundleNode], words: str | None, specs: Sequence[Spec],
               ) -> Callable[[list[str] | None], int]:
    """
    Return the ``main`` of the executable of a node, which takes a command line.

    ``make`` is called with the context: the class of the node. ``words`` say what the node does,
    for ``--help``, which lists its parameters, ``specs``, too.
    """
    def main(args: list[str] | None = None) -> int:
        return run(lambda context: [make(context=context)],
                   f'{words}\nParameters:\n{table(specs)}', args)
    return main


def node_command(module: str, parameters: Mapping[str, Any], namespace: str) -> list[str]:
    """Return the command that runs a node of this package, by its module, in an own process."""
    words = [sys.executable, '-c', f'import sys; from fam_bundle_ros.nodes.{module} import main; '
             f'sys.argv[0] = "{module}"; sys.exit(main())', '--ros-args',
             '-r', f'__ns:={namespace}']
    for name, value in parameters.items():
        words += ['-p', f'{name}:={str(value).lower() if isinstance(value, bool) else value}']
    return words


def run(make: NodeFactory, usage: str, args: Sequence[str] | None = None) -> int:
    """
    Run nodes until SIGINT or SIGTERM, vent, and return the exit status.

    Parameters
    ----------
    make : callable
        Gets the context, returns the nodes.
    usage : str
        Text for ``--help``.
    args : sequence of str, optional
        Command line; ``sys.argv`` by default.

    Returns
    -------
    int
        0 after a signal, 2 for bad input (one line on stderr says what). A process that hangs
        while it ends does so with status 1.
    """
    argv = list(sys.argv if args is None else args)
    program = os.path.basename(argv[0]) if argv else 'fam_bundle_ros'
    if '-h' in argv[1:] or '--help' in argv[1:]:
        print(usage)
        return 0
    # Imported here, as that module imports every node, and nodes import this module. It takes a
    # second, in which no timer may run: EventsExecutor makes up for every call that is overdue,
    # and each such call delays the next one by a period.
    from fam_bundle_ros.nodes.bundle_bringup import refuse_unknown
    with StopSignals(restore=False) as signals:
        context = Context()
        spinner = None
        try:
            _init(context, argv)
            nodes = make(context)
            spinner = Spinner(context, nodes)
            refuse_unknown(nodes)
            # What stays is not searched for garbage again: that takes 50 ms, in which nothing is
            # controlled.
            gc.freeze()
            while not signals.received and context.ok():
                spinner.spin()
        except InputError as error:
            print(f'{program}: {error}', file=sys.stderr)
            return 2
        except KeyboardInterrupt:
            pass
        finally:
            signals.ignore()
            with ends_within(END):
                if spinner is not None:
                    spinner.close()
                context.try_shutdown()
    return 0


@contextmanager
def ends_within(seconds: float) -> Iterator[None]:
    """
    End the process with status 1 if a block takes longer than some seconds.

    A participant of Fast DDS 2.14 that is destroyed can wait for ever for a callback of its own,
    with Python's lock held: no other thread of Python runs then.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    faulthandler.dump_traceback_later(seconds, exit=True, file=nowhere)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        os.close(nowhere)


def _init(context: Context, argv: Sequence[str]) -> None:
    try:
        rest = remove_ros_args(list(argv))[1:]
        if not rest:
            rclpy.init(args=list(argv), context=context,
                       signal_handler_options=SignalHandlerOptions.NO)
    except (RuntimeError, ValueError) as error:
        # RCLError is a RuntimeError whose reason is followed by places in C source files.
        reason = str(error).split(', at /')[0].partition(': ')
        raise InputError(' '.join((reason[2] or reason[0]).split())) from None
    if rest:
        raise InputError(f"unknown argument '{rest[0]}'; parameters are given as "
                         '--ros-args -p name:=value (see --help)')
