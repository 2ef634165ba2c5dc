# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What muscles say together: shares, contrasts, powers, and no more alarms than chance."""

import numpy as np
import pytest

from fam_bundle_ros.campaign.trends import contrasts, holm, per_muscle, power_law, shares, trends


def parameter(muscle, value, error=0.1, **other):
    """Return the row of a parameter with a relative error."""
    return {'muscle': muscle, 'parameter': 'coulomb_friction.force', 'unit': 'N',
            'data_value': value, 'data_low': value * np.exp(-1.96 * error),
            'data_high': value * np.exp(1.96 * error),
            'sure': True, **other}


def effect(muscle, name='coulomb_friction', named=True, tied=False):
    """Return the row of an effect."""
    return {'muscle': muscle, 'effect': name, 'named': named, 'tied': tied}


@pytest.mark.parametrize('claimed', [0.3, 1.0, 3.0])
def test_a_power_is_within_its_interval_whatever_the_fits_claim(claimed):
    """19 of 20 intervals hold the true power, also where errors are wrong and muscles differ."""
    rng = np.random.default_rng(1)
    x = np.log(np.linspace(80.0, 300.0, 8))
    held = alarms = 0
    for _ in range(400):
        y = 1.0 + 0.7 * x + rng.normal(0.0, np.hypot(0.1, 0.05), len(x))
        power, error, _, _, _ = power_law(x, y, np.full(len(x), 0.1 * claimed))
        held += abs(power - 0.7) < 2.447 * error  # Student, 6 degrees of freedom
        alarms += power_law(x, y - 0.7 * x, np.full(len(x), 0.1 * claimed))[-1] < 0.05
    assert 0.92 < held / 400 < 0.98
    assert 0.02 < alarms / 400 < 0.09


def test_muscles_that_differ_by_more_than_their_fits_have_a_scatter():
    """Of ten percent of the value, seen through fits that are good to one percent."""
    rng = np.random.default_rng(2)
    x = np.log(np.linspace(50.0, 500.0, 200))
    power, _, scatter, start, _ = power_law(x, np.log(3.0) + 1.5 * x + rng.normal(0.0, 0.1, 200),
                                            np.full(200, 0.01))
    assert power == pytest.approx(1.5, abs=0.04)
    assert scatter == pytest.approx(0.1, rel=0.15)
    assert np.exp(start) == pytest.approx(3.0, rel=0.25)


def test_the_scatter_is_that_of_dersimonian_and_laird():
    """Written out with the projection onto what a line leaves, for fits of unlike errors."""
    x, s = np.log([50.0, 90.0, 200.0, 400.0, 800.0]), np.array([0.05, 0.3, 0.1, 0.02, 0.2])
    y = x + np.array([0.4, -0.3, 0.5, -0.2, 0.1])
    design, weight = np.stack([np.ones(5), x], -1), np.diag(s ** -2.0)
    left = weight - weight @ design @ np.linalg.inv(
        design.T @ weight @ design) @ design.T @ weight
    between = (y @ left @ y - 3.0) / np.trace(left)
    assert power_law(x, y, s)[2] == pytest.approx(np.sqrt(between))


def test_a_bad_fit_weighs_little():
    """One muscle that the data hardly tell does not turn the line of the others."""
    x = np.log([50.0, 100.0, 200.0, 400.0, 800.0])
    y = x.copy()
    y[-1] += 2.0
    error = np.full(5, 0.01)
    error[-1] = 3.0
    assert power_law(x, y, error)[0] == pytest.approx(1.0, abs=0.02)


def test_the_clearest_trend_comes_first_and_dimensions_over_dimensions_are_none():
    """Friction with length; the fitted radius over the diameter in the table says nothing."""
    lengths = [80.0, 120.0, 170.0, 210.0, 300.0, 330.0]
    facts = {f'm{k}': {'length [mm]': each, 'age': float((7 * k) % 5 + 1)}
             for k, each in enumerate(lengths)}
    rng = np.random.default_rng(0)
    rows = [parameter(f'm{k}', 0.02 * each * np.exp(rng.normal(0.0, 0.03)))
            for k, each in enumerate(lengths)]
    rows += [{**row, 'parameter': 'geometry.radius'} for row in rows]
    found = trends(rows, facts)
    assert [(each.parameter, each.fact) for each in found][0] == (
        'coulomb_friction.force', 'length [mm]')
    assert found[0].power_low < 1.0 < found[0].power_high
    assert found[0].p < 0.01 < min(each.p for each in found if each.fact == 'age')
    assert ('geometry.radius', 'length [mm]') not in [(t.parameter, t.fact) for t in found]
    assert ('geometry.radius', 'age') in [(t.parameter, t.fact) for t in found]


def test_three_muscles_make_no_trend():
    """Nor does a number that is the same in all, or a parameter that is not of the data."""
    rows = [parameter(f'm{k}', 1.0 + k) for k in range(3)]
    assert trends(rows, {f'm{k}': {'age': 1.0 + k} for k in range(3)}) == []
    rows += [parameter('m3', 5.0, sure=False), parameter('m4', 6.0, sure=False)]
    assert trends(rows, {f'm{k}': {'age': 1.0 + k} for k in range(5)}) == []
    rows += [parameter('m5', 4.0)]
    assert trends(rows, {f'm{k}': {'age': 2.0} for k in range(6)}) == []


def test_recordings_of_one_muscle_are_one_point():
    """Averaged by their errors; where they disagree, the error is their disagreement."""
    (mean, error), = per_muscle([parameter('a', 2.0, 0.1), parameter('a', 2.0, 0.1)]).values()
    assert np.exp(mean) == pytest.approx(2.0)
    assert error == pytest.approx(0.1 / np.sqrt(2.0), rel=1e-3)
    (_, error), = per_muscle([parameter('a', 1.0, 0.01), parameter('a', 2.0, 0.01)]).values()
    assert error == pytest.approx(np.log(2.0) / 2.0, rel=1e-3)
    assert per_muscle([parameter('a', 1.0), parameter('b', -1.0)]) == {}


def test_a_muscle_lacks_what_half_of_its_recordings_say():
    """One of three is not enough; ties are counted beside."""
    rows = [effect('a'), effect('b'), effect('b'), effect('c', tied=True, named=False)]
    found, = shares(rows, {'a': 3, 'b': 3, 'c': 1, 'd': 1})
    assert (found.effect, found.muscles, found.of, found.tied) == ('coulomb_friction', 1, 4, 1)
    # Wilson's interval of 1 in 4, by hand
    assert (found.low, found.high) == pytest.approx((0.0456, 0.6994), abs=1e-3)


def test_old_muscles_that_lack_an_effect_are_told_from_young_ones():
    """Eight of each; the same question about a number at random is not answered with yes."""
    muscles = {f'm{k}': 1 for k in range(16)}
    facts = {f'm{k}': {'age': 10.0 + k, 'shelf': float((5 * k) % 16)} for k in range(16)}
    found = contrasts([effect(f'm{k}') for k in range(8, 16)], muscles, facts)
    assert [(each.fact, each.p < 0.01) for each in found] == [('age', True), ('shelf', False)]
    assert (found[0].lacking, found[0].others) == (8, 8)
    assert found[0].median_lacking > found[0].median_others


def test_many_questions_make_each_answer_less_sure():
    """Holm: the smallest by their number, the next by one less, never decreasing."""
    assert holm([0.04, 0.001, 0.04, 0.9]) == pytest.approx([0.12, 0.004, 0.12, 0.9])
