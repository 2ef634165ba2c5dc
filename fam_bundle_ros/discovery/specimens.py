# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
One diagnosis of several specimens: the same effects in all, dimensions and offsets of each.

    table = read_specimens('specimens.csv')
    result = diagnose_specimens(load_model('model.yaml'), table)

Each specimen is searched by itself; sets of effects are then weighed by what all say together.
A constant of the material is the same in all specimens; what is not may go with a dimension.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import csv
from dataclasses import dataclass, field
from pathlib import Path
import re
from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.reading import read_measurement
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.compare import compare
from fam_bundle_ros.discovery.covariance import Covariance
from fam_bundle_ros.discovery.estimates import DEAD, estimates, unit_of, with_intervals
from fam_bundle_ros.discovery.evidence import Fit, Fitter
from fam_bundle_ros.discovery.options import Names, Options
from fam_bundle_ros.discovery.posterior import Change, changes, Posterior
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.search import Progress, Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.told import Told
from fam_bundle_ros.units import si_factor

#: Dimensions of the braid that a table may give, in any unit of this kind.
DIMENSIONS = {'length': 'm', 'radius': 'm', 'diameter': 'm', 'braid_angle': 'deg',
             'wall_thickness': 'm'}
#: Sets of each specimen that are weighed on all of them.
_SETS = 6
#: Chance that a constant of the material is said to differ between specimens.
_ALARM = 0.01
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
        ``length``, ``radius``, ``braid_angle``, ``wall_thickness`` where they are known, SI.
    facts : dict of str to float
        These and every other number of the table, by its header: age, supplier's code, ...
    remarks : dict of str to str
        What is no number, by its header: the supplier, a name of the muscle, ...
    units : dict of str to str
        Of the cells whose header has one.
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
        """Return the recording; lengths in it are over this specimen's rest length."""
        if isinstance(self.data, Measurement):
            return self.data
        length = self.dimensions.get('length', nominal.motor_units[0].geometry.length)
        return read_measurement(self.data, rest_length=float(length))


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
        Without that column, for a dimension without unit, or a cell that is no number.
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


class Constant(NamedTuple):
    """
    A parameter of the effects over the specimens.

    Attributes
    ----------
    key, unit : str
    values, sd : list of float
        Of each specimen, in the unit.
    shared : float
        Probability that it is one number, before a fact of the table is asked.
    value : float
        The one number that fits all best, in the unit.
    goes_with : str
        Fact of the table in whose power it goes; empty for none.
    power : float
    """

    key: str
    unit: str
    values: list[float]
    sd: list[float]
    shared: float
    value: float
    goes_with: str
    power: float

    def __str__(self) -> str:
        unit = f' {self.unit}' if self.unit else ''
        if self.shared > 0.5:
            return (f'{self.key} is {self.value:.4g}{unit} in all '
                    f'(probability {self.shared:.2f}): a constant of the material')
        text = ', '.join(f'{value:.4g}' for value in self.values)
        if self.goes_with:
            return (f'{self.key} goes with {self.goes_with} (power {self.power:.2g}: {text}{unit})'
                    ': no constant of the material')
        return f'{self.key} differs ({text}{unit}) and goes with nothing in the table'


@dataclass(frozen=True, repr=False)
class Together(Told):
    """
    What several specimens say together.

    Attributes
    ----------
    specimens : tuple of Specimen
    changes : tuple of Change
        Against the model as given; empty when no effect is missing.
    probability : dict of str to float
        Of each effect, over all sets that were weighed.
    constants : tuple of Constant
    models : tuple of Bundle
        Of each specimen, fitted with these effects.
    error_N : list of dict
        Of each specimen: ``model``, ``recalibrated``, ``best``.
    """

    specimens: tuple[Specimen, ...]
    changes: tuple[Change, ...]
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
        return '\n'.join([*lines, *map(str, self.constants)])

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON has it."""
        return {'effects': list(self.effects),
                'shapes': [c.new for c in self.changes if not c.old],
                'replaced': {c.old: c.new for c in self.changes if c.old and c.new},
                'removed': [c.old for c in self.changes if not c.new],
                'probability': self.probability,
                'specimens': [{'name': s.name, 'facts': dict(s.facts), 'error_N': e}
                              for s, e in zip(self.specimens, self.error_N)],
                'constants': [c._asdict() for c in self.constants]}


def diagnose_specimens(model: Bundle, specimens: Sequence[Specimen], *,
                       progress: Progress = None, choices: Choices | None = None) -> Together:
    """
    Find out which effects a model is missing in all of several specimens.

    The log posterior of a set is that of its prior, plus the log evidence of every specimen, plus
    for each constant of its effects log((1 + B)/2): B is the Bayes factor of one number for all
    against one for each, by the normal approximation of each posterior.

    Parameters
    ----------
    model : Bundle
        With nominal dimensions.
    specimens : sequence of Specimen
    progress : callable, optional
        Called with a share from 0 to 1 and a word.
    choices : Choices, optional

    Raises
    ------
    InputError
        For fewer than two specimens, or bad data.
    """
    if len(specimens) < 2:
        raise InputError(f'{len(specimens)} specimens; expected two or more')
    choices = choices or Choices()
    searches, before = [], []
    for k, specimen in enumerate(specimens):
        if progress:
            progress(k / len(specimens), specimen.name)
        own = specimen.model(model)
        comparison = compare(own, specimen.measurement(model))
        before.append(comparison)
        cells = reduce(own, comparison.measurement)
        fitter = Fitter(cells, Covariance(cells, choices.unexplained))
        searches.append(Search(Options.of(own, cells, choices), fitter).run())
    weighed = _Weighed(searches)
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
    return Together(tuple(specimens), tuple(answer), weighed.probability(),
                    tuple(_constants(fits, specimens)), models, errors)


class _Weighed:
    """Sets of effects by what all specimens say of them."""

    def __init__(self, searches: list[Search]):
        self.searches = searches
        # an effect that one recording cannot show is no option there
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
                + sum(np.log(0.5 + 0.5 * np.exp(min(_one_number(fits, key)[0], 700.0)))
                      for key in _keys(fits)))

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
        """Return the best set without changes that lose too little, and its changes."""
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


def _keys(fits: list[Fit]) -> list[str]:
    """Return the parameters that might be constants of the material: those of force effects."""
    return [prior.key for prior in fits[0].priors if not prior.key.startswith('geometry.')
            and fits[0].model.effect(prior.key.partition('.')[0]).place.value != 'sensor']


def _coordinates(fits: list[Fit], key: str) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return values, their sd, and mean and sd of the prior; logarithms of log-normal ones."""
    values, sd, priors = [], [], []
    for fit in fits:
        place = [prior.key for prior in fit.priors].index(key)
        prior = fit.priors[place]
        centre = np.log(prior.value) if prior.kind == 'log' else prior.value
        values.append(centre + prior.width * fit.u[place])
        sd.append(prior.width * np.sqrt(fit.covariance[place, place]))
        priors.append((centre, prior.width))
    return np.array(values), np.array(sd), priors[0][0], max(width for _, width in priors)


def _one_number(fits: list[Fit], key: str) -> tuple[float, float]:
    """
    Return the log Bayes factor of one number against one for each, and that number.

    With posteriors N(x_i, s_i^2) under the prior N(m, w^2) the likelihoods are normal again.
    """
    x, s, m, w = _coordinates(fits, key)
    # posterior over prior: the likelihood of each specimen, as mean and precision
    precision = np.maximum(1.0 / s ** 2 - 1.0 / w ** 2, 1e-9 / w ** 2)
    mean = m + (x - m) / s ** 2 / precision
    total = precision.sum() + 1.0 / w ** 2
    best = (precision @ mean + m / w ** 2) / total

    def log_evidence(p: np.ndarray, y: np.ndarray) -> float:
        # of likelihoods exp(-p (y - theta)^2 / 2) under the prior, without what both share
        whole = p.sum() + 1.0 / w ** 2
        centre = (p @ y + m / w ** 2) / whole
        square = p @ y ** 2 + m ** 2 / w ** 2 - whole * centre ** 2
        return float(-0.5 * square - 0.5 * np.log(whole * w ** 2))

    each = sum(log_evidence(precision[[i]], mean[[i]]) for i in range(len(x)))
    return log_evidence(precision, mean) - each, float(best)


def _constants(fits: list[Fit], specimens: Sequence[Specimen]) -> list[Constant]:
    """Return how each parameter of the effects goes over the specimens."""
    found = []
    for key in _keys(fits):
        factor, one = _one_number(fits, key)
        x, s, _, w = _coordinates(fits, key)
        if np.all(s > DEAD * w):
            continue
        unit, size = unit_of(fits[0].model, key)
        is_log = next(p for p in fits[0].priors if p.key == key).kind == 'log'
        shared = 1.0 / (1.0 + np.exp(-np.clip(factor, -700.0, 700.0)))
        goes_with, power = ('', 0.0) if shared > 0.5 else _goes_with(x, s, specimens, is_log)
        values = np.exp(x) if is_log else x
        found.append(Constant(
            key, unit, (values / size).tolist(), (s * (values if is_log else 1.0) / size).tolist(),
            float(shared), float(np.exp(one) if is_log else one) / size, goes_with, power))
    return found


def _goes_with(x: np.ndarray, s: np.ndarray, specimens: Sequence[Specimen], is_log: bool
               ) -> tuple[str, float]:
    """
    Return the fact in whose power a parameter goes, and the power; empty for none.

    A straight line of logarithms, weighted; it has to take the scatter down to what the errors
    of the fits make (chi-square), and three specimens are the least that can show that.
    """
    from scipy import stats
    best: tuple[float, str, float] | None = None
    facts = set.intersection(*(set(specimen.facts) for specimen in specimens))
    for fact in sorted(facts):
        t = np.array([specimen.facts[fact] for specimen in specimens])
        positive = is_log or bool(np.all(x > 0.0))
        if len(x) < 3 or np.any(t <= 0.0) or len(np.unique(t)) < 2 or not positive:
            continue
        y, spread = (x, s) if is_log else (np.log(x), s / x)
        line = np.stack([np.ones(len(t)), np.log(t)], -1) / spread[:, None]
        found, _, _, _ = np.linalg.lstsq(line, y / spread, rcond=None)
        left = float(np.sum((y / spread - line @ found) ** 2))
        if stats.chi2.sf(left, len(t) - 2) > _ALARM and (best is None or left < best[0]):
            best = (left, fact, float(found[1]))
    return best[1:] if best is not None else ('', 0.0)
