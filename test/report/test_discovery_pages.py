# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The pages of `compare` and `diagnose` in sentences."""

from dataclasses import replace

import pytest

from fam_bundle_ros.discovery import compare
from fam_bundle_ros.report.discovery_pages import _sentence, comparison_page
from fam_bundle_ros.workbench.cases import load_example


@pytest.fixture
def noise_said():
    """Return a function: what the page says of the noise, for a note and a floor in N."""
    case = load_example('nothing_missing')
    result = compare(case.model, case.data)

    def said(note, value=1.0):
        other = replace(result, noise=replace(result.noise, note=note, value=value))
        page = comparison_page(other, case.model)
        return next(section.text for section in page.sections if section.title == 'Noise')
    return said


def test_a_note_on_the_noise_is_a_sentence(noise_said):
    """With a capital and a full stop."""
    assert '. Rows that follow each other agree.\n' in noise_said(
        'rows that follow each other agree')


def test_a_floor_without_a_note_has_no_empty_sentence(noise_said):
    """The floor is a sentence of its own."""
    assert '. .' not in noise_said('')


def test_a_large_force_is_written_without_an_exponent(noise_said):
    """As people write it."""
    assert noise_said('', 1634.0).startswith('The floor is 1634 N, ')


@pytest.mark.parametrize(('phrase', 'sentence'), [
    ('held-out levels are off', 'Held-out levels are off.'),
    ('mu1: pressures are high', 'mu1: pressures are high.'),
    ('end_caps take the error', 'end_caps take the error.'),
    ('5 of 90 rows are not used', '5 of 90 rows are not used.')])
def test_notes_are_sentences_and_names_keep_their_case(phrase, sentence):
    """A unit or an effect at the start has the name that files have."""
    assert _sentence(phrase) == sentence
