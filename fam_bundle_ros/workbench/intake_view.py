# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A file before it is opened: its first rows, what each column is, and the muscle."""

from functools import partial
from typing import Any, TYPE_CHECKING

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from fam_bundle_ros.data.reading import Preview
from fam_bundle_ros.workbench import parts
from fam_bundle_ros.workbench.incoming import Column, Incoming
from fam_bundle_ros.workbench.muscle_view import MuscleView

if TYPE_CHECKING:
    from fam_bundle_ros.workbench.page import Page


class IntakeView:
    """Columns and muscle; the button is enabled once both are complete."""

    def __init__(self, page: 'Page', incoming: Incoming):
        self.page, self.incoming = page, incoming
        #: Of each column the line below it, and the box of its unit.
        self.lines: dict[str, tuple[TextElement, ui.element | None]] = {}
        with parts.box('div', 'intake'):
            with parts.box('section', 'intake-head'):
                self.kind = parts.text('span', '', 'muted small')
                parts.text('h1', 'Are the columns of the file correct?')
                self.state = parts.box('div', 'state', 'intake:state').props(
                    'role=status aria-live=polite')
            with parts.box('section', 'columns'):
                self.table = parts.box('div', 'map-box').props(
                    'tabindex=0 role=region aria-label="first rows of the file"')
                self.constants = parts.box('div', 'form')
            with parts.box('aside', 'side'), parts.box('section'):
                parts.text('h2', 'Your muscle')
                self.muscle = MuscleView(incoming.muscle, self.draw, page.tell)
                with parts.box('div', 'row'):
                    parts.button('Save as a model file', self.muscle.save, mark='muscle:save')
        self._draw_constants()
        self.draw()

    def draw(self) -> None:
        """Read the file with the present settings, and show the result."""
        seen = self.incoming.look()
        self.kind.set_text(f'{seen.name} · {seen.kind} · {seen.rows} rows')
        self._draw_state(seen)
        self._draw_table(seen)

    def _draw_state(self, seen: Preview) -> None:
        self.state.clear()
        muscle = self.incoming.muscle.problem
        with self.state:
            if seen.measurement is None:
                parts.text('p', f'Not yet: {self.incoming.said(seen.problem)}.', 'bad')
            else:
                said, *notes = str(seen.measurement).splitlines()
                parts.text('p', said.partition(': ')[2] or said)
                for note in notes:
                    parts.text('p', note.strip(), 'muted small')
                if muscle:
                    parts.text('p', 'Not yet: your muscle is not complete.', 'bad')
            with parts.box('div', 'row'):
                off = {} if seen.measurement is not None and not muscle else {'disabled': 'true'}
                parts.button('Use these data', self.page.open_incoming, 'main-action',
                             'intake:use', **off)
                if '--drop-bad' in seen.problem:
                    parts.button('Leave such rows out', self._drop_bad, mark='intake:drop')
                if self.page.session.case is not None:
                    parts.button('Back', self.page.leave_columns, mark='intake:back')
                parts.button('Other data', self.page.start_over, mark='intake:other')

    def _drop_bad(self) -> None:
        self.incoming.drop_bad = True
        self.draw()

    # --- the columns ---------------------------------------------------------------------------

    def _draw_table(self, seen: Preview) -> None:
        columns = self.incoming.columns(seen)
        self.table.clear()
        self.lines.clear()
        if not columns:
            return
        good = seen.measurement is not None
        with self.table, parts.box('table', 'map'):
            with parts.box('thead'):
                with parts.box('tr'):
                    for column in columns:
                        with parts.box('th', 'used' if column.quantity else ''):
                            self._head(column, columns)
            self._draw_lines(columns, good)
            with parts.box('tbody'):
                for k in range(max(len(column.cells) for column in columns)):
                    with parts.box('tr'):
                        for column in columns:
                            parts.text('td', column.cells[k] if k < len(column.cells) else '',
                                       'num')

    def _head(self, column: Column, among: list[Column]) -> None:
        parts.text('b', column.header)
        name = column.header

        def change(**said: Any) -> None:
            self.incoming.change(column, among, **said)
            self.draw()

        def calibrate(typed: str) -> None:
            # not `draw`, by which the field that is typed into would be lost
            self.incoming.change(column, among, scale=typed)
            seen = self.incoming.look()
            self._draw_state(seen)
            self._draw_lines(self.incoming.columns(seen), seen.measurement is not None)

        options = self.incoming.quantities
        if column.quantity not in dict(options):
            options = [*options, (column.quantity, column.quantity)]
        parts.choose('', options, column.quantity, lambda value: change(quantity=value),
                     f'map:{name}:quantity', 'cell', f'what {name} is')
        unit_box = None
        if column.quantity and column.quantity != 'trial':
            units = self.incoming.units_for(column.quantity, column.unit)
            with parts.box('div', 'pair'):
                unit_box = parts.choose(
                    '', [*([] if column.unit else [('', 'unit?')]),
                         *((text, text) for text in units)], column.unit,
                    lambda value: change(unit=value), f'map:{name}:unit', 'cell',
                    f'unit of {name}')
                if column.quantity != 'time':
                    parts.choose('', [('+', '+'), ('-', '−')], '-' if column.turned else '+',
                                 lambda value: change(turned=value == '-'), f'map:{name}:sign',
                                 'cell', f'sign of {name}')
            if column.quantity != 'time':
                parts.typed('', column.scale, calibrate, 'cell', f'map:{name}:scale',
                            hint=self.incoming.hint(column.quantity),
                            named=f'calibration of {name}: what one count is worth, and an offset')
        self.lines[name] = parts.text('span', '', 'small'), unit_box

    def _draw_lines(self, columns: list[Column], good: bool) -> None:
        """Write below each column what it was taken for, or what is wrong with it."""
        for column in columns:
            line, unit_box = self.lines[column.header]
            used = bool(column.quantity) and not column.wrong
            line.set_text(('✓ ' if good and used else '')
                          + (column.why or ('used' if used else '')))
            line.classes(replace='small ' + ('wrong' if column.wrong else 'tick' if good and used
                                             else 'muted'))
            if unit_box is not None:  # the calibration has the unit
                unit_box.set_visibility('*' not in column.scale)

    def _draw_constants(self) -> None:
        """Draw fields for constants that a file may lack: pressure of an isobar, sample rate."""
        if self.incoming.table is None:
            return
        has = {taken.quantity.partition('.')[0] for taken in self.incoming.look().taken}
        with self.constants:
            for quantity, label, hint in (('pressure', 'Pressure, a constant', '300 kPa'),
                                          ('time', 'Sample rate', '100 Hz')):
                if quantity not in has:
                    parts.typed(label, self.incoming.told.get(quantity, ''),
                                partial(self._constant, quantity), mark=f'constant:{quantity}',
                                hint=hint)

    def _constant(self, quantity: str, value: str) -> None:
        self.incoming.constant(quantity, value)
        self.draw()
