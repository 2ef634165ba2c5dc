# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The panel "Your muscle" on the page: a part or dimensions, what is wrong, the model file."""

from collections.abc import Callable
from functools import partial

from nicegui import ui

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.own_muscle import ENTRIES, PARTS
from fam_bundle_ros.workbench import parts
from fam_bundle_ros.workbench.muscle import MuscleForm, STARTS


class MuscleView:
    """Fields of a form; ``on_change`` is called after each, ``tell`` shows why it is not saved."""

    def __init__(self, form: MuscleForm, on_change: Callable[[], None],
                 tell: Callable[[str], None]):
        self.form, self.on_change, self.tell = form, on_change, tell
        with parts.box('div', 'muscle'):
            if form.base is None:
                parts.choose('Part', [('', 'dimensions of my own'),
                                      *((part.name, part.title) for part in PARTS)],
                             form.part, self._part, 'muscle:part', 'field wide')
            self.fields = parts.box('div', 'form')
            self.sources = parts.box('div', 'muted small')
            self.said = parts.text('p', '', 'small', 'muscle:said').props('role=status')
        self._draw_fields()
        self.look()

    def _draw_fields(self) -> None:
        form = self.form
        with parts.fresh(self.fields):
            for entry in ENTRIES:
                field = parts.typed(f'{entry.label}{f", {entry.unit}" if entry.unit else ""}',
                                    form.values.get(entry.key, ''),
                                    partial(self._type, entry.key),
                                    mark=f'muscle:{entry.key}', hint=entry.example)
                field._props['title'] = entry.meaning
            if form.base is None:
                parts.choose('Begin with', [(key, words) for key, words, _ in STARTS], form.start,
                             partial(self._set, 'start'), 'muscle:start')
                parts.typed('Name', form.name, partial(self._set, 'name'), mark='muscle:name')

    def _part(self, part: str) -> None:
        self.form.choose(part)
        self._draw_fields()
        self._changed()

    def _type(self, key: str, value: str) -> None:
        self.form.type(key, value)
        self._changed()

    def _set(self, attribute: str, value: str) -> None:
        setattr(self.form, attribute, value)
        self._changed()

    def _changed(self) -> None:
        self.look()
        self.on_change()

    def look(self) -> None:
        """Show what is missing or wrong, and the source of values that were not typed."""
        problem = self.form.problem
        self.said.set_text(problem[:1].upper() + problem[1:])
        self.sources.clear()
        told: dict[str, list[str]] = {}
        for entry in ENTRIES:
            if entry.key in self.form.sources:
                told.setdefault(self.form.sources[entry.key], []).append(entry.label)
        if not told:
            return
        with self.sources, parts.box('details'):
            parts.text('summary', 'Sources of these values')
            for source, labels in told.items():
                parts.text('p', f'{", ".join(labels)}: {source}.')

    def save(self) -> None:
        """Offer the model file as a download."""
        try:
            content = self.form.text()
        except InputError as error:
            self.tell(str(error))
            return
        ui.download.content(content.encode(), f'{self.form.bundle().name}.model.yaml',
                            'application/yaml')
