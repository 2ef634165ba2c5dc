# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a fit knows about its parameters: intervals, dead and traded-off parameters, bounds."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fam_bundle_ros.discovery.fit import Fit
from fam_bundle_ros.discovery.search import Scale
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.units import si_factor

_GEOMETRY_UNITS = {'radius': 'mm', 'length': 'mm', 'braid_angle': 'deg', 'wall_thickness': 'mm'}


@dataclass(frozen=True)
class Estimate:
    """
    A fitted parameter in the unit that people use for it.

    Attributes
    ----------
    key : str
        ``effect.parameter`` or ``geometry.radius``.
    value : float
    unit : str
    interval : tuple of float
        95 %, within the bounds.
    flag : str
        Empty, or why the interval is not to be trusted: ``dead`` (the data do not move it),
        ``at bound``, ``traded off with ...``.
    tolerances : float or None
        How many tolerances a parameter of the model has moved.
    si : float
        The value in SI units.
    """

    key: str
    value: float
    unit: str
    interval: tuple[float, float]
    flag: str
    tolerances: float | None
    si: float
    si_interval: tuple[float, float]

    def __str__(self) -> str:
        low, high = self.interval
        text = f'{self.key} {self.value:.4g} {self.unit} ({low:.4g} to {high:.4g})'
        if self.tolerances is not None:
            text += f', moved {self.tolerances:+.1f} tolerances'
        return text + (f' [{self.flag}]' if self.flag else '')

    def to_dict(self) -> dict[str, Any]:
        """Return value, unit, interval and flag."""
        chosen = asdict(self)
        chosen['interval'] = list(self.interval)
        chosen['si_interval'] = list(self.si_interval)
        return chosen


def unit_of(model: Bundle, key: str) -> tuple[str, float]:
    """Return the unit that a parameter is shown in and its SI size."""
    owner, _, name = key.partition('.')
    if owner == 'geometry':
        unit = _GEOMETRY_UNITS[name]
        return unit, si_factor(unit, unit)
    parameter = model.effect(owner).parameter(name)
    return ('' if parameter.unit == '1' else parameter.unit), parameter.scale


def covariance(fit: Fit, scale: Scale) -> np.ndarray:
    """
    Return the covariance of the scaled parameters, (p, p).

    Data count by their independent samples; the priors count as they are. A direction that
    neither data nor priors hold gets the size of its bounds.
    """
    if not fit.terms:
        return np.zeros((0, 0))
    prior = np.array([0.0 if t.prior is None else 1.0 for t in fit.terms])
    reach = np.array([((t.upper - t.lower) / t.scale) ** 2 for t in fit.terms])
    information = fit.jacobian.T @ fit.jacobian / (scale.inflation * scale.tau)
    information += np.diag(prior + 1.0 / reach)
    return np.linalg.pinv(information, hermitian=True)


def estimates(fit: Fit, scale: Scale) -> list[Estimate]:
    """Return every fitted parameter with its interval and what is wrong with it, if anything."""
    cov = covariance(fit, scale)
    spread = np.sqrt(np.maximum(np.diag(cov), 0.0))
    found = []
    for j, (term, value) in enumerate(zip(fit.terms, fit.values)):
        unit, size = unit_of(fit.model, term.key)
        half = 1.96 * spread[j] * term.scale
        low, high = max(value - half, term.lower), min(value + half, term.upper)
        flag = ''
        width = term.upper - term.lower
        if half > 0.45 * width or (term.prior is not None and spread[j] > 0.97):
            flag = 'dead: the data do not move it'
        elif min(value - term.lower, term.upper - value) < 1e-6 * width:
            flag = 'at bound'
        else:
            others = cov[j] / np.maximum(spread * spread[j], 1e-300)
            others[j] = 0.0
            worst = int(np.argmax(np.abs(others))) if len(others) > 1 else j
            if worst != j and abs(others[worst]) > 0.98:
                flag = f'traded off with {fit.terms[worst].key}'
        moved = None if term.prior is None else float((value - term.prior) / term.scale)
        found.append(Estimate(term.key, float(value / size), unit,
                              (float(low / size), float(high / size)), flag, moved, float(value),
                              (float(low), float(high))))
    return found


def confounding(fit: Fit, scale: Scale) -> tuple[list[str], np.ndarray]:
    """Return parameter keys and the (p, p) matrix of correlations between their estimates."""
    cov = covariance(fit, scale)
    spread = np.sqrt(np.maximum(np.diag(cov), 1e-300))
    return [t.key for t in fit.terms], cov / np.outer(spread, spread)
