# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A change during a log: rows of two muscles, or of one rig before and after something was moved.

Each side of the change is then explained by the same model with other parameters, and no effect is
needed. The evidence of the two parts is compared with that of the most probable set of effects
(Bayesian comparison of a single change point, Smith 1975, Biometrika 62, 407).
"""

from __future__ import annotations

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.discovery.artefacts import Artefact
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.covariance import Hyper
from fam_bundle_ros.discovery.fitter import COOLING, Fitter
from fam_bundle_ros.discovery.linear import log_evidence
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.told import number


def change_point(search: Search) -> Artefact | None:
    """
    Return the change that is more probable than every set of effects, or None.

    It is as probable beforehand as a missing effect, and equally so at each cell of the log. Its
    place is that of the highest evidence of the model as given, linearised at its fit to all
    cells; there it is fitted to each part by itself. It must be more probable with a discrepancy
    in each part and without one: a discrepancy in two parts can follow what one part could not,
    such as damping at two speeds one after the other.
    """
    cells, null, covariance = search.fitter.cells, search.null, search.fitter.covariance
    least = len(null.priors) + 1  # fewer cells determine no model
    if cells.time is None or len(cells) < 2 * least:
        return None
    order = np.argsort(cells.mean(np.arange(len(cells.label), dtype=float)))
    place = np.argsort(order)
    places = range(least, len(cells) - least + 1)

    def linear(gone: np.ndarray) -> float:
        part = covariance.without(gone)
        return max(log_evidence(part, Hyper(white=white), null.linear) for white in COOLING)

    first = max(places, key=lambda k: linear(place >= k) + linear(place < k))
    share, log_odds = search.options.choices.inclusion, np.zeros(2)
    left, used = [], cells.label >= 0
    for gone in (place >= first, place < first):
        part = Fitter(covariance.without(gone))
        fit = part.fit(null.names, null.model, null.priors)
        alone = part.without_discrepancy(fit)
        log_odds += fit.evidence, alone.evidence
        left.append(cells.residual_of_rows(alone.model)[used & ~gone[cells.label]])
    log_odds += null.log_prior + np.log(share / (1.0 - share) / len(places))
    log_odds -= search.best.posterior, max(fit.white_posterior for fit in search.fits.values())
    if log_odds.min() <= 0.0:
        return None
    where = _where(cells, *order[first - 1:first + 1])
    error, digits = number(rms(np.concatenate(left)), 2), int(log_odds.min() / np.log(10.0))
    return Artefact(
        f'one model for the rows before {where}, and another from there on, leave {error} N and '
        f'are more probable than any effects (odds above 1e{digits} to 1): two muscles in one '
        'file, something on the rig that was changed, or a muscle that changed as no effect '
        'describes',
        'diagnose the rows before and after this by themselves')


def _where(cells: Cells, last: int, first: int) -> str:
    """Return the words for the place of a change between two cells."""
    assert cells.time is not None
    name = cells.data.trial_names[int(cells.trial[first])]
    if cells.trial[first] != cells.trial[last]:
        return f'trial {name} ({cells.time[first]:.4g} s)'
    return f'{cells.time[first]:.4g} s' + (f' of trial {name}' if np.ptp(cells.trial) else '')
