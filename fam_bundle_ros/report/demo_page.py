# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The report of ``fam_bundle demo``: closed loop on ROS 2, then a model against measured data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fam_bundle_ros.benchmarks.control_metrics import metrics
from fam_bundle_ros.discovery import compare as compare_with
from fam_bundle_ros.discovery import Diagnosis, figures
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import RigConfig
from fam_bundle_ros.report.control_pages import run_pictures
from fam_bundle_ros.report.discovery_pages import diagnosis_sections
from fam_bundle_ros.report.map_page import model_section
from fam_bundle_ros.report.page import Headline, Page, Picture, provenance, Section, Table
from fam_bundle_ros.report.paper import PaperFigures
from fam_bundle_ros.report.paper_plots import map_pictures
from fam_bundle_ros.simulation import Log
from fam_bundle_ros.told import number


@dataclass(frozen=True)
class DemoRun:
    """One trajectory, run twice on ROS 2."""

    name: str
    #: Reference and load.
    words: str
    #: With orderly recruitment.
    log: Log
    #: With every unit always on, as a single equivalent motor unit.
    all_on: Log


def demo_metrics(runs: Sequence[DemoRun], diagnosis: Diagnosis, bundle: Bundle, rig: RigConfig,
                 seconds: float, seed: int) -> dict[str, Any]:
    """Return the numbers of the report: metrics.json, the terminal's summary, the headline."""
    found: dict[str, Any] = {'runs': {}, 'seed': seed, 'seconds': seconds}
    for run in runs:
        own, other = (metrics(log, bundle, rig) for log in (run.log, run.all_on))
        found['runs'][run.name] = {
            'kind': run.log.kind, 'states': visited(run.log), 'orderly': own, 'all_on': other,
            'air_saving': 1.0 - own['air_mass'] / other['air_mass'],
            'tracking_ratio_all_on': own['tracking_rms'] / other['tracking_rms'],
            'decisions': [{'time_s': time, 'why': why} for time, why in run.log.decisions]}
    found['model'] = {
        'data': diagnosis.measurement.name, 'verdict': diagnosis.verdict,
        'effects': list(diagnosis.effects), 'noise_floor_N': diagnosis.noise.value,
        'steps': list(diagnosis.ladder), 'recommended': diagnosis.recommended.to_dict()}
    return found


def demo_page(runs: Sequence[DemoRun], diagnosis: Diagnosis, found: Mapping[str, Any],
              bundle: Bundle, paper: PaperFigures, files: Sequence[tuple[str, str | Path]],
              ) -> Page:
    """Return the page; all numbers come from the runs or from the data named on it."""
    steps = found['model']['steps']
    first, last = steps[0], steps[-1]
    lead = (f'A bundle of {bundle.n} motor units was simulated with its ROS 2 interface and '
            f'followed {len(runs)} trajectories by recruiting and releasing its second unit. Then '
            'the ideal model of a muscle with published measurements was improved step by step: '
            f'its error fell from {number(first["error_N"])} N to {number(last["error_N"])} N.')
    return Page(
        'fam_bundle_ros: the demonstration', lead, _headline(found),
        [_what(runs, found), *(_run_section(run, bundle) for run in runs),
         *_measured(diagnosis),
         Section('The paper’s figures', 'Computed from the model of the bundle above.',
                 map_pictures(paper)),
         Section('Models', '', [*model_section(bundle).items,
                                *model_section(diagnosis.best).items], folded=True)],
        provenance(files, [
            ('simulated', 'the rig: valves, chambers, supply, load, sensors and their noise; '
                          f'seed {found["seed"]}. All nodes ran on real ROS 2 (rclpy), in '
                          'lock-step'),
            ('measured', 'the DMSP-20 map: Martens and Boblan 2017, Actuators 6(4) 33, table A1, '
                         'CC BY 4.0; numbers from a transcription'),
            ('from memory', 'constants of the valve (Festo MPYE-5-M5-010-B data sheet)'),
            ('time taken', f'{found["seconds"]:.0f} s')]))


def visited(log: Log) -> list[str]:
    """Return the recruitment states in the order of the run, without RS0 at the start."""
    states = [int(log.state[0]), *(int(log.state[k]) for k in log.switches)]
    return [f'RS{state}' for state in (states[1:] if states[0] == 0 else states)]


def _headline(found: Mapping[str, Any]) -> list[Headline]:
    cards = []
    for name, run in found['runs'].items():
        own = run['orderly']
        rms, largest = own['tracking_rms'], own['largest_error']
        shown = (f'{number(rms)} N', f'{number(largest)} N') if run['kind'] == 'force' else (
            f'{number(100 * rms)} %', f'{number(100 * largest)} %')
        cards.append(Headline(f'Tracking error, {name}', shown[0],
                              f'rms; largest {shown[1]}; {" → ".join(run["states"])}'))
    for name, run in found['runs'].items():
        saving = 100.0 * run['air_saving']
        cards.append(Headline(
            f'Air, {name}', f'{abs(saving):.1f} % {"less" if saving >= 0 else "more"}',
            f'than with all units on, at {run["tracking_ratio_all_on"]:.2f} times the '
            'tracking error'))
    steps = found['model']['steps']
    cards.append(Headline('Model error, measured muscle',
                          f'{number(steps[0]["error_N"])} → {number(steps[-1]["error_N"])} N',
                          f'verdict {found["model"]["verdict"].replace("_", " ")}; held out '
                          f'{_held(steps[-1])}; noise floor '
                          f'{number(found["model"]["noise_floor_N"])} N'))
    return cards


def _what(runs: Sequence[DemoRun], found: Mapping[str, Any]) -> Section:
    rows = []
    for run in runs:
        for scheme, label in (('orderly', 'orderly'), ('all_on', 'all on')):
            row = found['runs'][run.name][scheme]
            scale, unit = (1.0, 'N') if run.log.kind == 'force' else (100.0, '% strain')
            rows.append((run.name, label, scale * row['tracking_rms'],
                         scale * row['largest_error'], unit, row['switches'],
                         row['shortest_dwell'], row['chatter'], 1e6 * row['air_mass'],
                         row['efficiency'] or None))
    return Section(
        'What was done', '\n\n'.join(f'{_capital(run.name)}: {run.words}' for run in runs),
        [Table(('trajectory', 'scheme', 'rms error', 'largest', 'of', 'switches',
                'shortest dwell (s)', 'chatter', 'air (mg)', 'efficiency'), rows,
               'Efficiency: work done on the load over the energy of the air used; none for a '
               'dynamometer at rest.')])


def _run_section(run: DemoRun, bundle: Bundle) -> Section:
    return Section(
        f'{_capital(run.name)} on ROS 2', _capital(run.words),
        [*run_pictures(run.log, bundle, run.name.replace(' ', '-'), _capital(run.name)),
         Table(('time (s)', 'decision'), run.log.decisions, 'Explanations of the recruitment '
               'controller for its switches.')])


def _measured(diagnosis: Diagnosis) -> list[Section]:
    before = diagnosis.comparison
    after = compare_with(diagnosis.best, diagnosis.measurement)
    caption = 'Points are measured, lines are the model. Below: measured minus model.'
    return [
        Section('A measured muscle, step by step', 'A Festo DMSP-20, 126 measured points. The '
                'initial model is the ideal braid with data-sheet geometry; each step adds one '
                'effect and refits all parameters.', [
                    Picture('before', 'Initial model: the ideal braid',
                            figures.comparison(before), caption),
                    Picture('after', 'Best model: with the effects found',
                            figures.comparison(after), caption)]),
        *diagnosis_sections(diagnosis)]


def _held(step: Mapping[str, Any]) -> str:
    value = step.get('held_out_N')
    return 'not computed' if value is None else f'{number(value)} N'


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
