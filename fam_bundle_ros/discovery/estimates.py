# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Estimates of the parameters: value, interval over all likely sets, and a flag if unreliable."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fam_bundle_ros.discovery.fitter import Fit
from fam_bundle_ros.discovery.posterior import Posterior
from fam_bundle_ros.discovery.priors import Prior
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.geometry import DIMENSIONS
from fam_bundle_ros.units import si_factor

#: Standard deviations of a 95 % interval.
_95 = 1.96
#: A parameter is dead if its posterior standard deviation exceeds this share of the prior's.
DEAD = 0.97
#: Two parameters trade off if the absolute correlation of their estimates is larger.
_TRADED = 0.98


@dataclass(frozen=True)
class Estimate:
    """
    A fitted parameter in its usual unit.

    Attributes
    ----------
    key : str
        ``effect.parameter`` or ``geometry.radius``.
    value : float
    unit : str
    interval : tuple of float
        95 % interval within the bounds, over all likely sets, so that a tie widens it.
    flag : str
        Empty, or why the interval is unreliable: ``dead`` (the data do not move the parameter),
        ``at bound``, ``traded off with ...``.
    tolerances : float or None
        Shift of a parameter of the model, in tolerances (widths of its prior).
    si : float
        The value in SI units.
    prior : tuple of float
        Centre and 95 % interval of the prior, in the unit.
    moved : tuple of float
        Value and 95 % interval relative to the centre of the prior, in widths of the prior.
    reach : tuple of float
        95 % interval of the prior, in the same measure.
    data_alone : tuple of float
        Value and 95 % interval without the parameter's prior. Use it to compare specimens: a
        prior shifts all of them towards one value. Empty if the parameter is dead.
    """

    key: str
    value: float
    unit: str
    interval: tuple[float, float]
    flag: str
    tolerances: float | None
    si: float
    si_interval: tuple[float, float]
    prior: tuple[float, float, float]
    moved: tuple[float, float, float]
    reach: tuple[float, float]
    data_alone: tuple[float, ...] = ()

    def __str__(self) -> str:
        low, high = self.interval
        text = f'{self.key} {self.value:.4g} {self.unit} ({low:.4g} to {high:.4g})'
        if self.tolerances is not None:
            text += f', moved {self.tolerances:+.1f} tolerances'
        return text + (f' [{self.flag}]' if self.flag else '')

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as plain numbers, lists and text."""
        return {key: list(value) if isinstance(value, tuple) else value
                for key, value in asdict(self).items()}


def unit_of(model: Bundle, key: str) -> tuple[str, float]:
    """Return the unit in which a parameter is shown, and the SI value of that unit."""
    owner, _, name = key.partition('.')
    if owner == 'geometry':
        unit = DIMENSIONS[name]
        return unit, si_factor(unit, unit)
    parameter = model.effect(owner).parameter(name)
    return ('' if parameter.unit == '1' else parameter.unit), parameter.scale


def estimates(fit: Fit, posterior: Posterior | None = None) -> list[Estimate]:
    """
    Return every parameter of a fit without a discrepancy, with its interval and flag.

    A posterior widens the intervals by the spread over other likely sets.
    """
    own, dead = _spread(fit), is_dead(fit)
    bound = fit.at_bound
    found = []
    for j, (prior, u) in enumerate(zip(fit.priors, fit.u)):
        unit, size = unit_of(fit.model, prior.key)
        spread = max(own[j], (posterior.spread(prior.key, u) if posterior else None) or 0.0)
        low, high = prior.limits
        moved = (float(u), max(float(u - _95 * spread), low), min(float(u + _95 * spread), high))
        ends = (prior.theta(moved[1]), prior.theta(moved[2]))
        reach = (max(-_95, low), min(_95, high))
        before = (prior.theta(0.0) / size, prior.theta(reach[0]) / size,
                  prior.theta(reach[1]) / size)
        flag = ''
        if dead[j]:
            flag = 'dead: the data do not move it'
        elif bound[j]:
            flag = 'at bound'
        else:
            others = fit.covariance[j] / np.maximum(own * own[j], 1e-300)
            others[j] = 0.0
            worst = int(np.argmax(np.abs(others)))
            if abs(others[worst]) > _TRADED:
                flag = f'traded off with {fit.priors[worst].key}'
        value = prior.theta(u)
        found.append(Estimate(prior.key, value / size, unit, (ends[0] / size, ends[1] / size),
                              flag, float(u) if prior.own else None, value, ends, before,
                              moved, reach,
                              tuple(v / size for v in _data_alone(prior, u, own[j]))))
    return found


def _spread(fit: Fit) -> np.ndarray:
    """Return the posterior standard deviation of each parameter in widths of its prior, (p,)."""
    return np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))


def is_dead(fit: Fit) -> np.ndarray:
    """Return which parameters have a posterior almost as wide as the prior, (p,) bool."""
    return _spread(fit) > DEAD


def _data_alone(prior: Prior, u: float, spread: float) -> tuple[float, ...]:
    """
    Return value and 95 % interval of a parameter without its prior, SI.

    The prior is N(0, 1) in u; a posterior N(u, s^2) is then that of a likelihood
    N(u / (1 - s^2), s^2 / (1 - s^2)).
    """
    if spread > DEAD:
        return ()
    left = 1.0 - spread ** 2
    centre, reach = u / left, _95 * spread / np.sqrt(left)
    return prior.theta(centre), prior.theta(centre - reach), prior.theta(centre + reach)


def confounding(fit: Fit) -> tuple[list[str], np.ndarray]:
    """Return parameter keys and the (p, p) matrix of correlations between their estimates."""
    spread = np.sqrt(np.maximum(np.diag(fit.covariance), 1e-300))
    return [prior.key for prior in fit.priors], fit.covariance / np.outer(spread, spread)


def with_intervals(model: Bundle, found: list[Estimate], error: float) -> Bundle:
    """Return a model with the intervals of its effects' parameters and its error, N, attached."""
    known: dict[str, dict[str, tuple[float, float]]] = {}
    for estimate in found:
        owner, _, name = estimate.key.partition('.')
        known.setdefault(owner, {})[name] = estimate.si_interval
    effects = []
    for effect in model.effects:
        copy = effect.replace()
        copy.intervals = {**effect.intervals, **known.get(effect.name, {})}
        effects.append(copy)
    return Bundle(model.name, model.motor_units, effects, error, model.notes)
