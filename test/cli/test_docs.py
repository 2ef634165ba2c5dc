# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The reference pages say what the code says, and what the guide shows works."""

import importlib.util
import re

import pytest

from fam_bundle_ros.model import load_model
from fam_bundle_ros.model.expression import FUNCTIONS, VARIABLES


def make_pages(repository):
    """Return what docs/make.py would write: file name -> function."""
    spec = importlib.util.spec_from_file_location('docs_make', repository / 'docs' / 'make.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.PAGES


@pytest.mark.parametrize('name', ['api.md', 'cli.md', 'effects.md'])
def test_reference_pages_are_up_to_date(repository, domain_id, name):
    """Topics, services, parameters, commands and effects are written as they are in the code."""
    written = (repository / 'docs' / name).read_text()
    assert written == make_pages(repository)[name](), 'run: python docs/make.py'


def blocks(repository, language):
    """Return the code blocks of a language in the guide."""
    text = (repository / 'docs' / 'guide.md').read_text()
    return re.findall(rf'^```{language}\n(.*?)^```', text, re.S | re.M)


def test_the_effects_of_the_guide_work(repository, tmp_path, monkeypatch):
    """The guide's formula, table, Python effect and lines of Python do what it says of them."""
    formula, *others = blocks(repository, 'yaml')
    head = formula[:formula.index('effects:')]
    _, table = blocks(repository, 'csv')
    latch, lines = blocks(repository, 'python')
    (tmp_path / 'surface.csv').write_text(table)
    (tmp_path / 'latch.py').write_text(latch)
    models = []
    for number, text in enumerate([formula, *(head + other for other in others)]):
        (tmp_path / f'{number}.yaml').write_text(text)
        models.append(load_model(tmp_path / f'{number}.yaml', allow_python=True))
    stop, surface, latched = models
    plain = stop.without_effect('stop')
    assert stop.force(0.2, [2e5]) - plain.force(0.2, [2e5]) == pytest.approx(-400 * 0.03)
    assert surface.force(0.2, [2e5]) == pytest.approx(14.0)
    assert latched.force(0.2, [2e5]) - plain.force(0.2, [2e5]) == pytest.approx(-8.0)
    monkeypatch.chdir(repository)
    exec(compile(lines, 'guide', 'exec'), {})


def test_the_guide_names_what_a_formula_may_use(repository):
    """Every variable and function of formulas stands in the guide."""
    text = (repository / 'docs' / 'guide.md').read_text()
    assert [name for name in (*VARIABLES, *FUNCTIONS) if f'`{name}`' not in text] == []
