# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The panel beside the figures: where the model fails, what is missing, what to take home."""

import asyncio
from typing import TYPE_CHECKING

from nicegui import ui

from fam_bundle_ros import palette
from fam_bundle_ros.workbench import parts, takeaway
from fam_bundle_ros.workbench.own_effect import Draft, from_template
from fam_bundle_ros.workbench.own_view import OwnEffectDialog
from fam_bundle_ros.workbench.session import Choice, short
from fam_bundle_ros.workbench.trial_view import TrialDialog

if TYPE_CHECKING:
    from fam_bundle_ros.workbench.case_view import CaseView

__all__ = ['SideView']


class SideView:
    """Regions, candidates, downloads."""

    def __init__(self, case: 'CaseView', place: ui.element):
        self.case, self.session, self.place = case, case.session, place

    def draw(self) -> None:
        """Draw the panel anew."""
        self.place.clear()
        with self.place:
            # what was found comes first once it is known
            if self.session.diagnosis is not None:
                self._learned()
            self._where()
            self._take_away()

    # --- where it fails ------------------------------------------------------------------------

    def _where(self) -> None:
        session = self.session
        with parts.box('section'):
            parts.text('h2', 'Where the model fails')
            for slip in session.now.comparison.slips:
                parts.text('p', parts.sentence(f'check first: {slip}'), 'tie')
            if not session.regions:
                parts.text('p', 'Nowhere: no region stands out of the noise.', 'muted small')
            for k, region in enumerate(session.regions):
                chosen = session.selection.region == k
                made = parts.box('button', 'region').props(
                    f'type=button aria-pressed={"true" if chosen else "false"}')
                made.on('click', lambda k=k, chosen=chosen: self.case.zoom(None if chosen else k),
                        args=[]).mark(f'region:{k}')
                made._props['data-mark'] = f'region:{k}'
                with made:
                    parts.text('span', region.where[:1].upper() + region.where[1:])
                    parts.text('b', f'{short(region.error_N)} N', 'num')
                    parts.text('span', f'{100 * region.share:.0f} % of the error · '
                               + ('click to zoom back' if chosen else 'click to zoom'),
                               'muted small')

    # --- what is missing -----------------------------------------------------------------------

    def _learned(self) -> None:
        session, found = self.session, self.session.diagnosis
        assert found is not None
        choices = session.choices()
        with parts.box('section').mark('learned'):
            later = len(session.steps) > session.diagnosed_at
            parts.text('h2', 'What was found' if later else {
                'recalibrate': 'What to correct', 'unexplained': 'What the error looks like',
            }.get(found.verdict, 'What is missing'))
            if not later or session.missing():
                parts.text('p', parts.sentence(found.summary), 'small')
            tied = [choice for choice in choices if not choice.found and choice.rivals]
            for choice in choices:
                if choice.found:
                    self._choice(choice)
                    for rival in tied:
                        if choice.candidate.effect in rival.rivals:
                            self._choice(rival)
            if found.verdict in ('unexplained', 'partial'):
                self._shapes()
            parts.text('p', parts.sentence(f'to be surer: {found.next_experiment}'), 'muted small')
            others = [choice for choice in choices if not choice.found and not choice.rivals]
            if others:
                with parts.box('details'):
                    parts.text('summary', f'{len(others)} others were tried')
                    for choice in others[:8]:
                        self._choice(choice)
            with parts.box('div', 'row').style('margin-top: .5rem'):
                parts.button('Write your own effect', self.write_own, mark='write-own')

    def _choice(self, choice: Choice) -> None:
        c = choice.candidate
        shade = 'dark' if self.case.page.dark else 'light'
        with parts.box('article', 'choice found' if choice.found else 'choice').mark(
                f'choice:{choice.effect}'):
            with parts.box('div', 'head'):
                parts.swatch(choice.effect, self.case.page.dark)
                parts.text('b', parts.sentence(c.effect)[:-1])
                if choice.added:
                    parts.text('span', 'added ✓', 'muted small')
                else:
                    parts.button('Add', lambda: self.case.add(choice.effect),
                                 'main-action small' if choice.found else 'plain',
                                 f'add:{choice.effect}',
                                 **{'aria-label': f'add {parts.words(choice.effect)}'})
            with parts.box('div', 'chances').props(
                    f'role=img aria-label="probability {c.probability:.2f}"'):
                parts.box('i').style(f'width: {100 * min(c.probability, 1.0):.0f}%; background: '
                                     f'{getattr(palette.effect(choice.effect), shade)}')
            with parts.box('div', 'facts'):
                found = self.session.diagnosis
                answered = found is None or found.verdict != 'unexplained'
                self._fact('probability' if answered else 'among these',
                           f'{100 * c.probability:.0f} %')
                self._fact('leaves', f'{short(c.error_N)} N')
                self._fact('family', parts.words(c.family))
                if c.shape != c.effect:
                    self._fact('shape', parts.words(c.shape))
                for e in c.parameters[:3]:
                    self._fact(parts.words(e.key.partition('.')[2]), f'{e.value:.3g} {e.unit}')
            parts.text('p', parts.sentence(c.reason), 'small')
            if choice.rivals:
                parts.text('p', '= A tie: these data cannot tell it from '
                           + ', '.join(parts.words(name) for name in choice.rivals) + '.', 'tie')

    @staticmethod
    def _fact(name: str, value: str) -> None:
        with parts.box('span'):
            parts.text('span', f'{name} ')
            parts.text('b', value, 'num')

    def _shapes(self) -> None:
        found = self.session.diagnosis
        assert found is not None
        for template in found.shapes_left[:3]:
            with parts.box('article', 'choice'):
                parts.text('span', parts.sentence(str(template)))
                if template.expression is not None:
                    with parts.box('div', 'row'):
                        parts.button('Use this shape', lambda template=template: self._own(
                            from_template(template)), mark=f'shape:{template.kind}')

    # --- one's own effect ----------------------------------------------------------------------

    def write_own(self) -> None:
        """Open the form for an effect of one's own, filled with the best shape where there is."""
        found = self.session.diagnosis
        shapes = [] if found is None or found.verdict not in ('unexplained', 'partial') else [
            t for t in found.shapes_left if t.expression is not None]
        self._own(from_template(shapes[0]) if shapes else Draft(formula='-k * strain_rate',
                                                                place='loss'))

    def _own(self, draft: Draft) -> None:
        draft.sync()
        with self.place:
            OwnEffectDialog(self.case, draft).open()

    # --- taking home ---------------------------------------------------------------------------

    def _take_away(self) -> None:
        with parts.box('section'):
            parts.text('h2', 'Take away')
            with parts.box('div', 'row'):
                parts.button('Model file', self.download_model, mark='download-model')
                parts.button('Report', self._download_report, mark='download-report')
                parts.button('CSV with prediction', self._download_csv, mark='download-csv')
                more: dict[str, str] = {} if len(self.session.steps) > 1 else {
                    'disabled': 'true', 'title': 'add something to the model first'}
                parts.button('Try it on the controller', self._try, mark='try', **more)
                if self.session.diagnosis is None:
                    parts.button('Write your own effect', self.write_own, mark='write-own')

    def download_model(self) -> None:
        """Give the present model as a file."""
        self._give(takeaway.model_text(self.session), '.model.yaml', 'application/yaml')

    def _download_csv(self) -> None:
        self._give(takeaway.csv_text(self.session), '_prediction.csv', 'text/csv')

    async def _download_report(self) -> None:
        page = await asyncio.to_thread(takeaway.report_text, self.session)
        with self.place:
            self._give(page, '_report.html', 'text/html')

    def _give(self, content: str, ending: str, kind: str) -> None:
        ui.download.content(content.encode(), takeaway.file_stem(self.session) + ending, kind)

    async def _try(self) -> None:
        with self.place:
            dialog = TrialDialog(self.case)
        await dialog.run()
