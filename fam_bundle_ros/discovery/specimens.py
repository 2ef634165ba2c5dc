# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
One diagnosis of several specimens: the same effects in all, dimensions and offsets of each.

    table = read_specimens('specimens.csv')
    result = diagnose_specimens(load_model('model.yaml'), table)

Each specimen is searched separately; the sets of effects are then compared by the evidence of all
specimens together. A parameter either has the same value in all specimens (a constant of the
material) or not; then it may depend on a dimension.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import csv
from dataclasses import dataclass, field
from pathlib import Path
import re
from typing import Any

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.reading import read_measurement
from fam_bundle_ros.data.recipe import Recipe
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.compare import compare
from fam_bundle_ros.discovery.covariance import Covariance
from fam_bundle_ros.discovery.estimates import estimates, with_intervals
from fam_bundle_ros.discovery.fitter import Fitter
from fam_bundle_ros.discovery.material import Constant, constants, sharings
from fam_bundle_ros.discovery.options import Names, Options, with_name, without
from fam_bundle_ros.discovery.posterior import Change, changes, Posterior
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.reading import recipe_for
from fam_bundle_ros.discovery.search import Progress, Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.processes import on_one_core
from fam_bundle_ros.told import Told
from fam_bundle_ros.units import si_factor

#: Dimensions of the braid that a table may have, with a unit that is convertible to this one.
DIMENSIONS = {'length': 'm', 'radius': 'm', 'diameter': 'm', 'braid_angle': 'deg',
             'wall_thickness': 'm'}
#: Number of sets of each specimen that are compared on all specimens.
_SETS = 6
_HEADER = re.compile(r'^\s*(?P<name>[^\[\]]+?)\s*(\[(?P<unit>[^\]]*)\])?\s*$')


@dataclass(frozen=True)
class Specimen:
    """
    One muscle and its recording.

    Attributes
    ----------
    name : str
    data : path or Measurement
    dimensions : dict of str to float
        ``length``, ``radius``, ``braid_angle``, ``wall_thickness``, as far as known, SI.
    facts : dict of str to float
        All numbers of the table, by header: dimensions, age, supplier's code, ...
    remarks : dict of str to str
        All text of the table, by header: the supplier, a name of the muscle, ...
    units : dict of str to str
        Units by header.
    """

    name: str
    data: Any
    dimensions: Mapping[str, float] = field(default_factory=dict)
    facts: Mapping[str, float] = field(default_factory=dict)
    remarks: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def model(self, nominal: Bundle) -> Bundle:
        """Return a model with the dimensions of this specimen."""
        return nominal.with_parameters({f'geometry.{name}': value
                                        for name, value in self.dimensions.items()})

    def measurement(self, nominal: Bundle) -> Measurement:
        """Return the recording; lengths in it are converted with this specimen's rest length."""
        if isinstance(self.data, Measurement):
            return self.data
        return read_measurement(self.data, recipe=recipe_for(nominal, Recipe(
            rest_length=self.dimensions.get('length'))))


def read_specimens(path: str | Path) -> list[Specimen]:
    """
    Read a table of specimens.

    Parameters
    ----------
    path : str or Path
        CSV with a column ``file`` (relative to the table) and any of ``length [mm]``,
        ``radius [mm]`` or ``diameter [mm]``, ``braid_angle [deg]``, ``wall_thickness [mm]``, in
        any unit, and further numbers (``age [days]``).

    Raises
    ------
    InputError
        Without the column ``file``, for a dimension without unit, or for text as a dimension.
    """
    path = Path(path)
    try:
        with open(path, newline='', encoding='utf-8-sig') as file:
            rows = [row for row in csv.reader(file) if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f'{path}: {error}') from error
    found = [_HEADER.match(cell) for cell in rows[0]] if rows else []
    headers = [(match['name'], match['unit']) if match else ('', None) for match in found]
    names = [name for name, _ in headers]
    if 'file' not in names:
        raise InputError(f"{path}: columns {', '.join(names) or 'none'}; expected one called "
                         "'file', and dimensions such as 'length [mm]'")
    return [_specimen(path, number, headers, row)
            for number, row in enumerate(rows[1:], start=2)]


def _specimen(path: Path, number: int, headers: list[tuple[str, str | None]], row: list[str]
              ) -> Specimen:
    dimensions, facts, remarks, units, file = {}, {}, {}, {}, ''
    for (name, unit), cell in zip(headers, row):
        where = f"{path}, row {number}, column '{name}'"
        if name == 'file':
            file = cell.strip()
        elif cell.strip() and name:
            if unit:
                units[name] = unit
            try:
                value = float(cell)
            except ValueError:
                if name in DIMENSIONS:
                    raise InputError(f"{where}: '{cell}'; expected a number") from None
                remarks[name] = cell.strip()
                continue
            facts[name] = value
            if name in DIMENSIONS:
                if not unit:
                    raise InputError(f"{where} has no unit; expected for example "
                                     f"'{name} [{'deg' if name == 'braid_angle' else 'mm'}]'")
                value *= si_factor(unit, DIMENSIONS[name])
                name, value = ('radius', value / 2) if name == 'diameter' else (name, value)
                dimensions[name] = value
    if not file:
        raise InputError(f'{path}, row {number}: no file; expected the name of a recording')
    return Specimen(Path(file).stem, path.parent / file, dimensions, facts, remarks, units)


@dataclass(frozen=True, repr=False)
class Together(Told):
    """
    Result of the diagnosis of several specimens.

    Attributes
    ----------
    specimens : tuple of Specimen
    changes : tuple of Change
        Against the model as given; empty when no effect is missing.
    tied : tuple of tuple of str
        A shape that was chosen, and those that can replace it.
    probability : dict of str to float
        Probability of each effect, over all sets that were compared.
    constants : tuple of Constant
    models : tuple of Bundle
        For each specimen, fitted with these effects.
    error_N : list of dict
        For each specimen: ``model``, ``recalibrated``, ``best``.
    """

    specimens: tuple[Specimen, ...]
    changes: tuple[Change, ...]
    tied: tuple[tuple[str, ...], ...]
    probability: dict[str, float]
    constants: tuple[Constant, ...]
    models: tuple[Bundle, ...]
    error_N: list[dict[str, float]]

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects that are missing in all specimens, by their heads."""
        return tuple(change.label for change in self.changes if not change.old)

    def __str__(self) -> str:
        lines = [f"missing in all: {', '.join(self.effects) or 'nothing'}"]
        lines += [f"{s.name}: {e['model']:.3g} N as it is, {e['recalibrated']:.3g} N "
                  f"recalibrated, {e['best']:.3g} N at best"
                  for s, e in zip(self.specimens, self.error_N)]
        lines += [f"tied: {', '.join(group)}" for group in self.tied]
        return '\n'.join([*lines, *map(str, self.constants)])

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON has it."""
        return {'effects': list(self.effects),
                'shapes': [c.new for c in self.changes if not c.old],
                'replaced': {c.old: c.new for c in self.changes if c.old and c.new},
                'removed': [c.old for c in self.changes if not c.new],
                'tied': [list(group) for group in self.tied],
                'probability': self.probability,
                'specimens': [{'name': s.name, 'facts': dict(s.facts), 'error_N': e}
                              for s, e in zip(self.specimens, self.error_N)],
                'constants': [c._asdict() for c in self.constants]}


@on_one_core
def diagnose_specimens(model: Bundle, specimens: Sequence[Specimen], *,
                       progress: Progress = None, choices: Choices | None = None) -> Together:
    """
    Find the effects that a model is missing in all of several specimens.

    The log posterior of a set is its log prior, plus the log evidence of every specimen, plus the
    log Bayes factor of constants with a common value in all specimens (see `material`).

    Parameters
    ----------
    model : Bundle
        With nominal dimensions.
    specimens : sequence of Specimen
    progress : callable, optional
        Called with a share from 0 to 1 and the name of the specimen.
    choices : Choices, optional

    Raises
    ------
    InputError
        For fewer than two specimens, or bad data.
    """
    if len(specimens) < 2:
        raise InputError(f'{len(specimens)} specimens; expected two or more')
    choices = choices or Choices()
    lengths = len({specimen.model(model).motor_units[0].geometry.length
                   for specimen in specimens})
    searches, before = [], []
    for k, specimen in enumerate(specimens):
        if progress:
            progress(k / len(specimens), specimen.name)
        own = specimen.model(model)
        comparison = compare(own, specimen.measurement(model))
        before.append(comparison)
        cells = reduce(own, comparison.measurement)
        fitter = Fitter(cells, Covariance(cells, choices.unexplained))
        searches.append(Search(Options.of(own, cells, choices, lengths), fitter).run())
    weighed = _JointPosterior(searches)
    names, answer = weighed.named()
    fits = [search.fitter.without_discrepancy(search.fit(names)) for search in searches]
    nulls = [search.fitter.without_discrepancy(search.null) for search in searches]
    models = tuple(with_intervals(
        fit.model.named(f'{model.name}_{specimen.name}'), estimates(fit),
        float(np.sqrt(np.mean(fit.residual ** 2)))) for fit, specimen in zip(fits, specimens))
    errors = [{'model': each.error_N, **{
        word: rms(each.measurement.force - predict(fit.model, each.measurement))
        for word, fit in (('recalibrated', null), ('best', best))}}
        for each, null, best in zip(before, nulls, fits)]
    facts = [specimen.facts for specimen in specimens]
    return Together(tuple(specimens), tuple(answer), weighed.ties(names, answer, choices.odds),
                    weighed.probability(), tuple(constants(fits, facts)), models, errors)


class _JointPosterior:
    """Log posteriors of sets of effects on all specimens."""

    def __init__(self, searches: list[Search]):
        self.searches = searches
        # a recording that cannot show an effect has no fit with it
        options = [set(search.options.effects) for search in searches]
        self._common = set.intersection(*options)
        sets = {search.options.own for search in searches}
        for search in searches:
            fits = [f for f in Posterior.of(search).fits if set(f.names) <= self._common]
            sets |= {fit.names for fit in fits[:_SETS]}
        self.value = {names: self._log_posterior(names) for names in sets}

    def _log_posterior(self, names: Names) -> float:
        fits = [search.fit(names) for search in self.searches]
        return (fits[0].log_prior + sum(fit.evidence for fit in fits)
                + sum(each.log_factor for each in sharings(fits)))

    def probability(self) -> dict[str, float]:
        """Return the probability of each change, by its label."""
        names = list(self.value)
        log = np.array([self.value[each] for each in names])
        weight = np.exp(log - log.max())
        weight /= weight.sum()
        found: dict[str, float] = {}
        for each, share in zip(names, weight):
            for label in {c.label for c in changes(self.searches[0].options, each)}:
                found[label] = found.get(label, 0.0) + float(share)
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def named(self) -> tuple[Names, list[Change]]:
        """Return the best set reduced to the effects to name, and its changes."""
        options = self.searches[0].options
        names = max(self.value, key=lambda each: self.value[each])
        null = self.value[options.own]
        while True:
            loss = {}
            for change in changes(options, names):
                fewer = change.undone(names)
                if fewer not in self.value:
                    self.value[fewer] = self._log_posterior(fewer)
                loss[change] = self.value[names] - self.value[fewer]
            least = min(loss, key=lambda change: loss[change], default=None)
            needed = max(settings.LEAST_LOSS, settings.LEAST_SHARE * (self.value[names] - null))
            if least is None or loss[least] >= needed:
                return names, sorted(loss, key=lambda change: -loss[change])
            names = least.undone(names)

    def ties(self, names: Names, answer: Sequence[Change], odds: float
             ) -> tuple[tuple[str, ...], ...]:
        """Return groups: a shape of the answer, then the shapes that can replace it."""
        least = self.value[names] - np.log(odds)
        groups = [(change.new, *(other for other in sorted(self._common - set(names))
                                 if self.value.get(with_name(without(names, change.new), other),
                                                   -np.inf) > least))
                  for change in answer if change.new]
        return tuple(group for group in groups if len(group) > 1)
