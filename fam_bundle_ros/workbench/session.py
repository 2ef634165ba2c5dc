# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
One user's session: a case, the models so far, the last diagnosis, the selection.

Plain Python without a browser; the page only displays this state and calls these methods.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from fam_bundle_ros.data.grouping import pressure_levels, varying_unit
from fam_bundle_ros.discovery import compare, Comparison, Measurement, Region
from fam_bundle_ros.discovery.result import Candidate, Diagnosis
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, catalogue, Effect
from fam_bundle_ros.workbench import changes
from fam_bundle_ros.workbench.cases import Case
from fam_bundle_ros.workbench.changes import Change, Since
from fam_bundle_ros.workbench.incoming import Incoming


@dataclass(frozen=True)
class Step:
    """One model of the ladder."""

    #: Change of the step: ``start``, ``recalibrated``, ``+ coulomb_friction``.
    label: str
    model: Bundle
    #: Of the model after this step, over every sample.
    comparison: Comparison
    #: Error on held-out blocks of data, N rms; nan without such blocks.
    held_out_N: float
    #: Changes since the first model.
    since: Since = Since()
    #: Name of the effect that this step added, '' for none.
    effect: str = ''

    @property
    def prediction(self) -> np.ndarray:
        """Force of the model at every sample, N, shape (T,)."""
        return self.comparison.prediction

    @property
    def error_N(self) -> float:
        """Error over all samples, N rms, as in `compare`."""
        return self.comparison.error_N


@dataclass(frozen=True)
class Selection:
    """Selected rows of the figures: one isobar, direction, trial or region; None for all."""

    level: int | None = None
    direction: int | None = None
    trial: int | None = None
    region: int | None = None


@dataclass(frozen=True)
class Choice:
    """A candidate as the page lists it."""

    candidate: Candidate
    #: Whether the diagnosis selected it; the others were tried and not needed.
    found: bool
    #: Effects that these data cannot distinguish from it.
    rivals: tuple[str, ...]
    #: Whether it is in the present model.
    added: bool

    @property
    def effect(self) -> str:
        """Name of the effect to add: that of the candidate's shape."""
        return self.candidate.shape


@dataclass
class Session:
    """A case, its ladder of models, the last diagnosis and the selection."""

    case: Case | None = None
    #: The first is the original model.
    steps: list[Step] = field(default_factory=list)
    diagnosis: Diagnosis | None = None
    #: Number of steps when the diagnosis was made.
    diagnosed_at: int = 0
    selection: Selection = Selection()
    #: A file that is being read, before it is a case.
    incoming: Incoming | None = None

    # --- opening -------------------------------------------------------------------------------

    def open(self, case: Case) -> None:
        """Open a case; InputError if its data and model do not match."""
        first = compare(case.model, case.data)
        self.case = case
        self.steps = [Step('start', case.model, first, first.error_N)]
        self.diagnosis, self.selection, self.incoming = None, Selection(), None

    def take(self, incoming: Incoming) -> None:
        """Open a file with its present columns and muscle; InputError says what is missing."""
        data, model = incoming.measurement(), incoming.muscle.bundle()
        self.open(Case(data.name, incoming.origin, data, model,
                       (incoming.file or data.name, f'{model.name}.model.yaml'), incoming))

    def close(self) -> None:
        """Close the case."""
        self.case, self.steps, self.diagnosis, self.incoming = None, [], None, None
        self.selection = Selection()

    # --- present state -------------------------------------------------------------------------

    @property
    def now(self) -> Step:
        """The present step, which is the last one."""
        if not self.steps:
            raise InputError('nothing is open; choose an example or drop a file first')
        return self.steps[-1]

    @property
    def before(self) -> Step | None:
        """The previous step, None at the first."""
        return self.steps[-2] if len(self.steps) > 1 else None

    @property
    def data(self) -> Measurement:
        """The measurement; InputError if no case is open."""
        if self.case is None:
            raise InputError('nothing is open; choose an example or drop a file first')
        return self.case.data

    def residual(self, step: Step | None = None) -> np.ndarray:
        """Return measured minus modelled force of a step (the present one), N, shape (T,)."""
        return self.data.force - (step or self.now).prediction

    @property
    def noise(self) -> float:
        """Noise floor, N: the lowest of all comparisons of this case."""
        return min(step.comparison.noise.value for step in self.steps)

    @property
    def levels(self) -> list[str]:
        """Names of the isobars, lowest first."""
        data = self.data
        unit = varying_unit(data)
        _, means = pressure_levels(data.pressure[:, unit])
        prefix = '' if data.pressure.shape[1] == 1 else f'{data.motor_units[unit]} '
        return [f'{prefix}{round(mean / 1e3) + 0:d} kPa' for mean in means]

    def headline(self) -> str:
        """Return the state of the model in one sentence."""
        error, noise = self.now.error_N, self.noise
        if error <= 1.1 * noise + 1e-9:
            return 'The model is as good as these data: the residual is noise.'
        if error < 1.5 * noise:
            return 'The model is close to the noise of these data.'
        return f'The error of the model is {short(error / noise)} times the noise of these data.'

    def rows(self) -> np.ndarray:
        """Return which samples are selected, (T,) bool."""
        data, chosen = self.data, self.selection
        keep = np.ones(len(data), bool)
        if chosen.level is not None:
            level, _ = pressure_levels(data.pressure[:, varying_unit(data)])
            keep &= level == chosen.level
        if chosen.direction is not None:
            keep &= data.direction == chosen.direction
        if chosen.trial is not None:
            keep &= data.trial == chosen.trial
        if self.region is not None:
            keep &= self.region.rows
        return keep

    # --- selecting -----------------------------------------------------------------------------

    @property
    def regions(self) -> tuple[Region, ...]:
        """Where the present model fails, largest first."""
        return self.now.comparison.located

    @property
    def region(self) -> Region | None:
        """The zoomed region."""
        chosen = self.selection.region
        return None if chosen is None else self.regions[chosen]

    def select(self, **choice: int | None) -> None:
        """
        Change the selection: ``level``, ``direction``, ``trial``, ``region``; None for all.

        InputError, and no change, if no sample has it.
        """
        before, self.selection = self.selection, replace(self.selection, **choice)
        if not self.rows().any():
            self.selection = before
            raise InputError('no sample has this pressure, direction and trial together')

    # --- diagnosis -----------------------------------------------------------------------------

    def learn(self, diagnosis: Diagnosis) -> None:
        """Keep a diagnosis of the present model."""
        self.diagnosis, self.diagnosed_at = diagnosis, len(self.steps)

    def choices(self) -> list[Choice]:
        """Return the candidates of the last diagnosis, the selected ones first."""
        if self.diagnosis is None:
            return []
        ties = {name: tuple(other for other in group if other != name)
                for group in self.diagnosis.tied for name in group}
        inside = {effect.name for effect in self.now.model.effects}
        chosen = set(self.diagnosis.effects)
        rows = [Choice(c, c.effect in chosen, ties.get(c.effect, ()), c.shape in inside)
                for c in self.diagnosis.ranking if not (c.replaces or c.removes)]
        # the selected ones in order, then their ties, then the rest
        return sorted(rows, key=lambda row: 0 if row.found else 1 if row.rivals else 2)

    def missing(self) -> list[Choice]:
        """Return the effects that the last diagnosis found and the present model lacks."""
        held = {row.candidate.effect for row in self.choices() if row.added}
        return [row for row in self.choices()
                if row.found and not row.added and not held & set(row.rivals)]

    def asked(self) -> list[Change]:
        """Return the changes of the last diagnosis that the present model does not have yet."""
        found, inside = self.diagnosis, {effect.name for effect in self.now.model.effects}
        if found is None:
            return []
        return [*(Change(new, old) for old, new in found.replaced.items()
                  if old in inside and new not in inside),
                *(Change(old, removes=True) for old in found.removed if old in inside),
                *(Change(row.effect) for row in self.missing())]

    def command(self) -> str:
        """Return the equivalent command; '' if an effect is the user's own."""
        return '' if self.case is None else changes.command(self.case, self.now.since,
                                                                  self.asked())

    def with_change(self, change: Change, effect: Effect | None = None) -> Since:
        """Return all changes since the first model, with one more."""
        new = effect or (None if change.replaces or change.removes
                         else self.candidate_effect(change.effect))
        return self.now.since.then(change, new)

    @property
    def asks_recalibration(self) -> bool:
        """Whether the last diagnosis recommends only a refit of the parameters."""
        return (self.diagnosis is not None and self.diagnosis.verdict == 'recalibrate'
                and len(self.steps) == self.diagnosed_at)

    # --- adding --------------------------------------------------------------------------------

    def candidate_effect(self, name: str) -> Effect:
        """Return an effect of the last diagnosis by name, at its fitted values if it has any."""
        for row in self.choices():
            if row.effect == name:
                values = {e.key.partition('.')[2]: e.si for e in row.candidate.parameters}
                effect = catalogue.get(name)()
                return effect.replace(**{key: value for key, value in values.items()
                                         if key in effect.values})
        raise InputError(f"'{name}' is not among the candidates")

    def advance(self, label: str, model: Bundle, held_out_N: float, since: Since,
                effect: str = '') -> None:
        """Add a refitted model to the ladder; see `Step`."""
        comparison = compare(model, self.data)
        self.steps.append(Step(label, model.named(model.name, error=comparison.error_N),
                               comparison, held_out_N, since, effect))
        self.selection = replace(self.selection, region=None)

    def undo(self) -> None:
        """Take the last step back; nothing happens at the first."""
        if len(self.steps) > 1:
            self.steps.pop()
            if self.diagnosis is not None and len(self.steps) < self.diagnosed_at:
                self.diagnosis = None
            self.selection = replace(self.selection, region=None)


def short(value: float) -> str:
    """
    Return a number as the page shows it: two significant digits, whole from ten on.

    Examples
    --------
    >>> short(6.630), short(0.6042), short(151.3), short(11.12)
    ('6.6', '0.60', '151', '11')
    """
    if not np.isfinite(value):
        return '–'
    digits = 0 if abs(value) >= 9.95 else 1 if abs(value) >= 0.995 else 2
    return f'{value:.{digits}f}'
