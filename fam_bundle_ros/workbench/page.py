# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The page: top bar, messages, and which of its views is shown. One per browser tab."""

import asyncio
from collections.abc import Awaitable, Callable
from copy import deepcopy
from typing import Any

from nicegui import app, ui

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, load_model
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.workbench import intake, parts
from fam_bundle_ros.workbench.case_view import CaseView
from fam_bundle_ros.workbench.cases import Case, load_example
from fam_bundle_ros.workbench.explorer import Explorer
from fam_bundle_ros.workbench.explorer_view import ExplorerView
from fam_bundle_ros.workbench.incoming import Incoming
from fam_bundle_ros.workbench.intake_view import IntakeView
from fam_bundle_ros.workbench.live import record
from fam_bundle_ros.workbench.muscle import MuscleForm
from fam_bundle_ros.workbench.rig_view import RigView
from fam_bundle_ros.workbench.session import Session
from fam_bundle_ros.workbench.start_view import StartView

_LOOK = '[matchMedia("(prefers-color-scheme: dark)").matches, ' \
        'matchMedia("(prefers-reduced-motion: reduce)").matches, innerWidth < 600]'


def register(first: Case | Incoming | None = None) -> None:
    """Serve the page at '/', where it opens ``first``, and at '/live'."""
    ui.page('/', title='fam_bundle workbench')(root(first))
    ui.page('/live', title='fam_bundle live')(root(view='live'))


def root(first: Case | Incoming | None = None, view: str = 'find'
         ) -> Callable[[], Awaitable[None]]:
    """Return the function that builds the page for one tab, with one of its views."""
    async def index() -> None:
        ui.add_css(parts.style())
        await ui.context.client.connected()
        if not ui.context.client.has_socket_connection:
            return  # a client without JavaScript
        # a tab keeps its session when it is reloaded; tabs do not share sessions
        kept = app.storage.tab
        fresh = 'session' not in kept
        session = kept.setdefault('session', Session())
        page = Page(session)
        page.view = view
        if fresh and isinstance(first, Incoming):
            session.incoming = deepcopy(first)  # tabs do not share input
        elif fresh and first is not None:
            session.open(first)
        await page.look()
        page.build()

    return index


class Page:
    """The page of one browser tab."""

    def __init__(self, session: Session):
        self.session = session
        self.dark, self.narrow, self.move_ms = False, False, 450
        self.mode = ui.dark_mode(None)
        self.view = 'find'
        self.explorer: Explorer | None = None
        self.case_view: CaseView | None = None
        self.rig_view: RigView | None = None
        #: For files that are dropped together and arrive at the same time.
        self._files = asyncio.Lock()

    async def look(self) -> None:
        """Ask the browser for dark mode, narrow window and reduced motion."""
        try:
            self.dark, still, self.narrow = await ui.run_javascript(_LOOK, timeout=3.0)
        except (TimeoutError, TypeError, ValueError):
            still = False
        self.move_ms = 0 if still else 450

    def build(self) -> None:
        """Make the frame and show the first view."""
        with parts.box('div', 'wb'):
            parts.text('a', 'Skip to the content', 'skip').props('href=#content')
            self.top = parts.box('header', 'top')
            self.messages = parts.box('div').props('role=alert aria-live=assertive')
            self.content = parts.box('main').props('id=content')
            # loads the plotting library in advance
            with parts.box('div').style('display: none'):
                ui.plotly({'data': [], 'layout': {}})
        self.show()

    def show(self, view: str | None = None) -> None:
        """Redraw a view: ``find``, ``explore`` or ``live``; by default the present one."""
        self.view = view or self.view
        if self.rig_view is not None:
            self.rig_view.timer.deactivate()
            self.rig_view = None
        self._draw_top()
        self.messages.clear()
        with parts.fresh(self.content):
            if self.view == 'explore':
                self.explorer = self.explorer or Explorer(
                    self.chosen_muscle or load_model(config_path('models/spie2021.yaml')))
                ExplorerView(self, self.explorer)
            elif self.view == 'live':
                self.rig_view = RigView(self)
            elif self.session.incoming is not None:
                IntakeView(self, self.session.incoming)
            elif self.session.case is None:
                StartView(self)
            else:
                self.case_view = CaseView(self)

    @property
    def chosen_muscle(self) -> Bundle | None:
        """The open model, else the muscle being entered, else an uploaded model, else None."""
        incoming = self.session.incoming
        if self.session.case is not None:
            return self.session.now.model
        if incoming is not None and not incoming.muscle.problem:
            return incoming.muscle.bundle()
        return self.pending_model

    def _draw_top(self) -> None:
        with parts.fresh(self.top):
            with parts.box('div', 'brand'):
                parts.text('b', 'fam_bundle')
                parts.text('span', ' workbench')
            for key, said in (('find', 'Find what is missing'), ('explore', 'Explore a bundle'),
                              ('live', 'Live')):
                parts.button(said, lambda key=key: self._go(key), 'tab', f'tab:{key}',
                             **({'aria-current': 'page'} if key == self.view else {}))
            parts.box('span', 'grow')
            if self.session.case is not None and self.view == 'find' and (
                    self.session.incoming is None):
                if self.session.case.source is not None:
                    parts.button('Columns and units', self.ask_columns, mark='columns')
                parts.button('Other data', self.start_over, mark='start-over')
            parts.button('Light' if self.dark else 'Dark', self.change_theme, mark='theme',
                         **{'aria-label': 'change to the other colour theme'})

    def _go(self, view: str) -> None:
        if view == 'explore':
            self.explorer = None
        self.show(view)

    # --- what a user does ----------------------------------------------------------------------

    def change_theme(self) -> None:
        """Go from light to dark or back."""
        self.dark = not self.dark
        self.mode.set_value(self.dark)
        self.show()

    def start_over(self) -> None:
        """Go back to the start view."""
        if self.case_view is not None:
            self.case_view.stop()
        self.session.close()
        self.explorer = None
        self.show('find')

    async def open_example(self, key: str) -> None:
        """Open an example that ships."""
        await self.guarded(lambda: self.session.open(load_example(key)))

    async def take_file(self, name: str, content: bytes) -> bool:
        """
        Take an uploaded file, a measurement or the model to start from, in any order.

        Returns whether it could be used.
        """
        def take() -> None:
            incoming = self.session.incoming
            if intake.is_model(name):
                self.pending_model = intake.model_from_bytes(name, content)
            else:
                incoming = intake.incoming_from_bytes(name, content)
            self._take(incoming)

        async with self._files:
            return await self.guarded(take)

    def _take(self, incoming: Incoming | None) -> None:
        """Open a file if its columns are clear and its model is known, else ask the user."""
        model = self.pending_model
        if incoming is not None and model is not None:
            incoming.muscle = MuscleForm.of(model)
            if incoming.plain(incoming.look()):
                self.session.take(incoming)
                self.pending_model = None
                return
        self.session.incoming = incoming

    async def open_incoming(self) -> None:
        """Open the file with the present columns and muscle."""
        incoming = self.session.incoming
        if incoming is None:
            return
        if await self.guarded(lambda: self.session.take(incoming)):
            self.pending_model = None

    def ask_columns(self) -> None:
        """Go back to the columns of the open file."""
        case = self.session.case
        if case is not None and case.source is not None:
            self.session.incoming = case.source.again()
            self.show('find')

    def leave_columns(self) -> None:
        """Go back to the open file without changes."""
        self.session.incoming = None
        self.show('find')

    #: A model that was dropped before its data.
    pending_model: Bundle | None = None

    async def record_live(self) -> None:
        """Record the live ROS graph for some seconds."""
        async def listen() -> None:
            data = await record()
            await asyncio.to_thread(self._take, Incoming(
                data.name, 'live ROS graph', read_bag=lambda rest: data))

        await self.guarded(listen)

    async def guarded(self, work: Callable[[], Any]) -> bool:
        """
        Call a coroutine function, or a plain one in a thread; return whether it was done.

        An InputError is shown on the page.
        """
        with parts.fresh(self.messages):
            parts.box('div', 'loading').props('role=progressbar aria-label="reading the data"')
        await asyncio.sleep(0.03)  # lets the browser draw it before the work begins
        try:
            await (work() if asyncio.iscoroutinefunction(work) else asyncio.to_thread(work))
        except InputError as error:
            self.tell(str(error))
            return False
        if not self.messages.is_deleted:  # the browser may have left
            self.show()
        return True

    def tell(self, said: str) -> None:
        """Show a message that stays until it is closed."""
        if self.messages.is_deleted:
            return
        with parts.fresh(self.messages), parts.box('div', 'alert', 'alert'):
            parts.text('span', said, 'grow')
            parts.button('Close', self.messages.clear, mark='close-alert')
