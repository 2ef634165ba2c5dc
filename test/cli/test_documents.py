# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What README and docs tell a user to type exists; links lead somewhere, files load."""

import ast
import importlib
import importlib.util
from pathlib import Path
import re
import shlex
import shutil
import textwrap

import pytest
from typer.main import get_command
import yaml

from fam_bundle_ros.cli.app import app
from fam_bundle_ros.data import load_recipe, read_protocol
from fam_bundle_ros.model import load_model
from fam_bundle_ros.nodes.profile import load_profile

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = ['README.md', 'CONTRIBUTING.md', *sorted(
    str(page.relative_to(ROOT)) for page in (ROOT / 'docs').rglob('*.md')
    if '_build' not in page.parts)]
READERS = {'fam-bundle-model/1': load_model, 'fam-bundle-recipe/1': load_recipe,
           'fam-bundle-trajectory/1': load_profile, 'fam-bundle-protocol/1': read_protocol}
_TYPED = re.compile(r'^(?:\$ )?fam_bundle ([a-z-]+)(.*?)(?:#.*)?$', re.M)


def blocks(text, *languages):
    """Return the code blocks in one of these languages."""
    return [textwrap.dedent(body) for language, body in re.findall(
        r'^ *```([\w{}-]*)\n(.*?)^ *```', text, re.M | re.S) if language in languages]


def typed(text):
    """Return what follows `fam_bundle` in blocks and in the prose."""
    lines = '\n'.join(blocks(text, '', 'sh', 'bash')).replace('\\\n', ' ')
    lines = re.sub(r'^ +|.* && (?=fam_bundle)', '', lines, flags=re.M)
    lines += '\n' + '\n'.join(re.findall(r'`(fam_bundle [a-z][^`]*)`', text))
    return _TYPED.findall(lines)


@pytest.mark.parametrize('document', DOCUMENTS)
def test_every_command_that_a_document_names_exists_with_its_options(repository, document):
    """A command or an option that went must go from the documents too."""
    commands = get_command(app).commands
    for name, rest in typed((repository / document).read_text()):
        assert name in commands, f'fam_bundle {name}'
        known = {option for param in commands[name].params
                 for option in (*param.opts, *param.secondary_opts)} | {'--help'}
        ours = rest.split(' --ros-args')[0]
        for word in shlex.split(ours, comments=True):
            if re.match(r'--?[a-z]', word):
                assert word.split('=')[0] in known | {'--ros-args'}, f'fam_bundle {name} {word}'


def anchors(text):
    """Return the anchors of a page's headings, as GitHub and the site make them."""
    headings = re.findall(r'^#+ (.*)$', re.sub(r'```.*?```', '', text, flags=re.S), re.M)
    return {re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-') for heading in headings}


@pytest.mark.parametrize('document', DOCUMENTS)
def test_every_link_of_a_document_leads_somewhere(repository, document):
    """Pages and pictures that it links to are there, and so are the headings."""
    page = repository / document
    text = page.read_text()
    links = re.findall(r'\]\(([^)\s]+)\)', text) + re.findall(r'(?:srcset|src)="([^"]+)"', text)
    for link in links:
        if '://' not in link:
            path, _, anchor = link.partition('#')
            target = page.parent / path if path else page
            assert target.exists(), link
            assert not anchor or anchor in anchors(target.read_text()), link


@pytest.mark.parametrize('document', DOCUMENTS)
def test_every_name_of_the_package_in_a_document_can_be_imported(repository, document):
    """Dotted names are written as Python finds them."""
    names = set(re.findall(r'`(fam_bundle_ros(?:\.\w+)+)', (repository / document).read_text()))
    for name in names - {'fam_bundle_ros.effects'}:  # the group of entry points
        module, _, last = name.rpartition('.')
        assert hasattr(importlib.import_module(module), last) or importlib.util.find_spec(name)


@pytest.mark.parametrize('document', DOCUMENTS)
def test_every_path_of_the_project_in_a_document_exists(repository, document):
    """Files and folders that it names are where it says."""
    folders = 'config|fam_bundle_ros|test|docs|scripts|launch'
    text = (repository / document).read_text()
    for path in re.findall(rf'`((?:{folders})/[\w./-]*)`', text):
        assert path.startswith('docs/_build') or (repository / path).exists(), path


def test_every_page_that_the_code_names_exists(repository):
    """Messages, comments and example files send nobody to a page that has moved."""
    files = [path for folder in ('fam_bundle_ros', 'config', 'launch', 'test', 'scripts')
             for kind in ('py', 'yaml', 'sh') for path in (repository / folder).rglob(f'*.{kind}')]
    named = {(page, path.name) for path in files
             for page in re.findall(r'docs/[a-z_/]+\.md', path.read_text())}
    assert [entry for entry in sorted(named) if not (repository / entry[0]).exists()] == []


@pytest.mark.parametrize('document', DOCUMENTS)
def test_every_make_target_of_a_document_exists(repository, document):
    """`make` does what is written."""
    text = (repository / document).read_text()
    known = set(re.findall(r'^([a-z-]+):', (repository / 'Makefile').read_text(), re.M))
    named = re.findall(r'^make ([a-z-]+)', '\n'.join(blocks(text, '', 'sh')), re.M)
    assert set(named + re.findall(r'`make ([a-z-]+)`', text)) <= known


@pytest.mark.parametrize('document', DOCUMENTS)
def test_every_python_block_of_a_document_imports_what_exists(repository, document):
    """It compiles, and its imports work; `make docs` runs the notebooks among them."""
    for block in blocks((repository / document).read_text(), 'python', '{code-cell}'):
        body = [node for node in ast.parse(block).body
                if isinstance(node, ast.Import | ast.ImportFrom)]
        exec(compile(ast.Module(body, []), document, 'exec'), {})


@pytest.mark.parametrize('document', DOCUMENTS)
def test_every_file_of_ours_that_a_document_shows_can_be_read(repository, tmp_path, document):
    """Models, recipes and trajectories in the text are ones that the package reads."""
    for block in blocks((repository / document).read_text(), 'yaml'):
        if block.startswith('format:'):
            file = tmp_path / 'shown.yaml'
            file.write_text(block)
            READERS[yaml.safe_load(block)['format']](file)


def test_the_python_of_the_readme_runs(repository, tmp_path, monkeypatch, capsys):
    """As it stands, in the project's folder: the hidden friction is found and added."""
    (block,) = blocks((repository / 'README.md').read_text(), 'python')
    shutil.copytree(repository / 'config', tmp_path / 'config')
    monkeypatch.chdir(tmp_path)
    exec(compile(block, 'README.md', 'exec'), {})
    printed = capsys.readouterr().out
    assert printed.startswith('missing_effect: coulomb_friction')
    assert 'added coulomb_friction' in printed


def test_readme_and_site_have_the_same_worst_cases(repository):
    """The table of the README stands in the site's results too: one is not renewed alone."""
    tables = [re.findall(r'^\|.* \|$', (repository / page).read_text().split(
        '| test | worst', 1)[1].split('\n\n')[0], re.M)
        for page in ('README.md', 'docs/results/index.md')]
    assert len(tables[0]) > 3
    assert tables[0] == tables[1]


def test_make_help_lists_every_target(repository):
    """A target without a line of help would not be found."""
    text = (repository / 'Makefile').read_text()
    (targets,) = re.findall(r'^\.PHONY: (.*)$', text, re.M)
    assert set(targets.split()) == set(re.findall(r'^([a-z-]+):.*## ', text, re.M))
