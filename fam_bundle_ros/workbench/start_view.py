# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The first view: an example to begin with, an area to drop files, more examples."""

from typing import TYPE_CHECKING

from nicegui import events, ui

from fam_bundle_ros import palette
from fam_bundle_ros.workbench import intake, live, parts
from fam_bundle_ros.workbench.cases import EXAMPLES

if TYPE_CHECKING:
    from fam_bundle_ros.workbench.page import Page


class StartView:
    """Examples, upload, live graph."""

    def __init__(self, page: 'Page'):
        self.page = page
        with parts.box('div', 'start'):
            parts.text('h1', 'Which effect is your model missing?')
            parts.text('p', 'Compare a measurement with a model of a fluidic muscle. The '
                       'workbench shows where the model fails, names the effect that is missing, '
                       'adds it, and shows how the error falls.', 'lead')
            with parts.box('div', 'start-grid'):
                self._first()
                self._drop()
            parts.text('h2', 'Other examples', 'others-title')
            with parts.box('div', 'others'):
                for example in EXAMPLES[1:]:
                    self._example(example)

    def _first(self) -> None:
        example = EXAMPLES[0]
        with parts.box('section', 'card first'):
            with parts.box('div', 'words'):
                parts.text('span', 'New here? Begin with this one, it takes a minute', 'kicker')
                parts.text('h2', example.title)
                parts.text('p', example.question)
                parts.button('Open the example', lambda: self.page.open_example(example.key),
                             'main-action', 'open-first')
                parts.text('span', parts.sentence(example.origin), 'muted small')
            # a sketch of the error that falls
            ui.html(self._sketch(), sanitize=False)

    def _sketch(self) -> str:
        start, found, ink = (colour.on(self.page.dark) for colour in (
            palette.NEUTRAL['faint'], palette.effect('coulomb_friction'),
            palette.NEUTRAL['muted']))
        return (f'<svg viewBox="0 0 184 132" aria-hidden="true" font-family="inherit" '
                f'font-size="13" fill="{ink}"><rect x="14" y="20" width="62" height="92" rx="4" '
                f'fill="{start}"/><rect x="96" y="99.5" width="62" height="12.5" rx="2" '
                f'fill="{found}"/><path d="M4 103.6h168" stroke="{ink}" stroke-width="1.5" '
                f'stroke-dasharray="4 4"/><path d="M80 34c26 2 40 22 44 58m-7-8 7 9 6-10" '
                f'fill="none" stroke="{ink}" stroke-width="1.5"/>'
                f'<text x="45" y="14" text-anchor="middle">6.6 N</text>'
                f'<text x="127" y="128" text-anchor="middle">0.9 N</text>'
                f'<text x="4" y="128">noise</text></svg>')

    def _drop(self) -> None:
        with parts.box('section', 'card drop'):
            parts.text('h2', 'Use your own')
            parts.text('p', 'A log of strain (or length), pressure and force as your software '
                       'wrote it: CSV or text, Excel, LabVIEW, MATLAB, parquet, a ROS 2 bag. You '
                       'can check the meaning of each column before the computation.', 'small')
            self.upload = ui.upload(
                label='Drop a measurement or a model file, or press +', multiple=True,
                auto_upload=True, max_file_size=intake.MAX_UPLOAD, on_upload=self._uploaded,
                on_rejected=self._rejected)
            self.upload.props(f'accept="{",".join(intake.TAKEN)}" '
                              'flat bordered hide-upload-btn').mark('upload')
            if self.page.pending_model is not None:
                parts.text('p', f'Model {self.page.pending_model.name} is ready: now drop the '
                           'measurement.', 'small', 'model-ready')
            else:
                parts.text('p', 'Drop the model file first if you have one; otherwise the page '
                           'asks for your muscle.', 'muted small')
            if live.available():
                self._live()

    def _live(self) -> None:
        said = f'Record {live.SECONDS:g} s of the live ROS graph'

        async def listen() -> None:
            button.set_text(f'Listening for {live.SECONDS:g} s …')
            button.props('disabled')
            await self.page.record_live()
            if not button.is_deleted:
                button.set_text(said)
                button.props(remove='disabled')

        with parts.box('div', 'row'):
            button = parts.button(said, listen, mark='live')

    def _example(self, example) -> None:
        with parts.box('button', 'card example', f'example:{example.key}').props('type=button').on(
                'click', lambda: self.page.open_example(example.key), args=[]):
            parts.text('b', example.title)
            parts.text('span', example.question, 'small')
            parts.text('span', example.origin[:1].upper() + example.origin[1:], 'muted small')

    async def _uploaded(self, event: events.UploadEventArguments) -> None:
        if not await self.page.take_file(event.file.name, await event.file.read()):
            # or the browser would list it as done
            self.upload.run_method('removeUploadedFiles')

    def _rejected(self) -> None:
        self.page.tell(f'this file is not accepted: expected one of '
                       f'{", ".join(intake.TAKEN)} of at most {intake.MAX_UPLOAD >> 20} MB')
