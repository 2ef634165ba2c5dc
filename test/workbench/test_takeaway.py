# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What is taken home can be used again: model file, CSV, report."""

import re

import numpy as np
import pytest

from fam_bundle_ros.discovery import compare, read_measurement
from fam_bundle_ros.model import dumps_model, loads_model
from fam_bundle_ros.workbench import takeaway
from fam_bundle_ros.workbench.session import short


def test_the_model_file_gives_the_same_prediction(with_friction):
    """A downloaded model, read again, predicts what the page showed."""
    model = loads_model(dumps_model(with_friction.now.model))
    again = compare(model, with_friction.data).prediction
    assert np.allclose(again, with_friction.now.prediction, atol=1e-4)


def test_the_csv_can_be_opened_again(with_friction, tmp_path):
    """The CSV is a measurement, with prediction and residual beside it."""
    text = takeaway.csv_text(with_friction)
    header, *rows = text.splitlines()
    assert header.endswith('model_force [N],residual [N]')
    assert len(rows) == len(with_friction.data)
    force, model, residual = (float(cell) for cell in rows[10].split(',')[-3:])
    assert force - model == pytest.approx(residual, abs=1e-3)
    path = tmp_path / 'again.csv'
    path.write_text(text)
    assert len(read_measurement(path)) == len(rows)


def test_the_report_is_one_file_that_asks_nothing_of_the_network(with_friction):
    """Numbers, ladder and origin are in it; no script, style or picture is fetched."""
    page = takeaway.report_text(with_friction)
    for step in with_friction.steps:
        assert f'{short(step.error_N)} N' in page
    assert f'all {len(with_friction.data)}' in page
    assert 'simulated with this project' in page
    markup = re.sub(r'<script.*?</script>', '', page, flags=re.S)
    assert not re.search(r'(src|href)="http', markup)


def test_names_of_downloads_suit_every_disk(with_friction):
    """The case's title makes a plain name."""
    assert takeaway.file_stem(with_friction) == 'hidden_friction'
