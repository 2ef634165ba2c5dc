# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Priors of the parameters, in a standard normal coordinate u.

theta = value exp(width u) for positive constants, value + width u for signed ones. A size that is
zero by default is half-normal; if it is positive, the other size of its law may be zero. Of a law
of the model with several sizes, such as the two constants of a Mooney-Rivlin tube, all but the
first may be zero: below its value such a size is linear in u, above it exponential with the same
slope. u = 0 is the value in the model file or the catalogue.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fam_bundle_ros.discovery import settings
from fam_bundle_ros.model import Bundle, Effect
from fam_bundle_ros.model.geometry import BRAID_ANGLE_TOLERANCE, RADIUS_TOLERANCE

#: Limit of u for log-normal priors, in widths.
_FAR = 6.0


@dataclass(frozen=True)
class Prior:
    """
    The prior of one parameter.

    Attributes
    ----------
    key : str
        ``effect.parameter`` or ``geometry.radius``.
    lower, upper : float
        Bounds, SI.
    value, width : float
        Centre (SI) and standard deviation (SI, or of the logarithm for ``log``).
    kind : str
        ``log``, ``normal``, ``half``, or ``size``: normal below the value, log-normal above it.
    own : bool
        Whether it is a parameter of the model as given.
    beside : str
        Key of the half-normal size of the same law; if that is positive, this one may be zero.
    """

    key: str
    lower: float
    upper: float
    value: float
    width: float
    kind: str
    own: bool = False
    beside: str = ''

    @cached_property
    def limits(self) -> tuple[float, float]:
        """Bounds of u."""
        if self.kind == 'log':
            low = np.log(max(self.lower, 1e-9 * self.value) / self.value) / self.width
            high = np.log(self.upper / self.value) / self.width
            return max(-_FAR, float(low)), min(_FAR, float(high))
        low, high = (self.lower - self.value) / self.width, (self.upper - self.value) / self.width
        if self.kind == 'size':
            high = min(_FAR, self.value / self.width * np.log(self.upper / self.value))
        return 0.0 if self.kind == 'half' else float(low), float(high)

    @property
    def start(self) -> float:
        """Start value of u; positive for sizes, as some laws have no slope at a size of zero."""
        return min(0.3, self.limits[1]) if self.kind == 'half' else 0.0

    def theta(self, u: float) -> float:
        """Return the SI value at u, within the bounds."""
        if self._is_exponential(u):
            value = self.value * np.exp(self._relative * u)
        else:
            value = self.value + self.width * u
        return float(min(max(value, self.lower), self.upper))

    def coordinate(self, u: float) -> float:
        """Return what is linear in u: the logarithm for ``log``, else the value (below it)."""
        return float(np.log(self.value) if self.kind == 'log' else self.value) + self.width * u

    def slope(self, u: float) -> float:
        """Return d theta / d u."""
        return self._relative * self.theta(u) if self._is_exponential(u) else self.width

    def _is_exponential(self, u: float) -> bool:
        return self.kind == 'log' or self.kind == 'size' and u > 0.0

    @property
    def _relative(self) -> float:
        return self.width if self.kind == 'log' else self.width / self.value


def own_priors(model: Bundle) -> list[Prior]:
    """Return the priors of a model's parameters: radius, braid angle, and those of its effects."""
    first = model.motor_units[0].geometry
    thinnest = 1.02 * max(u.geometry.wall_thickness / u.geometry.radius
                          for u in model.motor_units)
    radius, angle = float(first.radius), float(first.braid_angle)
    spread = [float(u.geometry.braid_angle) - angle for u in model.motor_units]
    found = [Prior('geometry.radius', thinnest * radius, 4.0 * radius, radius,
                   RADIUS_TOLERANCE * radius, 'normal', True),
             Prior('geometry.braid_angle', np.radians(8.0) - min(spread),
                   np.radians(54.0) - max(spread), angle, BRAID_ANGLE_TOLERANCE, 'normal', True)]
    for effect in model.effects:
        found += effect_priors(effect, model.n, own=True)
    return found


def effect_priors(effect: Effect, units: int, own: bool = False,
                  change: Callable[[str, float], float] | None = None, size: float = np.inf,
                  ) -> list[Prior]:
    """
    Return the priors of an effect's parameters.

    Parameters
    ----------
    units : int
        Number of motor units; some effects have a parameter for each.
    own : bool
        True if the effect belongs to the model as given.
    change : callable, optional
        Returns the rms change of the force, N, for a key and a step (SI). It limits the prior of
        signed parameters, whose bounds are wide: one width changes the force by at most ``size``.
    size : float, N
    """
    found = []
    further = [name for name, value in effect.off.items() if value == 0.0][1:]
    for parameter in effect.active(units):
        low, high = effect.limits(parameter.name)
        value = effect.values[parameter.name]
        if not parameter.fitted or high <= low:
            continue
        key = f'{effect.name}.{parameter.name}'
        if value > 0 and low >= 0:
            width = settings.OWN_WIDTH if own else settings.ADDED_WIDTH
            kind = 'log'
            if own and low == 0.0 and parameter.name in further:
                width, kind = width * value, 'size'
            found.append(Prior(key, low, high, value, width, kind, own))
            continue
        width = settings.SIGNED_WIDTH * (high - low)
        if change is not None:
            step = 0.02 * (high - low)
            rate = change(key, step if value + step <= high else -step) / step
            width = min(width, size / rate) if rate > 0 else width
        kind = 'half' if low >= 0 and value == 0 else 'normal'
        found.append(Prior(key, low, high, value, width, kind, own))
    halves = [prior.key for prior in found if prior.kind == 'half']
    if own or len(halves) != 1:
        return found
    return [replace(prior, beside=halves[0])
            if prior.kind == 'log' and effect.off.get(prior.key.partition('.')[2]) == 0.0
            else prior for prior in found]
