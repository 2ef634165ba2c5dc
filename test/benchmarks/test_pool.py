# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Independent tasks on several cores."""

import math
import os

import pytest

from fam_bundle_ros.benchmarks.pool import each


@pytest.mark.parametrize('workers', [1, 2])
def test_results_keep_the_order_of_the_tasks(workers):
    """Whatever ends first; progress counts every task once."""
    told = []
    assert each(math.sqrt, [4.0, 9.0, 16.0], workers, lambda *step: told.append(step)) == [
        2.0, 3.0, 4.0]
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_a_worker_computes_on_one_core(monkeypatch):
    """Linear algebra is told so before it is imported; the environment here is as it was."""
    monkeypatch.delenv('OMP_NUM_THREADS', raising=False)
    assert each(os.getenv, ['OMP_NUM_THREADS'] * 2, 2) == ['1', '1']
    assert 'OMP_NUM_THREADS' not in os.environ


@pytest.mark.parametrize('workers', [1, 2])
def test_a_task_that_fails_fails_the_rest(workers):
    """Its own error comes out."""
    with pytest.raises(ValueError, match='math domain error'):
        each(math.sqrt, [1.0, -1.0], workers)
