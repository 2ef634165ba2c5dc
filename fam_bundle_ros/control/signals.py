# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What goes into the recruitment controller each tick, and what comes out."""

from dataclasses import dataclass, field

import numpy as np

from fam_bundle_ros.control.recruitment import Margins


@dataclass(frozen=True)
class Measurement:
    """
    What the rig shows now.

    Attributes
    ----------
    force : float, N
    strain, strain_rate : float, and 1/s
    pressure : ndarray (n,), Pa (gauge)
    """

    force: float
    strain: float
    strain_rate: float
    pressure: np.ndarray


@dataclass(frozen=True)
class Reference:
    """
    What is wanted: ``kind`` is ``force`` (N) or ``strain``; ``rate`` is its rate per second.

    A reference that moves should say its rate: a rate of 0 with a new value is a step.
    """

    kind: str
    value: float
    rate: float = 0.0


@dataclass(frozen=True)
class Command:
    """
    What the pressure loops are to do, and why.

    Attributes
    ----------
    pressure : ndarray (n,), Pa (gauge)
    state : int
        k of RSk; 0 is off.
    active : ndarray (n,) of bool
    share : ndarray (n,)
        Of the bundle's force, per unit, after the model.
    saturated : str
        ``''``, ``'high'``, ``'low'`` (out of reach), ``'gap'`` (not in reach of this state yet).
    explanation : str
        In words, in the tick in which a decision was taken.
    margins : Margins
    demand : float, N
        What was allocated: reference, feedback and bias together.
    """

    pressure: np.ndarray
    state: int
    active: np.ndarray
    share: np.ndarray
    saturated: str = ''
    explanation: str = ''
    margins: Margins = field(default_factory=Margins)
    demand: float = 0.0
