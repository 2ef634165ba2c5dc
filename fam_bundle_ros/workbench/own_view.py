# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The form for the user's own effect, with a preview while it is typed."""

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui
import numpy as np

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.workbench import drawings, own_effect, parts
from fam_bundle_ros.workbench.drawings import thin
from fam_bundle_ros.workbench.own_effect import Draft, Field, PLACES, Preview
from fam_bundle_ros.workbench.session import short

if TYPE_CHECKING:
    from fam_bundle_ros.workbench.case_view import CaseView


class OwnEffectDialog:
    """A dialog around a `Draft`."""

    def __init__(self, case: 'CaseView', draft: Draft):
        self.case, self.draft = case, draft
        self.dialog = ui.dialog()
        with self.dialog, parts.box('div', 'sheet').props('role=dialog aria-label="own effect"'):
            parts.text('h2', 'Write your own effect')
            parts.text('p', 'A formula of strain, strain_rate, pressure, force, time, stretch, '
                       'radius, length, area and your own parameters; functions abs, sqrt, exp, '
                       'log, tanh, sin, cos, sign, min, max. SI inside, any unit in the values.',
                       'muted small')
            with parts.box('div', 'form'):
                parts.typed('Formula', draft.formula, self._formula, 'wide', 'own-formula', True,
                            '-k * strain_rate')
                parts.typed('Name', draft.name, partial(self._set, draft, 'name'),
                            mark='own-name')
                parts.choose('The formula gives', list(PLACES.items()), draft.place,
                             partial(self._set, draft, 'place'), 'own-place')
            self.fields = parts.box('div')
            self.said = parts.text('p', '', 'said', 'own-said').props('role=status')
            self.sketch = parts.box('div')
            with parts.box('div', 'row'):
                parts.button('Add and refit', self._add, 'main-action', 'own-add')
                parts.button('Cancel', self.dialog.close, mark='own-cancel')
        self._draw_fields()
        self._look()

    def _draw_fields(self) -> None:
        with parts.fresh(self.fields):
            for name, item in self.draft.fields.items():
                with parts.box('div', 'triple'):
                    parts.text('b', name)
                    for attribute, label, hint in (('value', 'start, with unit', '5 N*s'),
                                                   ('lower', 'at least', 'optional'),
                                                   ('upper', 'at most', 'optional')):
                        parts.typed(label, getattr(item, attribute),
                                    partial(self._set, item, attribute), hint=hint,
                                    mark=f'own:{name}:{attribute}')

    # --- typing --------------------------------------------------------------------------------

    def _formula(self, value: str) -> None:
        names = list(self.draft.fields)
        self.draft.formula = value
        self.draft.sync()
        if list(self.draft.fields) != names:
            self._draw_fields()
        self._look()

    def _set(self, of: Draft | Field, attribute: str, value: str) -> None:
        setattr(of, attribute, value)
        self._look()

    def _look(self) -> None:
        """Show the preview of the effect as typed."""
        self.sketch.clear()
        try:
            effect = self.draft.effect()
            seen = own_effect.preview(self.case.session, effect)
        except InputError as error:
            self.said.set_text(str(error))
            return
        now = self.case.session.now.error_N
        better = 'less' if seen.error_N < now else 'more'
        self.said.set_text(
            f'At these values it changes the force by {short(seen.change_N)} N rms; the error '
            f'would be {short(seen.error_N)} N, {better} than the present {short(now)} N. A refit '
            'will find better values.')
        with self.sketch:
            parts.plot(self._figure(seen), 'error now and with the effect')

    def _figure(self, seen: Preview) -> dict:
        session = self.case.session
        data, residual = session.data, session.residual()
        rows = thin(residual, 900)
        drawing = plotting.figure('strain', 'error (N)', height=240)
        for values, name, colour, size in (
                (residual, 'now', palette.NEUTRAL['faint'], 3.5),
                (data.force - seen.prediction, 'with the effect', palette.effect('my_effect'), 4)):
            drawing.add_trace(plotting.points(np.round(data.strain[rows], 5),
                                              np.round(values[rows], 4), name, colour, size,
                                              hoverinfo='skip'))
        return drawings.for_page(drawing, self.case.page.dark)

    async def _add(self) -> None:
        try:
            effect = self.draft.effect()
            own_effect.preview(self.case.session, effect)
        except InputError as error:
            self.said.set_text(str(error))
            return
        self.dialog.close()
        await self.case.add_effect(effect)
