# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Inputs and outputs of the recruitment controller."""

from dataclasses import dataclass, field

import numpy as np

from fam_bundle_ros.control.reasons import Reason
from fam_bundle_ros.control.switching import Margins


@dataclass(frozen=True)
class Measurement:
    """
    Readings of the rig at one time.

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
    Reference: ``kind`` is ``force`` (N) or ``strain``; ``rate`` is its rate per second.

    Without a rate it is estimated from the values before (`SampledReference`); a new value with
    a rate of 0 is a step. The kind ``pressure`` is for `DirectPressures`, not for
    `RecruitmentController`, and uses only ``pressure``, the gauge pressures of all units, Pa.
    """

    kind: str
    value: float = 0.0
    rate: float | None = None
    pressure: tuple[float, ...] = ()


@dataclass(frozen=True)
class Command:
    """
    Setpoints of the pressure loops, with the reason.

    Attributes
    ----------
    pressure : ndarray (n,), Pa (gauge)
    state : int
        k of RSk; 0 is off.
    active : ndarray (n,) of bool
    share : ndarray (n,)
        Share of each unit in the bundle's force, by the model.
    saturated : str
        ``''``, ``'high'``, ``'low'`` (out of reach), ``'gap'`` (not in reach of this state yet).
    explanation : str
        Reason as text, in the tick of a decision.
    margins : Margins
    demand : float, N
        Allocated force: feed-forward and feedback together.
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
    Setpoints of the pressure loops, with the reason; see `Command`.

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
    """Readings of the rig: force (N), strain, its rate (1/s), pressures (Pa, gauge)."""

    force: float
    strain: float
    strain_rate: float
    pressure: list


def command_record(n: int) -> CommandRecord:
    """Return the command of a vented bundle."""
    return CommandRecord([0.0] * n, [0] * n, [0.0] * n)
