# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The page "Live": a running bundle, the prediction of its model, and the error.

Diagnoses while the bundle runs, applies the recommended model, and restores the previous one.
"""

from collections.abc import Awaitable, Callable
import math
from typing import Any, TYPE_CHECKING

from nicegui import app, ui

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.workbench import drawings, live, parts
from fam_bundle_ros.workbench.measure_view import MeasureView
from fam_bundle_ros.workbench.rig_drawings import live_figure
from fam_bundle_ros.workbench.rig_feed import LiveRig

if TYPE_CHECKING:
    from fam_bundle_ros.workbench.page import Page

#: Periods of updating the values and the figure, s.
_PERIOD, _DRAW = 0.5, 0.9
#: Hidden effect that a click adds to the simulated bundle (`hidden_effect`), and its name.
HIDDEN = ('coulomb_friction: {force: 4 N}', 'Coulomb friction of 4 N')
_rig = LiveRig()
app.on_shutdown(_rig.close)


class RigView:
    """Numbers, figure and buttons of a running bundle."""

    def __init__(self, page: 'Page'):
        self.page, self.rig = page, _rig
        self._shown: dict[str, Any] = {}
        self._due = False
        with parts.box('div', 'case live'):
            with parts.box('div', 'answer').props('aria-live=polite'):
                self.head = parts.text('h1', 'Listening ...', mark='live:head')
                self.detail = parts.text('p', '', 'muted', 'live:detail')
            with parts.box('div', 'figs'):
                self.plot = parts.plot(drawings.for_page(live_figure([], None), page.dark),
                                       'force, residual, pressures and strain of the last seconds')
            with parts.box('div', 'right'):
                self._numbers()
                self._buttons()
                self.found = parts.box('div', 'side').props('aria-live=polite')
                self.measure = MeasureView(page, _rig)
                self._source()
        self.timer = ui.timer(_PERIOD, self._look)
        ui.timer(0.05, self._listen, once=True)

    # --- what is there -------------------------------------------------------------------------

    def _numbers(self) -> None:
        self.meters = {}
        with parts.box('section', 'meters'):
            for key, said in (('error', 'model error of the last minute'),
                              ('tracking', 'tracking error'), ('noise', 'noise'),
                              ('recruitment', 'recruitment state')):
                with parts.box('div', f'meter {key}'):
                    self.meters[key] = parts.text('b', '-', 'num', f'live:{key}')
                    parts.text('span', said, 'muted small')

    def _buttons(self) -> None:
        with parts.box('div', 'row'):
            self.buttons = {
                'diagnose': parts.button('What is missing?', lambda: self._order(call='diagnose'),
                                         'main-action small', 'live:diagnose'),
                'apply': parts.button('Apply', lambda: self._order(call='apply_model'),
                                      'main-action small', 'live:apply'),
                'back': parts.button('Back', lambda: self._order(call='restore_model'), 'plain',
                                     'live:back')}
        self.busy = parts.text('span', '', 'muted small', 'live:busy')
        self.told = parts.text('p', '', 'small', 'live:told').props('role=status')

    def _source(self) -> None:
        with parts.box('section', 'side'):
            with parts.box('div', 'row'):
                parts.typed('Namespace', self.rig.namespace, self._listen, mark='live:namespace')
            with parts.box('div', 'row'):
                self.start = parts.button('Start a simulated bundle', self._simulate, 'plain',
                                          'live:simulate')
                self.stop = parts.button('Stop it', lambda: self._try(self.rig.stop_simulation),
                                         'plain', 'live:stop')
                self.hide = parts.button(f'Add hidden {HIDDEN[1]}', lambda: self._hide(HIDDEN[0]),
                                         'plain', 'live:hide')
                self.show = parts.button('Remove it', lambda: self._hide(''), 'plain',
                                         'live:show')

    # --- what a user does ----------------------------------------------------------------------

    async def _listen(self, namespace: str | None = None) -> None:
        if not live.available():
            self.told.set_text('This Python has no ROS (rclpy): start the workbench with ROS.')
            return
        await self._try(lambda: self.rig.listen(
            self.rig.namespace if namespace is None else namespace.strip()))

    async def _simulate(self) -> None:
        await self._try(self.rig.simulate)
        self.told.set_text('A simulated bundle starts ...')

    async def _hide(self, effect: str) -> None:
        await self._order(set='hidden_effect', of='plant_simulator', value=effect)
        self.rig.record.forget_tracking()

    async def _order(self, **order: Any) -> None:
        if self._due:  # ignore the second of two clicks, which would be refused
            return
        self._due = True
        self._look()
        try:
            await self._try(lambda: self.rig.order(**order))
        finally:
            self._due = False

    async def _try(self, work: Callable[[], Awaitable[Any]]) -> None:
        """Call a function that may be refused; clear the old answer and show the new one."""
        self.told.set_text('')
        try:
            answer = await work()
        except InputError as error:
            answer = str(error)
        if not self.told.is_deleted:
            self.told.set_text(answer or '')
            self._look()

    # --- what it shows -------------------------------------------------------------------------

    def _look(self) -> None:
        """Update the display."""
        record = self.rig.record
        heard = bool(record.samples)
        self._words(heard)
        state = record.state if heard else {}
        values = {'error': newton(state.get('error_N')), 'tracking': self._tracking(),
                  'noise': newton(state.get('noise_N')),
                  'recruitment': f"RS{record.now['recruitment']}"
                  if 'recruitment' in record.now else '-'}
        for key, said in values.items():
            self.meters[key].set_text(said)
        at_work = state.get('diagnosing')
        self.busy.set_text(f"{100 * at_work['share']:.0f} %, {at_work['words']} ..."
                           if at_work else state.get('failure') or '')
        self.measure.look()
        candidate = state.get('candidate')
        self._able('diagnose', heard and not at_work and bool(state) and not self._due)
        self._able('apply', bool(candidate) and not self._due)
        self._able('back', heard and not self._due)
        nodes = record.graph.get('nodes', ())
        self.start.set_visibility(not heard and not self.rig.simulating)
        self.stop.set_visibility(self.rig.simulating)
        for button in (self.hide, self.show):
            button.set_visibility('plant_simulator' in nodes)
        if heard and abs(record.now['time'] - self._shown.get('time', math.inf)) >= _DRAW:
            self._shown['time'] = record.now['time']
            self.plot.update_figure(drawings.for_page(
                live_figure(record.samples, state.get('noise_N')), self.page.dark))
        if record.diagnosis is not self._shown.get('diagnosis') or (
                candidate != self._shown.get('candidate')):
            self._shown['diagnosis'], self._shown['candidate'] = record.diagnosis, candidate
            self._show_found(record.diagnosis, candidate)

    def _words(self, heard: bool) -> None:
        record = self.rig.record
        if self.rig.failure:
            self.head.set_text('No messages are received')
            self.detail.set_text(self.rig.failure)
        elif not heard:
            starts = self.rig.simulating
            self.head.set_text('The bundle is starting ...' if starts
                               else f'No bundle is running under {self.rig.namespace}')
            self.detail.set_text(
                '' if starts else 'Start one below, or in a terminal: ros2 run fam_bundle_ros '
                'bundle_bringup; for a rig: ros2 launch fam_bundle_ros controller.launch.py')
        elif not record.state:
            self.head.set_text('The bundle runs without model_monitor')
            self.detail.set_text('To test whether its model holds, start model_monitor.')
        else:
            waiting = not record.state['looks']
            holds = record.state['holds']
            self.head.set_text('Watching the model ...' if waiting else 'The model holds'
                               if holds else 'The model no longer holds')
            self.detail.set_text(f"{record.state['model']}: {record.state['words']}")

    def _tracking(self) -> str:
        value = self.rig.record.tracking
        if self.rig.record.now.get('reference_kind') == 'strain' and math.isfinite(value):
            return f'{100 * value:.2f} %'
        return newton(value)

    def _able(self, name: str, able: bool) -> None:
        button = self.buttons[name]
        if button._props.get('disabled', False) == (not able):
            return
        button._props['disabled'] = not able
        button.update()

    def _show_found(self, diagnosis: dict[str, Any], candidate: dict[str, Any] | None) -> None:
        self.found.clear()
        if not diagnosis:
            return
        effects = [*diagnosis['effects'], *diagnosis['replaced'].values()]
        with self.found, parts.box('section'):
            title = ', '.join(parts.words(name) for name in effects)
            parts.text('h2', f'Found: {title}' if title else parts.sentence(
                diagnosis['verdict']), mark='live:found')
            parts.text('p', parts.sentence(diagnosis['summary']), 'small')
            error = diagnosis['error_N']
            parts.text('p', f"Error on the memory: {newton(error['model'])} before, "
                       f"{newton(error['best'])} with the recommended model.", 'small num')
            if candidate:
                said = candidate['refusal'] or (
                    f"Apply reduces the error from {newton(candidate['present_N'])} to "
                    f"{newton(candidate['error_N'])}.")
                parts.text('p', said, 'small', 'live:candidate')
            parts.text('p', f"Next: {diagnosis['next_experiment']}", 'muted small')
            parts.text('code', diagnosis['model_file'], 'command small')


def newton(value: float | None) -> str:
    """
    Return a force as the page writes it.

    Examples
    --------
    >>> newton(0.912), newton(12.34), newton(None), newton(math.nan)
    ('0.91 N', '12.3 N', '-', '-')
    """
    if value is None or not math.isfinite(value):
        return '-'
    return f'{value:.3g} N' if abs(value) >= 1.0 else f'{value:.2f} N'
