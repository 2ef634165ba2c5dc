# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What colcon and pip install can be found and run away from the source tree."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

COPIED = ('config', 'fam_bundle_ros', 'launch', 'resource', 'package.xml', 'setup.cfg', 'setup.py')
PRINT_CONFIG = (
    'from fam_bundle_ros.resources import config_path; '
    "print(config_path('data/dmsp20_static_map.csv'))"
)


@pytest.fixture(scope='module')
def source(repository, tmp_path_factory):
    """Return a copy of the source tree, for builds leave their traces in it."""
    root = tmp_path_factory.mktemp('source') / 'fam_bundle_ros'
    root.mkdir()
    for name in COPIED:
        path = repository / name
        if path.is_dir():
            shutil.copytree(path, root / name, ignore=shutil.ignore_patterns('__pycache__'))
        elif path.exists():
            shutil.copy(path, root / name)
    return root


@pytest.fixture(scope='module', params=[[], ['--symlink-install']], ids=['copied', 'symlinked'])
def install(request, source, tmp_path_factory):
    """Return the install space of a colcon build."""
    colcon = shutil.which('colcon', path=f'{Path(sys.executable).parent}:{os.environ["PATH"]}')
    assert colcon, 'colcon is missing: it is in requirements.txt'
    work = tmp_path_factory.mktemp('workspace')
    build = subprocess.run(
        [colcon, 'build', '--base-paths', str(source), *request.param],
        cwd=work, capture_output=True, text=True, timeout=200,
    )
    assert build.returncode == 0, build.stdout + build.stderr
    return work / 'install' / 'fam_bundle_ros'


def run_installed(install, command):
    """Run a shell command with the install space sourced, away from the source tree."""
    return subprocess.run(
        ['bash', '-c', f'source "{install.parent}/local_setup.bash" && {command}'],
        cwd=install, capture_output=True, text=True, timeout=100,
    )


def test_colcon_puts_executables_where_ros2_run_looks(install):
    """Every executable lies in ``lib/fam_bundle_ros`` and the ament index knows the package."""
    assert (install / 'share/ament_index/resource_index/packages/fam_bundle_ros').is_file()
    assert (install / 'share/fam_bundle_ros/package.xml').is_file()
    folder = install / 'lib/fam_bundle_ros'
    assert {path.name for path in folder.iterdir() if os.access(path, os.X_OK)} == {
        'bundle_bringup', 'fam_bundle', 'model_monitor', 'plant_simulator', 'pressure_pid',
        'recruitment_controller', 'reference_generator', 'serial_rig',
    }


def test_colcon_installs_config_and_launch_files(install, source):
    """Every file of config/ and launch/ is below the share directory too."""
    for folder in ('config', 'launch'):
        shipped = {p.relative_to(source) for p in (source / folder).rglob('*') if p.is_file()}
        share = install / 'share/fam_bundle_ros'
        assert [str(path) for path in shipped if not (share / path).is_file()] == []


def test_executable_runs_from_the_install_space(install):
    """``fam_bundle --help`` runs as colcon installed it."""
    run = run_installed(install, 'lib/fam_bundle_ros/fam_bundle --help')
    assert run.returncode == 0, run.stderr
    assert 'demo' in run.stdout


def test_shipped_files_are_found_from_the_install_space(install):
    """The package that colcon installed finds its own config files."""
    run = run_installed(install, f'"{sys.executable}" -c "{PRINT_CONFIG}"')
    assert run.returncode == 0, run.stderr
    assert Path(run.stdout.strip()).is_file()


def test_shipped_files_are_found_after_a_plain_pip_install(source, tmp_path):
    """``pip install`` puts config files inside the package, where they are found."""
    target = tmp_path / 'site'
    pip = subprocess.run(
        [sys.executable, '-m', 'pip', 'install', '--no-deps', '--no-build-isolation', '--quiet',
         '--disable-pip-version-check', '--no-index', '--target', str(target), str(source)],
        capture_output=True, text=True, timeout=200,
    )
    assert pip.returncode == 0, pip.stderr
    run = subprocess.run(
        [sys.executable, '-c', PRINT_CONFIG], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, 'PYTHONPATH': str(target)},
    )
    found = Path(run.stdout.strip())
    assert found.is_relative_to(target), run.stderr
    assert found.is_file()
