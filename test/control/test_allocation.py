# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The inverse: exact within reach, on the rising branch, honest beyond it."""

import math

from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from fam_bundle_ros.control import allocate, Allocator, Curves, Instant
from fam_bundle_ros.control.belief import Belief
from fam_bundle_ros.control.curves import curve_table, find_branches, tabulate, unit_force
from fam_bundle_ros.control.inverse import hold_bottoms, place_bottoms, Shares
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, Geometry, MotorUnit

STRAIN = st.floats(0.0, 0.25)
SHARE = st.floats(0.0, 1.0)


def curves_of(bundle, strain):
    """Return the curves of a bundle at a strain, at rest."""
    return Allocator(bundle).curves(Instant(strain))


@given(units=st.sampled_from([2, 3, 6]), strain=STRAIN, share=SHARE, later=st.integers(0, 5))
# The bottom of the branch lies between two pressures of the table.
@example(units=2, strain=0.09297099165856011, share=0.0, later=0)
@settings(deadline=None, max_examples=60)
def test_allocation_inverts_the_model(bundles, units, strain, share, later):
    """Any force between floor and top of any state comes out of the model within 0.1 N."""
    bundle = bundles[units]
    state = 1 + later % units
    curves = curves_of(bundle, strain)
    # A unit that only pushes back at this strain is no part of the reach of a state.
    active = list(curves.order[:state])
    assume(np.all(curves.top_force[active] >= curves.rest_force[active]))
    low, high = curves.floor[state], curves.top[state]
    demand = low + share * (high - low)
    found = allocate(bundle, demand, strain, state)
    assert bundle.force(strain, found.pressure) == pytest.approx(demand, abs=0.1)
    assert abs(found.missing) < 1e-6


def unit_of(k, muscles, radius, angle, wall, limit):
    """Return a motor unit of 127 mm: radius in m, braid angle in degrees, wall in radii, Pa."""
    geometry = Geometry(radius, 0.127, math.radians(angle), wall * radius)
    return MotorUnit(f'mu{k}', muscles, geometry, limit)


UNIT = st.tuples(st.integers(1, 3), st.floats(3e-3, 12e-3), st.floats(18.0, 36.0),
                 st.floats(0.08, 0.28), st.floats(150e3, 600e3))


@given(units=st.lists(UNIT, min_size=1, max_size=6), strain=st.floats(-0.02, 0.3),
       beyond=st.floats(-0.1, 1.1), later=st.integers(0, 5),
       scheme=st.sampled_from(['orderly', 'batch', 'all_on']))
# One unit reaches its limit inside a cell of the table.
@example(units=[(3, 6e-3, 25.0, 1 / 6, 600e3), (3, 12e-3, 20.0, 1 / 12, 455e3)], strain=0.0,
         beyond=0.9575, later=1, scheme='all_on')
# A large unit is at the sharp bottom of its branch, inside a cell.
@example(units=[(3, 0.00980665, 24.28125, 0.09765625, 507500.75),
                *2 * [(1, 0.0078125, 18.0, 0.25, 150e3)]],
         strain=0.055728450890803194, beyond=0.0, later=0, scheme='orderly')
@settings(deadline=None, max_examples=300)
def test_what_is_not_missing_is_there(paper_bundle, units, strain, beyond, later, scheme):
    """
    For any bundle, scheme and demand the model's force plus what is missing is the demand.

    To 0.1 N or a ten thousandth of all that the bundle can pull: its table has cells.
    """
    bundle = Bundle('any', [unit_of(k + 1, *unit) for k, unit in enumerate(units)],
                    paper_bundle.effects)
    state = 1 + later % bundle.n
    curves = curves_of(bundle, strain)
    demand = curves.floor[state] + beyond * (curves.top[state] - curves.floor[state])
    found = allocate(bundle, demand, strain, state, scheme=scheme)
    within = max(0.1, 1e-4 * curves.top[-1])
    assert bundle.force(strain, found.pressure) + found.missing == pytest.approx(
        demand, abs=within)


@given(units=st.sampled_from([2, 3, 6]), strain=STRAIN, demand=st.floats(-60.0, 500.0),
       data=st.data())
@settings(deadline=None, max_examples=60)
def test_no_pressure_lies_on_a_falling_branch(bundles, units, strain, demand, data):
    """Every unit is either empty or at or beyond the pressure where its force is smallest."""
    bundle = bundles[units]
    state = data.draw(st.integers(0, units))
    curves = curves_of(bundle, strain)
    found = allocate(bundle, demand, strain, state)
    for unit, pressure in enumerate(found.pressure):
        assert pressure == 0.0 or pressure >= curves.bottom_pressure[unit] - 1.0
        assert pressure <= bundle.max_pressure[unit] + 1e-6


@given(strain=STRAIN, share=SHARE, state=st.integers(1, 3))
# The second unit cannot pull at this strain: it stays empty.
@example(strain=0.23828125, share=0.0, state=2)
@settings(deadline=None, max_examples=40)
def test_batch_gives_the_demand_with_one_pressure(bundles, strain, share, state):
    """The active units of use share one pressure, and the model gives the demand at it."""
    bundle = bundles[3]
    curves = curves_of(bundle, strain)
    active = [unit for unit in curves.order[:state] if curves.useful[unit]]
    assume(active)
    extreme = [allocate(bundle, f, strain, state, scheme='batch') for f in (-1e3, 1e3)]
    low, high = (float(bundle.force(strain, a.pressure)) for a in extreme)
    demand = low + share * max(high - low, 0.0)
    found = allocate(bundle, demand, strain, state, scheme='batch')
    assert np.ptp(found.pressure[list(active)]) < 1e-6
    assert bundle.force(strain, found.pressure) == pytest.approx(demand, abs=0.1)


@pytest.mark.parametrize('scheme', ['orderly', 'batch'])
@pytest.mark.parametrize('demand', [-4.0, 5.0, 60.0])
def test_the_inverse_is_exact_between_the_points_of_the_table(paper_bundle, scheme, demand):
    """Far better than the table's spacing of 3.6 kPa: a hundredth of a newton, kink or not."""
    found = allocate(paper_bundle, demand, 0.16, 2, scheme=scheme)
    assert abs(found.missing) < 1e-9
    assert paper_bundle.force(0.16, found.pressure) == pytest.approx(demand, abs=0.01)


def made_up(force, pressure, rows=None):
    """Return what kernels take, with this force and room for pressures."""
    def curve(unit, strain, rate, pressures, time, dt, start, shape, parameters, tables, memory,
              after, found):
        for k, value in enumerate(pressures):
            felt = [value] * len(pressure)
            found[k] = force(unit, strain, rate, felt)
    return Belief(force, 0, 0, 0, 0, 0, 0, 0, (), 0, pressure, curve, rows)


def test_a_kink_between_two_points_of_the_table_is_found():
    """Within a sixtieth of a cell: a muscle that leaves its free strain has one."""
    table = curve_table([0], [[1e3 * k for k in range(31)]], True)

    def force(unit, strain, rate, pressure, *_):
        return max(0.02 * (pressure[0] - 10.3e3), 0.0)
    model = made_up(force, [0.0])
    tabulate.kernel(table, model)
    find_branches(table, [0])
    found = Curves(table, model).fill(2.0, (0,))
    assert found.pressure[0] == pytest.approx(10.4e3, abs=1e3 / 60)


def test_a_slack_unit_waits_where_it_begins_to_pull_not_at_the_point_of_the_table_before():
    """Else the least demand above its bottom would move it across the flat in between."""
    table = curve_table([0], [[6e3 * k for k in range(31)]], True)

    def force(unit, strain, rate, pressure, *_):
        return max(2e-3 * (pressure[0] - 63e3), 0.0)
    model = made_up(force, [0.0])
    tabulate.kernel(table, model)
    find_branches(table, [0])
    place_bottoms(table, model)
    assert table.bottom_pressure == pytest.approx([63e3], abs=6e3 / 60)
    curves = Curves(table, model)
    waiting, pulling = curves.fill(0.0, (0,)).pressure[0], curves.fill(0.1, (0,)).pressure[0]
    assert (waiting, pulling) == pytest.approx((63e3, 63.05e3), abs=6e3 / 60)


@pytest.mark.parametrize(('pressure', 'missing', 'left', 'held'), [
    (57e3, 0.0, 0.0, False), (60e3, 0.0, 0.0, True), (60e3, 0.0, 0.4, True),
    (60e3, 0.0, 0.6, False)])
def test_a_unit_that_has_risen_waits_behind_the_end_of_its_falling_branch(
        paper_bundle, pressure, missing, left, held):
    """
    The lowest point lies between two points of the table; the unit before has some force left.

    Within a doubt of 0.5 N the noise of the demand could move it across that cell to and fro.
    """
    curves = curves_of(paper_bundle, 0.11)
    table, model = curves.table, curves.model
    shares = Shares([344.7e3, pressure], [table.top_force[0] - left, 0.0], missing)
    before = table.bottom_pressure[1]
    hold_bottoms(table, model, shares, [344.7e3, pressure], 2, 0.5)
    after = table.bottom_pressure[1]
    assert (after > before + 1e3) == held
    assert unit_force(table, model, 1, after) == pytest.approx(table.bottom_force[1], abs=1e-3)
    between = 0.3 * before + 0.7 * after
    assert (unit_force(table, model, 1, between) < table.bottom_force[1] - 0.01) == held


@pytest.mark.parametrize(('tilt', 'bottom'), [(0.0, 50), (1e-6, 55), (-1e-6, 50), (5e-5, 0)])
def test_an_almost_flat_curve_is_no_rising_branch(tilt, bottom):
    """It ends where the force rises, or soon after, unless the slope before is a real one."""
    table = curve_table([0], [[2e3 * k for k in range(101)]], True)

    def force(unit, strain, rate, pressure, *_):
        return -4.0 + tilt * pressure[0] + 2e-4 * max(pressure[0] - 100e3, 0.0)
    tabulate.kernel(table, made_up(force, [0.0]))
    find_branches(table, [0])
    assert table.bottom == [bottom]
    assert table.crossing[0] <= table.top[0]


def test_the_table_is_the_same_unit_by_unit_and_on_arrays():
    """Equal forces, both shifted by friction; a flat bottom ends where the force rises."""
    grid = [[1e3 * k for k in range(101)], [2e3 * k for k in range(101)]]

    def force(unit, strain, rate, pressure, *_):
        return max(-4.0 + 1e-15 * pressure[unit], 1e-4 * (pressure[unit] - 90e3 * (unit + 1)))

    def rows(moment, memory, rubs):
        return np.array([[force(unit, 0.1, 0.0, (p, p)) for unit, p in enumerate(each)]
                         for each in zip(*grid)])
    tables = []
    for way in (tabulate.kernel, tabulate.plain):
        table = curve_table([0, 1], grid, True)
        table.friction[:] = [-1.0, 2.0]
        model = made_up(force, [0.0, 0.0], rows)
        way(table, model)
        tables.append((table.force, table.bottom))
        assert table.force[1][30] == unit_force(table, model, 1, grid[1][30])
    assert tables[0] == tables[1]
    assert tables[0][1] == [50, 70]
    assert tables[0][0][1][0] == -2.0


def test_a_model_without_push_back_has_no_force_below_zero():
    """Neither in the table nor between its points."""
    table = curve_table([0], [[0.0, 1e5]], False)
    model = made_up(lambda *_: -3.0, [0.0], lambda *_: np.full((2, 1), -3.0))
    tabulate(table, model)
    assert table.force == [[0.0, 0.0]]
    assert unit_force(table, model, 0, 5e4) == 0.0


def test_without_a_memory_to_go_by_the_inverse_is_that_at_equilibrium(paper_bundle):
    """Rubber that softens is asked for its worn force, not for that of its first sample."""
    bundle = paper_bundle.with_effect('softening')
    found = allocate(bundle, 40.0, 0.1, 1)
    assert bundle.force(0.1, found.pressure) == pytest.approx(40.0, abs=0.01)


def test_neglect_knows_no_law_that_pushes_back(paper_bundle):
    """The laws say themselves which of them do; all others stay."""
    left = Allocator(paper_bundle, neglect=True).inverted.effects
    assert [effect.name for effect in left] == ['mesh', 'bladder_elasticity']


def test_the_table_is_read_as_numpy_interpolates(paper_bundle):
    """Between points, at them and beyond the ends; the slope is that of the cell."""
    curves = curves_of(paper_bundle, 0.16)
    grid, force = curves.grid[:, 1], curves.force[:, 1]
    for pressure in (-1.0, 0.0, 5e3, grid[7], 200e3, grid[-1], 1e6):
        assert curves.at(1, pressure) == pytest.approx(np.interp(pressure, grid, force))
    assert curves.slope(1, 0.5 * (grid[7] + grid[8])) == pytest.approx(
        (force[8] - force[7]) / (grid[8] - grid[7]))


def test_what_is_missing_is_said(paper_bundle):
    """Beyond top or floor the nearest pressures come with the force that they lack."""
    curves = curves_of(paper_bundle, 0.16)
    high = curves.fill(curves.top[2] + 7.0, (0, 1))
    low = curves.fill(curves.floor[2] - 3.0, (0, 1))
    assert high.missing == pytest.approx(7.0, abs=1e-6)
    assert high.pressure == pytest.approx(paper_bundle.max_pressure)
    assert low.missing == pytest.approx(-3.0, abs=1e-6)


@pytest.mark.parametrize('scheme', ['orderly', 'batch', 'all_on'])
def test_a_unit_that_can_only_push_stays_empty(paper_bundle, scheme):
    """Past the free strain no demand fills a unit: vented it pulls most, and that is said."""
    rest = float(paper_bundle.force(0.3, np.zeros(2)))
    for demand in (-50.0, 10.0, 200.0):
        found = allocate(paper_bundle, demand, 0.3, 2, scheme=scheme)
        assert not found.pressure.any()
        assert found.missing == pytest.approx(demand - rest)


def test_noise_does_not_fill_and_empty_a_unit_at_the_strain_where_it_stops_pulling(paper_bundle):
    """Noise of 5e-5 around the strain where a unit becomes useless changes its mind once."""
    allocator = Allocator(paper_bundle)
    strains = np.linspace(0.18, 0.3, 1201)
    flip = next(e for e in strains if not allocator.curves(Instant(float(e))).useful[0])
    random, asleep, seen = np.random.default_rng(3), None, []
    for strain in random.normal(flip, 5e-5, 400):
        curves = allocator.curves(Instant(float(strain)), asleep)
        asleep = ~curves.useful
        seen.append(curves.fill(100.0, (0,)).pressure[0])
    assert np.count_nonzero(np.diff(seen)) <= 1
    back = allocator.curves(Instant(float(flip) - 0.01), asleep)
    assert back.fill(100.0, (0,)).pressure[0] == paper_bundle.max_pressure[0]


def test_top_of_a_state_agrees_with_the_models_overlap(paper_bundle):
    """Top, crossing and dip are the model's own overlap region."""
    for strain in (0.08, 0.12, 0.16, 0.2):
        curves, overlap = curves_of(paper_bundle, strain), paper_bundle.overlap(strain, 1)
        assert curves.top[1] == pytest.approx(overlap.high, abs=0.01)
        # the branch begins where it visibly rises, a tenth of a newton above its lowest point
        assert curves.crossing[1] == pytest.approx(overlap.low, abs=0.25)
        assert curves.dip[1] == pytest.approx(overlap.dip, abs=0.25)


def test_filling_the_next_unit_while_the_present_one_compensates_keeps_the_force(paper_bundle):
    """At every pressure of MU2 up to the bottom of its branch the bundle's force is the demand."""
    curves = curves_of(paper_bundle, 0.16)
    demand = curves.crossing[1] - 0.1
    for pressure in np.linspace(0.0, curves.bottom_pressure[1], 40):
        found = curves.fill(demand, (0,), {1: float(pressure)})
        assert found.pressure[1] == pressure
        assert paper_bundle.force(0.16, found.pressure) == pytest.approx(demand, abs=0.1)


def test_effects_with_memory_are_inverted_with_the_memory_they_have(paper_bundle):
    """With friction that sticks, the pressures for the next tick give the demand in that tick."""
    bundle = paper_bundle.with_effect('presliding_hysteresis', force=4.0)
    memory = bundle.start_state()
    for strain in np.linspace(0.10, 0.13, 50):
        _, memory = bundle.step(memory, 2e-3, strain, np.array([250e3, 0.0]), 0.3)
    instant = Instant(0.1306, 0.3, memory, 2e-3)
    found = Allocator(bundle).curves(instant).fill(40.0, (0,))
    force, _ = bundle.step(memory, 2e-3, 0.1306, found.pressure, 0.3)
    assert force.sum() == pytest.approx(40.0, abs=0.1)
    assert abs(bundle.force(0.1306, found.pressure) - 40.0) > 1.0


def test_units_come_in_the_order_of_the_model_file_or_what_the_user_says(bundles):
    """The states of controller, map and model are the same: the file's order, unless given."""
    turned = Bundle('turned', bundles[3].motor_units[::-1], bundles[3].effects)
    assert 'mu3 is larger than mu2' in turned.unusual_order
    assert not bundles[6].unusual_order
    top = Allocator(turned).curves(Instant(0.1)).top
    assert top[1] == pytest.approx(turned.overlap(0.1, 1).high, abs=0.01)
    assert Allocator(bundles[3], order=(2, 0, 1)).order == (2, 0, 1)
    with pytest.raises(InputError, match='each of 0 to 2 once'):
        Allocator(bundles[3], order=(0, 0, 1))
