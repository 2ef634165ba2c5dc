# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The dialog in which the simulated rig runs with the old and the new model."""

from typing import TYPE_CHECKING

from nicegui import ui

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.workbench import drawings, parts, trial, worker
from fam_bundle_ros.workbench.jobs import Cancelled, Job, WorkerError

if TYPE_CHECKING:
    from fam_bundle_ros.workbench.case_view import CaseView

#: Length of the task, s.
_SECONDS = 5.0


class TrialDialog:
    """Progress, then both runs."""

    def __init__(self, case: 'CaseView'):
        self.case = case
        self.dialog = ui.dialog()
        with self.dialog, parts.box('div', 'sheet').props('role=dialog aria-label=controller'):
            parts.text('h2', 'The controller with the old and with the new model')
            self.body = parts.box('div')
            with parts.box('div', 'row'):
                parts.button('Close', self.dialog.close, mark='trial-close')

    async def run(self) -> None:
        """Show the dialog and fill it; closing it stops the work."""
        session = self.case.session
        job = Job(worker.trial_job, session.steps[0].model, session.now.model, _SECONDS)
        self.dialog.on('hide', job.cancel, args=[])
        with self.body, parts.box('div', 'busy'):
            said, timer = parts.progress(job)
        self.dialog.open()
        try:
            result = await job.run()
        except Cancelled:
            return
        except (InputError, WorkerError) as error:
            said.set_text(f'This model cannot be tried: {error}')
            return
        finally:
            timer.deactivate()
        if self.body.is_deleted:
            return
        with parts.fresh(self.body):
            old, new = trial.error_N(result.old), trial.error_N(result.new)
            share = f'{100 * (1 - new / old):.0f} % less' if new < old else 'no less'
            parts.text('p', f'Tracking error {old:.2f} N with the old model, {new:.2f} N with the '
                       f'new one: {share}.', mark='trial-result')
            parts.plot(drawings.for_page(
                trial.figure(result, session.now.effect), self.case.page.dark), 'force over time')
            parts.text('p', result.words, 'muted small')
