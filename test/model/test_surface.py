# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A measured force table in the place of a formula."""

import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, catalogue, load_model, save_model
from fam_bundle_ros.model.laws.surface import measured_surface

from .conftest import units


@pytest.fixture
def table(tmp_path, paper_bundle):
    """A coarse table of one muscle of the paper, in tension and compression."""
    one = Bundle('one', units(1), paper_bundle.effects)
    lines = ['strain,pressure [psi],force [N]']
    for psi in range(0, 70, 10):
        for e in np.linspace(0.0, 0.30, 16):
            lines.append(f'{e:.3f},{psi},{one.force(round(e, 3), [psi * 6894.757]):.6f}')
    (tmp_path / 'map.csv').write_text('\n'.join(lines))
    return one, Bundle('table', units(1), [measured_surface(table='map.csv', folder=tmp_path)])


def test_measured_points_are_met_exactly(table):
    """Interpolation goes through the data, compressed region included."""
    one, surface = table
    for psi, e in ((0, 0.02), (30, 0.10), (60, 0.30), (10, 0.18)):
        assert_allclose(surface.force(e, [psi * 6894.757]), one.force(e, [psi * 6894.757]),
                        atol=1e-4)


def test_a_model_with_a_table_can_be_saved_anywhere(table, tmp_path):
    """Beside the table by its name, elsewhere by its whole path."""
    _, surface = table
    (tmp_path / 'sub').mkdir()
    for path in (tmp_path / 'm.yaml', tmp_path / 'sub' / 'm.yaml'):
        save_model(surface, path)
        assert load_model(path).force(0.1, [2e5]) == surface.force(0.1, [2e5])
    assert str(tmp_path) not in (tmp_path / 'm.yaml').read_text()


def test_between_points_it_adds_no_overshoot(table):
    """Shape preserving: every value lies within the four corners of its cell."""
    _, surface = table
    e, p = np.meshgrid(np.linspace(0.0, 0.02, 9), np.linspace(0, 68947.57, 9))
    inside = surface.force(e, p[..., None])
    corners = surface.force(np.array([0, 0, .02, .02]), np.array([[0], [68947.57]] * 2))
    assert inside.min() >= corners.min() - 1e-9
    assert inside.max() <= corners.max() + 1e-9


@pytest.mark.parametrize(('strain', 'pressure'), [(-0.002, 2e5), (0.302, 2e5), (0.1, -6e3),
                                                  (0.1, 420e3)])
def test_each_side_of_the_table_is_an_outside(table, strain, pressure):
    """More than half a step (0.0025, 8.6 kPa) beyond the measured range: a warning for each."""
    _, surface = table
    with pytest.warns(UserWarning, match='asked outside'):
        surface.force(strain, [pressure])


@pytest.mark.parametrize(('strain', 'pressure'), [(-4e-4, 2e5), (0.3004, 2e5), (0.1, -1e3),
                                                  (0.1, 414.7e3)])
@pytest.mark.filterwarnings('error')
def test_noise_at_its_edge_is_none(table, strain, pressure):
    """Nearer to the edge than to a next point: the log that a table was made of has such rows."""
    _, surface = table
    inside = np.clip(strain, 0.0, 0.3), [np.clip(pressure, 0.0, 413685.4)]
    assert surface.force(strain, [pressure]) == pytest.approx(surface.force(*inside))


@pytest.mark.filterwarnings('error')
def test_the_search_for_the_free_strain_is_no_question_about_the_outside(table):
    """It looks from -2 % to 45 % strain; what it finds lies in the table."""
    _, surface = table
    assert 0.0 < float(surface.free_strain([2e5])) < 0.3


def test_extrapolation_warns_once_and_holds_the_edge(table):
    """A table does not know what lies outside it."""
    _, surface = table
    with pytest.warns(UserWarning, match='asked outside strain 0 to 0.3'):
        outside = surface.force(0.4, [2e5])
    assert outside == surface.force(0.3, [2e5])


HEADER = 'strain,pressure[kPa],force[N]'


@pytest.mark.parametrize(('rows', 'message'), [
    ('', 'is empty'),
    ('strain,pressure[kPa] 0,1', 'has no column force'),
    ('strain,pressure[N],force[N] 0,1,2', "unit 'N' does not fit"),
    (f'{HEADER} 0,1,much', 'row 2: force is not a number'),
    (f'{HEADER} 0,1', 'row 2: force is not a number'),
    (f'{HEADER} 0,1,inf', 'column force has values that are not finite'),
    (f'{HEADER} 0,1,2 .1,1,2', 'expected at least two pressures'),
    (f'{HEADER} 0,1,2 .1,1,2 0,5,2', '1 strains in 1 rows at 5 kPa; expected two or more'),
    (f'{HEADER} 0,1,2 .1,1,2 .1,1,2 0,5,2 .1,5,2', '2 strains in 3 rows at 1 kPa; .* each once'),
    (None, 'cannot be read as a CSV'),
])
def test_a_bad_table_is_refused(tmp_path, rows, message):
    """The error names the file and the row."""
    if rows is not None:
        (tmp_path / 'map.csv').write_text('\n'.join(rows.split()))
    with pytest.raises(InputError, match=f'map.csv.*{message}'):
        measured_surface(table='map.csv', folder=tmp_path)


@pytest.mark.parametrize(('rows', 'message'), [
    ('0,1,2,0,1 0,5,2,0,1 .1,1,2,0,1 .1,5,2,0,3', 'motor_unit has 1, 3; expected 1, 2, '),
    ('0,1,2,0,1 0,5,2,0,1 .1,1,2,0,1', '3 rows; expected every pair of 2 strains and 2 press'),
    ('0,1,2,0,1 .1,1,2,0,1', '2 rows; expected every pair of 2 strains and 1 pressures')])
def test_a_discrepancy_needs_a_whole_grid_for_each_motor_unit(tmp_path, rows, message):
    """Gaps among units or points, a single pressure: what was found, and what is expected."""
    (tmp_path / 'left.csv').write_text('\n'.join([
        'strain,pressure [kPa],force [N],odd [N],motor_unit', *rows.split()]))
    with pytest.raises(InputError, match=f'left.csv: {message}'):
        catalogue.get('discrepancy_surface')(table='left.csv', folder=tmp_path)


def test_an_effect_that_reads_a_table_needs_one():
    """Without it the message says of which kind."""
    with pytest.raises(InputError, match=r'measured_surface: needs a table \(a CSV file\)'):
        measured_surface()


def test_a_discrepancy_is_bilinear_between_its_points(tmp_path):
    """A plane with a twist comes back exactly, even and odd part, for each motor unit."""
    def even(unit, e, p):
        return unit * (3.0 + 40.0 * e - 0.02 * p + 0.3 * e * p)

    def odd(unit, e, p):
        return unit * (1.0 - 5.0 * e + 0.01 * p + 0.05 * e * p)
    lines = ['strain,pressure [kPa],force [N],odd [N],motor_unit', *(
        f'{e},{p},{even(unit, e, p)},{odd(unit, e, p)},{unit}'
        for unit in (1, 2) for e in (0.0, 0.1, 0.3) for p in (0.0, 150.0, 400.0))]
    (tmp_path / 'left.csv').write_text('\n'.join(lines))
    bundle = Bundle('left', units(2), [catalogue.get('discrepancy_surface')(
        table='left.csv', folder=tmp_path)])
    for e, p in ((0.04, (60.0, 230.0)), (0.25, (390.0, 10.0)), (0.1, (150.0, 340.0))):
        up, down = (bundle.unit_forces(e, 1e3 * np.array(p), rate) for rate in (1.0, -1.0))
        assert_allclose((up + down) / 2, [even(1, e, p[0]), even(2, e, p[1])])
        assert_allclose((up - down) / 2, [odd(1, e, p[0]), odd(2, e, p[1])])


def test_two_tables_in_a_model_are_two(table, tmp_path):
    """What is left over is added to the measured force, whichever is named first."""
    (tmp_path / 'left.csv').write_text('strain,pressure [kPa],force [N],odd [N],motor_unit\n' + (
        '\n'.join(f'{e},{p},{3.0 + 40.0 * e - 0.02 * p},{0.5 * e},1'
                  for e in (0.0, 0.1, 0.3) for p in (0.0, 400.0))))
    _, surface = table
    left = catalogue.get('discrepancy_surface')(table='left.csv', folder=tmp_path)
    strain, pressure = np.linspace(0.0, 0.3, 9), np.full((9, 1), 2e5)
    each = [Bundle('one', units(1), [effect]).force(strain, pressure, 1.0)
            for effect in (*surface.effects, left)]
    for effects in ([*surface.effects, left], [left, *surface.effects]):
        both = Bundle('both', units(1), effects)
        assert_allclose(both.force(strain, pressure, 1.0), sum(each))
        one, _ = both.step(both.start_state(), 0.0, strain[4], pressure[4], 1.0)
        assert_allclose(one, sum(each)[4])
