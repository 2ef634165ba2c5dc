# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What goes into the recruitment controller each tick, and what comes out."""

from dataclasses import dataclass, field

import numpy as np

from fam_bundle_ros.control.reasons import Reason
from fam_bundle_ros.control.switching import Margins


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
    With the kind ``pressure`` (see `fam_bundle_ros.control.direct`) neither is used but
    ``pressure``, the gauge pressures of all motor units, Pa.
    """

    kind: str
    value: float = 0.0
    rate: float = 0.0
    pressure: tuple[float, ...] = ()


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


@dataclass
class CommandRecord:
    """
    What the pressure loops are to do, and why; see `Command`.

    ``active`` has 1 for units that are on, ``saturated`` a code of `saturation.SATURATION`.
    """

    pressure: list
    active: list
    share: list
    state: int = 0
    saturated: int = 0
    demand: float = 0.0
    margins: Margins = field(default_factory=Margins)
    reason: Reason = field(default_factory=Reason)


@dataclass
class MeasurementRecord:
    """What the rig shows: force (N), strain, its rate (1/s), pressures (Pa, gauge)."""

    force: float
    strain: float
    strain_rate: float
    pressure: list


def command_record(n: int) -> CommandRecord:
    """Return the command of a vented bundle."""
    return CommandRecord([0.0] * n, [0] * n, [0.0] * n)
