# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Settings of the outer loops (`outer_loop`), and what is known of the load."""

from dataclasses import dataclass

import numpy as np

from fam_bundle_ros.errors import InputError


@dataclass(frozen=True)
class LoadModel:
    """
    What is known of the load on the bundle, for strain references; zeros where nothing is.

    A load of which nothing is known is learnt as it moves (`load_estimate`).

    Parameters
    ----------
    force : float, N
        That holds the load at zero strain.
    stiffness : float, N
        Change of it per unit of strain.
    table : tuple of (strain, force), optional
        Holding force over rising strain, instead of the two numbers above.
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

    @property
    def known(self) -> bool:
        """Return whether anything is known."""
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
        The model's own inverse: demand = reference (force), load model (strain).
    feedback : bool
        Bias estimate and the gains below.
    delay : float, s
        Dead time from a force that changes to the pressures that answer it; as told to the
        pressure loops and `tune`.
    reading_share : float
        Share of ``delay`` which is on the way of the readings; commands have the rest. Nothing
        that is measured tells which: even odds by default, the least error to be expected.
    bias_time : float, s, optional
        Of the quick bias estimate (`observer`); by default the lag of the loop: dead time,
        `lead_time`, one sample, and the lag of the force that was learnt, with its doubt.
    force_gain : float, optional
        On the force error; by default what leaves a gain margin of 2 (6 dB) where the bundle
        answers by ``gain_error`` more than the model: `default_force_gain`. It counts as much as
        the quick bias estimate shows more than noise.
    gain_error : float
        By how much the bundle's force may change more than the model's, relative.
    force_integral : float, 1/s
        On the force error, without feed-forward (with it, the bias estimate does this).
    strain_gain : float, N, optional
        Per unit of strain error; by default, as the next two, as large as ``delay`` and load
        allow at the present stiffness: see `strain_gains`. Late feedback is turned back by a
        gain below 0.
    strain_integral : float, N/s, optional
        Larger where friction holds the strain behind a reference that moves; 0 for none.
    strain_damping : float, N s, optional
        On the error of the strain rate.
    still : float, N
        Corrections of a strain loop change only by more than this, or by more than the noise
        that is found in them: no air for sensor noise.
    filter_time : float, s
        Of the force reading.
    strain_reach : float
        Pressures are worked out for the reference strain where it is no further away than this:
        the muscles' own stiffness then pulls towards it.
    lead_time : float, s
        How long the pressures take to follow: feed-forward asks for where a reference that says
        its rate will be by then.
    fade_time : float, s
        Over which a force taken over on enabling fades into the demand; with a strain reference
        and a load of which nothing is known it goes on in the integral instead.
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
    still: float = 0.2
    filter_time: float = 0.02
    strain_reach: float = 0.03
    lead_time: float = 0.0055
    fade_time: float = 0.2

    def __post_init__(self):
        """Refuse what cannot be meant."""
        if not (self.feed_forward or self.feedback):
            raise InputError('feed_forward and feedback are both off; expected one at least')
        if not 0.0 <= self.reading_share <= 1.0:
            raise InputError(f'reading_share is {self.reading_share}; expected 0 to 1')
        for name in ('bias_time', 'filter_time', 'fade_time'):
            value = getattr(self, name)
            if value is not None and not value > 0.0:
                raise InputError(f'{name} is {value}; expected more than 0 s')
        for name in ('force_gain', 'force_integral', 'strain_gain', 'strain_integral',
                     'strain_damping', 'strain_reach', 'still', 'lead_time', 'delay',
                     'gain_error'):
            value = getattr(self, name)
            if value is not None and not value >= 0.0:
                raise InputError(f'{name} is {value}; expected 0 or more')


def default_force_gain(gain_error: float) -> float:
    """
    Return the gain k on the force error that leaves a gain margin of 2.

    Quick observer and force error pass a first-order lag as long as the loop's own, T: the loop
    is (e + k (1 + e)) exp(-sT) / (1 + sT) where the bundle answers 1 + e times as much as the
    model. Its phase is -180 degrees at w T = 2.029, where the lag leaves 1/2.262.

    Examples
    --------
    >>> round(default_force_gain(0.5), 2)
    0.42
    """
    return max((2.262 / 2.0 - gain_error) / (1.0 + gain_error), 0.0)
