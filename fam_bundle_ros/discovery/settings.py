# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Every number that the search for missing effects goes by, each with its reason.

Three kinds: what a user may choose (`Choices`), widths of priors and grids, and the few numbers
that are neither (from `LEAST_NOISE` on). None is a threshold on a measured quantity of one muscle:
all are log odds, shares of the force or of the range of the data, or counts. How a solver steps
stands where it steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Choices:
    """
    What a user may choose.

    Attributes
    ----------
    unexplained : float
        How much structure beyond every law is normal: the mean of the exponential prior on the
        amplitudes of the discrepancy, as a share of the force's standard deviation. Smaller
        values make the search add effects sooner. Ten times as much makes a verdict
        `unexplained`.
    odds : float
        Sets of effects that are at most so many times less probable than the best one are ties.
    inclusion : float
        Probability before the data that an effect is missing (or one of the model's wrong).
    most : int
        How many effects may be added, replaced or removed.
    """

    unexplained: float = 0.01
    odds: float = 20.0
    inclusion: float = 0.1
    most: int = 5


# --- widths of priors --------------------------------------------------------------------------

#: Constants of the model's own effects (a data sheet's or a former fit's), log-normal.
OWN_WIDTH = 0.5
#: Positive constants of an effect that is added, log-normal about what is usual: a factor of
#: three.
ADDED_WIDTH = 1.2
#: m: radius of the muscle that the catalogue's defaults are for (Kim et al. 2021). Materials of
#: other muscles are alike, so their forces go with the section.
USUAL_RADIUS = 6.35e-3
#: Signed constants, normal: this share of the range of their bounds ...
SIGNED_WIDTH = 0.125
#: ... but no more than what changes the force by this share of its standard deviation.
SIGNED_SIZE = 0.3

# --- grids -------------------------------------------------------------------------------------

#: Amplitudes of the discrepancy, shares of the force's standard deviation.
AMPLITUDES = np.concatenate([[0.0], 10.0 ** np.arange(-3.5, 0.01, 0.25)])
#: Its lengths over strain and pressure (shares of their range) and time (s).
STRAIN_LENGTHS = np.array([1.0, 0.5, 0.25, 0.12, 0.06])
PRESSURE_LENGTHS = np.array([1.5, 0.75, 0.35])
TIME_LENGTHS = np.array([0.3, 3.0, 30.0])
#: Its length over the natural logarithm of the speed: a factor of e.
SPEED_LENGTH = 1.0
#: Most cells that the data are averaged to: the work grows with the cube.
CELLS = 200
#: Most places of the table of what is left: it is fitted once, not for each set of effects.
PLACES = 600
#: Most sets of effects that are weighed again without each fold.
WEIGHED = 100
#: Most rows that physics runs on; longer logs are averaged in blocks of neighbours.
ROWS = 8000

# --- neither -----------------------------------------------------------------------------------

#: The least white noise, as a share of the largest force: no load cell is better.
LEAST_NOISE = 1e-3
#: Sets that each beam keeps.
BEAM = 3
#: Candidates of each expanded set that are fitted, by each of the two rankings.
FITTED = 4
#: An effect is named when leaving it out loses so many log units (odds of 20) ...
LEAST_LOSS = 3.0
#: ... and this share of what all effects gain.
LEAST_SHARE = 0.02
#: A discrepancy below this share of the largest force is as good as none: no gauge of a rig is
#: better.
SMALL = 0.01
#: Structure, or offsets of trials, below this share of a row's noise are not told as findings.
VISIBLE = 0.5
#: So many times the structure that is normal cannot be left by an explanation: its prior
#: probability is exp(-10).
ABNORMAL = 10.0
#: Share of the error's mean square that effects must take to be an explanation. Not of its
#: evidence: that would ask more of the same effects the better the load cell is.
MOST_OF_IT = 0.5
