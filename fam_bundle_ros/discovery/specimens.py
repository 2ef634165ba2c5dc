# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
One diagnosis of several specimens: the same effects in all, dimensions and offsets of each.

    table = read_specimens('specimens.csv')
    result = diagnose_specimens(load_model('model.yaml'), table)

Each specimen is searched separately; the sets of effects are then compared by the evidence of all
specimens together (`joint`). Each specimen has a verdict, as in a single diagnosis. A parameter
either has the same value in all specimens (a constant of the material) or not; then it may depend
on a dimension (`material`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.discovery.diagnose import Judged, Searched
from fam_bundle_ros.discovery.estimates import estimates, with_intervals
from fam_bundle_ros.discovery.held_out import beyond_cells
from fam_bundle_ros.discovery.joint import JointPosterior
from fam_bundle_ros.discovery.material import Constant, constants
from fam_bundle_ros.discovery.options import Change
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.search import Progress
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.discovery.specimen_table import incomplete_columns, Specimen, unused_columns
from fam_bundle_ros.discovery.verdict import Finding
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.processes import on_one_core
from fam_bundle_ros.told import Told


@dataclass(frozen=True)
class Verdict:
    """
    What the effects that were found explain in one recording.

    Attributes
    ----------
    specimen : Specimen
    changes : tuple of Change
        Those that this recording needs; sensor errors are those of its rig.
    tied : tuple of tuple of str
        Groups: a sensor error of this recording, then those that can replace it.
    finding : Finding
    error_N : dict of str to float
        ``model``, ``recalibrated``, ``best``, ``held_out``.
    moved : dict of str to float
        Shifts of the geometry, in tolerances.
    slips : tuple of str
        Mistakes of unit or sign that would explain the error.
    left_out : bool
        Whether it is left out of the constants, as nothing explains it.
    model : Bundle
        Fitted with these effects; without them where the verdict refuses them.
    """

    specimen: Specimen
    changes: tuple[Change, ...]
    tied: tuple[tuple[str, ...], ...]
    finding: Finding
    error_N: dict[str, float]
    moved: dict[str, float]
    slips: tuple[str, ...]
    left_out: bool
    model: Bundle

    @property
    def name(self) -> str:
        """Name of the specimen."""
        return self.specimen.name

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences: left out or not, slips, refusals and warnings."""
        return (*(['left out of the constants'] if self.left_out else []),
                *(f'check first: {slip}' for slip in self.slips),
                *(f'this recording cannot tell apart {" and ".join(group)}'
                  for group in self.tied),
                *self.finding.corrected, *self.finding.refusals, *self.finding.warnings)

    @property
    def moved_words(self) -> str:
        """The shifts of the geometry in words, as far as their first decimal shows them."""
        return ', '.join(f'{key} {u:+.1f}' for key, u in self.moved.items() if round(u, 1)) or '-'

    def __str__(self) -> str:
        e = self.error_N
        return '\n  '.join([
            f'{self.name}: {self.finding.verdict}, {e["model"]:.3g} N as it is, '
            f'{e["recalibrated"]:.3g} N recalibrated, {e["best"]:.3g} N at best, '
            f'{e["held_out"]:.3g} N held out; tolerances moved: {self.moved_words}',
            *self.notes])

    def to_dict(self) -> dict[str, Any]:
        """Return the entry as JSON has it."""
        return {'name': self.name, 'facts': dict(self.specimen.facts),
                'verdict': self.finding.verdict, 'changes': [str(c) for c in self.changes],
                'tied': [list(group) for group in self.tied],
                'error_N': self.error_N, 'tolerances_moved': self.moved,
                'left_out': self.left_out, 'notes': list(self.notes)}


@dataclass(frozen=True, repr=False)
class Together(Told):
    """
    Result of the diagnosis of several specimens.

    Attributes
    ----------
    changes : tuple of Change
        Of the muscle, against the model as given; empty when no effect is missing.
    hidden : dict of str to tuple of str
        Effects (labels) that some recordings cannot show -> names of these specimens.
    tied : tuple of tuple of str
        A shape that was chosen, and those that can replace it.
    probability : dict of str to float
        Probability of each effect of the muscle, over all sets that were compared.
    verdicts : tuple of Verdict
        Of each specimen.
    constants : tuple of Constant
    notes : tuple of str
    """

    changes: tuple[Change, ...]
    hidden: dict[str, tuple[str, ...]]
    tied: tuple[tuple[str, ...], ...]
    probability: dict[str, float]
    verdicts: tuple[Verdict, ...]
    constants: tuple[Constant, ...]
    notes: tuple[str, ...]

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects that are missing in all specimens that can show them, by their heads."""
        return tuple(c.label for c in self.changes if not c.old and c.label not in self.needed)

    @property
    def needed(self) -> dict[str, tuple[str, ...]]:
        """Changes (labels) that only some specimens need -> names of these specimens."""
        labels = {change.label: None for each in self.verdicts if not each.left_out
                  for change in each.changes}
        shared = {change.label for change in self.changes}
        found = {label: tuple(each.name for each in self.verdicts if not each.left_out and
                              any(change.label == label for change in each.changes))
                 for label in labels}
        could = sum(not each.left_out for each in self.verdicts)
        return {label: names for label, names in found.items() if label not in shared
                or len(names) + len(self.hidden.get(label, ())) < could}

    @property
    def models(self) -> tuple[Bundle, ...]:
        """For each specimen, fitted with the effects."""
        return tuple(each.model for each in self.verdicts)

    @property
    def headlines(self) -> list[tuple[str, str]]:
        """Title and text of what is missing, and where."""
        kept = sum(not each.left_out for each in self.verdicts)
        return [('missing in all', ', '.join(self.effects) or 'nothing'),
                *(('changed in all', str(change)) for change in self.changes
                  if change.old and change.label not in self.needed),
                *((f'needed in {len(names)} of {kept}', f"{label} ({', '.join(names)})")
                  for label, names in self.needed.items()),
                *((f'cannot show {label}', ', '.join(names))
                  for label, names in self.hidden.items()),
                *(('tied', ', '.join(group)) for group in self.tied),
                *(('note', note) for note in self.notes)]

    def __str__(self) -> str:
        return '\n'.join([*(f'{title}: {text}' for title, text in self.headlines),
                          *map(str, self.verdicts), *map(str, self.constants)])

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON has it."""
        shared = [c for c in self.changes if c.label not in self.needed]
        return {'effects': list(self.effects),
                'shapes': [c.new for c in shared if not c.old],
                'replaced': {c.old: c.new for c in shared if c.old and c.new},
                'removed': [c.old for c in shared if not c.new],
                'needed': {label: list(names) for label, names in self.needed.items()},
                'hidden': {label: list(names) for label, names in self.hidden.items()},
                'tied': [list(group) for group in self.tied],
                'probability': self.probability,
                'specimens': [each.to_dict() for each in self.verdicts],
                'constants': [each.to_dict() for each in self.constants],
                'notes': list(self.notes)}


@on_one_core
def diagnose_specimens(model: Bundle, specimens: Sequence[Specimen], *,
                       progress: Progress = None, choices: Choices | None = None) -> Together:
    """
    Find the effects that a model is missing in all of several specimens.

    A recording that no set of effects explains is left out of the comparison; it has a verdict.

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
    searched = []
    for k, specimen in enumerate(specimens):
        if progress:
            progress(k / len(specimens), specimen.name)
        searched.append(Searched.of(specimen.model(model), specimen.measurement(model), choices,
                                    lengths=lengths))
    searches = [each.search for each in searched]
    kept = _two_or_more([each.alone().finding for each in searched])
    joint = JointPosterior(searches, kept)
    names, answer = joint.named()
    judged = [each.with_set(fit) for each, fit in zip(searched, joint.reduced(names))]
    told = [k for k in kept if k in _two_or_more([each.finding for each in judged])]
    told = told if len(told) > 1 else kept
    verdicts = tuple(_verdict(model.name, *each, k not in told,
                              joint.error_ties(k, each[-1].chosen, choices.odds))
                     for k, each in enumerate(zip(specimens, searched, judged)))
    hidden = {change.label: tuple(specimens[k].name for k in told
                                  if change.new not in searches[k].options.effects)
              for change in answer if change.new}
    return Together(
        tuple(answer), {label: there for label, there in hidden.items() if there},
        joint.ties(names, answer, choices.odds), joint.probability(), verdicts,
        tuple(constants([judged[k].chosen for k in told], [specimens[k].facts for k in told],
                        [specimens[k].name for k in told], choices.odds)),
        (*unused_columns(specimens), *incomplete_columns(specimens)))


def _two_or_more(findings: Sequence[Finding]) -> list[int]:
    """Return which recordings are explained; all of them if these are fewer than two."""
    found = [k for k, each in enumerate(findings) if each.verdict != 'unexplained']
    return found if len(found) > 1 else list(range(len(findings)))


def _verdict(name: str, specimen: Specimen, searched: Searched, judged: Judged,
             left_out: bool, tied: tuple[tuple[str, ...], ...]) -> Verdict:
    data, final = searched.data, judged.final
    errors = {word: rms(data.force - predict(fit.model, data))
              for word, fit in (('recalibrated', judged.base), ('best', final))}
    cells = searched.search.fitter.cells
    held = judged.held.of_rows(beyond_cells(cells, final, errors['best']))
    return Verdict(
        specimen, tuple(judged.found), tied, judged.finding,
        {'model': searched.comparison.error_N, **errors, 'held_out': held.physics},
        {p.key.partition('.')[2]: float(u) for p, u in zip(final.priors, final.u)
         if p.key.startswith('geometry.')}, searched.comparison.slips, left_out,
        with_intervals(final.model.named(f'{name}_{specimen.name}'), estimates(final),
                       rms(final.residual)))
