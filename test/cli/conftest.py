# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs commands in an empty folder."""

import signal
from types import SimpleNamespace

import pytest

from fam_bundle_ros.cli import main


@pytest.fixture
def fam_bundle(tmp_path, monkeypatch, capfd):
    """Return a function that runs ``fam_bundle`` and gives status, stdout and stderr."""
    monkeypatch.chdir(tmp_path)
    # `run` ignores signals from its end on, as a process that is about to exit should
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def run(*arguments):
        capfd.readouterr()
        try:
            status = main([str(argument) for argument in arguments])
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
        shown = capfd.readouterr()
        return SimpleNamespace(returncode=status, stdout=shown.out, stderr=shown.err)
    return run
