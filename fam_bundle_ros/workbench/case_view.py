# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""An open case on the page: answer, ladder of models, figures, and the panel beside them."""

import asyncio
from typing import Any, TYPE_CHECKING

from fam_bundle_ros import palette
from fam_bundle_ros.discovery.figures import has_isobars
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Effect
from fam_bundle_ros.model.own_muscle import muscle_words
from fam_bundle_ros.workbench import drawings, parts, worker
from fam_bundle_ros.workbench.changes import Change, Since
from fam_bundle_ros.workbench.jobs import Cancelled, Job, WorkerError
from fam_bundle_ros.workbench.session import short
from fam_bundle_ros.workbench.side_view import SideView

if TYPE_CHECKING:
    from fam_bundle_ros.workbench.page import Page

#: Of the curves, which have open points only where the data have directions.
_CURVES = 'Points: measured{}. Lines: model. Band: noise.'
_CAPTIONS = {
    'maps': 'Measured minus model. Even: the same in both directions of motion. Odd: what changes '
            'sign with the motion.',
    'loops': 'The error while shortening and while lengthening. Two separate branches: a loss '
             'such as friction. Grey band: noise, ±2 sd.'}


class CaseView:
    """The view of an open case; redraws only what a click changes."""

    def __init__(self, page: 'Page'):
        self.page, self.session = page, page.session
        data = self.session.data
        self.tab = 'curves'
        self.over_time = not data.is_static and not has_isobars(data)
        self.job: Job | None = None
        with parts.box('div', 'case'):
            self.answer = parts.box('section', 'answer').props('role=status aria-live=polite')
            with parts.box('div', 'right'):
                self.ladder = parts.box('section', 'ladder').props(
                    'aria-label="error after each step"')
                self.side = SideView(self, parts.box('aside', 'side'))
            with parts.box('section', 'figs'):
                self.head = parts.box('div', 'panel-head')
                self.figure = parts.box('div')
                self.caption = parts.text('p', '', 'caption')
        self.draw()

    # --- drawing -------------------------------------------------------------------------------

    def draw(self) -> None:
        """Redraw everything."""
        self.draw_answer()
        self.draw_ladder()
        self.draw_head()
        self.draw_figure()
        self.side.draw()

    def draw_answer(self) -> None:
        """Show how good the model is, and a button for the next action."""
        session = self.session
        with parts.fresh(self.answer):
            if session.case is not None:
                parts.text('span', f'{session.case.title} · {session.case.origin}', 'muted small')
                parts.text('span', f'Model {muscle_words(session.now.model)}', 'muted small',
                           'muscle-words')
            parts.text('h1', self._said(), mark='headline')
            with parts.box('div', 'answer-row'):
                if self.job is not None:
                    with parts.box('div', 'busy', 'busy'):
                        parts.progress(self.job)
                        parts.button('Cancel', self.job.cancel, mark='cancel')
                    return
                self._next()
                if len(session.steps) > 1:
                    parts.button('Undo', self.undo, mark='undo')

    def _said(self) -> str:
        """Return the verdict of the last diagnosis if it is up to date, else the state."""
        found = self.session.diagnosis
        if found is None or len(self.session.steps) > self.session.diagnosed_at:
            return self.session.headline()
        names = ', '.join(parts.words(name) for name in (
            *found.effects, *(f'{new} in place of {old}' for old, new in found.replaced.items()),
            *(f'no {old}' for old in found.removed)))
        return {
            'missing_effect': f'Found: {names}.',
            'partial': f'Found in part: {names}. Its shape is not quite right.',
            'recalibrate': 'No effect is missing; the parameters of the model are inaccurate.',
            'adequate': parts.sentence(f'nothing is missing: {found.summary}'),
            'unexplained': parts.sentence('; '.join(found.artefacts)) if found.artefacts else
            'Something is missing that the catalogue does not have.',
        }[found.verdict]

    def _next(self) -> None:
        session, found = self.session, self.session.diagnosis
        asked = session.asked()
        if asked:
            first = asked[0]
            said = f'Make all {len(asked)} changes' if len(asked) > 1 else (
                f'Leave out {parts.words(first.effect)}' if first.removes else
                f'Replace {parts.words(first.replaces)} by {parts.words(first.effect)}'
                if first.replaces else f'Add {parts.words(first.effect)}')
            parts.button(said, self.do_all, 'main-action', 'next-add')
            command = session.command()
            if command:
                parts.text('code', command, 'command small', 'command').props(
                    'title="the same in a terminal"')
        elif session.asks_recalibration:
            parts.button('Recalibrate the model', self.recalibrate, 'main-action', 'recalibrate')
        elif found is not None and found.verdict == 'unexplained' and \
                len(session.steps) == session.diagnosed_at:
            parts.button('Write it yourself', self.side.write_own, 'main-action', 'write-own-main')
        elif len(session.steps) > 1 or (found is not None and found.verdict == 'adequate'):
            parts.button('Download the model', self.side.download_model, 'main-action',
                         'download-main')
            if len(session.steps) > session.diagnosed_at or found is None:
                parts.button('Is anything still missing?', self.diagnose, mark='diagnose')
        else:
            parts.button('What is missing?', self.diagnose, 'main-action', 'diagnose')

    def draw_ladder(self) -> None:
        """Draw the error after each step, and the noise floor across all."""
        session = self.session
        most = max(step.error_N for step in session.steps)
        floor = 100.0 * min(session.noise / most, 1.0)
        with parts.fresh(self.ladder):
            with parts.box('ol'):
                for k, step in enumerate(session.steps):
                    colour = palette.effect(step.effect) if step.effect else (
                        palette.NEUTRAL['faint'])
                    last = ' now' if k == len(session.steps) - 1 else ''
                    with parts.box('li', f'rung{last}', f'rung:{k}'):
                        parts.text('span', 'original model' if k == 0
                                   else parts.words(step.label), 'name')
                        with parts.box('span', 'track'):
                            parts.box('i').style(
                                f'width: {100 * step.error_N / most:.1f}%; '
                                f'background: {colour.on(self.page.dark)}')
                            parts.box('u').style(f'left: {floor:.1f}%')
                        parts.text('span', f'{short(step.error_N)} N', 'value')
            parts.text('span', f'Rms error. Dashed: noise floor {short(session.noise)} N. '
                       f'{self._held_out()}', 'muted small')

    def _held_out(self) -> str:
        step = self.session.now
        if len(self.session.steps) < 2 or step.held_out_N != step.held_out_N:
            return ''
        return f'On held-out data: {short(step.held_out_N)} N.'

    def draw_head(self) -> None:
        """Draw the controls for the figure and for the data that it shows."""
        session = self.session
        data = session.data
        tabs = [('curves', 'Curves'), ('maps', 'Error maps')]
        if not data.is_static:
            tabs.append(('loops', 'Loops'))
        with parts.fresh(self.head):
            parts.segments(tabs, self.tab, self._show_tab, 'figure')
            if self.tab != 'curves':
                return
            chosen = session.selection
            parts.pick('Pressure', session.levels, chosen.level,
                       lambda value: self._select(level=value))
            if not data.is_static:
                directions = {None: None, 1: 0, -1: 1}
                parts.pick('Direction', ['shortening', 'lengthening'],
                           directions[chosen.direction], lambda value: self._select(
                               direction=None if value is None else (1, -1)[value]), 'both')
            if 1 < len(data.trial_names) <= 200:
                parts.pick('Trial', list(data.trial_names), chosen.trial,
                           lambda value: self._select(trial=value))
            if not data.is_static:
                parts.pick('Over', ['time'], 0 if self.over_time else None,
                           lambda value: self._over(value is not None), 'strain')

    def draw_figure(self) -> None:
        """Draw the chosen figure in a new box."""
        self.figure.clear()
        data = self.session.data
        caption = _CAPTIONS.get(self.tab) or _CURVES.format(
            f' (open: {data.ways[1]})' if (data.direction < 0).any() else '')
        self.caption.set_text(caption)
        drawn = self._drawn()
        with self.figure:
            if drawn is None:
                parts.text('p', 'Nothing was measured in both directions at one pressure.')
                return
            self.plot = parts.plot(drawn, caption.split('.')[0])

    def _drawn(self, move_ms: int = 0) -> dict[str, Any] | None:
        if self.tab == 'curves':
            figure: Any = drawings.main_figure(self.session, self.over_time,
                                                   self.page.narrow)
            return drawings.for_page(figure, self.page.dark, move_ms)
        figure = drawings.maps(self.session) if self.tab == 'maps' else \
            drawings.loops(self.session)
        return None if figure is None else drawings.for_page(figure, self.page.dark)

    def _redraw(self, move_ms: int) -> None:
        """Animate the curves to the present model; redraw the other figures."""
        drawn = self._drawn(move_ms) if self.tab == 'curves' else None
        if drawn is None:
            self.draw_figure()
        else:
            self.plot.update_figure(drawn)

    # --- selecting -----------------------------------------------------------------------------

    def _show_tab(self, tab: str) -> None:
        self.tab = tab
        self.draw_head()
        self.draw_figure()

    def _over(self, time: bool) -> None:
        self.over_time = time
        self.draw_head()
        self.draw_figure()

    def _select(self, **choice: int | None) -> None:
        try:
            self.session.select(**choice)
        except InputError as error:
            self.page.tell(str(error))
            self.draw_head()
            return
        self._redraw(0)

    async def zoom(self, region: int | None) -> None:
        """Zoom every figure to a region, or back."""
        self.session.select(region=region, level=None, direction=None, trial=None)
        self.draw_head()
        self.side.draw()
        await asyncio.sleep(0.03)  # lets the button respond before the figure is computed
        self._redraw(0)

    # --- long work -----------------------------------------------------------------------------

    async def work(self, job: Job) -> Any:
        """Run a job with progress on the page; None when it was cancelled or failed."""
        if self.job is not None:
            return None
        self.job = job
        self.draw_answer()
        await asyncio.sleep(0.03)  # lets the page be drawn before the process starts
        try:
            return await job.run()
        except Cancelled:
            return None
        except InputError as error:
            self.page.tell(str(error))
        except WorkerError as error:
            self.page.tell(f'the computation failed: {error}')
        finally:
            self.job = None
            if not self.is_gone:
                self.draw_answer()
        return None

    @property
    def is_gone(self) -> bool:
        """Whether another view is shown, or the browser left: then nothing can be drawn."""
        return self.answer.is_deleted

    def stop(self) -> None:
        """Cancel what is running."""
        if self.job is not None:
            self.job.cancel()

    async def diagnose(self) -> None:
        """Diagnose the present model."""
        step = self.session.now
        found = await self.work(Job(worker.diagnose_job, step.model, self.session.data))
        if found is not None and self.session.steps and self.session.now is step:
            self.session.learn(found)
            if not self.is_gone:
                self.draw_answer()
                self.side.draw()

    async def change(self, change: Change, effect: Effect | None = None) -> None:
        """Add, replace or leave out an effect, and refit everything."""
        await self._refit(change.label, '' if change.removes else change.effect,
                          self.session.with_change(change, effect))

    async def do_all(self) -> None:
        """Make all changes that the diagnosis recommends, one step after the other."""
        for change in self.session.asked():
            steps = len(self.session.steps)
            await self.change(change)
            if len(self.session.steps) == steps:
                return

    async def add_effect(self, effect: Effect) -> None:
        """Add an effect of the user's own and refit everything."""
        await self.change(Change(effect.name), effect)

    async def recalibrate(self) -> None:
        """Refit the model's own parameters."""
        await self._refit('recalibrated', '', self.session.now.since)

    async def _refit(self, label: str, effect: str, since: Since) -> None:
        session = self.session
        step = session.now
        refitted = await self.work(Job(worker.refit_job, session.steps[0].model, session.data,
                                       since))
        if refitted is None or not session.steps or session.now is not step:
            return
        model, held_out = refitted
        await asyncio.to_thread(session.advance, label, model, held_out, since, effect)
        if not self.is_gone:
            self._moved()

    def undo(self) -> None:
        """Take the last step back."""
        self.session.undo()
        self._moved()

    def _moved(self) -> None:
        self.draw_answer()
        self.draw_ladder()
        self.draw_head()
        self._redraw(self.page.move_ms)
        self.side.draw()
