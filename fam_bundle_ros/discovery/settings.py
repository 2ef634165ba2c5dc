# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Settings of the search for missing effects, each with its reason.

Three kinds: choices of the user (`Choices`), widths of priors and grids, and a few other numbers
(from `LEAST_NOISE` on). None is a threshold on a measured quantity of one muscle: all are log
odds, shares of the force or of the range of the data, or counts. Settings of a solver are in the
module of the solver.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fam_bundle_ros.data.resolution import ACCURACY


@dataclass(frozen=True)
class Choices:
    """
    Choices of the user.

    Attributes
    ----------
    unexplained : float
        Normal size of the structure that no law explains: the mean of the exponential prior on
        the amplitudes of the discrepancy, as a share of the force's standard deviation. With
        smaller values the search adds effects sooner. A discrepancy of ten times this size gives
        the verdict `unexplained`.
    odds : float
        Sets of effects whose odds against the best one are at most this are ties. Of several
        specimens, odds from which the values of a constant are said to be the same, or to differ.
    inclusion : float
        Prior probability that an effect is missing (or that one of the model is wrong).
    most : int
        Largest number of effects that are added, replaced or removed.
    """

    unexplained: float = 0.01
    odds: float = 20.0
    inclusion: float = 0.1
    most: int = 5


# --- widths of priors --------------------------------------------------------------------------

#: Positive constants of the model's own effects (data sheet, earlier fit), log-normal.
OWN_WIDTH = 0.5
#: Positive constants of an added effect, log-normal about the default: a factor of three.
ADDED_WIDTH = 1.2
#: Radius, m, of the muscle of the catalogue's defaults (Kim et al. 2021). Other muscles have
#: similar materials, so default forces are scaled with the cross section.
USUAL_RADIUS = 6.35e-3
#: Signed constants, normal: this share of the range of their bounds ...
SIGNED_WIDTH = 0.125
#: ... but at most the step that changes the force by this share of its standard deviation.
SIGNED_SIZE = 0.3

# --- grids -------------------------------------------------------------------------------------

#: Amplitudes of the discrepancy, shares of the force's standard deviation.
AMPLITUDES = np.concatenate([[0.0], 10.0 ** np.arange(-3.5, 0.01, 0.25)])
#: Length scales of the discrepancy in strain and pressure (shares of their range) and time (s).
STRAIN_LENGTHS = np.array([1.0, 0.5, 0.25, 0.12, 0.06])
PRESSURE_LENGTHS = np.array([1.5, 0.75, 0.35])
TIME_LENGTHS = np.array([0.3, 3.0, 30.0])
#: Length scale of the discrepancy in the natural logarithm of the speed: a factor of e.
SPEED_LENGTH = 1.0
#: Largest number of cells in the search; its time grows with the cube.
CELLS = 200
#: Largest number of places of a table; larger than `CELLS`, as it is fitted only once.
PLACES = 600
#: Number of sets of effects whose evidence is computed again without each fold.
WEIGHED = 100
#: Most rows for which models are computed; longer logs are averaged in blocks of neighbours.
ROWS = 8000

# --- others ------------------------------------------------------------------------------------

#: Least white noise, as a share of the largest force: no load cell is better.
LEAST_NOISE = 1e-3
#: Number of sets in each beam.
BEAM = 3
#: Number of candidates of each expanded set that are fitted, for each of the two rankings.
FITTED = 4
#: An effect is named if the log posterior without it is lower by this much (odds of 20) ...
LEAST_LOSS = 3.0
#: ... and by this share of the gain of all effects.
LEAST_SHARE = 0.02
#: A discrepancy below this share of the largest force is negligible: the gauges of a rig are not
#: more accurate.
SMALL = ACCURACY
#: Significance level of chi-square tests.
ALARM = 0.01
#: Structure, or offsets of trials, below this share of a row's noise are not reported.
VISIBLE = 0.5
#: A set that leaves more than this times the normal structure is no explanation: the prior
#: probability of such a discrepancy is exp(-10).
ABNORMAL = 10.0
#: Share of the mean square error that effects must remove to be an explanation. A share of the
#: log evidence would demand more of the same effects with a better load cell.
MOST_OF_IT = 0.5
