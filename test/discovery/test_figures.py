# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Figures show the numbers that they are drawn from, each at its place."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros import palette
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery import compare, figures
from fam_bundle_ros.discovery.figures import _ladder_labels, _ladder_places, _short, thin


@pytest.fixture(scope='module')
def compared(make_sweeps, paper_muscle):
    """Return the comparison of sweeps that hide an even and an odd error."""
    return compare(paper_muscle, make_sweeps(
        cycles=1, noise=0.2, extra=lambda e, p, way, t: 2.0 - 1.5 * way))


@pytest.fixture(scope='module')
def swept(paper_muscle):
    """Return the comparison of a log whose pressure never stays, in two trials from zero."""
    time = np.tile(0.05 * np.arange(300), 2)
    strain = 0.1 - 0.1 * np.cos(time)
    pressure = 2e5 - 1.5e5 * np.cos(0.7 * time)
    force = paper_muscle.force(strain, pressure[:, None]) + 1.0
    return compare(paper_muscle, build('log', strain, pressure, force, np.repeat([0, 1], 300),
                                       time))


def drawn(drawing, axis, mode):
    """Return x and y of all points or lines on an axis, sorted."""
    found = [(t.x, t.y) for t in drawing.data if t.yaxis == axis and t.mode == mode]
    x, y = (np.concatenate([np.asarray(each[k], float) for each in found]) for k in (0, 1))
    order = np.lexsort((y, x))
    return x[order], y[order]


def test_every_row_of_isobars_is_a_point_and_on_the_line_of_the_model(compared):
    """Force above, residual below; one colour and one entry in the legend for each isobar."""
    data, drawing = compared.measurement, figures.comparison(compared)
    for axis, values in (('y', data.force), ('y2', compared.residual)):
        order = np.lexsort((values, data.strain))
        assert_allclose(np.array(drawn(drawing, axis, 'markers')),
                        np.array([data.strain[order], values[order]]))
    x, y = drawn(drawing, 'y', 'lines')
    kept = np.isfinite(x)
    order = np.lexsort((compared.prediction, data.strain))
    assert_allclose(np.array([x[kept], y[kept]]),
                    np.array([data.strain[order], compared.prediction[order]]))
    assert [t.name for t in drawing.data if t.showlegend] == [
        '0', '83', '165', '248', '331', '414']
    assert len({t.marker.color for t in drawing.data if t.mode == 'markers'}) == 6


@pytest.mark.parametrize(('levels', 'step'), [(12, 1), (13, 2), (20, 2)])
def test_of_many_isobars_the_legend_has_twelve_at_most(paper_muscle, levels, step):
    """Evenly; all are drawn."""
    pressure = np.repeat(1e4 * np.arange(1, levels + 1), 8)
    strain = np.tile(np.linspace(0.0, 0.1, 8), levels)
    drawing = figures.comparison(compare(paper_muscle, build(
        'map', strain, pressure, paper_muscle.force(strain, pressure[:, None]))))
    assert [t.name for t in drawing.data if t.showlegend] == [
        f'{10 * k}' for k in range(1, levels + 1, step)]
    assert len({t.marker.color for t in drawing.data if t.mode == 'markers'}) == levels


def test_a_log_is_drawn_over_its_time_with_trials_end_to_end(swept):
    """The second trial, whose clock begins at zero, one second after the first."""
    drawing = figures.comparison(swept)
    time, force = drawn(drawing, 'y', 'markers')
    assert_allclose(time, np.r_[0.05 * np.arange(300), 15.95 + 0.05 * np.arange(300)])
    assert_allclose(force, swept.measurement.force)
    assert_allclose(drawn(drawing, 'y', 'lines')[1], swept.prediction)
    assert_allclose(drawn(drawing, 'y2', 'markers')[1], swept.residual)
    assert drawing.layout.xaxis2.title.text == 'time (s)'


def test_isobars_are_told_from_a_pressure_that_sweeps(compared, swept):
    """Where levels are narrow beside the range; one pressure for all is an isobar too."""
    assert figures.has_isobars(compared.measurement)
    assert not figures.has_isobars(swept.measurement)
    one = replace(swept.measurement, pressure=np.full((600, 1), 2e5))
    assert figures.has_isobars(one)
    noisy = compared.measurement.pressure + 8e3 * np.sin(np.arange(480.0))[:, None]
    assert figures.has_isobars(replace(compared.measurement, pressure=noisy))
    assert not figures.has_isobars(replace(
        compared.measurement, pressure=noisy + 5e3 * np.sin(1.7 * np.arange(480.0))[:, None]))


def test_maps_have_the_even_and_the_odd_part_and_the_free_strain(compared, paper_muscle):
    """One scale for both, symmetric; the curve is where the model's force is zero."""
    drawing, maps = figures.residual_maps(compared, paper_muscle), compared.maps()
    even, odd = (t for t in drawing.data if t.type == 'heatmap')
    for trace, part in ((even, 'even'), (odd, 'odd')):
        assert_allclose(np.array(trace.z, float), maps[part])
        assert_allclose(trace.x, maps['strain'])
        assert_allclose(trace.y, maps['pressure'] / 1e3)
        assert trace.zmin == -trace.zmax
    assert even.zmax == odd.zmax == pytest.approx(max(
        np.nanpercentile(np.abs(maps[part]), 98) for part in ('even', 'odd')))
    assert [t.showscale for t in (even, odd)] == [False, True]
    curves = [t for t in drawing.data if t.type != 'heatmap']
    assert len(curves) == 2
    label, = (note for note in drawing.layout.annotations if note.text == 'free strain')
    assert (label.x, label.y) == (curves[0].x[-1], curves[0].y[-1])
    for curve in curves:
        force = paper_muscle.force(curve.x, 1e3 * np.asarray(curve.y)[:, None])
        assert np.abs(force).max() < 0.02
        assert maps['strain'][0] <= min(curve.x)
        assert max(curve.x) <= maps['strain'][-1]
    still = replace(compared, measurement=replace(compared.measurement, time=None))
    assert len(figures.residual_maps(still).data) == 1


def test_loops_show_the_residual_each_way_on_some_isobars(compared, swept):
    """At most so many, from the lowest to the highest; none of a log without isobars."""
    data, drawing = compared.measurement, figures.loops(compared, most=3)
    titles = [note.text for note in drawing.layout.annotations]
    assert titles == ['0 kPa', '165 kPa', '414 kPa']
    for k, kPa in enumerate((0.0, 165.48, 413.7)):
        for trace, way in zip(drawing.data[2 * k:2 * k + 2], (1, -1)):
            rows = (np.abs(data.pressure[:, 0] / 1e3 - kPa) < 1.0) & (data.direction == way)
            assert_allclose(trace.x, data.strain[rows])
            assert_allclose(trace.y, compared.residual[rows])
            assert trace.name == ('shortening' if way > 0 else 'lengthening')
            assert bool(trace.showlegend) == (k == 0)
    assert figures.loops(swept) is None
    assert figures.loops(replace(compared, measurement=replace(data, time=None))) is None


def test_a_ladder_goes_down_step_by_step_beside_the_noise():
    """On a log scale that holds all that is drawn, each label away from the other line."""
    steps = [{'step': 'mesh', 'error_N': 40.0, 'held_out_N': 44.0},
             {'step': 'bladder', 'error_N': 5.0, 'held_out_N': 4.0},
             {'step': 'friction', 'error_N': 0.7, 'held_out_N': 0.71}]
    drawing = figures.ladder(steps, noise=0.6, empirical=3.0)
    all_rows, held = drawing.data
    assert list(all_rows.y) == [40.0, 5.0, 0.7]
    assert list(held.y) == [44.0, 4.0, 0.71]
    assert list(all_rows.x) == [0, 1, 2]
    assert list(all_rows.text) == ['40', '5', '0.7']
    assert list(held.text) == ['44', '4', '']
    assert list(all_rows.textposition) == ['bottom center', 'top center', 'bottom center']
    assert list(held.textposition) == ['top center', 'bottom center', 'top center']
    low, high = 10.0 ** np.array(drawing.layout.yaxis.range)
    assert low < 0.6
    assert 44.0 < high < 100.0
    assert all(low <= tick <= high for tick in drawing.layout.yaxis.tickvals)
    assert {1.0, 2.0, 5.0, 10.0} <= set(drawing.layout.yaxis.tickvals)
    assert [shape.y0 for shape in drawing.layout.shapes] == [0.6, 3.0]
    words = [note.text for note in drawing.layout.annotations]
    assert words == ['noise floor 0.6 N', 'six-parameter form, held out, 3 N']
    alone = figures.ladder([{'step': 'mesh', 'error_N': 40.0}])
    assert len(alone.data) == 1
    assert not alone.layout.shapes


def test_labels_that_say_the_same_are_left_out():
    """Where the other line is within 3 %; a value that is none has no label."""
    assert _ladder_labels([1.0, None, 2.0, 3.0], [1.02, 1.0, 1.9, 3.1]) == ['', '', '2', '3']
    assert _ladder_labels([1.0, 2.0], None) == ['1', '2']
    assert _ladder_places([1.0, 2.0, None, 3.0], [2.0, 1.0, 1.0, 3.0], True) == [
        'bottom center', 'top center', 'top center', 'top center']
    assert _ladder_places([3.0], [3.0], False) == ['bottom center']


def test_candidates_are_bars_the_likeliest_on_top():
    """With the error that each leaves; without a shortlist there is no figure."""
    ranking = [SimpleNamespace(effect=name, probability=p, error_N=error, reason=f'by {name}')
               for name, p, error in (('coulomb_friction', 0.9, 0.61), ('end_caps', 0.08, 1.234),
                                      ('braid_elasticity', 0.02, 3.0))]
    result = SimpleNamespace(ranking=ranking, shortlist=ranking, verdict='found')
    bar, = figures.candidates(result, most=2).data
    assert list(bar.y) == ['end_caps', 'coulomb_friction']
    assert list(bar.x) == [0.08, 0.9]
    assert list(bar.text) == ['0.08 · leaves 1.23 N', '0.90 · leaves 0.61 N']
    assert list(bar.marker.color) == [palette.effect(name).light for name in bar.y]
    assert figures.candidates(SimpleNamespace(ranking=ranking, shortlist=(), verdict='x')) is None
    unsure = SimpleNamespace(ranking=ranking, shortlist=ranking, verdict='unexplained')
    assert figures.candidates(unsure).layout.xaxis.title.text == 'probability among these'


def test_correlations_are_drawn_once_for_each_pair():
    """Below the diagonal, rounded; a single parameter trades off with none."""
    names = ['mesh.a', 'bladder.b', 'caps.c']
    matrix = np.array([[1.0, -0.6, 0.001], [-0.6, 1.0, 0.3], [0.001, 0.3, 1.0]])
    heat, = figures.confounding(SimpleNamespace(confounding=(names, matrix))).data
    assert list(heat.x) == ['a', 'b']
    assert list(heat.y) == ['bladder.b', 'caps.c']
    assert_allclose(np.array(heat.z, float), [[-0.6, np.nan], [0.0, 0.3]])
    assert np.array(heat.text).tolist() == [['-0.60', ''], ['0.00', '0.30']]
    assert (heat.zmin, heat.zmax) == (-1.0, 1.0)
    assert figures.confounding(SimpleNamespace(confounding=(names[:1], matrix[:1, :1]))) is None
    assert _short(['a.x', 'b.x', 'c.y']) == ['a.x', 'b.x', 'y']


def test_thinned_rows_are_every_so_manieth():
    """As many as asked for at most, from the first on."""
    rows = np.arange(1000)
    for most in (1, 7, 250, 999, 1000, 5000):
        kept = thin(rows, most)
        assert len(kept) <= most
        assert len(kept) >= min(len(rows), most // 2)
        assert kept[0] == 0
        assert len(set(np.diff(kept))) <= 1
    assert thin(rows, 0).tolist() == [0]
