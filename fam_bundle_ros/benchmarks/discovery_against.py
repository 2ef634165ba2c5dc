# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Sparse regression on the cases of the discovery benchmark: LASSO and pysindy's STLSQ.

Both get the same dictionary as `diagnose`: the force of each effect of the catalogue at its usual
size, and the sensitivities to the model's own parameters.
"""

import importlib.util
from typing import Any

import numpy as np

from fam_bundle_ros.benchmarks import discovery_cases as make
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.options import head, Options
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Place

_Dictionary = tuple[list[str], np.ndarray, np.ndarray]


def dictionary(case: make.Case) -> _Dictionary:
    """Return names, standardised columns (T, m) and the whitened residual (T,) of a case."""
    cells = reduce(case.model, case.data)
    options = Options.of(case.model, cells, Choices())
    search = Search(options)
    base = search.fitter.without_discrepancy(search.fit(options.own))
    names, columns = [p.key for p in base.priors], list(base.slopes.T)
    for name, effect in options.effects.items():
        if name in options.own:
            continue
        lively = effect
        if effect.place is Place.SENSOR:
            first = effect.parameters[0]
            lively = effect.replace(**{first.name: 0.1 * first.upper * first.scale})
        with_it = cells.mean(base.model.with_effect(lively).predict(cells.motion))
        names.append(name)
        columns.append(with_it - (cells.force - base.residual))
    table = np.stack(columns, -1)
    size = table.std(axis=0)
    keep = size > 1e-9
    table = (table[:, keep] - table[:, keep].mean(axis=0)) / size[keep]
    target = base.residual / cells.noise
    return [n for n, k in zip(names, keep) if k], table, target - target.mean()


def lasso(names: list[str], table: np.ndarray, target: np.ndarray) -> dict[str, float]:
    """Return the terms that a cross-validated LASSO selects, with their coefficients."""
    from sklearn.linear_model import LassoCV
    fitted = LassoCV(cv=5, alphas=30, max_iter=3000).fit(table, target)
    return {n: float(c) for n, c in zip(names, fitted.coef_) if abs(c) > 1e-3}


def stlsq(names: list[str], table: np.ndarray, target: np.ndarray) -> dict[str, float]:
    """Return the terms that pysindy's STLSQ selects, with their coefficients."""
    import pysindy
    fitted = pysindy.STLSQ(threshold=0.2, alpha=1e-3).fit(table, target[:, None])
    return {n: float(c) for n, c in zip(names, np.ravel(fitted.coef_)) if c != 0}


#: Name of a method -> function, and the package that it needs.
_METHODS = {'lasso': (lasso, 'sklearn'), 'pysindy stlsq': (stlsq, 'pysindy')}


def methods() -> list[str]:
    """Return the methods whose packages are installed; InputError when none is."""
    found = [name for name, (_, package) in _METHODS.items() if importlib.util.find_spec(package)]
    if not found:
        raise InputError('--against: expected scikit-learn or pysindy to be installed')
    return found


def against(cases: int) -> dict[str, dict[str, Any]]:
    """
    Return, by method, how often the true effect is first, and the number of selected terms.

    The number of cases is per kind of data and form of the hidden effect.
    """
    found: dict[str, list[tuple[bool, int]]] = {name: [] for name in methods()}
    for form in ('same', 'other'):
        for kind, names in make.HIDEABLE.items():
            for k in range(cases):
                hidden = names[k % len(names)]
                case = make.make_case(kind, k, (hidden,), form)
                terms = dictionary(case)
                right = {hidden, *make.SAME_PHYSICS.get(hidden, ())}
                for name, rows in found.items():
                    kept = {key: size for key, size in _METHODS[name][0](*terms).items()
                            if '.' not in key}
                    first = max(kept, key=lambda key: abs(kept[key]), default='')
                    rows.append((bool(first) and head(first) in right, len(kept)))
    return {name: {'first_right': round(float(np.mean([r for r, _ in rows])), 3),
                   'terms_mean': round(float(np.mean([n for _, n in rows])), 1),
                   'cases': len(rows)} for name, rows in found.items() if rows}
