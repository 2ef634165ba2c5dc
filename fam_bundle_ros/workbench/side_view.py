# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The panel beside the figures: where the model fails, what is missing, downloads."""

import asyncio
from dataclasses import replace
from typing import TYPE_CHECKING

from nicegui import ui

from fam_bundle_ros import palette
from fam_bundle_ros.discovery import compare
from fam_bundle_ros.discovery.result import Candidate
from fam_bundle_ros.discovery.templates import SHARE
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import dumps_model
from fam_bundle_ros.told import number
from fam_bundle_ros.workbench import parts, takeaway
from fam_bundle_ros.workbench.cases import Case
from fam_bundle_ros.workbench.changes import Change
from fam_bundle_ros.workbench.muscle import MuscleForm
from fam_bundle_ros.workbench.muscle_view import MuscleView
from fam_bundle_ros.workbench.own_effect import Draft, from_template
from fam_bundle_ros.workbench.own_view import OwnEffectDialog
from fam_bundle_ros.workbench.session import Choice, short
from fam_bundle_ros.workbench.trial_view import TrialDialog

if TYPE_CHECKING:
    from fam_bundle_ros.workbench.case_view import CaseView


class SideView:
    """Regions, candidates, downloads."""

    def __init__(self, case: 'CaseView', place: ui.element):
        self.case, self.session, self.place = case, case.session, place
        self.form: MuscleForm | None = None
        self.form_of: Case | None = None
        self.muscle_open = False

    def draw(self) -> None:
        """Redraw the panel."""
        with parts.fresh(self.place):
            # the diagnosis comes first once it is known
            if self.session.diagnosis is not None:
                self._learned()
            self._where()
            self._muscle()
            self._take_away()

    # --- where it fails ------------------------------------------------------------------------

    def _where(self) -> None:
        session = self.session
        with parts.box('section'):
            parts.text('h2', 'Where the model fails')
            for slip in session.now.comparison.slips:
                parts.text('p', parts.sentence(f'check first: {slip}'), 'tie')
            if not session.regions:
                parts.text('p', 'In no region does the error stand out from the noise.',
                           'muted small')
            for k, region in enumerate(session.regions):
                chosen = session.selection.region == k
                made = parts.box('button', 'region', f'region:{k}').props(
                    f'type=button aria-pressed={"true" if chosen else "false"}')
                made.on('click', lambda k=k, chosen=chosen: self.case.zoom(None if chosen else k),
                        args=[])
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
        with parts.box('section', '', 'learned'):
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
            for candidate in found.ranking:
                if (candidate.replaces and found.replaced.get(candidate.replaces)
                        == candidate.shape) or (candidate.removes
                                                and candidate.shape in found.removed):
                    self._swap(candidate)
            self._shapes()
            parts.text('p', parts.sentence(f'to be surer: {found.next_experiment}'), 'muted small')
            others = [choice for choice in choices if not choice.found and not choice.rivals]
            if others:
                with parts.box('details'):
                    parts.text('summary', f'{len(others)} other effects were tried')
                    for choice in others[:8]:
                        self._choice(choice)
            with parts.box('div', 'row').style('margin-top: .5rem'):
                parts.button('Write your own effect', self.write_own, mark='write-own')

    def _choice(self, choice: Choice) -> None:
        c = choice.candidate
        with parts.box('article', 'choice found' if choice.found else 'choice',
                       f'choice:{choice.effect}'):
            with parts.box('div', 'head'):
                parts.swatch(choice.effect, self.case.page.dark)
                parts.text('b', parts.sentence(c.effect)[:-1])
                if choice.added:
                    parts.text('span', 'added ✓', 'muted small')
                else:
                    parts.button('Add', lambda: self.case.change(Change(choice.effect)),
                                 'main-action small' if choice.found else 'plain',
                                 f'add:{choice.effect}',
                                 **{'aria-label': f'add {parts.words(choice.effect)}'})
            with parts.box('div', 'chances').props(
                    f'role=img aria-label="probability {c.probability:.2f}"'):
                parts.box('i').style(f'width: {100 * min(c.probability, 1.0):.0f}%; background: '
                                     f'{palette.effect(choice.effect).on(self.case.page.dark)}')
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
                    self._fact(parts.words(e.key.partition('.')[2]), f'{number(e.value)} {e.unit}')
            parts.text('p', parts.sentence(c.reason), 'small')
            if choice.rivals:
                parts.text('p', '= A tie: these data cannot distinguish it from '
                           + ', '.join(parts.words(name) for name in choice.rivals) + '.', 'tie')

    def _swap(self, candidate: Candidate) -> None:
        """Draw an effect that replaces another, or one to remove."""
        change = Change(candidate.shape, candidate.replaces, candidate.removes)
        inside = {effect.name for effect in self.session.now.model.effects}
        done = change.effect not in inside if change.removes else change.effect in inside
        with parts.box('article', 'choice found', f'choice:{change.effect}'):
            with parts.box('div', 'head'):
                parts.swatch(change.effect, self.case.page.dark)
                parts.text('b', f'No {parts.words(change.effect)}' if change.removes else
                           f'{parts.sentence(change.effect)[:-1]} in place of '
                           f'{parts.words(change.replaces)}')
                if done:
                    parts.text('span', 'done ✓', 'muted small')
                else:
                    parts.button('Leave out' if change.removes else 'Replace',
                                 lambda: self.case.change(change), 'main-action small',
                                 f'swap:{change.effect}')
            with parts.box('div', 'facts'):
                self._fact('probability', f'{100 * candidate.probability:.0f} %')
                self._fact('leaves', f'{short(candidate.error_N)} N')
            parts.text('p', parts.sentence(candidate.reason), 'small')

    @staticmethod
    def _fact(name: str, value: str) -> None:
        with parts.box('span'):
            parts.text('span', f'{name} ')
            parts.text('b', value, 'num')

    def _shapes(self) -> None:
        found = self.session.diagnosis
        assert found is not None
        left = found.shapes_left[:3]
        if left:
            parts.text('p', f'Shapes {SHARE}, {short(found.error_N["best"])} N rms, and '
                       'their shares:', 'small')
        for template in left:
            with parts.box('article', 'choice'):
                parts.text('span', parts.sentence(str(template)))
                if template.expression is not None:
                    with parts.box('div', 'row'):
                        parts.button('Use this shape', lambda template=template: self._own(
                            from_template(template)), mark=f'shape:{template.kind}')

    # --- own effect ----------------------------------------------------------------------------

    def write_own(self) -> None:
        """Open the form for an own effect, filled with the best shape if there is one."""
        found = self.session.diagnosis
        left = [] if found is None else [t for t in found.shapes_left if t.expression is not None]
        self._own(from_template(left[0]) if left else Draft(formula='-k * strain_rate',
                                                                place='loss'))

    def _own(self, draft: Draft) -> None:
        draft.sync()
        with self.place:
            OwnEffectDialog(self.case, draft).dialog.open()

    # --- the muscle ----------------------------------------------------------------------------

    def _muscle(self) -> None:
        """Draw the form of the muscle, with the error that its dimensions would give."""
        session = self.session
        case = session.case
        assert case is not None
        source = case.source
        # the input is kept until another case is opened
        if self.form is None or self.form_of is not case:
            self.form_of = case
            self.form = source.muscle if source is not None else MuscleForm.of(case.model)
        form = self.form
        with parts.box('section'), parts.box('details', '', 'muscle') as box:
            if self.muscle_open:
                box.props('open')
            box.on('toggle', lambda event: setattr(self, 'muscle_open', bool(event.args)),
                   js_handler='(e) => emit(e.target.open)')
            parts.text('summary', 'Your muscle', mark='muscle:open')
            view = MuscleView(form, lambda: self._would_be(form), self.case.page.tell)
            self.would = parts.text('p', '', 'small', 'muscle:would').props('role=status')
            with parts.box('div', 'row'):
                parts.button('Use it', self._use_muscle, 'main-action small', 'muscle:use')
                parts.button('Save as a model file', view.save, mark='muscle:save')
        self._would_be(form)

    def _would_be(self, form: MuscleForm) -> None:
        case = self.session.case
        if case is None or form.problem or not form.changed(case.model):
            self.would.set_text('')
            return
        try:
            bundle = form.bundle()
            data = case.source.measurement() if case.source is not None else case.data
            error = compare(bundle, data).error_N
        except InputError as error_said:
            self.would.set_text(str(error_said))
            return
        self.would.set_text(f'With these dimensions the error would be {short(error)} N; at the '
                            f'start it is {short(self.session.steps[0].error_N)} N. Using them '
                            'restarts the ladder.')

    async def _use_muscle(self) -> None:
        case, form = self.session.case, self.form
        if case is None or form is None:
            return

        def use() -> None:
            if case.source is not None:
                self.session.take(case.source)
            else:
                self.session.open(replace(case, model=form.bundle()))

        await self.case.page.guarded(use)

    # --- downloads -----------------------------------------------------------------------------

    def _take_away(self) -> None:
        with parts.box('section'):
            parts.text('h2', 'Downloads')
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
        """Offer the present model as a download."""
        self._give(dumps_model(self.session.now.model), '.model.yaml', 'application/yaml')

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
