# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Discovery on measured muscles: diagnosis on a part of the rows, score on the others.

Every ``NAME.csv`` of a folder with a ``NAME.model.yaml`` is used. Held out are inner strain levels
one by one, and random draws of inner isobars or of trials; the six-parameter empirical form is
fitted to and scored on the same rows.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
import tempfile
from typing import Any

import numpy as np

from fam_bundle_ros.campaign.pool import each, Progress
from fam_bundle_ros.data.folds import fold_labels
from fam_bundle_ros.data.grouping import pressure_levels, rms, varying_unit
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.reading import read_measurement
from fam_bundle_ros.discovery.diagnose import diagnose
from fam_bundle_ros.discovery.options import family
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.rivals import empirical
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, load_model

#: Number of seeded draws, and of isobars or trials that each holds out (fewer if there are few).
DRAWS, AWAY = 10, 5


@dataclass(frozen=True)
class Split:
    """A measurement with held-out rows ``test``, (T,) bool, and their description ``away``."""

    data: Path
    model: Path
    away: str
    test: np.ndarray


def measured(folder: Path) -> list[tuple[Path, Path]]:
    """Return the measurements of a folder with their model files; InputError for none."""
    found = [(data, data.with_name(f'{data.stem}.model.yaml'))
             for data in sorted(folder.glob('*.csv'))]
    found = [(data, model) for data, model in found if model.exists()]
    if not found:
        raise InputError(f'{folder}: no measurement NAME.csv with a model NAME.model.yaml')
    return found


def splits(data: Measurement, draws: int = DRAWS) -> Iterator[tuple[str, np.ndarray]]:
    """
    Yield the description of the held-out rows, and the rows, (T,) bool.

    Of a static map: inner strain levels one by one and draws of inner isobars. Of a log: draws of
    trials. The draws have the seeds 0, 1, ...
    """
    if data.is_static:
        label = fold_labels(data, 'strain', len(data))
        for k in range(label.max() + 1):
            here = label == k
            yield f'strain {data.strain[here].mean():.3f}', here
        level, means = pressure_levels(data.pressure[:, varying_unit(data)])
        kind, inner = 'isobars', np.arange(1, len(means) - 1)
    else:
        level, kind, inner = data.trial, 'trials', np.arange(len(data.trial_names))
    count = min(AWAY, len(inner) // 3)
    for seed in range(draws if count else 0):
        chosen = np.random.default_rng(seed).choice(inner, count, replace=False)
        yield f'{count} {kind}, draw {seed}', np.isin(level, chosen)


def score(split: Split, choices: Choices | None = None) -> dict[str, Any]:
    """
    Diagnose without the held-out rows and return the errors on them.

    Returns
    -------
    dict
        ``data``, ``away``, ``verdict``, ``effects``, ``ties`` (trades too), ``families`` of all
        these effects, ``held_out_N`` of the recommended model, ``physics_N`` of its effects alone,
        ``empirical_N``, and ``ratio`` of ``held_out_N`` to ``empirical_N``.
    """
    data, model = read_measurement(split.data), load_model(split.model)
    train, test = data.select(~split.test), data.select(split.test)
    result = diagnose(model, train, choices=choices)
    rival = empirical(train.strain, train.pressure, train.force, np.ones(len(train)))
    errors = {'held_out_N': rms(test.force - predict(_written(result.recommended), test)),
              'physics_N': rms(test.force - predict(result.recommended.model, test)),
              'empirical_N': rms(test.force - rival(test.strain, test.pressure))}
    named = sorted({*result.effects, *result.replaced.values()})
    ties = [*map(list, result.tied), *(list(trade.labels) for trade in result.traded)]
    return {'data': split.data.stem, 'away': split.away, 'verdict': result.verdict,
            'effects': named, 'ties': ties,
            'families': sorted({family(name) for group in (named, *ties) for name in group}),
            **errors,
            'ratio': errors['held_out_N'] / errors['empirical_N']}


def benchmark(folder: Path, processes: int | None = None, draws: int = DRAWS,
              progress: Progress = None, scheduler: str | None = None) -> dict[str, Any]:
    """
    Score every split of every measurement of a folder.

    Parameters
    ----------
    processes : int, optional
        All cores by default.
    progress : callable, optional
        Called with the number of splits done and the number of splits.
    scheduler : str, optional
        Address of a Dask scheduler whose workers score the splits.

    Returns
    -------
    dict
        ``rows`` worst ratio first, and ``summary``.
    """
    todo = [Split(data, model, away, rows) for data, model in measured(folder)
            for away, rows in splits(read_measurement(data), draws)]
    rows = each(score, todo, processes, progress, scheduler)
    rows.sort(key=lambda row: -row['ratio'])
    return {'rows': rows, 'summary': summary(rows)}


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """
    Return the figures of all splits.

    Returns
    -------
    dict
        ``splits``, ``named``; ``worst`` and ``median`` ratio of the error on held-out rows to the
        empirical form's, ``worst_physics`` and ``median_physics`` of effects alone; ``always``,
        by measurement: families that are named, or tied with a named one, on every split.
    """
    ratio = np.array([row['ratio'] for row in rows])
    physics = np.array([row['physics_N'] / row['empirical_N'] for row in rows])
    families: dict[str, set[str]] = {}
    for row in rows:
        families[row['data']] = families.get(row['data'], set(row['families'])) & {
            *row['families']}
    return {'splits': len(rows), 'named': sum(bool(row['effects']) for row in rows),
            'worst': float(ratio.max()), 'median': float(np.median(ratio)),
            'worst_physics': float(physics.max()), 'median_physics': float(np.median(physics)),
            'always': {name: tuple(sorted(always)) for name, always in families.items()}}


def _written(recommended: Any) -> Bundle:
    """Return the recommended model as read from its file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'recommended.yaml'
        recommended.save(path)
        return load_model(path)
