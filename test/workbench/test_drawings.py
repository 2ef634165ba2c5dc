# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Figures show what is selected, in the colours of the theme, with no more points than help."""

from dataclasses import replace
import json

import numpy as np
import pytest

from fam_bundle_ros import palette
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.workbench import drawings
from fam_bundle_ros.workbench.cases import Case, load_example
from fam_bundle_ros.workbench.drawings import thin, thin_groups
from fam_bundle_ros.workbench.session import Session


def points(figure):
    """Return the traces of measured points."""
    return [trace for trace in figure['data'] if trace['name'] == 'measured']


def test_every_isobar_has_its_points_lines_and_errors(session):
    """Seven isobars: measured, model, model before and error of each."""
    figure = drawings.main_figure(session)
    assert len(points(figure)) == 7
    assert len(figure['data']) == 28
    assert sum(len(trace['x']) for trace in points(figure)) == 1260


def test_hovering_shows_the_row(session):
    """The label of a point names its row in the file and its numbers."""
    trace = points(drawings.main_figure(session))[0]
    row, strain, pressure, measured, model, error = trace['customdata'][5]
    number = int(row.split()[1].strip(',')) - 2
    assert session.data.strain[number] == pytest.approx(strain, abs=1e-4)
    assert measured - model == pytest.approx(error, abs=2e-4)


def test_the_traces_stay_the_same_when_an_effect_is_added(session, with_friction):
    """A step changes where curves are, not which there are: so they can move."""
    after = drawings.main_figure(with_friction)
    with_friction.undo()
    before = drawings.main_figure(with_friction)
    assert [(t['name'], len(t['x'])) for t in before['data']] == \
        [(t['name'], len(t['x'])) for t in after['data']]
    assert before['layout']['yaxis2']['range'] == pytest.approx(
        after['layout']['yaxis2']['range'], rel=0.02)


def test_selecting_an_isobar_draws_that_one(session):
    """Only the chosen isobar has points."""
    session.select(level=2)
    assert [len(trace['x']) > 0 for trace in points(drawings.main_figure(session))] == \
        [k == 2 for k in range(7)]


def test_a_region_zooms_every_figure():
    """Choosing a region sets the axes of the curves and frames it on the maps."""
    made = Session()
    made.open(load_example('bundle_push_back'))
    wide = drawings.main_figure(made)['layout']['xaxis'].get('range')
    made.select(region=0)
    zoomed = drawings.main_figure(made)['layout']
    rows = made.rows()
    assert zoomed['xaxis']['range'][0] <= made.data.strain[rows].min()
    assert zoomed['xaxis']['range'] != wide
    frames = [shape for shape in drawings.maps(made).layout.shapes if shape.type == 'rect']
    assert len(frames) == 2


def test_a_dark_page_has_the_dark_colours(session):
    """On a dark page no light ink is left, and the isobars take their dark shades."""
    text = json.dumps(drawings.for_page(drawings.main_figure(session), dark=True))
    assert palette.NEUTRAL['ink'].light not in text
    assert palette.isobar(1.0).dark in text


def test_figures_are_json_without_nan(session):
    """A browser can read every figure: no NaN anywhere."""
    for figure in (drawings.main_figure(session), drawings.main_figure(session, True),
                   drawings.maps(session), drawings.loops(session)):
        json.loads(json.dumps(drawings.for_page(figure, False)), parse_constant=pytest.fail)


def test_a_static_map_has_no_loops():
    """Nothing was measured both ways: no figure of loops."""
    made = Session()
    made.open(load_example('dmsp20'))
    assert drawings.loops(made) is None


@pytest.fixture(scope='module')
def long_session():
    """Return a session with 100 000 samples."""
    case = load_example('hidden_friction')
    repeats = -(-100_000 // len(case.data))
    data = case.data
    count = len(data) * repeats
    long = build('long', np.tile(data.strain, repeats), np.tile(data.pressure, (repeats, 1)),
                 np.tile(data.force, repeats), None, 0.23 * np.arange(count))
    made = Session()
    made.open(replace_case(case, long))
    return made


def ramps(gap=0.0):
    """Return a session: pressure up and down twice, the second time after a gap of the clock."""
    case = load_example('hidden_friction')
    pressure = np.tile(np.r_[np.linspace(1e5, 4e5, 60), np.linspace(4e5, 1e5, 60)], 2)
    time = np.arange(240.0)
    time[120:] += gap
    made = Session()
    made.open(replace_case(case, build('ramps', np.full(240, 0.05), pressure[:, None],
                                       pressure / 1e4, None, time)))
    return made


def lines(figure):
    """Return the stretches (first and last time) of each line of the model."""
    found = []
    for trace in figure['data']:
        if trace['name'] == 'model':
            x = np.array(trace['x'], float)
            found.append([(part[np.isfinite(part)][0], part[np.isfinite(part)][-1])
                          for part in np.split(x, np.flatnonzero(np.isnan(x)))])
    return found


def test_a_line_over_time_has_a_gap_where_another_isobar_was_measured():
    """From the rise to the fall of the pressure nothing was measured at the lowest isobar."""
    lowest = lines(drawings.main_figure(ramps(), over_time=True))[0]
    assert [(start < 20, 100 < start < 140, start > 200) for start, _ in lowest] == [
        (True, False, False), (False, True, False), (False, False, True)]


def test_a_line_over_time_has_a_gap_where_the_clock_has_one():
    """Nobody knows what was between."""
    lowest = lines(drawings.main_figure(ramps(gap=500.0), over_time=True))[0]
    assert not any(first < 300.0 < last for first, last in lowest)
    assert len(lowest) == 4


def replace_case(case, data):
    """Return the case with other data."""
    return Case(case.title, case.origin, data, case.model)


def test_100_000_samples_are_thinned_for_drawing_only(long_session):
    """The figure has some thousand points; the error is over every sample."""
    figure = drawings.main_figure(long_session)
    assert sum(len(trace['x']) for trace in points(figure)) <= 4000
    assert len(long_session.residual()) > 100_000
    one = Session()
    one.open(load_example('hidden_friction'))
    assert long_session.now.error_N == pytest.approx(one.now.error_N, rel=0.02)


def test_thinning_keeps_extremes_and_order():
    """Spikes survive, indices rise, and few points are left alone."""
    rng = np.random.default_rng(1)
    values = rng.normal(size=50_000)
    values[[7, 31_234]] = 50.0, -50.0
    kept = thin(values, 500)
    assert len(kept) <= 500
    assert {7, 31_234, 0, 49_999} <= set(kept)
    assert np.all(np.diff(kept) > 0)
    assert np.array_equal(thin(values[:10], 500), np.arange(10))


def test_thinning_gives_every_group_its_share():
    """A small group beside a large one is drawn too."""
    group = np.r_[np.zeros(10_000, int), np.ones(20, int)]
    kept = thin_groups(group, np.arange(10_020.0), 200)
    assert (group[kept] == 1).sum() == 20
    assert (group[kept] == 0).sum() <= 100


def test_the_selection_is_part_of_what_is_kept(session):
    """Selections are plain values: two sessions never share them."""
    other = Session()
    other.open(load_example('hidden_friction'))
    session.select(level=1)
    assert other.selection.level is None
    assert replace(session.selection, level=None) == other.selection
