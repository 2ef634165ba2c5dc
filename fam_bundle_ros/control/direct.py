# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Direct pressure references, without a model, for experiments."""

from __future__ import annotations

import math

import numpy as np

from fam_bundle_ros.control.safety import HOLD_TIME
from fam_bundle_ros.control.signals import Command, Measurement, Reference
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle

#: Pa: above it a motor unit counts as on.
_ON = 2e3
#: Relative excess over a limit that counts as rounding (50 psi are 344.74 kPa, not 344.7).
ROUNDING = 1e-3


class DirectPressures:
    """
    Pass pressure references on, with the interface of `RecruitmentController`.

    Parameters
    ----------
    bundle : Bundle
        Its largest pressures are the limits.
    fade_time : float, s
        Transition time from the initial pressures to the reference (bumpless transfer).
    hold_time : float, s
        Readings that are not finite hold the pressures for this time, then all units are vented.

    Examples
    --------
    >>> from fam_bundle_ros.model import load_model
    >>> direct = DirectPressures(load_model('config/models/spie2021.yaml'))
    >>> direct.enable(Measurement(0.0, 0.1, 0.0, np.array([50e3, 0.0])))
    >>> asked = Reference('pressure', pressure=(100e3, 0.0))
    >>> seen = Measurement(0.0, 0.1, 0.0, np.array([50e3, 0.0]))
    >>> [float(direct.update(0.1, seen, asked).pressure[0]) for _ in range(3)]
    [75000.0, 100000.0, 100000.0]
    """

    def __init__(self, bundle: Bundle, fade_time: float = 0.2,
                 hold_time: float = HOLD_TIME):
        self._limit = bundle.max_pressure
        self._fade_time, self._hold_time = fade_time, hold_time
        self._now = np.zeros(bundle.n)
        self._taken = np.zeros(bundle.n)
        self._fade = self._lost = 0.0

    def enable(self, measurement: Measurement) -> None:
        """Start from the present pressures (bumpless transfer)."""
        self._taken = np.clip(np.nan_to_num(measurement.pressure), 0.0, self._limit)
        self._now = self._taken.copy()
        self._fade, self._lost = 1.0, 0.0

    def update(self, dt: float, measurement: Measurement, reference: Reference) -> Command:
        """
        Return the command of this tick.

        Parameters
        ----------
        dt : float, s
            Time since the last update; if not positive (clock reset), or infinite, the command is
            repeated.
        measurement : Measurement
        reference : Reference
            Reference of the kind ``pressure``.

        Raises
        ------
        InputError
            For another kind of reference, another number of pressures, or one out of range.
        """
        asked = self.checked(reference)
        if 0.0 < dt < math.inf:
            seen = measurement.force + measurement.strain + float(np.sum(measurement.pressure))
            if math.isfinite(seen):
                self._lost = 0.0
                self._fade = max(self._fade - dt / self._fade_time, 0.0)
                self._now = asked + self._fade * (self._taken - asked)
            else:
                self._lost += dt
                if self._lost > self._hold_time:
                    self._now = np.zeros_like(asked)
        active = self._now > _ON
        return Command(self._now.copy(), int(active.sum()), active, np.zeros(len(asked)))

    def checked(self, reference: Reference) -> np.ndarray:
        """Return the pressures of a reference, (n,), Pa; InputError where they are invalid."""
        if reference.kind != 'pressure':
            raise InputError(f"reference kind is '{reference.kind}'; expected pressure")
        asked = np.asarray(reference.pressure, float)
        if asked.shape != self._limit.shape:
            raise InputError(f'{asked.size} pressures; expected {self._limit.size}')
        for k, (value, limit) in enumerate(zip(asked, self._limit), 1):
            if not 0.0 <= value <= limit * (1.0 + ROUNDING):
                raise InputError(f'reference of mu{k} is {value / 1e3:.4g} kPa; expected 0 to '
                                 f'{limit / 1e3:.4g} kPa, its largest pressure')
        return np.minimum(asked, self._limit)
