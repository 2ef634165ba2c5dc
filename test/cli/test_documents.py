# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What README and docs tell a user to type exists, and their Python runs."""

import importlib
import importlib.util
import re
import shlex
import shutil

import pytest
from typer.main import get_command

from fam_bundle_ros.cli.app import app

DOCUMENTS = ['README.md', *(f'docs/{name}.md' for name in (
    'benchmarks', 'driver', 'faults', 'guide', 'safety', 'serial_rig'))]
_TYPED = re.compile(r'^(?:\$ )?fam_bundle ([a-z-]+)(.*?)(?:#.*)?$', re.M)


def blocks(text, *languages):
    """Return the code blocks in one of these languages."""
    return [body for language, body in re.findall(r'^```(\w*)\n(.*?)^```', text, re.M | re.S)
            if language in languages]


def typed(text):
    """Return what follows `fam_bundle` in blocks and in the prose."""
    lines = '\n'.join(blocks(text, '', 'sh', 'bash')).replace('\\\n', ' ')
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


@pytest.mark.parametrize('document', DOCUMENTS)
def test_every_link_of_a_document_leads_somewhere(repository, document):
    """Pages and pictures that it links to are there."""
    page = repository / document
    text = page.read_text()
    links = re.findall(r'\]\(([^)\s]+)\)', text) + re.findall(r'(?:srcset|src)="([^"]+)"', text)
    for link in links:
        if '://' not in link and not link.startswith('#'):
            assert (page.parent / link.split('#')[0]).exists(), link


@pytest.mark.parametrize('document', DOCUMENTS)
def test_every_name_of_the_package_in_a_document_can_be_imported(repository, document):
    """Dotted names are written as Python finds them."""
    names = set(re.findall(r'`(fam_bundle_ros(?:\.\w+)+)', (repository / document).read_text()))
    for name in names - {'fam_bundle_ros.effects'}:  # the group of entry points
        module, _, last = name.rpartition('.')
        assert hasattr(importlib.import_module(module), last) or importlib.util.find_spec(name)


@pytest.mark.parametrize('document', ['README.md', 'docs/guide.md'])
def test_every_make_target_of_a_document_exists(repository, document):
    """`make` does what is written."""
    text = (repository / document).read_text()
    known = set(re.findall(r'^([a-z-]+):', (repository / 'Makefile').read_text(), re.M))
    named = re.findall(r'^make ([a-z-]+)', '\n'.join(blocks(text, '', 'sh')), re.M)
    assert set(named + re.findall(r'`make ([a-z-]+)`', text)) <= known


def test_the_python_of_the_readme_runs(repository, tmp_path, monkeypatch, capsys):
    """As it stands, in the project's folder: the hidden friction is found and added."""
    (block,) = blocks((repository / 'README.md').read_text(), 'python')
    shutil.copytree(repository / 'config', tmp_path / 'config')
    monkeypatch.chdir(tmp_path)
    exec(compile(block, 'README.md', 'exec'), {})
    assert 'coulomb_friction' in (tmp_path / 'better.yaml').read_text()
    assert 'coulomb_friction' in capsys.readouterr().out
