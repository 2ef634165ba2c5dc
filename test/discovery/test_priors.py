# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What is known of parameters before the data: coordinates, limits, and where both come from."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.priors import effect_priors, own_priors, Prior
from fam_bundle_ros.model import Bundle, catalogue, MotorUnit

KINDS = [Prior('a.b', 0.5, 12.0, 2.0, 0.7, 'log'), Prior('a.b', -4.0, 9.0, 2.0, 0.7, 'normal'),
         Prior('a.b', 0.0, 9.0, 0.0, 0.7, 'half'), Prior('a.b', 0.0, 9.0, 2.0, 1.0, 'size')]


@pytest.mark.parametrize('prior', KINDS, ids=lambda prior: prior.kind)
def test_limits_are_the_coordinates_of_the_bounds(prior):
    """Beyond them the bound is taken; within, the slope is that of the value."""
    low, high = prior.limits
    assert prior.theta(low) == pytest.approx(prior.lower)
    assert prior.theta(high) == pytest.approx(prior.upper)
    assert prior.theta(low - 1.0) == prior.lower
    assert prior.theta(high + 1.0) == prior.upper
    for u in np.linspace(low, high, 9)[1:-1]:
        step = 1e-6
        assert prior.slope(u) == pytest.approx(
            (prior.theta(u + step) - prior.theta(u - step)) / (2.0 * step), rel=1e-5)


def test_one_width_is_what_the_kind_says():
    """A factor of exp(width), or so much more; a size that is zero begins where it has a slope."""
    log, normal, half, size = KINDS
    assert size.theta(-1.0) == size.theta(0.0) - 1.0 == 1.0
    assert size.theta(1.0) == pytest.approx(2.0 * np.exp(0.5))
    assert log.theta(1.0) / log.theta(0.0) == pytest.approx(np.exp(0.7))
    assert log.theta(0.0) == normal.theta(0.0) == 2.0
    assert normal.theta(1.0) - normal.theta(0.0) == pytest.approx(0.7)
    assert half.theta(1.0) - half.theta(0.0) == pytest.approx(0.7)
    assert (log.start, normal.start, half.start) == (0.0, 0.0, 0.3)
    assert half.limits[0] == 0.0
    assert replace(half, upper=0.14).start == pytest.approx(0.2)


def test_bounds_far_beyond_a_log_prior_are_six_widths_away():
    """A lower bound of zero has no logarithm."""
    wide = Prior('a.b', 0.0, 1e9, 1.0, 0.5, 'log')
    assert wide.limits == (-6.0, 6.0)
    assert Prior('a.b', 0.0, 2.0, 1.0, 0.5, 'log').limits == pytest.approx(
        (-6.0, np.log(2.0) / 0.5))


def test_dimensions_of_all_units_stay_possible(paper_muscle):
    """No wall thicker than the radius, no angle outside 8 to 54 degrees, with the ratios kept."""
    first = paper_muscle.motor_units[0].geometry
    thick = replace(first, wall_thickness=0.5 * first.radius,
                    braid_angle=first.braid_angle + np.radians(6.0))
    flat = replace(first, braid_angle=first.braid_angle - np.radians(5.0))
    bundle = Bundle('three', [MotorUnit(f'mu{k}', 1, each) for k, each in
                              enumerate((first, thick, flat))], paper_muscle.effects)
    radius, angle, *_ = own_priors(bundle)
    assert (radius.key, angle.key) == ('geometry.radius', 'geometry.braid_angle')
    assert radius.lower == pytest.approx(1.02 * 0.5 * first.radius)
    assert radius.upper == pytest.approx(4.0 * first.radius)
    for value, inside in ((angle.lower, 8.0), (angle.upper, 54.0)):
        angles = np.degrees(value + np.radians([0.0, 6.0, -5.0]))
        assert (angles.min() if inside == 8.0 else angles.max()) == pytest.approx(inside)
    assert (radius.value, angle.value) == (first.radius, first.braid_angle)
    assert all(prior.own for prior in own_priors(bundle))


def test_a_parameter_of_an_effect_has_the_prior_of_its_kind():
    """Positive ones are log-normal, sizes of zero half-normal, signed ones normal.

    Of a model's own law all sizes but the first may be zero.
    """
    for name in catalogue.available():
        law = catalogue.get(name)
        if law.load is not None:
            continue
        effect = law()
        for own, width in ((True, settings.OWN_WIDTH), (False, settings.ADDED_WIDTH)):
            found = {prior.key.partition('.')[2]: prior
                     for prior in effect_priors(effect, 2, own=own)}
            fitted = [p for p in effect.active(2) if p.fitted and p.lower < p.upper]
            assert list(found) == [p.name for p in fitted], name
            for parameter in fitted:
                prior, value = found[parameter.name], effect.values[parameter.name]
                low, high = effect.limits(parameter.name)
                assert (prior.value, prior.lower, prior.upper, prior.own) == (
                    value, low, high, own)
                kind = ('log' if value > 0.0 and low >= 0.0 else
                        'half' if value == 0.0 and low >= 0.0 else 'normal')
                zeros = [name for name, off in law.off.items() if off == 0.0]
                if own and kind == 'log' and low == 0.0 and parameter.name in zeros[1:]:
                    kind = 'size'
                assert prior.kind == kind, parameter.name
                assert prior.width == pytest.approx({
                    'log': width, 'size': width * value}.get(kind, 0.125 * (high - low)))


def test_the_width_of_a_signed_parameter_is_limited_by_what_it_does():
    """By the rms change of the force per unit; the step that is tried stays within the bounds."""
    effect, key = catalogue.get('bladder_polynomial')(), 'bladder_polynomial.k2'
    low, high = effect.limits('k2')
    asked = {}

    def change(key, step):
        asked[key] = step
        return 2.0 * abs(step)

    def prior_of(value, change, size=0.01):
        found = effect_priors(effect.replace(k2=value), 1, change=change, size=size)
        return next(prior for prior in found if prior.key == key)
    assert prior_of(0.0, change).width == pytest.approx(0.005)
    assert asked[key] == pytest.approx(0.02 * (high - low))
    prior_of(high, change)
    assert asked[key] == pytest.approx(-0.02 * (high - low))
    free = 0.125 * (high - low)
    assert prior_of(0.0, change, size=1e12).width == pytest.approx(free)
    assert prior_of(0.0, lambda key, step: 0.0).width == pytest.approx(free)


@pytest.mark.parametrize(('name', 'other'), [('coulomb_friction', 'force'),
                                             ('viscous_damping', 'coefficient')])
def test_beside_a_part_that_grows_with_the_pressure_the_constant_one_may_be_absent(name, other):
    """Where a law is added; what a model has is there, and so is all that has no such part."""
    effect = catalogue.get(name)()
    beside = {prior.key: prior.beside for prior in effect_priors(effect, 1) if prior.beside}
    assert beside == {f'{name}.{other}': f'{name}.per_pressure'}
    assert not any(prior.beside for prior in effect_priors(effect, 1, own=True))
    rubber = effect_priors(catalogue.get('bladder_elasticity')(), 1)
    assert not any(prior.beside for prior in rubber)


def test_geometry_is_held_by_its_tolerances(paper_muscle):
    """One width is 4 % of the radius and 1.5 deg of the braid angle."""
    radius, angle = own_priors(paper_muscle)[:2]
    assert radius.theta(1.0) / radius.theta(0.0) == pytest.approx(1.04)
    assert np.degrees(angle.theta(1.0) - angle.theta(0.0)) == pytest.approx(1.5)
