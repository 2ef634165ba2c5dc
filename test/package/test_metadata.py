# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""package.xml, setup.py and the package itself tell the same story."""

import ast
from importlib import import_module
from importlib.metadata import distribution
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import pytest
import yaml

import fam_bundle_ros
from fam_bundle_ros.extras import EXTRAS

EXECUTABLES = {
    'bundle_bringup',
    'fam_bundle',
    'model_monitor',
    'plant_simulator',
    'pressure_pid',
    'recruitment_controller',
    'reference_generator',
    'serial_rig',
}
# What every catkin_pkg accepts, old ones too; with any other address colcon silently drops the
# ament index marker.
EMAIL = re.compile(r'^[a-zA-Z0-9._%+-]+@[a-zA-Z0-9._%+-]+\.[a-zA-Z]{2,6}$')


@pytest.fixture(scope='module')
def manifest(repository):
    """Return the root element of package.xml."""
    return ElementTree.parse(repository / 'package.xml').getroot()


@pytest.fixture(scope='module')
def setup(repository):
    """Return what setup.py says, asked as colcon asks it."""
    fields = ['name', 'version', 'maintainer', 'maintainer-email', 'license']
    answer = subprocess.run(
        [sys.executable, 'setup.py', '-q', *(f'--{field}' for field in fields)],
        cwd=repository, capture_output=True, text=True, check=True,
    ).stdout.split('\n')
    return dict(zip(fields, answer, strict=False))


def test_every_optional_package_is_in_the_extra_that_messages_name(repository):
    """`library` and the command line say what to install; setup.py installs it."""
    extras, = (ast.literal_eval(node.value) for node in ast.walk(
        ast.parse((repository / 'setup.py').read_text()))
        if isinstance(node, ast.keyword) and node.arg == 'extras_require')
    missing = [package for package, extra in EXTRAS.items()
               if not any(entry.lower().startswith(package) for entry in extras[extra])]
    assert missing == []


def test_manifest_is_valid(repository):
    """catkin_pkg, which colcon uses, reads package.xml without error or warning."""
    catkin_pkg = pytest.importorskip('catkin_pkg.package')
    warnings: list[str] = []
    package = catkin_pkg.parse_package(str(repository), warnings=warnings)
    package.validate(warnings=warnings)
    assert package.get_build_type() == 'ament_python'
    assert warnings == []


def test_manifest_and_setup_agree(manifest, setup):
    """Name, version, maintainer and license are the same in package.xml and setup.py."""
    maintainer = manifest.find('maintainer')
    assert {
        'name': manifest.findtext('name'),
        'version': manifest.findtext('version'),
        'maintainer': maintainer.text,
        'maintainer-email': maintainer.get('email'),
        'license': manifest.findtext('license'),
    } == setup


def test_version_of_the_package_is_that_of_the_manifest(manifest):
    """``fam_bundle_ros.__version__`` is the version that package.xml states."""
    assert fam_bundle_ros.__version__ == manifest.findtext('version')


def test_citation_and_changelog_have_the_version_of_the_manifest(repository, manifest):
    """Who cites the package, and who reads what is new, finds the version that is installed."""
    version = manifest.findtext('version')
    cited = yaml.safe_load((repository / 'CITATION.cff').read_text())
    assert (cited['version'], cited['license']) == (version, manifest.findtext('license'))
    newest = re.search(r'^(\S+) \((\S+)\)\n-+$', (repository / 'CHANGELOG.rst').read_text(), re.M)
    assert newest.groups() == (version, str(cited['date-released']))


def test_maintainer_address_is_one_that_catkin_accepts(manifest):
    """The maintainer's address has a form that keeps the ament hook."""
    assert EMAIL.match(manifest.find('maintainer').get('email'))


def test_every_package_folder_is_installed(repository):
    """Every folder with Python modules has an ``__init__.py``, without which it is left out."""
    folders = {path.parent for path in (repository / 'fam_bundle_ros').rglob('*.py')}
    assert [str(f) for f in sorted(folders) if not (f / '__init__.py').is_file()] == []


def test_executables_are_those_of_the_design():
    """The package installs its nodes and ``fam_bundle``, no more and no less."""
    installed = distribution('fam_bundle_ros').entry_points.select(group='console_scripts')
    assert {entry.name for entry in installed} == EXECUTABLES


@pytest.mark.parametrize('name', sorted(EXECUTABLES))
def test_executable_is_importable(name):
    """The executable's module imports and its ``main`` can be called."""
    module = 'fam_bundle_ros.cli' if name == 'fam_bundle' else f'fam_bundle_ros.nodes.{name}'
    assert callable(import_module(module).main)


@pytest.mark.parametrize('file', ['requirements.txt', 'docs/requirements.txt'])
def test_requirements_hold_no_addresses(repository, file):
    """The pins are plain ``name==version`` lines, each name once."""
    lines = (repository / file).read_text().splitlines()
    pins = [line for line in lines if line and not line.startswith('#')]
    plain = re.compile(r'[A-Za-z0-9._-]+==[0-9][0-9a-z.]*')
    assert [pin for pin in pins if not plain.fullmatch(pin)] == []
    names = [re.sub(r'[-_.]+', '-', pin.split('==')[0]).lower() for pin in pins]
    assert len(names) == len(set(names))


def test_ubuntu_pins_replace_pins(repository):
    """What Ubuntu ships of the run time is pinned in both files under the same name."""
    newest, ubuntu = (
        {line.split('==')[0] for line in (repository / name).read_text().splitlines()
         if '==' in line}
        for name in ('requirements.txt', 'requirements-ubuntu.txt')
    )
    assert {'numpy', 'scipy', 'PyYAML', 'Pint'} <= newest & ubuntu


def test_every_module_names_its_license(repository):
    """Every Python file starts with the copyright and the SPDX line."""
    head = '# Copyright 2026 fam_bundle_ros contributors\n# SPDX-License-Identifier: Apache-2.0\n'
    files = [
        path for folder in ('fam_bundle_ros', 'launch', 'test')
        for path in (repository / folder).rglob('*.py')
    ]
    missing = [str(path) for path in files if head not in path.read_text()[:200]]
    assert missing == []


def test_setup_runs_nothing_but_setup(repository):
    """setup.py imports only setuptools and the standard library: it runs before pip does."""
    tree = ast.parse((repository / 'setup.py').read_text())
    roots = {
        name.split('.')[0]
        for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)
        for name in ([node.module] if isinstance(node, ast.ImportFrom)
                     else [alias.name for alias in node.names])
    }
    assert roots - set(sys.stdlib_module_names) == {'setuptools'}
