# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Sets of effects on several specimens, from log evidences that are told for each."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from fam_bundle_ros.discovery import Choices
from fam_bundle_ros.discovery.covariance import Hyper
from fam_bundle_ros.discovery.fitter import Fit
from fam_bundle_ros.discovery.joint import JointPosterior
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.model import catalogue

FRICTION, BIAS, ENDS = 'coulomb_friction', 'force_sensor_bias', 'end_caps'


@dataclass
class Told(Search):
    """A search whose log evidence is the sum of what each effect gains."""

    gains: dict[str, float] = field(default_factory=dict)

    def fit(self, names, start=None, hyper=None):
        """Return a fit without parameters."""
        if names not in self.fits:
            none = np.zeros(0)
            self.fits[names] = Fit(
                names, self.options.model, (), none, Hyper(), none, np.zeros((0, 0)),
                sum(self.gains.get(name, 0.0) for name in names),
                log_prior=self.options.log_prior(names))
        return self.fits[names]


def searched(model, gains):
    """Return the search of a recording that can show the effects of these gains."""
    addable = tuple(catalogue.get(name)() for name in gains)
    search = Told(Options(model, None, Choices(), addable), gains=gains)
    for names in search.options.further(search.options.own):
        for more in search.options.further(names):
            search.fit(more)
        search.fit(names)
    return search


@pytest.fixture
def joint(paper_muscle):
    """Return a function from the gains of each recording, of what it can show, to the answer."""
    def make(*recordings, model=paper_muscle):
        searches = [searched(model, gains) for gains in recordings]
        found = JointPosterior(searches, range(len(searches)))
        names, answer = found.named()
        return [c.new for c in answer], [
            set(fit.names) ^ set(search.options.own)
            for fit, search in zip(found.reduced(names), searches)]
    return make


def test_a_recording_that_cannot_show_an_effect_counts_without_it(joint):
    """Friction beside a static map: it was dropped for all."""
    logged = {FRICTION: 50.0, ENDS: 20.0}
    answer, own = joint(logged, {ENDS: 20.0}, logged)
    assert set(answer) == {FRICTION, ENDS}
    assert own == [{FRICTION, ENDS}, {ENDS}, {FRICTION, ENDS}]


def test_the_error_of_one_rig_is_not_missing_in_all(joint):
    """Each recording has the sensor errors that it needs; one of weak evidence is not named."""
    answer, own = joint(*({BIAS: gain, ENDS: 20.0} for gain in (-2.0, 60.0, 4.0)))
    assert answer == [ENDS]
    assert own == [{ENDS}, {ENDS, BIAS}, {ENDS}]


def test_sensor_errors_of_one_rig_that_can_replace_each_other_are_tied(paper_muscle):
    """Within the odds; an effect of the muscle or a weaker error is no tie."""
    gains = {BIAS: 60.0, 'strain_sensor_offset': 58.0, 'pressure_sensor_bias': 50.0,
             FRICTION: 59.0}
    searches = [searched(paper_muscle, {ENDS: 20.0}), searched(paper_muscle, gains)]
    found = JointPosterior(searches, [0, 1])
    fit = searches[1].fit(tuple(sorted({*searches[1].options.own, BIAS})))
    assert found.error_ties(1, fit, 20.0) == ((BIAS, 'strain_sensor_offset'),)
    assert found.error_ties(1, fit, 2.0) == ()
    assert found.error_ties(0, searches[0].null, 20.0) == ()


def test_an_effect_of_one_muscle_is_not_missing_in_all(joint):
    """Those with clear evidence against it go without it; of those that are unsure it is said."""
    assert joint(*({FRICTION: gain} for gain in (-8.0, 90.0, -1.0))) == (
        [FRICTION], [set(), {FRICTION}, {FRICTION}])


@pytest.mark.parametrize('constant', [-3000.0, 3000.0])
def test_only_ratios_of_evidences_make_probabilities(paper_muscle, constant):
    """More rows multiply the evidence of every set, and no set becomes likelier by it."""
    def probability(shared):
        search = searched(paper_muscle, {'mesh': shared, FRICTION: 6.0, ENDS: 5.0})
        return JointPosterior([search], [0]).probability()
    plain = probability(0.0)
    assert 0.01 < plain[ENDS] < plain[FRICTION] < 0.99
    assert probability(constant) == pytest.approx(plain)


def test_a_recording_that_cannot_show_another_shape_keeps_that_of_the_model(joint, paper_muscle):
    """A static map beside logs that replace one friction by another."""
    logged = {FRICTION: 5.0, 'stribeck_friction': 50.0}
    answer, own = joint(logged, {ENDS: 0.0}, logged,
                        model=paper_muscle.with_effect(FRICTION, force=2.0))
    assert answer == ['stribeck_friction']
    assert own == [{FRICTION, 'stribeck_friction'}, set(), {FRICTION, 'stribeck_friction'}]
