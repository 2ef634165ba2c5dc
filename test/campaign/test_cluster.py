# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The same work on a Dask cluster that loses one of two workers, and what is said without one."""

import math
import os
import signal
import sys

import pytest
from typer.testing import CliRunner

import fam_bundle_ros
from fam_bundle_ros.campaign import pool, version
from fam_bundle_ros.cli.app import app
from fam_bundle_ros.errors import InputError
from test.campaign.test_campaign import assert_same_of_three


@pytest.fixture(scope='module')
def cluster():
    """Yield a Dask cluster of two worker processes on this machine."""
    distributed = pytest.importorskip('distributed')
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None,
                                  silence_logs=50) as found:
        yield found


def test_a_campaign_on_a_cluster_that_loses_a_worker_has_the_same_table(
        alone, campaign, three, cluster, tmp_path):
    """SIGKILL of one of two workers in the middle; what it was at is done again."""
    killed = []

    def kill_one(done, every, file):
        if not killed:
            killed.append(next(iter(cluster.workers.values())).process.pid)
            os.kill(killed[0], signal.SIGKILL)
    found = campaign(tmp_path / 'out', scheduler=cluster.scheduler_address, progress=kill_one,
                     **three)
    assert killed
    assert found.computed == 3
    assert_same_of_three(tmp_path / 'out', alone[1])


def test_workers_with_other_code_are_refused(cluster, monkeypatch):
    """Results of two versions in one table could not be compared; the worker is named."""
    monkeypatch.setattr(fam_bundle_ros, '__version__', '9.9')
    version.code_version.cache_clear()
    with pytest.raises(InputError, match=r'worker tcp://.* has fam_bundle_ros 0\..*expected 9\.9'):
        pool.each(abs, [-1], scheduler=cluster.scheduler_address)
    version.code_version.cache_clear()


def test_a_task_that_fails_on_a_cluster_fails_the_rest(cluster):
    """Its own error comes out, as it does on this machine."""
    assert pool.each(math.sqrt, [4.0, 9.0], scheduler=cluster.scheduler_address) == [2.0, 3.0]
    with pytest.raises(ValueError, match='math domain error'):
        pool.each(math.sqrt, [1.0, -1.0], scheduler=cluster.scheduler_address)


def test_an_address_of_a_worker_is_not_taken_for_the_scheduler(cluster):
    """What answers there is said."""
    address = next(iter(cluster.workers.values())).worker_address
    with pytest.raises(InputError, match=r'no scheduler answers \(what answers is a Worker\)'):
        pool.each(abs, [-1], scheduler=address)


def test_a_cluster_without_its_package_says_what_to_install(monkeypatch):
    """The extra is named."""
    monkeypatch.setitem(sys.modules, 'distributed', None)
    with pytest.raises(InputError, match=r"pip install 'fam_bundle_ros\[cluster\]'"):
        pool.each(abs, [-1], scheduler='tcp://127.0.0.1:8786')


@pytest.mark.parametrize('command', [
    ['benchmark-control', '--trajectories', 'ramp_20', '--plants', 'nominal'],
    ['benchmark-faults', '--faults', 'none', '--work', '0.1'],
    ['benchmark-discovery', '--cases', '1', '--sets', 'clean'],
    ['benchmark-discovery', '--real', str(pool.__file__).replace(
        'fam_bundle_ros/campaign/pool.py', 'config/data')]])
def test_benchmarks_take_a_scheduler(command):
    """It is asked for the work: a wrong address is an error, not work done here."""
    pytest.importorskip('distributed')
    told = CliRunner().invoke(app, [*command, '--scheduler', 'nonsense'])
    assert 'scheduler nonsense: no scheduler answers' in str(told.exception)
