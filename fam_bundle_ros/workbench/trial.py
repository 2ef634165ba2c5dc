# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
"Try it on the controller": one task on one simulated muscle, with the old and the new model.

The simulated muscle is the new model, the best available description of the real one; the
controller has the old model in one run and the new one in the other.
"""

from collections.abc import Callable
from dataclasses import dataclass
import math

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.own_muscle import muscle_words
from fam_bundle_ros.plant import Dynamometer
from fam_bundle_ros.simulation import ClosedLoop, Log, Trajectory


@dataclass(frozen=True)
class ControllerTrial:
    """Description of the task, and the runs with the old and the new model."""

    words: str
    old: Log
    new: Log


def error_N(log: Log) -> float:
    """Return the rms error of a run after the first second, N."""
    return rms(log.error[log.time > 1.0])


def controller_trial(old: Bundle, new: Bundle, seconds: float,
                     progress: Callable[[float, str], None]) -> ControllerTrial:
    """
    Return both runs: a force to be held level while the strain goes up and down.

    ``old`` and ``new`` are models of the controller, the simulated muscle is ``new``; the task
    takes ``seconds``.
    """
    low, high = 0.06, 0.12
    middle, swing = 0.5 * (low + high), 0.5 * (high - low)
    at_most = float(new.force(high, new.max_pressure))
    level = 0.45 * at_most
    beat = 2.0 * math.pi * 0.5

    def imposed(t: float) -> float:
        return middle + swing * math.sin(beat * t)

    task = Trajectory('level force over a moving strain', 'force', seconds,
                      lambda t: level, lambda t: 0.0, Dynamometer(middle), imposed, prepare=1.0)
    runs: list[Log] = []
    for k, (model, name) in enumerate(((old, 'the old model'), (new, 'the new model'))):
        def report(t: float, k: int = k, name: str = name) -> None:
            progress(0.5 * (k + (t + 1.0) / (seconds + 1.0)), f'the controller has {name}')

        report(-1.0)
        # compiling a new model would take longer than this simulation
        runs.append(ClosedLoop(new, model, seed=1, compiled=False).run(task, report))
    words = (f'The task: hold {level:.0f} N while the strain swings between {100 * low:.0f} and '
             f'{100 * high:.0f} % every two seconds. The simulated muscle is the new model, '
             f'{muscle_words(new)}.')
    return ControllerTrial(words, *runs)


def figure(trial: ControllerTrial, effect: str = ''):
    """Draw both runs and the reference; the new run in the colour of the added effect."""
    drawing = plotting.figure('time (s)', 'force (N)', height=340)
    keep = slice(None, None, max(1, len(trial.old.time) // 1200))
    for log, name, colour, width in (
            (trial.old, 'old', palette.NEUTRAL['faint'], 1.6),
            (trial.new, 'new', palette.effect(effect or 'mesh'), 2.2)):
        drawing.add_trace(plotting.line(
            log.time[keep], log.force[keep], f'{name} model, {error_N(log):.2f} N rms',
            colour, width=width, hovertemplate='%{y:.1f} N at %{x:.2f} s'))
    drawing.add_trace(plotting.line(
        trial.old.time[keep], trial.old.reference[keep], 'reference', palette.NEUTRAL['ink'],
        'dot', 1.4, hoverinfo='skip'))
    return drawing
