# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What physics leaves: rivals, folds, the discrepancy as a table that a model file names."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery import rivals, templates
from fam_bundle_ros.discovery.add import recommend
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.covariance import Hyper
from fam_bundle_ros.discovery.held_out import beyond_cells, held_out, splits, squares_of_folds
from fam_bundle_ros.discovery.leftover import Leftover
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.result import Recommended
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, catalogue, load_model, Motion, save_model

TABLE = """strain,pressure [kPa],force [N],sd [N],odd [N]
0.0,0,1,0.1,0.5
0.0,400,3,0.1,0.5
0.2,0,2,0.1,1.5
0.2,400,6,0.1,1.5
"""


@pytest.fixture
def surface(tmp_path):
    """Return the law with a table of four points."""
    (tmp_path / 'left.csv').write_text(TABLE)
    return catalogue.get('discrepancy_surface')(table='left.csv', folder=tmp_path)


def fitted(model, data):
    """Return a fitter and the model's own effects fitted with and without a discrepancy."""
    cells = reduce(model, data)
    search = Search(Options(model, cells, Choices()))
    fitter, joint = search.fitter, search.fit(search.options.own)
    return fitter, joint, fitter.without_discrepancy(joint)


# --- the law -----------------------------------------------------------------------------------

def test_the_surface_is_added_to_the_force_between_its_points(surface, paper_muscle):
    """The middle of four points is their mean; at rest there is no odd part."""
    added = paper_muscle.with_effect(surface).force(0.1, [200e3]) - paper_muscle.force(
        0.1, [200e3])
    assert added == pytest.approx(3.0)


@pytest.mark.filterwarnings('ignore:.*nearest edge')
def test_outside_its_data_the_surface_has_no_slope(surface, paper_muscle):
    """What holds at the edge holds beyond it."""
    with_it = paper_muscle.with_effect(surface)
    for strain, pressure, edge in ((0.25, 200e3, 4.0), (-0.02, 200e3, 2.0), (0.1, 600e3, 4.5)):
        added = with_it.force(strain, [pressure]) - paper_muscle.force(strain, [pressure])
        assert added == pytest.approx(edge)


def test_the_odd_part_follows_the_direction_of_motion(surface, paper_muscle):
    """Shortening adds it, lengthening takes it away."""
    with_it = paper_muscle.with_effect(surface)
    up, down = (with_it.force(0.1, [200e3], rate) for rate in (0.05, -0.05))
    assert (up - down) / 2 == pytest.approx(1.0)
    assert (up + down) / 2 == pytest.approx(with_it.force(0.1, [200e3]))


@pytest.mark.parametrize(('name', 'values'), [
    ('threshold_pressure', {'pressure': 40e3}), ('end_caps', {'dead_length': 12e-3}),
    ('tendon_slack', {}), ('pressure_creep', {'share': 0.2})])
def test_the_surface_is_added_over_what_gauges_show(surface, paper_muscle, name, values):
    """Whatever the muscle makes of strain and pressure, and where it would be slack."""
    bare = paper_muscle.with_effect(name, **values)
    added = bare.with_effect(surface)
    for strain in (0.1, 0.19):
        extra = added.force(strain, [100e3], 0.05) - bare.force(strain, [100e3], 0.05)
        assert extra == pytest.approx(1.5 + 7.5 * strain + 0.5 + 5.0 * strain)


def test_the_way_of_the_pressure_counts_at_rest(tmp_path, paper_muscle):
    """After filling it is added, after venting taken away, over one step; not in motion."""
    rows = [f'{e},{p},0,0,{2.0 + p / 100.0}' for e in (0.0, 0.2) for p in range(0, 420, 20)]
    (tmp_path / 'left.csv').write_text(
        '\n'.join(['strain,pressure [kPa],force [N],odd [N],filling [N]', *rows]))
    surface = catalogue.get('discrepancy_surface')(table='left.csv', folder=tmp_path)
    with_it, time = paper_muscle.with_effect(surface), 0.1 * np.arange(81.0)
    pressure = 1e3 * (300.0 - 5.0 * np.abs(np.arange(81.0) - 40.0))[:, None]

    def added(rate):
        motion = Motion(np.full(81, 0.1), pressure, np.full(81, rate), time)
        return with_it.predict(motion) - paper_muscle.predict(motion)
    most = 2.0 + pressure[:, 0] / 1e5
    assert added(0.0)[0] == 0.0
    np.testing.assert_allclose(added(0.0)[30:41], most[30:41], rtol=1e-3)
    np.testing.assert_allclose(added(0.0)[71:], -most[71:], rtol=2e-3)
    # 20 kPa, less the dead band to both sides, after the reversal
    assert added(0.0)[45] == pytest.approx(most[45] * (2.0 * np.exp(-21.0 / 20.0) - 1.0), rel=1e-2)
    np.testing.assert_allclose(added(0.05), 0.0, atol=1e-9)


def test_the_table_is_the_same_in_one_call_and_tick_by_tick(tmp_path, paper_muscle):
    """The memory of the way is carried from tick to tick as along a record."""
    rng = np.random.default_rng(4)
    rows = [f'{e},{p},{rng.normal()},{rng.normal()},{rng.normal()}'
            for e in (0.0, 0.1, 0.2) for p in range(0, 420, 60)]
    (tmp_path / 'left.csv').write_text(
        '\n'.join(['strain,pressure [kPa],force [N],odd [N],filling [N]', *rows]))
    bundle = paper_muscle.with_effect(catalogue.get('discrepancy_surface')(
        table='left.csv', folder=tmp_path))
    strain, pressure = rng.uniform(0.0, 0.2, 60), rng.uniform(0.0, 4e5, (60, 1))
    rate, time = rng.normal(0.0, 2e-3, 60), 0.01 * np.arange(60.0)
    whole, state = bundle.predict(Motion(strain, pressure, rate, time)), bundle.start_state()
    for k in range(60):
        force, state = bundle.step(state, 0.01 if k else 0.0, strain[k], pressure[k], rate[k])
        assert float(np.sum(force)) == pytest.approx(whole[k], abs=1e-9)


def test_a_table_with_a_hole_is_refused(tmp_path):
    """Every pair of strain and pressure once, said with the numbers found."""
    (tmp_path / 'left.csv').write_text(TABLE[:TABLE.rindex('0.2,400')])
    with pytest.raises(InputError, match='3 rows; expected every pair of 2 strains and 2'):
        catalogue.get('discrepancy_surface')(table='left.csv', folder=tmp_path)


# --- written by a diagnosis --------------------------------------------------------------------

def test_a_written_discrepancy_makes_the_model_meet_the_data(sweeps, paper_muscle, tmp_path):
    """A smooth error of 8 N that no law explains: physics with the table predicts it."""
    data = sweeps(extra=lambda e, p, way, t: 8.0 * np.sin(20 * e) * p / 4e5 + 2.0 * way)
    fitter, joint, physics = fitted(paper_muscle, data)
    left = Leftover.of(fitter, physics, joint.hyper)
    found = Recommended(physics.model, (), 'discrepancy', left, 0.7, 2.5, 0.7, {})
    found.save(tmp_path / 'model.yaml')
    again = load_model(tmp_path / 'model.yaml')
    assert again.error == 0.7  # with the table, on data left out, not that of the physics
    motion = Motion(data.strain, data.pressure, data.strain_rate, data.time, data.start)
    error = np.sqrt(np.mean((data.force - again.predict(motion)) ** 2))
    alone = np.sqrt(np.mean((data.force - physics.model.predict(motion)) ** 2))
    assert error < 0.9
    assert alone > 2.0
    assert left.odd.mean() == pytest.approx(2.0, abs=0.4)


@pytest.mark.filterwarnings('error')  # no true value is outside the table, but readings are
def test_a_table_is_of_true_values_where_each_gauge_has_its_own_error(tmp_path):
    """What was left at readings is added to the reading there, however many muscles a unit has."""
    bundle = load_model('spie2021')
    bundle = Bundle('three', [replace(unit, muscles=k) for unit, k in zip(
        bundle.motor_units, (1, 3))], bundle.effects)
    for name, values in (('unit_pressure_bias', {'mu2': 20e3}), ('unit_pressure_gain', {
            'mu1': 0.1}), ('strain_rest_length', {'excess': 0.05}), (
            'force_sensor_gain', {'gain': 0.04})):
        bundle = bundle.with_effect(name, **values)
    strain, shown = np.array([0.0, 0.2]), np.array([0.0, 200e3, 400e3])
    even = np.multiply.outer([1.0, 2.0], np.outer(1.0 + 3.0 * strain, shown / 1e5))
    none = np.zeros_like(even)
    Leftover(strain, [shown, shown], even, none, none, none, bundle).write(tmp_path / 'left.csv')
    with_it = bundle.with_effect(catalogue.get('discrepancy_surface')(
        table='left.csv', folder=tmp_path))
    motion = Motion(np.array([0.02, 0.15]), np.array([[120e3, 5e3], [300e3, 395e3]]), np.zeros(2))
    added = with_it.predict(motion) - bundle.predict(motion)
    assert added == pytest.approx((1.0 + 3.0 * motion.strain) * (
        motion.pressure @ [1.0, 2.0]) / 1e5, rel=1e-4)


def test_a_table_is_finer_than_the_visits_of_a_fast_log(paper_muscle):
    """Filled and vented within seconds at fixed lengths: a bump 40 kPa wide is in the table."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 96.0, 0.1)
    pressure = 2e5 * (1.0 - np.cos(2.0 * np.pi * time / 8.0))
    strain = 0.04 * np.floor(time / 24.0)

    def bump(p):
        return 6.0 * np.exp(-((p - 2e5) / 4e4) ** 2)
    motion = Motion(strain, pressure[:, None], 0.0 * strain, time, np.diff(strain, prepend=-1) > 0)
    force = paper_muscle.predict(motion) + bump(pressure) + rng.normal(0.0, 0.3, len(time))
    data = build('bump', strain, pressure, force, np.floor(time / 24.0), time)
    fitter, joint, physics = fitted(paper_muscle, data)
    left = Leftover.of(fitter, physics, joint.hyper)
    still = physics.model.predict(motion) - paper_muscle.predict(motion)
    table = np.array([
        np.interp(p, left.pressure[0], left.even[0, np.abs(left.strain - e).argmin()])
        for e, p in zip(strain, pressure)])
    assert np.sqrt(np.mean((table + still - bump(pressure)) ** 2)) < 0.2


@pytest.mark.parametrize('step', [0.04, 0.0])
def test_what_differs_between_filling_and_venting_is_in_the_table(paper_muscle, tmp_path, step):
    """A loop of a shape no law has, at four fixed lengths or one: left is hardly above noise."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 160.0, 0.1)
    pressure = 2e5 * (1.0 - np.cos(2.0 * np.pi * time / 20.0))
    strain = step * np.floor(time / 40.0)
    way = np.where(np.sin(2.0 * np.pi * time / 20.0) > 0.0, 1.0, -1.0)
    trial = np.floor(time / 40.0)
    motion = Motion(strain, pressure[:, None], 0.0 * strain, time, np.diff(trial, prepend=-1) > 0)
    loop = 6.0 * np.sin(np.pi * pressure / 4e5) * (1.0 + 10.0 * strain)
    force = paper_muscle.predict(motion) - way * loop + rng.normal(0.0, 0.3, len(time))
    data = build('loop', strain, pressure, force, trial, time)
    fitter, joint, physics = fitted(paper_muscle, data)
    left = Leftover.of(fitter, physics, joint.hyper)
    assert not left.odd.any()
    left.write(tmp_path / 'left.csv')
    with_it = physics.model.with_effect(catalogue.get('discrepancy_surface')(
        table='left.csv', folder=tmp_path))
    error = [np.sqrt(np.mean((force - model.predict(motion)) ** 2))
             for model in (physics.model, with_it)]
    assert error[0] > 3.0
    assert error[1] < 0.6


def test_the_discrepancy_is_unsure_where_nothing_was_measured(sweeps, paper_muscle):
    """Its standard deviation between two isobars far apart is above that on one."""
    pressure = sweeps().pressure[:, 0]
    measured = (pressure < 100e3) | (pressure > 300e3)
    fitter, joint, physics = fitted(paper_muscle, sweeps(
        extra=lambda e, p, way, t: 8.0 * np.sin(20 * e) * p / 4e5).select(measured))
    left = Leftover.of(fitter, physics, joint.hyper)
    middle = left.sd[0][len(left.strain) // 2]
    gap = np.abs(left.pressure[0] - 200e3) < 60e3
    assert middle[gap].mean() > 1.5 * middle[left.pressure[0] < 60e3].mean()


def test_every_shape_that_has_a_formula_is_an_effect(sweeps, paper_muscle, tmp_path):
    """Units fit, a model file holds it, and its force is the coefficient times the shape."""
    data = sweeps()
    fitter, _, _ = fitted(paper_muscle, data)
    cells = fitter.cells
    shapes = [s for s in templates.bank(cells, paper_muscle) if s.expression is not None]
    assert any('rounding' in s.expression for s in shapes)
    before = paper_muscle.predict(cells.motion)
    moving = np.abs(cells.motion.strain_rate) > 0.02
    for shape in shapes:
        found = templates.Template(shape.words, 2.0, shape.unit, 0.5, 9.0, (),
                                   shape.expression, shape.kind, constants=shape.constants)
        save_model(paper_muscle.with_effect(found.effect('shape')), tmp_path / 'model.yaml')
        added = load_model(tmp_path / 'model.yaml').predict(cells.motion) - before
        expected = 2.0 * shape.columns.sum(axis=1)
        scale = np.abs(expected[moving]).max()
        np.testing.assert_allclose(added[moving], expected[moving], atol=1e-3 * scale)


# --- held-out errors ---------------------------------------------------------------------------

def test_the_right_model_predicts_unseen_folds_down_to_the_noise(sweeps, paper_muscle):
    """Trials, isobars and strain levels left out: 0.6 N of noise, and rivals do worse."""
    fitter, joint, physics = fitted(paper_muscle, sweeps())
    held = held_out(fitter, physics, joint)
    assert set(held.kinds) == {'trial', 'isobar', 'strain'}
    assert held.of_rows(beyond_cells(fitter.cells, physics, 0.6)).physics == pytest.approx(
        0.6, rel=0.1)
    assert held.physics < held.rivals['empirical'] < held.rivals['plane'] < held.rivals['mean']
    np.testing.assert_allclose(held.squares, squares_of_folds(fitter, physics))


@pytest.mark.parametrize(('noise', 'written'), [(0.3, True), (20.0, False)])
def test_a_table_is_recommended_where_rows_show_what_it_holds(sweeps, paper_muscle, noise,
                                                              written):
    """A wave of 3 N: a table of it predicts better in any noise, and is seen in little."""
    data = sweeps(noise=0.3, cycles=1, extra=lambda e, p, way, t: 3.0 * np.sin(40.0 * e))
    fitter, joint, physics = fitted(paper_muscle, data)
    held = held_out(fitter, physics, joint)
    assert held.discrepancy < held.physics
    heard = SimpleNamespace(cells=replace(fitter.cells, noise=noise),
                            covariance=fitter.covariance)
    found = recommend(paper_muscle, physics, joint, held, heard)
    assert (found.leftover is not None) == written
    assert found.held_out_N == (held.discrepancy if written else held.physics)
    worse = replace(held, discrepancy=1.01 * held.physics)
    assert recommend(paper_muscle, physics, joint, worse, heard).leftover is None


def test_folds_are_whole_and_inner(sweeps, paper_muscle):
    """Each cell is in one fold of each kind; the outermost strains are never left out."""
    cells = reduce(paper_muscle, sweeps())
    for kind, label in splits(cells):
        assert len(label) == len(cells)
        if kind == 'strain':
            assert label[np.argmin(cells.strain)] == label[np.argmax(cells.strain)] == -1
        if kind == 'trial':
            assert all(len(np.unique(label[cells.trial == k])) == 1
                       for k in np.unique(cells.trial))


# --- rivals ------------------------------------------------------------------------------------

def test_rivals_recover_what_they_can_be():
    """A plane and a six-parameter form are found again from their own values."""
    rng = np.random.default_rng(0)
    e, p = rng.uniform(0, 0.25, 200), rng.uniform(0, 5e5, (200, 1))
    weight = np.ones(200)
    flat = 3.0 - 20.0 * e + 1e-4 * p[:, 0]
    np.testing.assert_allclose(rivals.plane(e, p, flat, weight)(e, p), flat, atol=1e-9)
    bent = (2e-4 * p[:, 0] + 5) * np.exp(-18 * e) - 6e-4 * e * p[:, 0] + 1e-4 * p[:, 0] - 2
    np.testing.assert_allclose(rivals.empirical(e, p, bent, weight)(e, p), bent, atol=0.05)
    assert rivals.mean(e, p, flat, weight)(e[:3], p[:3]) == pytest.approx(flat.mean())


def test_the_empirical_form_ends_at_the_lowest_force():
    """A slack tendon reads zero: the form does not go below it."""
    e = np.tile(np.linspace(0, 0.3, 30), 5)
    p = np.repeat(np.linspace(1e5, 5e5, 5), 30)[:, None]
    force = np.maximum(1e-3 * p[:, 0] * (1 - 5 * e), 0.0)
    assert rivals.empirical(e, p, force, np.ones(150))(e, p).min() >= 0.0


def test_no_discrepancy_is_a_flat_table(sweeps, paper_muscle):
    """Where nothing is left the table is zero."""
    fitter, joint, physics = fitted(paper_muscle, sweeps())
    left = Leftover.of(fitter, physics, physics.hyper)
    assert physics.hyper == Hyper(white=physics.hyper.white)
    assert not left.even.any()
    assert not left.odd.any()
