# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The arrows between the layers point one way."""

import ast
from pathlib import Path

import pytest

PACKAGE = 'fam_bundle_ros'
# Each layer and the layers that it may import; itself and the plain modules go without saying.
DRAWS = {'palette', 'plotting'}
ALLOWED = {
    # the package itself: names for a notebook, loaded when they are asked for
    '': {'model', 'data', 'plant', 'control', 'discovery', 'simulation'},
    'model': set(),
    'data': set(),
    'palette': {'model'},
    'plotting': {'palette'},
    'plant': {'model'},
    'control': {'model'},
    'closed_loop': {'model', 'plant', 'control'},
    'simulation': {'model', 'plant', 'control', 'closed_loop'},
    'discovery': {'model', 'data', *DRAWS},
    'nodes': {'model', 'data', 'plant', 'control', 'discovery', 'simulation'},
    'campaign': {'model', 'data', 'discovery'},
    'benchmarks': {'model', 'data', 'plant', 'control', 'discovery', 'simulation', 'campaign',
                   *DRAWS},
    'report': {'model', 'data', 'plant', 'control', 'discovery', 'simulation', 'benchmarks',
               'campaign', *DRAWS},
    'workbench': {'model', 'data', 'plant', 'control', 'discovery', 'simulation', 'report',
                  *DRAWS},
    'cli': {'model', 'data', 'plant', 'control', 'discovery', 'simulation', 'nodes', 'report',
            'benchmarks', 'campaign', 'workbench', *DRAWS},
    '__main__': {'cli'},
}
# Modules that know nothing of physics and serve every layer.
PLAIN = {'atomic', 'bagwriter', 'errors', 'extras', 'jsonfile', 'kernels', 'mcapfile', 'processes',
         'resources', 'told', 'units'}
# Only nodes/ and the commands that start nodes may speak ROS.
ROS = {'rclpy', 'launch', 'launch_ros', 'ament_index_python', 'std_msgs', 'geometry_msgs',
       'sensor_msgs', 'trajectory_msgs', 'diagnostic_msgs', 'std_srvs', 'rosgraph_msgs',
       'builtin_interfaces', 'rcl_interfaces'}


def imported(path, module):
    """Return the dotted names that a file imports, relative ones made absolute."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = module[:len(module) - node.level] if node.level else ()
            stem = '.'.join([*base, *([node.module] if node.module else [])])
            names.update(f'{stem}.{alias.name}' for alias in node.names)
    return names


def wrong_arrows(root):
    """Return one line for each import in a package folder that no arrow allows."""
    wrong = []
    for path in sorted(root.rglob('*.py')):
        module = (PACKAGE, *path.relative_to(root).with_suffix('').parts)
        layer = module[1]
        if layer == '__init__':
            layer = ''
        for name in sorted(imported(path, module)):
            parts = name.split('.')
            if parts[0] in ROS and layer != 'nodes':
                wrong.append(f'{path.relative_to(root)} imports {name}')
            if parts[0] != PACKAGE or len(parts) < 2 or parts[1] in {layer, *PLAIN}:
                continue
            known = parts[1] in ALLOWED
            if layer in PLAIN or (known and parts[1] not in ALLOWED.get(layer, set())):
                wrong.append(f'{path.relative_to(root)} imports {name}')
    return wrong


def test_imports_run_one_way(repository):
    """Model knows nobody, control and plant know the model, and only nodes import ROS."""
    assert wrong_arrows(repository / PACKAGE) == []


def test_every_layer_has_its_arrows(repository):
    """No folder or module of the package is missing from the table above."""
    names = {
        path.stem for path in (repository / PACKAGE).iterdir()
        if path.suffix == '.py' or (path / '__init__.py').is_file()
    }
    assert names - set(ALLOWED) - PLAIN == {'__init__'}


@pytest.mark.parametrize(('where', 'line'), [
    ('model/a.py', 'from fam_bundle_ros.control import PressurePid'),
    ('model/a.py', 'from ..plant import Rig'),
    ('model/effects/a.py', 'from ...control.pid import PressurePid'),
    ('control/a.py', 'import fam_bundle_ros.plant.rig'),
    ('plant/a.py', 'def late():\n    from fam_bundle_ros import nodes'),
    ('discovery/a.py', 'import rclpy'),
    ('errors.py', 'from fam_bundle_ros.model import load_model'),
])
def test_a_wrong_arrow_is_found(tmp_path: Path, where, line):
    """An import against the arrows is seen however it is written."""
    (tmp_path / where).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / where).write_text(line)
    assert len(wrong_arrows(tmp_path)) == 1
