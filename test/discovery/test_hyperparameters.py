# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Search of the hyperparameters of highest evidence."""

import numpy as np

from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.covariance import Covariance, Hyper
from fam_bundle_ros.discovery.fitter import Fitter
from fam_bundle_ros.discovery.hyperparameters import along_ridge, ascend
from fam_bundle_ros.discovery.linear import Linear, log_evidence
from fam_bundle_ros.discovery.priors import own_priors


def peak(**places):
    """Return a value that is highest at these places."""
    return lambda h: -float(sum((getattr(h, axis) - place) ** 2 for axis, place in places.items()))


def test_each_axis_climbs_to_its_peak_and_no_further_than_it_may():
    """Up and down; with a reach of two places, two from where it began."""
    value, axes = peak(even=9, strain=3, white=2), ('even', 'white', 'strain')
    start = Hyper(even=1, white=8)
    assert ascend(start, value, axes) == Hyper(even=9, white=2, strain=3)
    assert ascend(start, value, axes, reach=2) == Hyper(even=3, white=6, strain=2)
    assert ascend(start, value, ('white',)) == Hyper(even=1, white=2)


def test_what_changes_nothing_stays_where_it_is():
    """All places are equal, and lengths of a part that is not there."""
    axes = ('even', 'white', 'strain', 'pressure', 'slow', 'tau')
    assert ascend(Hyper(even=5, slow=5), lambda h: 0.0, axes) == Hyper(even=5, slow=5)
    assert ascend(Hyper(), peak(even=0, slow=0, strain=3, tau=2), axes) == Hyper()
    assert ascend(Hyper(slow=4), peak(slow=6, tau=2), axes) == Hyper(slow=6, tau=2)


def test_an_amplitude_leaves_zero_over_places_that_hardly_matter():
    """The first three places of a grid in quarter decades gain nothing, the fourth does."""
    assert ascend(Hyper(), lambda h: max(h.even - 3, 0) - 2.0 * max(h.even - 6, 0),
                  ('even',)) == Hyper(even=6)


def test_a_length_is_found_though_its_amplitude_has_to_follow(problem):
    """Data tell amplitude over length^(5/2) of a Matern 5/2; alone neither can be moved."""
    cells, _, fitter = problem
    wave = 10.0 * np.sin(6.0 * cells.strain / np.ptp(cells.strain) + cells.pressure[:, 0] / 1.4e5)
    given = Linear.of((), np.zeros(0), wave, np.zeros((len(cells), 0)))
    h, value = fitter.best_hyper(fitter.first_hyper(), given)

    def evidence(hyper):
        return log_evidence(fitter.covariance, hyper, given)
    better = along_ridge(h, evidence)
    assert evidence(h) == value
    assert evidence(better) > value + 3.0
    shorter = better.strain - h.strain + better.pressure - h.pressure
    assert shorter * (better.even - h.even) < 0  # a place further on is a shorter length
    assert along_ridge(h, evidence, reach=0) == h


def test_a_fit_ends_where_no_other_length_is_better(sweeps, paper_muscle):
    """A wave over strain and pressure that no parameter of the muscle takes."""
    data = sweeps(noise=0.2, extra=lambda e, p, way, t: 10 * np.sin(25 * e + p / 1.4e5))
    cells = reduce(paper_muscle, data, most=120)
    fitter = Fitter(Covariance(cells, 0.01))
    fit = fitter.fit(('mesh', 'bladder_elasticity'), paper_muscle, own_priors(paper_muscle))

    def evidence(hyper):
        return log_evidence(fitter.covariance, hyper, fit.linear)
    better = along_ridge(fit.hyper, evidence)
    assert evidence(better) < fit.evidence + fit.promise + 0.3
