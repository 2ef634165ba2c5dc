# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Changes of a model: add, replace or remove an effect; and the same as a command line."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import shlex

from fam_bundle_ros.model import catalogue, Effect
from fam_bundle_ros.workbench.cases import Case


@dataclass(frozen=True)
class Change:
    """One change of the model: an effect to add, in place of ``replaces`` if any, or to remove."""

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
        """The change as an argument of ``fam_bundle add``."""
        if self.removes:
            return f'--remove {self.effect}'
        return f'--replace {self.replaces}={self.effect}' if self.replaces else self.effect


@dataclass(frozen=True)
class Since:
    """All changes since the first model."""

    #: At their start values for the next refit.
    added: tuple[Effect, ...] = ()
    #: Effects of the first model -> their replacements.
    replaced: Mapping[str, str] = field(default_factory=dict)
    #: Effects of the first model that are left out.
    removed: tuple[str, ...] = ()

    def then(self, change: Change, effect: Effect | None = None) -> 'Since':
        """Return these changes and one more; ``effect`` is added, by default the catalogue's."""
        added, replaced, removed = self.added, dict(self.replaced), self.removed
        gone = change.effect if change.removes else change.replaces
        if gone and gone not in {e.name for e in added}:
            # an effect of the first model, perhaps replaced before: the refit needs the first name
            first = next((old for old, new in replaced.items() if new == gone), gone)
            replaced.pop(first, None)
            if change.removes:
                removed = (*removed, first)
            else:
                replaced[first] = change.effect
        else:
            added = tuple(e for e in added if e.name not in (gone, change.effect))
            if not change.removes:
                added = (*added, effect or catalogue.get(change.effect)())
        return Since(added, replaced, removed)


def command(case: Case, since: Since, asked: Sequence[Change]) -> str:
    """Return the command that makes all changes; '' if one is the user's own formula."""
    if any(effect.name not in catalogue.names() for effect in since.added):
        return ''
    done = [*(Change(effect.name) for effect in since.added),
            *(Change(new, old) for old, new in since.replaced.items()),
            *(Change(old, removes=True) for old in since.removed)]
    words = [change.option for change in (*done, *asked)]
    source = case.source
    columns = [] if source is None else [
        *(f'--columns {shlex.quote(f"{key}={value}")}' for key, value in source.told.items()),
        *(['--drop-bad'] if source.drop_bad else [])]
    data, model = (shlex.quote(name or 'FILE') for name in case.files)
    return ' '.join(['fam_bundle add', *words, '--data', data, *columns, '--model', model,
                     '--out better.yaml'])
