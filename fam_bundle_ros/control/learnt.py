# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Results of the online adaptation: as sentences, and as a model."""

from collections.abc import Sequence
from dataclasses import replace
import math
from typing import Any

from fam_bundle_ros.control.adaptation import AdaptationSettings, AdaptationState, bounds_of
from fam_bundle_ros.model import Bundle

#: Relative errors, offsets (N) and lags (s) below these are not reported.
_LITTLE, _LITTLE_FORCE, _LITTLE_LAG = 0.01, 0.2, 1e-3
#: The sentence when there is nothing to report.
FITS = 'the model fits'


def learnt_words(settings: AdaptationSettings, state: AdaptationState, names: Sequence[str]
                 ) -> list[str]:
    """
    Return the learnt errors of the model, a sentence each: "MU1 pulls 7 % less than the model".

    Parameters
    ----------
    settings, state : AdaptationSettings, AdaptationState
    names : sequence of str
        Names of the motor units.
    """
    if not settings.enabled:
        return ['adaptation is off']
    n, found = len(names), []
    for name, error in zip(names, state.error):
        if abs(error) >= _LITTLE:
            found.append(f'{name} pulls {abs(error):.0%} {_more(error)} than the model'
                         .replace('%', ' %'))
    push, offset, lag = state.error[n], state.error[n + 1], state.error[n + 2]
    if abs(push) >= _LITTLE:
        found.append(f'compressed muscles push back {abs(push):.0%} {_more(push)} than the model'
                     .replace('%', ' %'))
    if abs(offset) >= _LITTLE_FORCE:
        found.append(f'the force is {abs(offset):.1f} N {_more(offset)} than the model at any '
                     'pressure')
    if lag >= _LITTLE_LAG:
        found.append(f'the force comes {1e3 * lag:.0f} ms after the pressures')
    return found or [FITS]


def wrong_model(settings: AdaptationSettings, state: AdaptationState) -> str:
    """Return a warning where an estimate is at its bound, else an empty string."""
    reached = any(error <= 0.999 * low or error >= 0.999 * high for error, (low, high) in zip(
        state.error[:-1], (bounds_of(settings, k) for k in range(len(state.error)))))
    return ('adaptation is at its bounds: the model is wrong; record some motion and run '
            '`fam_bundle diagnose`') if settings.enabled and reached else ''


def adapted_bundle(bundle: Bundle, state: AdaptationState) -> Bundle:
    """
    Return the model with the learnt gains of tension and push-back.

    Tension is proportional to a muscle's cross-section, the square of its radius. In laws of
    push-back, loads, moments, and shares of the cross-section are scaled by the push-back. Bias
    and lag are not parameters of a muscle model.
    """
    n = bundle.n
    pulls = [1.0 + error for error in state.error[:n]]
    push, mean = 1.0 + state.error[n], sum(pulls) / n
    units = [replace(unit, geometry=replace(unit.geometry,
                                            radius=unit.geometry.radius * math.sqrt(pull)))
             for unit, pull in zip(bundle.motor_units, pulls)]
    effects = [_pushing(effect, push, mean) if effect.law.pushes_back else effect
               for effect in bundle.effects]
    return Bundle(bundle.name, units, effects, bundle.error, bundle.notes)


def _pushing(effect: Any, push: float, pull: float) -> Any:
    values = {}
    for parameter in effect.law.parameters:
        by = push if parameter.unit in ('N', 'N*m') else (
            push / pull if parameter.name.endswith('_share') else 1.0)
        low, high = effect.limits(parameter.name)
        values[parameter.name] = min(max(by * effect.values[parameter.name], low), high)
    return effect.replace(**values)


def _more(value: float) -> str:
    return 'more' if value > 0.0 else 'less'
