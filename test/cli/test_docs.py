# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The reference pages say what the code says."""

import importlib.util

import pytest


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
