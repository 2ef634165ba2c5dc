# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The command line ``fam_bundle``.

Exit status 0 on success, 2 for bad input with a one-line message on stderr, 1 otherwise.
Commands import their modules when they run, so that the help is fast.
"""

from collections.abc import Sequence
import os
import signal
import sys
import threading
import warnings

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.extras import EXTRAS
from fam_bundle_ros.processes import keep_freed_memory

#: Status that typer returns after Ctrl-C.
_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command, by default that of the process, and return the exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    debug = '--debug' in given
    keep_freed_memory()
    if (threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL):
        # as Ctrl-C, so that worker processes end with this one
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        from fam_bundle_ros.cli.app import app
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            status = app(args=[a for a in given if a != '--debug'], prog_name='fam_bundle',
                         standalone_mode=False)
        sys.stdout.flush()
        if status == _INTERRUPTED:
            return _fail('stopped', 1)
        return status if isinstance(status, int) else 0
    except BrokenPipeError:
        # the reader of a pipe (head, less) has ended, which is not an error
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        return _fail('stopped', 1)
    except Exception as error:  # unexpected errors become one line here
        if debug:
            raise
        return _report(error)


def _report(error: Exception) -> int:
    if isinstance(error, InputError):
        return _fail(str(error), 2)
    if isinstance(error, ModuleNotFoundError):
        return _fail(_missing(error), 1)
    if isinstance(error, OSError) and error.filename:
        return _fail(f'{error.filename}: {error.strerror}; expected a file that this user may '
                     'read or write', 2)
    if hasattr(error, 'format_message'):  # a usage error of typer, with its own click or not
        context = getattr(error, 'ctx', None)
        command = f'{context.command_path}: ' if context else ''
        help_line = f' ({context.command_path} --help lists the options)' if context else ''
        message = error.format_message().rstrip('.')
        if not message.strip() or type(error).__name__ == 'NoArgsIsHelpError':
            print(message)
            return 2
        return _fail(f'{command}{message}{help_line}', 2, prefix='')
    if type(error).__name__ == 'Abort':
        return _fail('stopped', 1)
    return _fail(f'unexpected {type(error).__name__}: {error} (--debug shows where)', 1)


def _missing(error: ModuleNotFoundError) -> str:
    name = (error.name or '').partition('.')[0]
    if name in EXTRAS:
        return f"this command needs {name}: pip install 'fam_bundle_ros[{EXTRAS[name]}]'"
    if name == 'rclpy' or name.endswith('_msgs') or name == 'std_srvs':
        return f'this command needs ROS 2 ({name}): source its setup.bash, or run make install'
    module = error.name if name == 'fam_bundle_ros' else name
    return f'the Python package {module} is not installed'


def _fail(message: str, status: int, prefix: str = 'fam_bundle: ') -> int:
    print(prefix + ' '.join(message.split()), file=sys.stderr)
    return status


def _show_warning(message, category, filename, lineno, file=None, line=None):
    if issubclass(category, (DeprecationWarning, PendingDeprecationWarning)):
        return
    print(f'fam_bundle: note: {" ".join(str(message).split())}', file=sys.stderr)
