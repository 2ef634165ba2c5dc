# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A comparison's tables and figure say where the error is, in whole and in the right units."""

from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros import discovery
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery import Choices, compare, figures
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.locate import locate
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.templates import _add_hum, describe
from fam_bundle_ros.model import Bundle, MotorUnit


def masks(data, labels):
    """Return the rows that labels as `0.030 to 0.060` name, of a column (T,)."""
    bounds = [list(map(float, label.split()[:3:2])) for label in labels]
    return [(data >= low) & (data <= high) for low, high in bounds]


@pytest.fixture
def compared(sweeps, paper_muscle):
    """Return the comparison of sweeps with the muscle that made them."""
    return compare(paper_muscle, sweeps())


def test_every_sample_is_in_one_row_of_each_table(compared):
    """By pressure, strain, region and direction the samples add up; pressures are in kPa."""
    data = compared.measurement
    for name, rows in compared.tables.items():
        if name in ('pressure', 'strain', 'region', 'direction'):
            assert sum(row['samples'] for row in rows) == len(data), name
            squares = sum(row['samples'] * row['error_N'] ** 2 for row in rows)
            assert squares == pytest.approx(np.sum(compared.residual ** 2)), name
    highest = round(float(data.pressure.max()) / 1e3)
    assert compared.tables['pressure'][-1]['label'] == f'{highest} kPa'


def test_quarters_of_the_speed_follow_each_other(paper_muscle):
    """Each begins where the one before ends, and holds a quarter of the samples."""
    time = np.linspace(0.0, 20.0, 1001)
    compared = compare(paper_muscle, build('sine', 0.1 - 0.1 * np.cos(time), np.full(1001, 2e5),
                                           np.zeros(1001), None, time))
    rows = compared.tables['rate']
    edges = [row['label'].removesuffix(' 1/s').split(' to ') for row in rows]
    assert [low for low, _ in edges[1:]] == [high for _, high in edges[:-1]]
    assert [row['samples'] for row in rows] == pytest.approx(4 * [250], abs=2)


def test_the_rows_of_a_table_are_those_that_its_label_names(sweeps, paper_muscle):
    """Of the strain in eighths, of each trial and direction; a bias is a mean."""
    data = sweeps(extra=lambda strain, pressure, way, time: 20.0 * strain * way)
    compared = compare(paper_muscle, data)
    residual, tables = compared.residual, compared.tables
    assert compared.bias_N == pytest.approx(residual.mean())
    assert compared.largest_N == pytest.approx(np.abs(residual).max())
    assert compared.relative_error == pytest.approx(compared.error_N / np.sqrt(
        np.mean(data.force ** 2)))
    strain = masks(data.strain, [row['label'] for row in tables['strain']])
    trial = [data.trial == k for k in range(12)]
    way = [data.direction == d for d in (1, 0, -1) if (data.direction == d).any()]
    for name, rows in (('strain', strain), ('trial', trial), ('direction', way)):
        assert len(rows) == len(tables[name])
        for inside, row in zip(rows, tables[name]):
            assert row['bias_N'] == pytest.approx(residual[inside].mean(), abs=0.01), name
            assert row['error_N'] == pytest.approx(np.sqrt(np.mean(residual[inside] ** 2)),
                                                   abs=0.01), name
    assert [row['label'] for row in tables['strain']][::7] == ['0.000 to 0.030', '0.210 to 0.240']
    assert [row['label'] for row in tables['trial']] == list(data.trial_names)
    past = paper_muscle.force(data.strain, data.pressure) < 0.0
    assert [row['samples'] for row in tables['region']] == [(~past).sum(), past.sum()]


def test_even_and_odd_parts_of_an_error_are_told_apart(sweeps, paper_muscle):
    """One part is the same both ways, the other turns its sign; cells have noise of a few rows."""
    data = sweeps(cycles=6, extra=lambda strain, pressure, way, time: (
        2.0 - 3.0 * way + 1e-5 * pressure * way))
    compared = compare(paper_muscle, data)
    maps = compared.maps()
    assert maps['pressure'] == pytest.approx(np.linspace(0, 413.7e3, 6), abs=1.0)
    assert maps['strain'] == pytest.approx(np.arange(0.005, 0.24, 0.01), abs=1e-9)
    inside = maps['even'][:, 2:-2]
    assert np.isfinite(inside).all()
    assert inside == pytest.approx(2.0, abs=0.8)
    assert inside.mean() == pytest.approx(2.0, abs=0.05)
    odd = maps['odd'][:, 2:-2].mean(axis=1)
    assert odd == pytest.approx(-3.0 + 1e-5 * maps['pressure'], abs=0.15)
    assert compared.even_N == pytest.approx(2.0, abs=0.15)
    assert compared.odd_N == pytest.approx(np.sqrt(np.mean(odd ** 2)), abs=0.15)
    assert maps['mean'][:, 2:-2].mean() == pytest.approx(2.0, abs=0.1)


def test_a_right_model_leaves_what_noise_leaves(sweeps, paper_muscle):
    """Means of cells scatter as white noise lets them; an error of 1 N is several times that."""
    right = compare(paper_muscle, sweeps(cycles=6))
    wrong = compare(paper_muscle, sweeps(cycles=6, extra=lambda e, p, way, t: 1.0 * (p > 2e5)))
    assert right.lack_of_fit == pytest.approx(1.0, abs=0.25)
    assert wrong.lack_of_fit > 1.5 * right.lack_of_fit
    assert 'no region stands out of the noise' in str(right)
    assert right.located == ()


def test_motor_units_that_are_on_are_told_apart(paper_muscle):
    """Those above a tenth of the highest pressure; an isobar has the pressures of both."""
    unit = paper_muscle.motor_units[0]
    bundle = Bundle('two', [MotorUnit(f'mu{k}', 1, unit.geometry) for k in (1, 2)],
                    paper_muscle.effects)
    strain = np.tile(np.linspace(0.0, 0.2, 40), 4)
    state = np.repeat([0, 1, 2, 3], 40)
    pressure = np.stack([np.array([0.0, 3e5, 3e5, 2e4])[state],
                         np.array([0.0, 0.0, 4e5, 4e5])[state]], -1)
    noise = 0.2 * np.random.default_rng(2).normal(size=160)
    data = build('two', strain, pressure, bundle.force(strain, pressure) + noise + state,
                 motor_units=('mu1', 'mu2'))
    tables = compare(bundle, data).tables
    assert {row['label']: row['bias_N'] for row in tables['motor_unit']} == pytest.approx(
        {'none': 0.0, 'mu1': 1.0, 'mu1 + mu2': 2.0, 'mu2': 3.0}, abs=0.2)
    assert {row['label']: row['bias_N'] for row in tables['pressure']} == pytest.approx({
        'mu1 0, mu2 0 kPa': 0.0, 'mu1 20, mu2 400 kPa': 3.0, 'mu1 300, mu2 0 kPa': 1.0,
        'mu1 300, mu2 400 kPa': 2.0}, abs=0.2)


def test_isobars_of_a_sweep_are_those_of_the_unit_that_varies_most(paper_muscle):
    """All pairs of pressures would be a table without end."""
    unit = paper_muscle.motor_units[0]
    bundle = Bundle('two', [MotorUnit(f'mu{k}', 1, unit.geometry) for k in (1, 2)],
                    paper_muscle.effects)
    wave = np.linspace(0.0, 30.0, 600)
    pressure = np.stack([1e5 * (1.0 + np.sin(wave)), 2e5 * (1.0 + np.cos(1.7 * wave))], -1)
    strain = np.linspace(0.0, 0.2, 600)
    data = build('two', strain, pressure, bundle.force(strain, pressure),
                 motor_units=('mu1', 'mu2'))
    rows = compare(bundle, data).tables['pressure']
    assert len(rows) == 8
    assert all(row['label'].startswith('mu2 ') for row in rows)


def test_an_isobar_is_one_row_though_its_noise_crosses_an_edge(paper_muscle):
    """Ramps between isobars leave no gaps: the range is cut into bins, here at 300 kPa."""
    unit = paper_muscle.motor_units[0]
    bundle = Bundle('two', [MotorUnit(f'mu{k}', 1, unit.geometry) for k in (1, 2)],
                    paper_muscle.effects)
    rng = np.random.default_rng(3)
    first = np.concatenate([np.full(100, 150e3), np.linspace(150e3, 300e3, 100),
                            300e3 + 300.0 * rng.standard_normal(200),
                            np.linspace(300e3, 450e3, 100), np.full(100, 450e3)])
    pressure = np.stack([first, np.repeat([0.0, 2e5], 300)], -1)
    strain = np.tile(np.linspace(0.0, 0.2, 50), 12)
    data = build('two', strain, pressure, bundle.force(strain, pressure),
                 motor_units=('mu1', 'mu2'))
    rows = {row['label']: row['samples'] for row in compare(bundle, data).tables['pressure']}
    near = [count for label, count in rows.items() if 280 < int(label.split()[1][:-1]) < 320]
    assert near == [125, 125]  # one without MU2, one with; 25 rows of a ramp in each
    assert sum(rows.values()) == 600


def test_the_figure_has_forces_above_and_residuals_below(compared):
    """The band about zero is twice the noise either way."""
    drawing = figures.comparison(compared)
    above = [t.y for t in drawing.data if t.mode == 'markers' and t.yaxis == 'y']
    below = [t.y for t in drawing.data if t.mode == 'markers' and t.yaxis == 'y2']
    assert max(np.abs(values).max() for values in above) > 100.0
    assert max(np.abs(values).max() for values in below) < 6.0 * compared.noise.value
    assert (drawing.layout.yaxis.title.text, drawing.layout.yaxis2.title.text) == (
        'force (N)', 'residual (N)')
    band = next(shape for shape in drawing.layout.shapes if shape.type == 'rect')
    assert (band.y0, band.y1) == pytest.approx((-2.0 * compared.noise.value,
                                                2.0 * compared.noise.value))


def test_a_held_muscle_is_told_of_in_filling_and_venting(paper_muscle):
    """Directions, speeds and shapes of its error speak of the pressure, not of shortening."""
    once = np.concatenate([np.linspace(0, 3e5, 80), np.linspace(3e5, 0, 80)])
    pressure, time = np.tile(once, 5), 0.05 * np.arange(800)
    strain = np.repeat(np.linspace(0.0, 0.16, 5), 160)
    way = np.tile(np.repeat([1.0, -1.0], 80), 5)
    force = (paper_muscle.force(strain, pressure[:, None]) - 4.0 * way
             + 0.3 * np.random.default_rng(1).standard_normal(800))
    data = build('held', strain, pressure, force, np.repeat(np.arange(5), 160), time)
    compared = compare(paper_muscle, data)
    assert [row['label'] for row in compared.tables['direction']] == ['filling', 'venting']
    assert compared.tables['direction'][0]['bias_N'] == pytest.approx(-4.0, abs=0.3)
    assert all(row['label'].endswith('kPa/s') for row in compared.tables['rate'])
    assert 'with the sign of the pressure change' in compared.located[0].where
    cells = reduce(paper_muscle, data)
    search = Search(Options(paper_muscle, cells, Choices()))
    fitter, fit = search.fitter, search.fit(search.options.own)
    shape = describe(cells, fitter.without_discrepancy(fit))[0]
    assert shape.words == 'lower while filling than while venting, constant'
    assert shape.coefficient == pytest.approx(4.0, abs=0.3)
    assert shape.size_N == pytest.approx(4.0, abs=0.3)
    assert shape.expression is None  # a formula knows no way of the pressure


def test_only_the_isobar_that_is_off_is_beyond_the_noise(sweeps, paper_muscle):
    """A quarter of its error more than noise, over 160 rows: more than three of its deviations."""
    data = sweeps(extra=lambda strain, pressure, way, time: 0.9 * (pressure > 4e5) * way)
    rows = compare(paper_muscle, data).tables['pressure']
    assert [row['beyond_noise'] for row in rows] == [False] * 5 + [True]
    assert rows[-1]['error_N'] == pytest.approx(np.hypot(0.9, 0.6), abs=0.1)


def test_a_bias_of_many_rows_is_beyond_the_noise_however_small(sweeps, paper_muscle):
    """A fifth of the noise, both ways: the rms hardly grows, but the mean is off by ten sd."""
    data = sweeps(extra=lambda strain, pressure, way, time: 0.12 * way)
    ways = {row['label']: row for row in compare(paper_muscle, data).tables['direction']}
    found = {label: row['beyond_noise'] for label, row in ways.items() if row['samples'] > 100}
    assert set(found.values()) == {True}
    right = compare(paper_muscle, sweeps()).tables['direction']
    assert not any(row['beyond_noise'] for row in right)


def test_one_trial_that_went_wrong_is_named_alone(sweeps):
    """Its rows and no others; an error that all trials share is no trial's."""
    data = sweeps()
    noise = 0.5 * np.random.default_rng(5).normal(size=len(data))
    wrong = data.trial == 3
    region = locate(data, noise + 5.0 * wrong, 0.6)[0]
    assert region.where == f'trial {data.trial_names[3]} alone'
    assert np.array_equal(region.rows, wrong)
    assert region.bias_N == pytest.approx(5.0, abs=0.3)
    assert not any('alone' in each.where for each in locate(data, noise + 5.0, 0.6))


def test_a_hum_is_described_by_waves_of_its_period():
    """Sine and cosine of the period that is told explain it."""
    time = 0.02 * np.arange(3000)
    hum = 2.0 * np.sin(2.0 * np.pi * time / 1.25 + 0.4)
    trial = np.zeros(3000, int)
    cells = SimpleNamespace(data=SimpleNamespace(trial=trial), label=trial)
    told = []
    _add_hum(lambda *given: told.append(given), cells, hum, time)
    (waves, words, *_), = told
    assert 'every 1.25 s' in words
    left = hum - waves @ np.linalg.lstsq(waves, hum, rcond=None)[0]
    assert np.std(left) < 0.1 * np.std(hum)


def test_results_cannot_be_changed(not_frozen):
    """Only what searches changes."""
    assert not_frozen(discovery) == {'Fitter', 'Search', '_Look'}
