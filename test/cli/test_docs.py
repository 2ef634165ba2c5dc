# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The reference pages say what the code says, and the effects that a guide shows work."""

import importlib.util
import re

import numpy as np
import pytest

from fam_bundle_ros.model import load_model
from fam_bundle_ros.model.expression import FUNCTIONS, VARIABLES


def make_pages(repository):
    """Return what docs/make.py would write: file name -> function."""
    spec = importlib.util.spec_from_file_location('docs_make', repository / 'docs' / 'make.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.PAGES


@pytest.mark.parametrize('name', ['ros.md', 'cli.md', 'effects.md'])
def test_reference_pages_are_up_to_date(repository, domain_id, name):
    """Topics, services, parameters, commands and effects are written as they are in the code."""
    written = (repository / 'docs' / 'reference' / name).read_text()
    assert written == make_pages(repository)[name](), 'run: python docs/make.py'


def blocks(repository, language, page='own_effect.md'):
    """Return the code blocks of a language in a guide."""
    text = (repository / 'docs' / 'how_to' / page).read_text()
    return re.findall(rf'^```{language}\n(.*?)^```', text, re.S | re.M)


def test_the_effects_of_the_guide_work(repository, tmp_path):
    """The guide's formula, table and Python effect do what it says of them."""
    formula, *others = blocks(repository, 'yaml')
    head = formula[:formula.index('effects:')]
    (table,) = blocks(repository, 'csv')
    (latch,) = blocks(repository, 'python')
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


def test_the_forces_of_the_guide_can_be_asked_for(repository, monkeypatch):
    """The lines of Python below "Forces" run in the project's folder."""
    (lines,) = (block for block in blocks(repository, 'python', 'python.md')
                if 'bundle.force' in block)
    monkeypatch.chdir(repository)
    exec(compile(lines, 'python.md', 'exec'), {})


class Rig:
    """A dynamometer at a strain of 0.16; the pressures follow the valves at 5 MPa/s."""

    def __init__(self, bundle, samples):
        self.bundle, self.left = bundle, samples
        self.pressure = np.zeros(bundle.n)

    def running(self):
        self.left -= 1
        return self.left >= 0

    def read(self):
        return float(self.bundle.force(0.16, self.pressure)), 0.16, 0.0, self.pressure

    def write(self, valves):
        self.pressure = np.clip(self.pressure + 25e3 * np.array(valves), 0.0, 500e3)


def test_the_loop_of_the_guide_holds_the_force_of_a_rig(repository, monkeypatch):
    """Any object that can be read and written: 30 N after a second."""
    (lines,) = (block for block in blocks(repository, 'python', 'python.md')
                if 'rig.read' in block)
    monkeypatch.chdir(repository)
    rig = Rig(load_model('config/models/spie2021.yaml'), 200)
    exec(compile(lines, 'python.md', 'exec'), {'rig': rig})
    assert rig.read()[0] == pytest.approx(30.0, abs=0.5)


def test_the_guide_names_what_a_formula_may_use(repository):
    """Every variable and function of formulas stands in the guide."""
    text = (repository / 'docs' / 'how_to' / 'own_effect.md').read_text()
    assert [name for name in (*VARIABLES, *FUNCTIONS) if f'`{name}`' not in text] == []
