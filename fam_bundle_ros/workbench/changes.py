# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Changes of a model: add an effect, replace one, leave one out; and the same as a command."""

from collections.abc import Sequence
from dataclasses import dataclass
import shlex
from typing import TYPE_CHECKING

from fam_bundle_ros.model import catalogue, Effect
from fam_bundle_ros.workbench.cases import Case

if TYPE_CHECKING:
    from fam_bundle_ros.workbench.session import Step

#: Effects added, replaced (old -> new) and removed, all since the first model.
Since = tuple[tuple[Effect, ...], dict[str, str], tuple[str, ...]]


@dataclass(frozen=True)
class Change:
    """
    One change of the model: an effect to add, to replace another with, or to leave out.

    Attributes
    ----------
    effect : str
        What comes, or what goes.
    replaces : str
        What it takes the place of, '' for nothing.
    removes : bool
    """

    effect: str
    replaces: str = ''
    removes: bool = False

    @property
    def label(self) -> str:
        """Name of the step."""
        if self.removes:
            return f'no {self.effect}'
        return f'{self.effect} for {self.replaces}' if self.replaces else f'+ {self.effect}'

    @property
    def option(self) -> str:
        """The same as an argument of ``fam_bundle add``."""
        if self.removes:
            return f'--remove {self.effect}'
        return f'--replace {self.replaces}={self.effect}' if self.replaces else self.effect


def after(step: 'Step', change: Change, effect: Effect | None = None) -> Since:
    """
    Return all changes since the first model, with one more.

    Parameters
    ----------
    step : Step
        Changes so far.
    change : Change
    effect : Effect, optional
        The one that comes, at the value to start from; by default as the catalogue has it.
    """
    added, replaced, removed = list(step.added), dict(step.replaced), list(step.removed)
    gone = change.effect if change.removes else change.replaces
    if gone and gone not in {e.name for e in added}:
        # an effect of the first model, perhaps replaced before: the refit takes its first name
        first = next((old for old, new in replaced.items() if new == gone), gone)
        replaced.pop(first, None)
        if change.removes:
            removed.append(first)
        else:
            replaced[first] = change.effect
    else:
        added = [e for e in added if e.name not in (gone, change.effect)]
        if not change.removes:
            added.append(effect or catalogue.get(change.effect)())
    return tuple(added), replaced, tuple(removed)


def command(case: Case, step: 'Step', asked: Sequence[Change]) -> str:
    """
    Return the command that makes the same model from the first; '' with a formula of the user.

    Parameters
    ----------
    case : Case
    step : Step
        What was done so far.
    asked : sequence of Change
        What is to be done.
    """
    if any(effect.name not in catalogue.names() for effect in step.added):
        return ''
    done = [*(Change(effect.name) for effect in step.added),
            *(Change(new, old) for old, new in step.replaced.items()),
            *(Change(old, removes=True) for old in step.removed)]
    words = [change.option for change in (*done, *asked)]
    source = case.source
    columns = [] if source is None else [
        *(f'--columns {shlex.quote(f"{key}={value}")}' for key, value in source.told.items()),
        *(['--drop-bad'] if source.drop_bad else [])]
    data, model = (shlex.quote(name or 'FILE') for name in case.files)
    return ' '.join(['fam_bundle add', *words, '--data', data, *columns, '--model', model,
                     '--out better.yaml'])
