# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""`fam_bundle benchmark-faults` on one fault: table, page and numbers are complete."""

import json

import pytest

pytest.importorskip('rclpy', reason='rclpy is not installed')

from fam_bundle_ros.benchmarks import faults


def test_benchmark_writes_table_page_and_numbers(fam_bundle, domain_id, tmp_path):
    """Every run has a row, every fault a line in terminal, page and JSON."""
    result = fam_bundle('benchmark-faults', '--faults', 'mu1 burst', '--phases', 'ramp',
                        '--policies', 'neglect', '--work', '0', '--workers', '1',
                        '--out', 'faults.md', '--json', 'faults.json')
    assert result.returncode == 0, result.stderr
    found = json.loads((tmp_path / 'faults.json').read_text())
    assert set(found) == {'conditions', 'faults', 'sound', 'rows'}
    row, = found['rows']
    assert (row['fault'], row['phase'], row['policy']) == ('mu1 burst', 'ramp', 'neglect')
    assert row['force_error'] > 10.0
    assert found['faults'][0]['runs'] == 1
    assert 'mu1 burst' in result.stdout
    assert '| mu1 burst | 1 |' in (tmp_path / 'faults.md').read_text()


def test_benchmark_lists_its_faults_and_refuses_others(fam_bundle):
    """`--list` names every fault; a name that is none is one line with those that are."""
    listed = fam_bundle('benchmark-faults', '--list').stdout
    assert [name for name in (*faults.FAULTS, *faults.MESSAGES) if name not in listed] == []
    wrong = fam_bundle('benchmark-faults', '--faults', 'mu1 bursts')
    assert wrong.returncode == 2
    assert "--faults: 'mu1 bursts' is not known; expected all, or some of" in wrong.stderr


def test_nothing_to_run_is_refused(fam_bundle):
    """No fault and no work is a slip, not an empty table."""
    empty = fam_bundle('benchmark-faults', '--faults', 'none', '--work', '0')
    assert empty.returncode == 2
    assert '--work' in empty.stderr
