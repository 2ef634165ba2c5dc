# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Settings of the outer loops (`outer_loop`), and the model of the load."""

from dataclasses import dataclass
from itertools import pairwise
import math
from typing import Any

import numpy as np

from fam_bundle_ros.errors import InputError


@dataclass(frozen=True)
class LoadModel:
    """
    Model of the load on the bundle, for strain references; all zero if unknown.

    An unknown load is identified online (`load_estimate`).

    Parameters
    ----------
    force : float, N
        Holding force at zero strain.
    stiffness : float, N
        Change of the holding force per unit of strain.
    table : tuple of (strain, force), optional
        Holding force at rising strains, instead of the two numbers above.
    inertia : float, N s^2
        Force per strain acceleration.
    damping : float, N s
        Force per strain rate.
    """

    force: float = 0.0
    stiffness: float = 0.0
    inertia: float = 0.0
    damping: float = 0.0
    table: tuple[tuple[float, float], ...] = ()

    def __post_init__(self):
        """Check the numbers, and the order of the table."""
        for name in ('force', 'stiffness', 'inertia', 'damping'):
            value = getattr(self, name)
            if not math.isfinite(value) or (name in ('inertia', 'damping') and value < 0.0):
                raise InputError(f'{name} of the load is {value}; expected a finite number'
                                 + (', 0 or more' if name in ('inertia', 'damping') else ''))
        if not (all(math.isfinite(number) for point in self.table for number in point)
                and all(first[0] < second[0] for first, second in pairwise(self.table))):
            raise InputError(f'table of the load is {self.table}; expected finite numbers, and '
                             'strains that rise')

    @property
    def known(self) -> bool:
        """Return whether any parameter is set."""
        return self != LoadModel()

    def holding_force(self, strain: float) -> float:
        """Return the force that holds the load at a strain, N."""
        if self.table:
            strains, forces = zip(*self.table)
            return float(np.interp(strain, strains, forces))
        return self.force + self.stiffness * strain


@dataclass(frozen=True)
class OuterConfig:
    """
    Gains of the outer loops.

    Parameters
    ----------
    feed_forward : bool
        Demand from the reference (force) or from the load model (strain).
    feedback : bool
        Use the bias estimate and the gains below.
    delay : float, s
        Dead time from a change of force to the pressures that respond to it; the same as for the
        pressure loops and `tune`.
    reading_share : float
        Share of ``delay`` in the readings; the rest is in the commands. Measurements cannot tell
        the two apart: one half by default, which has the least expected error.
    bias_time : float, s, optional
        Time constant of the fastest bias estimate (`observer`); by default the lag of the loop:
        dead time, `lead_time`, one and a half samples, and the learnt lag of the force with its
        uncertainty.
    force_gain : float, optional
        Gain on the force error; by default a gain margin of 2 (6 dB) remains where the bundle's
        force changes by ``gain_error`` more than the model's: `default_force_gain`. It is weighted
        by the share of the fastest bias estimate beyond noise.
    gain_error : float
        Largest excess of the change of the bundle's force over the model's, relative.
    force_integral : float, 1/s
        Integral gain on the force error without feed-forward (with it, the bias estimate acts).
    strain_gain : float, N, optional
        Gain on the strain error; by default, as the next two, the largest that ``delay`` and load
        allow at the present stiffness: see `strain_gains`. With a long delay it is negative.
    strain_integral : float, N/s, optional
        Gain on the integral of the strain error, raised while friction holds the strain behind a
        moving reference; 0 for no integral.
    strain_damping : float, N s, optional
        Gain on the error of the strain rate.
    still : float, N, optional
        Backlash of the strain loop's correction: it is held while it would change by less than
        this, or by less than its noise, so that no air is used for sensor noise. By default 0.02 %
        of the largest force.
    filter_time : float, s
        Low-pass filter of the force reading.
    strain_reach : float
        Pressures are computed for the reference strain, at most this far from the measured one:
        the muscles' own stiffness then pulls towards it. Where a load drives the strain further
        away, they remain those for the last strain (`strain_loop.next_aim`).
    lead_time : float, s
        Lag of the pressures behind their setpoints. Feed-forward advances a reference with a rate
        by the dead time, this time, and half a sample, for which a setpoint is held on average.
    fade_time : float, s
        Decay time of the initial force on enabling (bumpless transfer); with a strain reference
        and an unknown load the integral takes this force over instead.
    """

    feed_forward: bool = True
    feedback: bool = True
    delay: float = 5e-3
    reading_share: float = 0.5
    bias_time: float | None = None
    force_gain: float | None = None
    gain_error: float = 0.5
    force_integral: float = 12.0
    strain_gain: float | None = None
    strain_integral: float | None = None
    strain_damping: float | None = None
    still: float | None = None
    filter_time: float = 0.02
    strain_reach: float = 0.03
    lead_time: float = 0.0035
    fade_time: float = 0.2

    def __post_init__(self):
        """Check the ranges of the settings."""
        if not (self.feed_forward or self.feedback):
            raise InputError('feed_forward and feedback are both off; expected one at least')
        if not 0.0 <= self.reading_share <= 1.0:
            raise InputError(f'reading_share is {self.reading_share}; expected 0 to 1')
        for name in ('bias_time', 'filter_time', 'fade_time'):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise InputError(f'{name} is {value}; expected a finite number, more than 0 s')
        for name in ('force_gain', 'force_integral', 'strain_gain', 'strain_integral',
                     'strain_damping', 'strain_reach', 'still', 'lead_time', 'delay',
                     'gain_error'):
            value = getattr(self, name)
            if value is not None and not 0.0 <= value < math.inf:
                raise InputError(f'{name} is {value}; expected a finite number, 0 or more')


def command_lag(outer: Any, dt: float) -> float:
    """
    Return the time from a command to its pressure, s: a kernel.

    Dead time, lag of the pressures, and half of a sample, for which a command is held on average.

    Parameters
    ----------
    outer : OuterConfig or OuterSettings
    dt : float, s
        Sample time of the recruitment controller.
    """
    return outer.delay + outer.lead_time + 0.5 * dt


def default_force_gain(gain_error: float) -> float:
    """
    Return the gain k on the force error that leaves a gain margin of 2.

    Fastest observer and force error pass a first-order lag with the loop's own lag T: the loop is
    (e + k (1 + e)) exp(-sT) / (1 + sT) where the bundle's force changes 1 + e times as much as the
    model's. Its phase is -180 degrees at w T = 2.029, where the lag has a gain of 1/2.262.

    Examples
    --------
    >>> round(default_force_gain(0.5), 2)
    0.42
    """
    return max((2.262 / 2.0 - gain_error) / (1.0 + gain_error), 0.0)
