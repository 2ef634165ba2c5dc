# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The part "Measure" of the page "Live": choose, run, stop an experiment; open its recording."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TYPE_CHECKING

from fam_bundle_ros.data.protocol import duration, minutes, Protocol, read_protocol, segments
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import load_model
from fam_bundle_ros.resources import config_names
from fam_bundle_ros.workbench import parts
from fam_bundle_ros.workbench.intake import incoming_from_path
from fam_bundle_ros.workbench.measure_run import model_file, Order
from fam_bundle_ros.workbench.muscle import MuscleForm
from fam_bundle_ros.workbench.rig_feed import LiveRig

if TYPE_CHECKING:
    from fam_bundle_ros.workbench.page import Page

#: Choices besides the protocols that ship.
_FILE, _NEXT = 'file:', 'next:'
#: Shipped protocol that is chosen at first.
_FIRST = 'first_look'


class MeasureView:
    """Choice, button, progress and outcome of a measurement."""

    def __init__(self, page: 'Page', rig: LiveRig):
        self.page, self.rig = page, rig
        self._chosen, self._typed, self._model = _FIRST, '', ''
        self._protocol: Protocol | None = None
        #: Order that the user must confirm.
        self._asked: Order | None = None
        self._shown: dict[str, Any] = {}
        self._refilled = ''
        with parts.box('section', 'side'):
            parts.text('h2', 'Measure')
            self.choice = parts.box('div')
            self.path = parts.typed('Protocol file', '', self._type, mark='live:protocol-file',
                                    hint='/home/me/my_protocol.yaml')
            self.path.set_visibility(False)
            self.model = parts.typed('Model of the controller', '', self._type_model,
                                     mark='live:model', hint='that of model_monitor')
            self.takes = parts.text('p', '', 'muted small', 'live:takes')
            self.buttons = parts.box('div', 'row')
            self.said = parts.text('p', '', 'small', 'live:measured').props('role=status')
        self._fill_choice()
        self._reckon()

    # --- what is chosen ------------------------------------------------------------------------

    def _fill_choice(self) -> None:
        self._refilled = self._next
        names = [name.removesuffix('.yaml') for name in config_names('protocols')]
        options = [*((name, name) for name in names), (_FILE, 'a file ...')]
        if self._next:
            options.append((_NEXT, 'the next experiment of the diagnosis'))
        elif self._chosen == _NEXT:
            self._chosen = _FIRST
        with parts.fresh(self.choice):
            parts.choose('Protocol', options, self._chosen, self._choose, 'live:protocol')

    @property
    def _next(self) -> str:
        """File of the experiment that the last diagnosis proposes; empty for none."""
        return str(self.rig.record.diagnosis.get('protocol_file') or '')

    @property
    def _name(self) -> str:
        """File or name of the protocol that is chosen."""
        return {_FILE: self._typed, _NEXT: self._next}.get(self._chosen, self._chosen)

    def _choose(self, key: str) -> None:
        self._chosen = key
        self.path.set_visibility(key == _FILE)
        self._reckon()

    def _type(self, path: str) -> None:
        self._typed = path.strip()
        self._reckon()

    def _type_model(self, name: str) -> None:
        self._model, self._asked = name.strip(), None
        self.look()

    def _reckon(self) -> None:
        """Show the duration of the experiment, or why its protocol cannot be read."""
        self._asked, self._protocol, problem = None, None, ''
        if self._chosen == _FILE and not self._typed:
            problem = 'The path of a protocol file, on the machine of the workbench.'
        else:
            try:
                if Path(self._name).suffix not in ('', '.yaml', '.yml'):
                    raise InputError(f'{self._name}: expected a protocol file (.yaml)')
                self._protocol = read_protocol(self._name)
            except InputError as error:
                problem = str(error)
        plan = self._protocol
        self.takes.set_text(problem if plan is None else (
            f'{plan.name}: {len(segments(plan))} segments, {minutes(duration(plan))}, up to '
            f'{max(plan.highest) / 1e3:.0f} kPa'
            + (', strain by the dynamometer' if plan.imposes_strain else '')))
        self.look()

    # --- what a user does ----------------------------------------------------------------------

    def _measure(self) -> None:
        self._try(lambda: self._begin(Order.new(self._file(), self._controller_model(),
                                                self.rig.namespace)))

    def _go_on(self) -> None:
        before = self.rig.measurement.order
        if before is not None:
            self._try(lambda: self._begin(replace(before, resume=True)))

    def _begin(self, order: Order) -> None:
        """Measure; on a real rig only after confirmation."""
        if self.rig.simulated:
            self.rig.measure(order)
        else:
            self._asked = order

    def _confirm(self) -> None:
        asked, self._asked = self._asked, None
        if asked is not None:
            self._try(lambda: self.rig.measure(asked))

    def _try(self, work: Callable[[], None]) -> None:
        self.rig.measure_failure = ''
        try:
            work()
        except InputError as error:
            self.rig.measure_failure = str(error)
        self.look()

    def _cancel(self) -> None:
        self._asked = None
        self.look()

    async def _stop(self) -> None:
        await self.rig.measurement.stop()

    def _file(self) -> str:
        path = Path(self._name)
        return str(path.absolute()) if path.is_file() else self._name

    def _controller_model(self) -> str:
        name_or_path = self._model or str(self.rig.record.state.get('file') or '')
        if not name_or_path:
            raise InputError('which model does the controller use? No model_monitor is running: '
                             'enter its file above')
        return model_file(name_or_path)

    async def _open(self) -> None:
        """Open the recording with the model of the controller, to compare and diagnose."""
        run = self.rig.measurement
        order = run.order
        if order is None or not run.file:
            return
        file = run.file

        def read() -> None:
            incoming = incoming_from_path(Path(file))
            incoming.muscle = MuscleForm.of(load_model(order.model))
            self.page.session.take(incoming)

        self.page.view = 'find'
        await self.page.guarded(read)

    # --- what it shows -------------------------------------------------------------------------

    def look(self) -> None:
        """Update the display."""
        if self._next != self._refilled:
            self._fill_choice()
        run = self.rig.measurement
        heard = bool(self.rig.record.samples) and not self.rig.failure
        state = {'running': run.running, 'asking': self._asked is not None, 'file': run.file,
                 'kept': run.kept, 'able': heard and self._protocol is not None}
        if state != self._shown:
            self._shown = state
            with parts.fresh(self.buttons):
                self._draw(state)
        self.said.set_text(self._words())

    def _draw(self, state: dict[str, Any]) -> None:
        run = self.rig.measurement
        if state['running']:
            parts.button('Stop', self._stop, 'main-action small', 'live:measure-stop')
        elif state['asking']:
            parts.text('p', 'The muscles of a real rig will be filled and will move. Is everybody '
                       'away from them and the stop button within reach?', 'small')
            # first, so that an accidental double click does not start the experiment
            parts.button('Cancel', self._cancel, 'plain', 'live:measure-cancel')
            parts.button('Everybody is away: measure', self._confirm, 'main-action small',
                         'live:measure-confirm')
        else:
            measure = parts.button('Measure', self._measure, 'main-action small', 'live:measure')
            measure._props['disabled'] = not state['able']
            if state['kept']:
                parts.button('Resume', self._go_on, 'plain', 'live:measure-on')
            if run.file:
                parts.button('Open the recording', self._open, 'plain', 'live:measure-open')

    def _words(self) -> str:
        run = self.rig.measurement
        if run.running:
            return f'{100 * run.share:.0f} %: {run.words}'
        if self.rig.measure_failure:
            return self.rig.measure_failure
        if run.failure:
            return f'No recording: {run.failure}'
        if run.file:
            return f'Measured: {run.file}'
        return ''
