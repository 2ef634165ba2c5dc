# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Statistics over many muscles: how often an effect is missing, and which numbers correlate.

Shares have Wilson's interval. The dependence of a parameter on a number of the table of specimens
is a meta-regression of logarithms: each muscle has the error of its fit, plus a scatter between
muscles. p values are corrected for the number of tests (Holm).

References
----------
E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209. R. DerSimonian, N. Laird, Control. Clin. Trials 7
(1986) 177. G. Knapp, J. Hartung, Stat. Med. 22 (2003) 2693. S. Holm, Scand. J. Stat. 6 (1979) 65.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fam_bundle_ros.discovery.specimen_table import dimension_of

#: Least number of muscles for a trend: two determine a line, a third hardly the scatter.
LEAST = 4
#: Standard deviations of a 95 % interval.
_95 = 1.96
#: Least relative error of a fitted parameter; at a bound an interval may have no width.
_LEAST_ERROR = 1e-3

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Share:
    """
    Share of the muscles that lack an effect.

    Attributes
    ----------
    effect : str
    muscles : int
        Number of muscles for which it is named in at least half of the recordings.
    of : int
        Number of all muscles.
    low, high : float
        95 % interval of the share.
    tied : int
        Number of muscles for which it is in a tie in at least half of the recordings.
    """

    effect: str
    muscles: int
    of: int
    low: float
    high: float
    tied: int


@dataclass(frozen=True)
class Contrast:
    """
    Comparison of muscles that lack an effect with the others, in one number of the table.

    Attributes
    ----------
    effect, fact : str
    lacking, others : int
        Numbers of muscles.
    median_lacking, median_others : float
        Medians of the fact.
    p : float
        p value of the Mann-Whitney test, corrected for the number of tests.
    """

    effect: str
    fact: str
    lacking: int
    others: int
    median_lacking: float
    median_others: float
    p: float

    def __str__(self) -> str:
        return (f'{self.effect}: median {self.fact} {self.median_lacking:.4g} where it is '
                f'missing, {self.median_others:.4g} where not')


@dataclass(frozen=True)
class Trend:
    """
    A power law of a parameter in a number of the table, value = factor * fact ** power.

    Attributes
    ----------
    parameter, unit, fact : str
    fact_values, values, low, high : tuple of float
        For each muscle, with 95 % intervals of the values.
    power, power_low, power_high : float
        Exponent with 95 % interval.
    factor : float
    scatter : float
        Relative standard deviation of the muscles about the line beyond the errors of their fits.
    p : float
        p value of the hypothesis that the power is zero, corrected for the number of tests.
    """

    parameter: str
    unit: str
    fact: str
    fact_values: tuple[float, ...]
    values: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    power: float
    power_low: float
    power_high: float
    factor: float
    scatter: float
    p: float

    def __str__(self) -> str:
        return (f'{self.parameter} goes with {self.fact} to the power {self.power:.2g} '
                f'({self.power_low:.2g} to {self.power_high:.2g}, {len(self.values)} muscles)')


def shares(effects: Sequence[Row], muscles: Mapping[str, int]) -> list[Share]:
    """
    Return the share of muscles that lack each effect, the most frequent first.

    ``effects`` are the `tables.effect_rows` of all recordings that count, ``muscles`` has the
    number of such recordings for each muscle.
    """
    from scipy import stats
    named, tied = (_lacking(effects, muscles, kind) for kind in ('named', 'tied'))
    found = []
    for name in sorted({*named, *tied}):
        count = len(named.get(name, ()))
        interval = stats.binomtest(count, len(muscles)).proportion_ci(0.95, 'wilson')
        found.append(Share(name, count, len(muscles), float(interval.low), float(interval.high),
                           len(tied.get(name, ()))))
    return sorted(found, key=lambda share: (-share.muscles, share.effect))


def contrasts(effects: Sequence[Row], muscles: Mapping[str, int],
              facts: Mapping[str, Mapping[str, float]]) -> list[Contrast]:
    """
    Compare each number of the table between muscles with and without each effect.

    ``facts`` are the numbers of the table for each muscle, the rest as in `shares`. The contrasts
    are in the order of p; there is one only if both groups have at least `LEAST` muscles.
    """
    from scipy import stats
    found = []
    for name, lacking in sorted(_lacking(effects, muscles, 'named').items()):
        for fact in sorted({key for each in facts.values() for key in each}):
            values = [np.array([facts[m][fact] for m in muscles
                                if (m in lacking) is kind and fact in facts.get(m, {})])
                      for kind in (True, False)]
            if min(map(len, values)) < LEAST or len(np.unique(np.concatenate(values))) < 2:
                continue
            p = float(stats.mannwhitneyu(*values).pvalue)
            found.append(Contrast(name, fact, len(values[0]), len(values[1]),
                                  float(np.median(values[0])), float(np.median(values[1])), p))
    return _clearest_first(found)


def trends(parameters: Sequence[Row], facts: Mapping[str, Mapping[str, float]]) -> list[Trend]:
    """
    Return the power law of each parameter in each number of the table, in the order of p.

    ``parameters`` are the `tables.parameter_rows` of all recordings that count. Those that the
    data do not determine are omitted, and dimensions as a function of dimensions, as both are in
    the table. Of ``facts``, the numbers of the table for each muscle, only values above 0 are
    used.
    """
    from scipy import stats
    found = []
    rows: dict[str, list[Row]] = {}
    for row in parameters:
        rows.setdefault(row['parameter'], []).append(row)
    names = sorted({name for each in facts.values() for name in each})
    for key, own in sorted(rows.items()):
        values, unit = per_muscle(own), own[0]['unit']
        for fact in names:
            if key.startswith('geometry.') and dimension_of(fact.partition(' [')[0]):
                continue
            chosen = [m for m in values if facts.get(m, {}).get(fact, 0.0) > 0.0]
            x = np.array([facts[m][fact] for m in chosen])
            if len(chosen) < LEAST or len(np.unique(x)) < 2:
                continue
            y, s = np.array([values[m] for m in chosen]).T
            power, error, scatter, start, p = power_law(np.log(x), y, s)
            reach = error * float(stats.t.ppf(0.975, len(x) - 2))
            found.append(Trend(
                key, unit, fact, tuple(x.tolist()), tuple(np.exp(y).tolist()),
                tuple(np.exp(y - _95 * s).tolist()), tuple(np.exp(y + _95 * s).tolist()),
                power, power - reach, power + reach, float(np.exp(start)), scatter, p))
    return _clearest_first(found)


def per_muscle(rows: Sequence[Row]) -> dict[str, tuple[float, float]]:
    """
    Return the logarithm of a parameter and its standard error for each muscle.

    The estimates are those without the prior, which would reduce the differences between muscles.
    Recordings of one muscle are averaged, weighted by their errors; the error of the mean is the
    larger of the propagated error and that from their scatter. If any value is not above 0, the
    parameter is omitted: the result is empty.
    """
    sure = [row for row in rows if row['sure']]
    if any(row['data_value'] <= 0.0 for row in sure):
        return {}
    found = {}
    for muscle in dict.fromkeys(row['muscle'] for row in sure):
        own = [row for row in sure if row['muscle'] == muscle]
        y = np.log([row['data_value'] for row in own])
        s = np.array([max(_log_error(row), _LEAST_ERROR) for row in own])
        weight = 1.0 / s ** 2
        mean = float(weight @ y / weight.sum())
        error = 1.0 / weight.sum()
        if len(own) > 1:
            error = max(error, float(np.var(y, ddof=1)) / len(own))
        found[muscle] = (mean, float(np.sqrt(error)))
    return found


def power_law(x: np.ndarray, y: np.ndarray, s: np.ndarray
              ) -> tuple[float, float, float, float, float]:
    """
    Fit y = a + b x with errors s and an additional scatter of the muscles.

    The scatter is estimated by moments (DerSimonian and Laird), the error of b after Knapp and
    Hartung: valid for few muscles, and if all errors s are too small or too large by a factor.

    Parameters
    ----------
    x, y, s : ndarray (n,)
        Logarithms, and standard errors of y.

    Returns
    -------
    power, error, scatter, start, p : float
        b, its standard error (n - 2 degrees of freedom), the scatter, a, and the p value of b = 0.
    """
    from scipy import stats
    design = np.stack([np.ones(len(x)), x], -1)

    def fit(weight: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        inverse = np.linalg.inv(design.T * weight @ design)
        beta = inverse @ (design.T * weight @ y)
        return beta, inverse, float(weight @ (y - design @ beta) ** 2)

    weight = s ** -2.0
    _, inverse, q = fit(weight)
    trace = weight.sum() - np.trace(inverse @ (design.T * weight ** 2 @ design))
    between = max(0.0, (q - (len(x) - 2)) / trace)
    beta, inverse, q = fit(1.0 / (s ** 2 + between))
    # from the residuals about the line, not from the errors of the fits: an error common to all
    # fits (a tie, correlated parameters) shifts the line but does not change its slope
    error = float(np.sqrt(inverse[1, 1] * max(q / (len(x) - 2), _LEAST_ERROR ** 2)))
    p = 2.0 * float(stats.t.sf(abs(beta[1]) / error, len(x) - 2))
    return float(beta[1]), error, float(np.sqrt(between)), float(beta[0]), p


def holm(p: Sequence[float]) -> list[float]:
    """
    Return p values corrected for their number (Holm's method).

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    order = sorted(range(len(p)), key=lambda k: p[k])
    found, largest = [0.0] * len(p), 0.0
    for place, k in enumerate(order):
        largest = max(largest, min(1.0, (len(p) - place) * p[k]))
        found[k] = largest
    return found


def _lacking(effects: Sequence[Row], muscles: Mapping[str, int], kind: str
             ) -> dict[str, set[str]]:
    """Return by effect the muscles with it named (or tied) in at least half of the recordings."""
    count = Counter((row['effect'], row['muscle']) for row in effects if row[kind])
    found: dict[str, set[str]] = {}
    for (effect, muscle), many in count.items():
        if 2 * many >= muscles[muscle]:
            found.setdefault(effect, set()).add(muscle)
    return found


def _log_error(row: Row) -> float:
    """Return the standard error of a parameter's logarithm, from its interval."""
    value, low, high = (row[f'data_{name}'] for name in ('value', 'low', 'high'))
    if low > 0.0:
        return float(np.log(high / low)) / (2.0 * _95)
    return float((high - low) / (2.0 * _95 * value))


def _clearest_first(found: list[Any]) -> list[Any]:
    """Return contrasts or trends in the order of p, which is corrected for their number."""
    return sorted((replace(each, p=p) for each, p in zip(found, holm([e.p for e in found]))),
                  key=lambda each: (each.p, str(each)))
