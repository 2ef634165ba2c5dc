# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Long work runs in a process of its own: progress, result, cancel, and errors that are told."""

import asyncio

import pytest

from fam_bundle_ros.data.grouping import reversals, rms
from fam_bundle_ros.discovery import Choices
from fam_bundle_ros.discovery.predict import motion
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import catalogue
from fam_bundle_ros.workbench import trial, worker
from fam_bundle_ros.workbench.cases import load_example
from fam_bundle_ros.workbench.changes import Since
from fam_bundle_ros.workbench.jobs import Cancelled, Job, WorkerError
from fam_bundle_ros.workbench.own_effect import Draft

pytestmark = pytest.mark.anyio


async def test_a_diagnosis_comes_back_with_progress_on_the_way(session, friction_found):
    """The worker's diagnosis is the one of discovery, and the share rises while it works."""
    job = Job(worker.diagnose_job, session.now.model, session.data, Choices(most=1))
    seen = []

    async def watch():
        while True:
            seen.append(job.share)
            await asyncio.sleep(0.05)

    watching = asyncio.create_task(watch())
    found = await job.run()
    watching.cancel()
    assert found.effects[0] == 'coulomb_friction'
    assert (found.verdict, found.effects) == (friction_found.verdict, friction_found.effects)
    assert found.error_N == pytest.approx(friction_found.error_N)
    assert max(seen) > 0.1
    assert seen == sorted(seen)


async def test_cancel_stops_the_work(session):
    """A cancelled job ends without a result and leaves no process."""
    job = Job(worker.diagnose_job, session.now.model, session.data)
    running = asyncio.create_task(job.run())
    await asyncio.sleep(0.5)
    job.cancel()
    with pytest.raises(Cancelled):
        await running
    assert not job._process.is_alive()


async def test_a_job_cancelled_before_it_starts_never_works(session):
    """Cancel wins, however early."""
    job = Job(worker.diagnose_job, session.now.model, session.data)
    job.cancel()
    with pytest.raises(Cancelled):
        await job.run()


async def test_a_refit_with_a_users_formula_comes_back(session):
    """Effects made at run time go to the worker and return in the model."""
    draft = Draft('mine', '-k * tanh(strain_rate / v)', 'loss')
    draft.sync()
    draft.fields['k'].value, draft.fields['v'].value = '5 N', '0.002 1/s'
    model, held_out = await Job(worker.refit_job, session.now.model, session.data,
                                Since((draft.effect(),))).run()
    assert model.effect('mine').k == pytest.approx(6.66, abs=0.1)
    # no direction of motion is known where a trial is entered: friction is off there by its size
    data = session.data
    inside = ~reversals(data)
    residual = data.force - model.predict(motion(data))
    assert rms(residual[inside]) < 0.75
    assert held_out < 0.15 * session.now.error_N


async def test_bad_input_in_the_worker_is_bad_input_here(session):
    """An effect that the model has already is refused in the user's words."""
    effect = catalogue.get('bladder_elasticity')()
    with pytest.raises(InputError, match='already'):
        await Job(worker.refit_job, session.now.model, session.data, Since((effect,))).run()


async def test_a_worker_that_breaks_down_is_told():
    """What goes wrong in the worker is an error here, not a page that waits for ever."""
    with pytest.raises(WorkerError, match='AttributeError'):
        await Job(worker.diagnose_job, None, load_example('hidden_friction').data).run()


async def test_the_better_model_tracks_better(with_friction):
    """On a rig of the user's own muscle the controller that knows the friction keeps the force."""
    job = Job(worker.trial_job, with_friction.steps[0].model, with_friction.now.model, 2.5)
    found = await job.run()
    assert trial.error_N(found.new) < 0.6 * trial.error_N(found.old)
    assert with_friction.now.model.name in found.words
