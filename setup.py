# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Installs fam_bundle_ros for colcon (ament_python) and for pip."""

from collections import defaultdict
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = 'fam_bundle_ros'
NODES = (
    'plant_simulator',
    'recruitment_controller',
    'pressure_pid',
    'reference_generator',
    'model_monitor',
    'bundle_bringup',
    'serial_rig',
)


def shared(folder):
    """Return the files below a folder as data_files entries that keep the tree."""
    entries = defaultdict(list)
    for path in sorted(Path(folder).rglob('*')):
        if path.is_file() and '__pycache__' not in path.parts:
            entries[f'share/{PACKAGE}/{path.parent}'].append(str(path))
    return list(entries.items())


setup(
    name=PACKAGE,
    version='0.2.0',
    # config/ is installed twice: below share/ where ROS users look for parameter files, and
    # inside the Python package, so that nodes and command line need no share directory.
    packages=[*find_packages(include=[PACKAGE, f'{PACKAGE}.*']), f'{PACKAGE}.config'],
    package_dir={f'{PACKAGE}.config': 'config'},
    package_data={
        PACKAGE: ['**/*.html', '**/*.css', '**/*.js', '**/*.svg', 'py.typed'],
        f'{PACKAGE}.config': ['**/*'],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        *shared('config'),
        *shared('launch'),
    ],
    python_requires='>=3.11',
    # rclpy and the messages come from ROS (package.xml) or from requirements.txt.
    install_requires=['numpy>=1.26', 'scipy>=1.11', 'PyYAML>=6', 'pint>=0.19', 'control>=0.10',
                      'threadpoolctl>=3.1'],
    extras_require={
        'cluster': ['distributed'],
        'fast': ['numba'],
        'files': ['openpyxl', 'npTDMS', 'h5py', 'pyarrow'],
        'serial': ['pyserial>=3.5'],
        'tools': ['typer', 'rich', 'rosbags', 'plotly>=6', 'pandas>=2'],
        'web': ['nicegui>=3'],
        'docs': ['sphinx>=9', 'myst-nb', 'pydata-sphinx-theme', 'sphinx-copybutton'],
        'test': ['pytest', 'pytest-timeout', 'pytest-xdist', 'hypothesis', 'playwright',
                 'scikit-learn'],
    },
    zip_safe=False,
    maintainer='fam_bundle_ros contributors',
    maintainer_email='maintainers@fam-bundle-ros.example.org',
    description='Fluidic artificial muscle bundles with variable recruitment on ROS 2',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            *(f'{node} = {PACKAGE}.nodes.{node}:main' for node in NODES),
            f'fam_bundle = {PACKAGE}.cli:main',
        ],
    },
)
