# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The covariance of noise and discrepancy, compared with its definition."""

import numpy as np
import pytest
from scipy.special import gamma, kv
from scipy.stats import multivariate_normal

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.covariance import Covariance, Hyper, matern_5_2
from fam_bundle_ros.discovery.linear import Linear, log_evidence
from fam_bundle_ros.discovery.priors import Prior
from fam_bundle_ros.discovery.settings import (
    AMPLITUDES,
    PRESSURE_LENGTHS,
    STRAIN_LENGTHS,
    TIME_LENGTHS,
)
from fam_bundle_ros.model import Bundle, MotorUnit

FULL = Hyper(even=9, strain=1, pressure=1, odd=8, white=6, slow=7, tau=1)


@pytest.mark.parametrize('h', [FULL, Hyper(white=8), FULL._replace(odd=0), Hyper(slow=9)])
def test_whitening_makes_the_covariance_the_identity(problem, h):
    """L^-1 K L^-T = I, and the determinant is that of K."""
    cells, covariance, _ = problem
    k = covariance.matrix(h)
    half = covariance.whiten(h, covariance.whiten(h, k).T)
    np.testing.assert_allclose(half, np.eye(len(cells)), atol=1e-6)
    assert covariance.log_determinant(h) == pytest.approx(0.5 * np.linalg.slogdet(k)[1])


def test_the_odd_part_has_opposite_signs_in_opposite_directions(problem):
    """Cells of one place and two directions: the even part agrees, the odd part opposes."""
    cells, covariance, _ = problem
    even = covariance.structured(Hyper(even=9))
    odd = covariance.structured(Hyper(odd=9))
    np.testing.assert_allclose(odd, even * np.outer(cells.direction, cells.direction))


def test_slow_misfit_ends_with_its_trial(problem):
    """Cells of two trials share no drift."""
    cells, covariance, _ = problem
    slow = covariance.structured(Hyper(slow=9))
    assert np.all(slow[cells.trial[:, None] != cells.trial] == 0.0)
    assert np.diag(slow) == pytest.approx((AMPLITUDES[9] * cells.force_sd) ** 2)


def test_the_part_of_the_speed_is_odd_and_fades_with_the_ratio_of_speeds(sweeps, paper_muscle):
    """Strangers at speeds far apart, as the odd part at one speed; no such part without two."""
    slow, fast = sweeps(speed=0.003), sweeps(speed=0.1)
    both = build('both', np.append(slow.strain, fast.strain),
                 np.concatenate([slow.pressure, fast.pressure]), np.append(slow.force, fast.force),
                 np.append(slow.trial, fast.trial + 100),
                 np.append(slow.time, fast.time + slow.time[-1] + 9.0))
    assert 'speed' not in Covariance(reduce(paper_muscle, slow), 0.01).axes
    covariance = Covariance(reduce(paper_muscle, both, most=200), 0.01)
    assert 'speed' in covariance.axes
    odd, part = (covariance.structured(Hyper(**{axis: 9})) for axis in ('odd', 'speed'))
    quick = covariance.cells.speed > np.log(0.02)
    apart = np.ix_(quick, ~quick)
    assert np.abs(part[apart]).max() < 0.1 * np.abs(odd[apart]).max()
    np.testing.assert_allclose(np.diag(part), np.diag(odd))
    assert np.all(part * odd >= 0.0)
    assert np.all(np.abs(part) <= np.abs(odd) * (1.0 + 1e-9))


def test_matern_falls_from_one_and_stays_positive_definite():
    """The Bessel function of its definition; a matrix of it has no negative eigenvalue."""
    x = np.linspace(0, 3, 40)
    k = matern_5_2((x[:, None] - x) ** 2)
    d = np.sqrt(5.0) * x[1:]
    assert k[0, 0] == 1.0
    assert k[0, 1:] == pytest.approx(2.0 ** -1.5 / gamma(2.5) * d ** 2.5 * kv(2.5, d))
    assert np.all(np.diff(k[0]) < 0)
    assert np.linalg.eigvalsh(k).min() > -1e-10


def test_the_discrepancy_adds_over_motor_units(paper_muscle):
    """As forces do: what it is between cells is the mean over units of what each gives."""
    unit = paper_muscle.motor_units[0]
    bundle = Bundle('two', [MotorUnit(f'mu{k}', 1, unit.geometry) for k in (1, 2)],
                    paper_muscle.effects)
    rng = np.random.default_rng(0)
    strain, pressure = rng.uniform(0, 0.2, 160), rng.uniform(0, (4e5, 1e5), (160, 2))
    data = build('two', strain, pressure, bundle.force(strain, pressure),
                 motor_units=('mu1', 'mu2'))
    covariance = Covariance(reduce(bundle, data), 0.01)
    h = Hyper(even=9)
    parts = [covariance.across(h, strain, pressure, k) for k in (0, 1)]
    np.testing.assert_allclose(parts[0] + parts[1], covariance.across(h, strain, pressure))
    assert np.allclose(np.diag(parts[0]), 0.5)
    apart = np.subtract.outer(strain, strain) / np.ptp(strain) / STRAIN_LENGTHS[0]
    for part, own in zip(parts, pressure.T, strict=True):  # each unit by its own range
        gap = np.subtract.outer(own, own) / np.ptp(own) / PRESSURE_LENGTHS[0]
        np.testing.assert_allclose(part, 0.5 * matern_5_2(apart ** 2 + gap ** 2))


def test_the_covariance_is_the_sum_of_its_parts_by_their_definitions(problem):
    """Noise of cells, white misfit, even, odd and slow parts; with the prior of the amplitudes."""
    cells, covariance, _ = problem
    even, odd, white, slow = ((AMPLITUDES[k] * np.std(cells.force)) ** 2 for k in (9, 8, 6, 7))
    e = np.subtract.outer(cells.strain, cells.strain) / cells.strain_range
    p = np.subtract.outer(*[cells.pressure[:, 0]] * 2) / cells.pressure_range
    apart = np.abs(np.subtract.outer(cells.time, cells.time))
    for h in (FULL, FULL._replace(pressure=2), FULL._replace(strain=3), FULL._replace(tau=0)):
        smooth = matern_5_2((e / STRAIN_LENGTHS[h.strain]) ** 2
                            + (p / PRESSURE_LENGTHS[h.pressure]) ** 2)
        fading = np.where(np.equal.outer(cells.trial, cells.trial),
                          np.exp(-apart / TIME_LENGTHS[h.tau]), 0.0)
        expected = (np.diag(cells.variance + white) + slow * fading
                    + smooth * (even + odd * np.outer(cells.direction, cells.direction)))
        np.testing.assert_allclose(covariance.matrix(h), expected, rtol=1e-9, atol=1e-12)
    assert covariance.variance(FULL.white) == pytest.approx(white)
    shares = AMPLITUDES[[9, 8, 6, 7]].sum()
    assert covariance.log_prior(FULL) - covariance.log_prior(Hyper()) == pytest.approx(
        -shares / 0.01)
    assert covariance.axes == ('even', 'white', 'strain', 'pressure', 'odd', 'slow', 'tau')


def test_amplitudes_pay_by_what_is_normal(problem):
    """exp(-sum of amplitudes / unexplained): half of what is normal costs twice as much."""
    cells, _, _ = problem
    wide, narrow = Covariance(cells, 0.02), Covariance(cells, 0.01)
    assert narrow.log_prior(FULL) == pytest.approx(2 * wide.log_prior(FULL))
    assert narrow.log_prior(Hyper()) == 0.0
    for axis in ('even', 'odd', 'white', 'slow', 'speed'):
        assert narrow.log_prior(Hyper(**{axis: 7})) == pytest.approx(-AMPLITUDES[7] / 0.01)


def test_the_parts_of_a_residual_add_up_to_what_is_no_noise(problem):
    """Means of even, odd and slow part together: the residual without the mean of its noise."""
    cells, covariance, _ = problem
    residual = np.random.default_rng(5).standard_normal(len(cells))
    parts = [FULL._replace(**dict.fromkeys({'even', 'odd', 'slow'} - {axis}, 0))
             for axis in ('even', 'odd', 'slow')]
    noise = cells.variance + covariance.variance(FULL.white)
    smooth = residual - noise * np.linalg.solve(covariance.matrix(FULL), residual)
    found = [covariance.mean_of(part, FULL, residual) for part in parts]
    np.testing.assert_allclose(sum(found), smooth, atol=1e-8)
    assert all(np.abs(part).max() > 1e-3 for part in found)


@pytest.mark.parametrize('hyper', [FULL, Hyper(white=6)])
def test_cells_of_no_bounded_noise_tell_no_more_than_cells_that_are_not_there(problem, hyper):
    """The evidence is that of the other cells alone, beside the prior of the amplitudes."""
    cells, covariance, _ = problem
    gone = np.arange(len(cells)) % 3 == 0
    silent = covariance.without(gone)
    rng = np.random.default_rng(2)
    off, slopes = rng.standard_normal(len(cells)), rng.standard_normal((len(cells), 2))
    u = np.array([0.3, -0.5])
    priors = [Prior(f'a.{k}', -1e3, 1e3, 0.0, 1.0, 'normal') for k in 'xy']
    told = log_evidence(silent, hyper, Linear.of(priors, u, off, slopes))
    covered = covariance.matrix(hyper)[np.ix_(~gone, ~gone)] + slopes[~gone] @ slopes[~gone].T
    true = multivariate_normal(cov=covered).logpdf((off + slopes @ u)[~gone])
    assert told - covariance.log_prior(hyper) == pytest.approx(true, abs=1e-6)
    assert len(covariance._factors) == 0  # what all cells tell is another covariance
