# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Results of a diagnosis: verdict, effects, ranking, ties, regions of error, next experiment."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.noise import NoiseFloor
from fam_bundle_ros.data.protocol import Protocol
from fam_bundle_ros.discovery import empirical_surface
from fam_bundle_ros.discovery.compare import Comparison
from fam_bundle_ros.discovery.estimates import Estimate
from fam_bundle_ros.discovery.held_out import HeldOut
from fam_bundle_ros.discovery.leftover import Leftover
from fam_bundle_ros.discovery.locate import Region
from fam_bundle_ros.discovery.posterior import LikelySet, Trade
from fam_bundle_ros.discovery.templates import SHARE, Template
from fam_bundle_ros.jsonfile import Answer
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.told import Told

VERDICTS = ('adequate', 'recalibrate', 'missing_effect', 'partial', 'unexplained')
#: Words for each kind of `Recommended`.
KINDS = {'physics': 'effects alone', 'discrepancy': 'effects with the discrepancy',
         empirical_surface.NAME: 'effects corrected to the empirical form and a surface of its '
                                 'residual'}


@dataclass(frozen=True)
class Candidate:
    """
    One effect of the ranking.

    Attributes
    ----------
    effect, shape : str
        Name of the physical effect, and of its best fitting shape (often the same).
    family : str
    probability : float
        Over all sets of effects that were fitted.
    error_N : float
        Rms error of the most probable set with the effect.
    score : float
        Log posterior of the best set minus that of this set.
    parameters : tuple of Estimate
    reason : str
        The feature of the error that is typical of the effect.
    replaces : str
        Effect of the model that it replaces; empty for an effect that is added.
    removes : bool
        True if the candidate is to remove this effect from the model.
    beside : tuple of str
        Of an effect that is not named, the others in its most probable set: `error_N` and
        ``probability`` may be due to them.
    """

    effect: str
    shape: str
    family: str
    probability: float
    error_N: float
    score: float
    parameters: tuple[Estimate, ...]
    reason: str
    replaces: str = ''
    removes: bool = False
    beside: tuple[str, ...] = ()

    @property
    def why(self) -> str:
        """The reason, and the effects that the most probable set has beside this one."""
        others = f'(together with {", ".join(self.beside)})' if self.beside else ''
        return ' '.join(filter(None, [self.reason, others]))

    @property
    def label(self) -> str:
        """The effect, with its shape if that has another name."""
        if self.replaces or self.removes:
            return f'{self.shape} for {self.replaces}' if self.replaces else f'no {self.shape}'
        return self.effect if self.shape == self.effect else f'{self.effect} as {self.shape}'

    def to_dict(self) -> dict[str, Any]:
        """Return the entry as JSON has it."""
        return {'effect': self.effect, 'shape': self.shape, 'family': self.family,
                'probability': self.probability, 'error_N': self.error_N,
                'score': self.score, 'reason': self.reason, 'beside': list(self.beside),
                'replaces': self.replaces, 'removes': self.removes,
                'parameters': {e.key.partition('.')[2]: {
                    'value': e.value, 'unit': e.unit, 'interval': list(e.interval),
                    'flag': e.flag} for e in self.parameters}}


@dataclass(frozen=True, repr=False)
class Recommended(Told):
    """
    The model for predictions and control; see `add.recommend`.

    Attributes
    ----------
    model : Bundle
        The physics, without ``leftover``.
    effects : tuple of str
        All effects of the model.
    kind : str
        ``physics``; ``discrepancy``: with a surface of its residual; ``empirical_surface``: with
        the difference to the `EmpiricalSurface`, which predicts better than the effects.
    leftover : Leftover or None
        The table to add to it.
    held_out_N, held_out_physics_N, held_out_discrepancy_N : float
        Held-out errors of the recommended model, of physics alone, and with the discrepancy.
    rivals_N : dict of str to float
        Held-out errors of rivals, see `HeldOut`.
    """

    model: Bundle
    effects: tuple[str, ...]
    kind: str
    leftover: Leftover | None
    held_out_N: float
    held_out_physics_N: float
    held_out_discrepancy_N: float
    rivals_N: dict[str, float]

    def __str__(self) -> str:
        rivals = self.rivals_N
        beside = {'effects alone': self.held_out_physics_N,
                  'with the discrepancy': self.held_out_discrepancy_N,
                  'six-parameter empirical form': rivals['empirical'], 'plane': rivals['plane'],
                  'mean force': rivals['mean']}
        return (f"recommended: {KINDS[self.kind]} ({', '.join(self.effects)}): "
                f'{self.held_out_N:.3g} N on held-out folds; '
                + ', '.join(f'{words} {value:.3g} N' for words, value in beside.items())
                + ('; for control use the effects alone (add): the correction bends between the '
                   'measured strains' if self.kind == empirical_surface.NAME else ''))

    def save(self, path: str | Path) -> tuple[Path, ...]:
        """Write the model file, and its table beside it; return the paths."""
        from fam_bundle_ros.model import catalogue, save_model
        path = Path(path)
        if self.leftover is None:
            save_model(self.model, path)
            return (path,)
        table = path.with_name(f'{path.stem}.discrepancy.csv')
        self.leftover.write(table)
        effect = catalogue.get('discrepancy_surface')(table=table.name, folder=path.parent)
        whole = self.model.with_effect(effect)
        save_model(whole.named(whole.name, error=self.held_out_N), path)
        return path, table

    def to_dict(self) -> dict[str, Any]:
        """Return the entry as the JSON has it."""
        return {'effects': list(self.effects), 'kind': self.kind,
                'held_out_N': self.held_out_N, 'held_out_physics_N': self.held_out_physics_N,
                'held_out_discrepancy_N': self.held_out_discrepancy_N,
                'rivals_N': dict(self.rivals_N)}


@dataclass(frozen=True, repr=False)
class Diagnosis(Answer):
    """
    What a model is missing, judged on a measurement.

    Attributes
    ----------
    verdict : str
        One of `VERDICTS`.
    measurement : Measurement
        The rows that were judged: if a reading jumped during the log, without the jump.
    summary : str
        The verdict in a sentence.
    effects, shapes : tuple of str
        The chosen effects in the order found, and the shape of each; empty unless the verdict is
        ``missing_effect`` or ``partial``.
    replaced : dict of str to str
        Effects of the model to replace -> their replacement.
    removed : tuple of str
        Effects of the model to remove.
    error_N : dict
        ``model``, ``recalibrated``, ``best``: rms over all rows.
    noise : NoiseFloor
    ranking : tuple of Candidate
    tied : tuple of tuple of str
        Effects that these data cannot distinguish.
    located : tuple of Region
        Where the model fails, largest first.
    next_experiment : str
    next_protocol : Protocol or None
        The protocol of the next experiment, if it is a force test.
    parameters : tuple of Estimate
        Of the best model.
    moved : dict
        Shifts of the best model's own parameters, in tolerances.
    best, recalibrated : Bundle
    shapes_left : tuple of Template
        Simple shapes that the remaining error resembles; empty for a verdict that leaves none.
    notes : tuple of str
    rows_left_out : int
        Spikes, rows whose direction of motion is not known, and rows of visits beyond the largest
        number of cells.
    confounding : tuple
        Parameter keys and the matrix of correlations of their estimates.
    held_out : HeldOut
        Cross-validation errors.
    recommended : Recommended
    artefacts : tuple of str
        Errors of how the data were taken, such as a drift, which no effect explains.
    leftover, leftover_before : Leftover
        Maps of the discrepancy of the best model, and of the recalibrated model as given.
    likely : tuple of LikelySet
        The most probable sets of effects, and the chosen one.
    traded : tuple of Trade
        Named changes, and other changes that together can replace them.
    ladder : list of dict
        The steps from the model as given to the best one: ``step``, ``error_N``, ``held_out_N``.
    """

    verdict: str
    summary: str
    model: Bundle
    measurement: Measurement
    comparison: Comparison
    effects: tuple[str, ...]
    shapes: tuple[str, ...]
    replaced: dict[str, str]
    removed: tuple[str, ...]
    error_N: dict[str, float]
    noise: NoiseFloor
    ranking: tuple[Candidate, ...]
    tied: tuple[tuple[str, ...], ...]
    located: tuple[Region, ...]
    next_experiment: str
    parameters: tuple[Estimate, ...]
    moved: dict[str, float]
    best: Bundle
    recalibrated: Bundle
    shapes_left: tuple[Template, ...]
    notes: tuple[str, ...]
    rows_left_out: int
    confounding: tuple[list[str], np.ndarray] = field(repr=False)
    held_out: HeldOut
    recommended: Recommended
    leftover: Leftover = field(repr=False)
    leftover_before: Leftover = field(repr=False)
    likely: tuple[LikelySet, ...]
    traded: tuple[Trade, ...] = ()
    ladder: list[dict[str, Any]] = field(default_factory=list)
    artefacts: tuple[str, ...] = ()
    seconds: float = 0.0
    next_protocol: Protocol | None = None

    def __str__(self) -> str:
        lines = [f'{self.verdict}: {self.summary}',
                 *(f'check first: {slip}' for slip in self.comparison.slips),
                 f"error {self.error_N['model']:.3g} N as it is, "
                 f"{self.error_N['recalibrated']:.3g} N recalibrated, "
                 f"{self.error_N['best']:.3g} N at best; {self.noise}", str(self.recommended)]
        if self.shortlist:
            lines.append(self.shortlist_title)
            for entry in self.shortlist:
                lines.append(f'  {entry.label:<26} p {entry.probability:5.2f}  '
                             f'{entry.error_N:8.3g} N   {entry.why}')
        for group in self.tied:
            lines.append('tied: ' + ', '.join(group))
        lines += [f'tied: {trade}' for trade in self.traded]
        if self.parameters:
            lines.append('parameters of the best model')
            lines += [f'  {estimate}' for estimate in self.parameters]
        if self.shapes_left:
            lines.append(f'the error that is left looks like (% {SHARE})')
            lines += [f'  {template}' for template in self.shapes_left]
        if self.located:
            lines.append('where the model fails')
            lines += [f'  {region}' for region in self.located]
        lines.append(f'next: {self.next_experiment}')
        return '\n'.join(lines + [f'note: {note}' for note in self.notes])

    @property
    def shortlist(self) -> tuple[Candidate, ...]:
        """
        The first six of ``ranking`` that are named or have a probability of at least 0.005.

        Empty if no effect is missing.
        """
        if self.verdict in ('adequate', 'recalibrate'):
            return ()
        return tuple(entry for entry in self.ranking
                     if entry.effect in self.effects or entry.replaces in self.replaced
                     or entry.probability >= 0.005)[:6]

    @property
    def shortlist_title(self) -> str:
        """Title of the shortlist."""
        return ('nearest in the catalogue, none of them the answer'
                if self.verdict == 'unexplained' else 'candidates')

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers, lists and text."""
        return {
            'verdict': self.verdict, 'summary': self.summary, 'model': self.model.name,
            'data': self.measurement.name, 'data_sha256': self.measurement.sha256,
            'samples': len(self.measurement), 'noise_floor_N': self.noise.value,
            'noise': self.noise.to_dict(), 'error_N': dict(self.error_N),
            'effects': list(self.effects), 'shapes': list(self.shapes),
            'replaced': dict(self.replaced), 'removed': list(self.removed),
            'recommended': self.recommended.to_dict(), 'artefacts': list(self.artefacts),
            'ranking': [entry.to_dict() for entry in self.ranking],
            'sets': [each.to_dict() for each in self.likely],
            'tied': [list(group) for group in self.tied]
            + [list(trade.labels) for trade in self.traded],
            'traded': [trade.to_dict() for trade in self.traded],
            'located': [region.to_dict() for region in self.located],
            'next_experiment': self.next_experiment,
            'parameters': {e.key: e.to_dict() for e in self.parameters},
            'tolerances_moved': dict(self.moved),
            'shapes_left': [template.to_dict() for template in self.shapes_left],
            'ladder': self.ladder, 'notes': [*self.comparison.slips, *self.notes],
            'rows_left_out': self.rows_left_out,
            'confounding': {'parameters': self.confounding[0],
                            'correlation': np.round(self.confounding[1], 4).tolist()},
            'seconds': self.seconds}

    def to_frame(self) -> Any:
        """Return the ranking as a pandas DataFrame."""
        import pandas
        return pandas.DataFrame([{
            'effect': c.effect, 'shape': c.shape, 'family': c.family,
            'probability': c.probability, 'error [N]': c.error_N, 'score': c.score,
            'parameters': '; '.join(str(e) for e in c.parameters), 'reason': c.why}
            for c in self.ranking])

    def figure(self) -> Any:
        """Return the plotly figure of the candidates (extra `tools`)."""
        from fam_bundle_ros.discovery import figures
        return figures.diagnosis(self)
