# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The sets of effects that may be tried, and their order."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build, Taken
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.options import Change, head, Options, shapes_of, usual
from fam_bundle_ros.discovery.predict import motion
from fam_bundle_ros.discovery.search import _ranked, Screened, Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.model import catalogue


@pytest.mark.parametrize('rounding', [-1e-13, 1e-13])
def test_rounding_does_not_choose_between_sets_that_are_alike(rounding):
    """Compiled and plain laws differ in the last digit; what is better goes first all the same."""
    sets = [Screened((name,), {}, value, 0.0)
            for name, value in (('c', 3.0), ('b', 3.0 + rounding), ('d', 2.0), ('e', 4.0))]
    assert [each.names for each in _ranked(sets, lambda each: each.posterior)] == [
        ('e',), ('b',), ('c',), ('d',)]


def test_one_change_more_and_one_less_are_inverse(problem, paper_muscle):
    """Every set with one change more leads back to where it came from."""
    cells, _, _ = problem
    options = Options.of(paper_muscle, cells, Choices())
    further = options.further(options.own)
    assert all(options.own in options.back(names) for names in further)
    assert {len(options.changes(names)) for names in further} == {1}
    assert all(len({head(n) for n in names}) == len(names) for names in further)


def test_the_models_own_effects_may_be_replaced_and_removed(problem, paper_muscle):
    """Another bladder and no bladder are among the sets; the mesh, without numbers, stays."""
    cells, _, _ = problem
    options = Options.of(paper_muscle, cells, Choices())
    further = options.further(options.own)
    assert ('bladder_polynomial', 'mesh') in further
    assert ('mesh',) in further
    assert all('mesh' in names for names in further)
    assert options.changes(('bladder_polynomial', 'mesh')) == [
        Change('bladder_elasticity', 'bladder_polynomial')]
    assert options.changes(('mesh',)) == [Change('bladder_elasticity', '')]


def test_other_shapes_of_the_models_own_effects_are_tried_in_the_best_set(problem, paper_muscle):
    """Each other bladder, beside whatever else the best set has."""
    cells, _, fitter = problem
    search = Search(Options.of(paper_muscle, cells, Choices(most=1))).run()
    assert search.best.names == ('bladder_elasticity', 'coulomb_friction', 'mesh')
    others = search.options.reshaped_own(search.best.names)
    assert {'bladder_polynomial', 'coulomb_friction', 'mesh'} in map(set, others)
    assert all(set(names) >= {'coulomb_friction', 'mesh'} for names in others)
    assert all(names in search.fits for names in others)


def test_shapes_of_one_effect_share_its_prior(problem, paper_muscle):
    """All shapes of a head together have the odds that are chosen."""
    cells, _, _ = problem
    options = Options.of(paper_muscle.without_effect('bladder_elasticity'), cells,
                         Choices(inclusion=0.2))
    shapes = [n for n in options.effects if head(n) == 'bladder_elasticity']
    assert len(shapes) >= 2
    odds = sum(np.exp(options.log_prior(('mesh', name))) for name in shapes)
    assert odds == pytest.approx(0.25)
    assert options.log_prior(options.own) == 0.0


@pytest.mark.parametrize(('size', 'force'), [(1.0, 4.0), (2.0, 16.0)])
def test_what_is_usual_of_a_force_goes_with_the_cross_section(paper_muscle, size, force):
    """The friction of the catalogue is that of the paper's muscle; a share is that of any."""
    radius = paper_muscle.motor_units[0].geometry.radius
    muscle = paper_muscle.with_parameters({'geometry.radius': size * radius})
    assert usual(catalogue.get('coulomb_friction'), muscle).force == pytest.approx(force)
    share = catalogue.get('tondu_factor')
    assert usual(share, muscle).values == share().values


def test_an_end_effect_that_goes_with_length_needs_two_lengths(problem, paper_muscle):
    """Muscles of one length cannot tell it from end caps: there it is not offered."""
    cells, _, _ = problem
    law = 'end_effect_of_length'
    assert law not in Options.of(paper_muscle, cells, Choices()).effects
    assert law not in {shape.name for shape in shapes_of('end_caps', paper_muscle)}
    several = Options.of(paper_muscle, cells, Choices(), lengths=2)
    assert tuple(sorted((law, 'bladder_elasticity', 'mesh'))) in several.further(several.own)


def test_a_wrong_rest_length_is_offered_where_lengths_were_read(problem, paper_muscle):
    """A strain that the file gives itself does not depend on the rest length of the model."""
    cells, _, _ = problem
    for quantity, offered in (('length', True), ('contraction', False), ('strain', False)):
        read = replace(cells, data=replace(cells.data, taken=(Taken('x', quantity),)))
        options = Options.of(paper_muscle, read, Choices())
        assert ('strain_rest_length' in options.effects) is offered


def test_a_decay_that_takes_longer_than_the_log_is_another_static_law(paper_muscle):
    """In 20 s relaxation over 300 s is a share of the force since the start: not to be fitted."""
    time = np.arange(0.0, 20.0, 0.1)
    pressure = np.interp(time, [2.0, 6.0, 12.0, 15.0], [20e3, 300e3, 300e3, 50e3])
    clock, fill = np.concatenate([time, time + 60.0]), np.tile(pressure, 2)[:, None]
    strain = np.repeat([0.05, 0.15], len(time))
    elastic = paper_muscle.force(strain, fill)
    data = build('ramps', strain, fill, elastic, np.repeat([0, 1], len(time)), clock)
    since = elastic - elastic[np.repeat([0, len(time)], len(time))]
    for tau, static in ((300.0, True), (2.0, False)):
        arm = paper_muscle.with_effect('viscoelastic_relaxation', share=0.1, time_constant=tau)
        left = arm.predict(motion(data)) - elastic - 0.1 * since
        assert (np.std(left) < 0.05 * np.std(0.1 * since)) == static
    options = Options.of(paper_muscle, reduce(paper_muscle, data), Choices())
    assert {prior.key: round(prior.upper, 6) for prior in options.priors((
        'viscoelastic_relaxation', 'pressure_creep', 'pressure_line_lag'))
        if prior.key.endswith('time_constant')} == {
        'viscoelastic_relaxation.time_constant': 19.9, 'pressure_creep.time_constant': 19.9,
        'pressure_line_lag.time_constant': 2.0}
