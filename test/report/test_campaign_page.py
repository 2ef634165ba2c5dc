# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of a campaign: what each muscle lacks, what goes with what, what was left out."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.campaign import Campaign
from fam_bundle_ros.campaign.trends import Contrast, Share, Trend
from fam_bundle_ros.model import Bundle, catalogue, Geometry, MotorUnit
from fam_bundle_ros.report import campaign_figures as figures
from fam_bundle_ros.report.campaign_page import campaign_page
from fam_bundle_ros.report.page import render


def recording(file, muscle, status='done', **other):
    """Return the row of a recording."""
    return {'file': file, 'muscle': muscle, 'status': status, 'error': '', 'duplicate_of': '',
            'check_first': '', 'in_table': True, 'verdict': 'missing_effect',
            'effects': 'end_caps', 'replaced': '', 'removed': '', 'tied': '',
            'model_error_N': 8.0, 'recalibrated_error_N': 3.0, 'best_error_N': 0.5,
            'held_out_N': 0.6, 'noise_floor_N': 0.4,
            'counted': status == 'done' and not {'duplicate_of', 'check_first'} & set(other),
            **other}


def effect(file, muscle, name, probability, named=False, tied=False):
    """Return the row of an effect."""
    return {'file': file, 'muscle': muscle, 'effect': name, 'probability': probability,
            'named': named, 'tied': tied}


@pytest.fixture
def found():
    """Return a campaign of three muscles: one of two recordings, one copy, one failure."""
    trend = Trend('end_caps.dead_length', 'mm', 'length [mm]', (100.0, 200.0, 300.0),
                  (4.0, 16.0, 36.0), (3.5, 14.0, 1.0), (4.5, 18.0, 360.0), 2.0, 1.9, 2.1, 4e-4,
                  0.02, 0.001)
    return Campaign(
        Bundle('lab', [MotorUnit('mu1', 1, Geometry(6e-3, 0.2, np.radians(30.0), 1e-3))],
               [catalogue.get('mesh')()]),
        [recording('a1.csv', 'a'), recording('a2.csv', 'a'), recording('b.csv', 'b'),
         recording('c.csv', 'c', verdict='adequate', effects='', in_table=False),
         recording('copy.csv', 'copy.csv', duplicate_of='b.csv'),
         recording('<bad>.csv', 'd', 'failed', error='no column is a force', verdict='')],
        [effect('a1.csv', 'a', 'end_caps', 1.0, True), effect('a2.csv', 'a', 'end_caps', 0.5),
         effect('b.csv', 'b', 'end_caps', 0.9, True, True),
         effect('b.csv', 'b', 'strain_sensor_offset', 0.1, tied=True),
         effect('c.csv', 'c', 'end_caps', 0.2), effect('copy.csv', 'copy.csv', 'end_caps', 0.9)],
        [], {'a': {'length [mm]': 100.0}}, [Share('end_caps', 2, 3, 0.2, 0.94, 1),
                                            Share('strain_sensor_offset', 0, 3, 0.0, 0.56, 1)],
        [Contrast('end_caps', 'age', 4, 4, 30.0, 200.0, 0.01)], [trend], 3)


def test_a_muscle_is_a_row_with_the_mean_of_its_recordings(found):
    """Dots where an effect is named in half of them, rings where it is only tied."""
    heat, missing, tied = figures.lacking(found).data
    shown = {(muscle, name): heat.z[i][j] for i, muscle in enumerate(heat.y)
             for j, name in enumerate(heat.x)}
    assert shown == {('a', 'end_caps'): 0.75, ('b', 'end_caps'): 0.9, ('c', 'end_caps'): 0.2,
                     ('a', 'strain_sensor_offset'): 0.0, ('b', 'strain_sensor_offset'): 0.1,
                     ('c', 'strain_sensor_offset'): 0.0}
    assert set(zip(missing.y, missing.x)) == {('a', 'end_caps'), ('b', 'end_caps')}
    assert set(zip(tied.y, tied.x)) == {('b', 'strain_sensor_offset')}


def test_a_trend_is_drawn_through_its_points_on_logarithmic_axes(found):
    """An interval that is wide open does not press the points into a line."""
    drawing = figures.over_facts(found.trends)
    points, line = drawing.data
    assert np.allclose(points.y, 4e-4 * np.array(points.x) ** 2)
    assert np.allclose(line.y, 4e-4 * np.array(line.x) ** 2)
    assert np.allclose(np.array(points.y) + points.error_y.array, (4.5, 18.0, 360.0))
    assert (drawing.layout.xaxis.type, drawing.layout.yaxis.type) == ('log', 'log')
    assert 10.0 ** drawing.layout.yaxis.range[1] < 100.0


def test_the_errors_are_those_of_recordings_that_count(found):
    """Four of six, each with its model, recalibration, best and noise."""
    drawing = figures.errors(found)
    assert [(trace.name, len(trace.y)) for trace in drawing.data] == [
        ('present model', 4), ('recalibrated', 4), ('with the effects found', 4),
        ('noise floor', 4)]


def test_the_page_says_what_is_missing_and_what_was_left_out(found):
    """Names are escaped; failures, copies and recordings out of the table are listed."""
    page = campaign_page(found)
    text = render(page)
    assert 'end_caps is missing in 2 of 3.' in page.lead
    assert 'end_caps: median age 30 where it is missing, 200 where not.' in page.lead
    assert 'end_caps.dead_length goes with length [mm] to the power 2' in page.lead
    assert [(card.name, card.value) for card in page.headline[:2]] == [
        ('Recordings', '6'), ('Muscles', '3')]
    left, = [section for section in page.sections if section.title == 'Left out, or in doubt']
    assert [[row[0] for row in table.rows] for table in left.items] == [
        ['<bad>.csv'], ['copy.csv'], ['c.csv']]
    assert '&lt;bad&gt;.csv' in text
    assert '<bad>' not in text


def test_the_page_says_which_recordings_to_check_first(found):
    """With the words, and that they are not counted; or that they are, where this was asked."""
    slip = 'with pressures in psi, not in kPa the model would be off by 2 N'
    for counted, said in ((False, 'Not counted: correct'), (True, 'Counted all the same')):
        page = campaign_page(replace(found, recordings=[
            *found.recordings, recording('e.csv', 'e', check_first=slip, counted=counted)]))
        table = page.sections[-2].items[0]
        assert table.rows[0][:2] == ('e.csv', slip)
        assert said in render(page)
        assert '1 to check first' in page.headline[0].note


def test_the_page_names_recordings_whose_error_stays_far_above_the_noise(found):
    """Whatever their verdict is."""
    rows = [*found.recordings, recording('f.csv', 'f', verdict='recalibrate', best_error_N=40.0)]
    text = render(campaign_page(replace(found, recordings=rows)))
    assert 'Largest errors with the effects found, in multiples of the noise: f.csv 100, ' in text


def test_a_campaign_in_which_all_failed_has_a_page():
    """It says so, without figures."""
    empty = Campaign(
        Bundle('lab', [MotorUnit('mu1', 1, Geometry(6e-3, 0.2, np.radians(30.0), 1e-3))],
               [catalogue.get('mesh')()]),
        [recording('a.csv', 'a', 'failed', error='empty', verdict='')], [], [], {}, [], [], [], 1)
    page = campaign_page(empty)
    assert 'No recording could be evaluated.' in render(page)
    assert [card.value for card in page.headline] == ['1', '0']
