# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What `jobs` runs in a process of its own."""

from collections.abc import Callable
from typing import Any

Progress = Callable[[float, str], None]


def diagnose_job(progress: Progress, model: Any, data: Any, choices: Any = None) -> Any:
    """Return the `Diagnosis` of a model on a measurement."""
    from fam_bundle_ros.discovery.diagnose import diagnose
    return diagnose(model, data, choices=choices, progress=progress)


def refit_job(progress: Progress, model: Any, data: Any, since: Any) -> Any:
    """
    Return a model with changed effects and all parameters refitted, and its held-out error, N.

    All rows are fitted; without effects the model's own parameters are recalibrated.
    """
    from fam_bundle_ros.discovery.add import add_effect
    names = ', '.join((*(effect.name for effect in since.added), *since.replaced.values()))
    progress(0.3, f'refitting with {names}' if names else 'refitting the parameters of the model')
    added = add_effect(model, list(since.added), data, replacing=since.replaced,
                       removing=since.removed)
    return added.model, added.held_out_N


def trial_job(progress: Progress, old: Any, new: Any, seconds: float) -> Any:
    """Return the `ControllerTrial` of two models on the simulated rig."""
    from fam_bundle_ros.workbench.trial import controller_trial
    return controller_trial(old, new, seconds, progress)
