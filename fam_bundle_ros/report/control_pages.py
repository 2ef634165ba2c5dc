# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pages of control: one closed-loop run, and the benchmark of policies and schemes."""

from collections.abc import Mapping, Sequence
from typing import Any

from fam_bundle_ros.benchmarks.control import COMPARED, ControlBenchmark, SHOWN
from fam_bundle_ros.benchmarks.control_metrics import reaches, TARGETS
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.report import control_figures
from fam_bundle_ros.report.page import Headline, Page, Section, Table
from fam_bundle_ros.report.picture import Picture
from fam_bundle_ros.report.provenance import provenance
from fam_bundle_ros.simulation import Log

__all__ = ['benchmark_page', 'run_pictures']


def run_pictures(log: Log, model: Bundle, key: str, title: str, words: str = '') -> list[Picture]:
    """Return a run over time and its track over the regions of the recruitment states."""
    return [
        Picture(f'{key}-run', f'{title}: over time', control_figures.run(log),
                f'{words} Tinted and below: the recruitment state. Dotted: pressures asked '
                'for.'.strip()),
        Picture(f'{key}-track', f'{title}: over the regions of the recruitment states',
                control_figures.track(log, model),
                'The line is the run. Hatched: forces that both states can give; holding there '
                'without a rule makes a controller chatter.')]


def benchmark_page(result: ControlBenchmark, model: Bundle, seed: int,
                   over_ros: Sequence[Mapping[str, Any]] = (),
                   files: Sequence[tuple[str, Any]] = ()) -> Page:
    """
    Return the page of ``fam_bundle benchmark-control``.

    ``over_ros`` has one row of the benchmark and the same run over ROS, named by ``through``.
    """
    rows = verdicts(result.summary)
    reached = sum(row[-1] == 'reached' for row in rows)
    headline = [Headline(f'{words[:1].upper()}{words[1:]}', _shown(value),
                         f'to reach: {target}; {verdict}')
                for words, value, target, verdict in rows]
    sections = [
        Section('Against the targets', 'Policy reversal_aware, worst trajectory each, on the '
                'nominal plant (chatter: on every plant).',
                [Table(('figure', 'value', 'to reach', ''), rows), _by_trajectory(result)]),
        *_missed(result),
        *_over_ros(over_ros),
        *_shown_runs(result, model),
        Section('Every run', 'Errors in N for a force, in strain for a strain. The least air is '
                'an exhaustive search that knows the future and has ideal valves.',
                [_every_run(result)], folded=True)]
    return Page(
        'Recruitment control: what each part buys',
        f'{len(result.rows)} closed-loop runs in simulation, the same trajectories and plants '
        f'for every policy and scheme; {reached} of {len(rows)} targets are reached.',
        headline, sections,
        provenance(files, [('seed', str(seed)),
                           ('kind of numbers', 'all simulated; nothing here is measured')]))


def verdicts(summary: dict[str, Any]) -> list[tuple[str, Any, str, str]]:
    """Return one row per target: words, value, target, whether it is reached."""
    rows = []
    for key, words, target, at_most in TARGETS:
        value = summary.get(key)
        shown = f'at most {target:.3g}' if at_most else f'above {target:.3g}'
        verdict = 'not run' if value is None else (
            'reached' if reaches(value, target, at_most) else 'not reached')
        rows.append((words, value, shown, verdict))
    return rows


def _shown(value: Any) -> str:
    return '–' if value is None else f'{value:.3g}'


def _by_trajectory(result: ControlBenchmark) -> Table:
    table = result.summary['by_trajectory']
    keys = ('dip_ratio', 'transition_rms_ratio', 'air_over_least', 'air_saving',
            'air_saving_bound', 'liquid_saving', 'tracking_ratio_all_on')
    return Table(
        ('trajectory', 'dip ratio', 'transition rms ratio', 'air over least',
         'air saved against all on', 'most that could be saved', 'saved with a liquid',
         'tracking over all on'),
        [(name, *(entry.get(key) for key in keys)) for name, entry in table.items()],
        'A gas is drawn in proportion to pressure and volume, a liquid to volume alone: that is '
        'why the saving differs by so much.')


def _missed(result: ControlBenchmark) -> list[Section]:
    """Return what is not reached, by how much and why, with the air of both ways over time."""
    sections = []
    for name, sentences in result.summary['not_reached'].items():
        logs = {case[1]: result.logs[case] for case in COMPARED
                if case[2] == name and case in result.logs}
        pictures = [Picture(f'air-{name}', f'{name}: air drawn', control_figures.air(logs),
                            'Policy reversal_aware. Flat where air is let out or nothing moves.')]
        text = ' '.join(f'{line[:1].upper()}{line[1:]}.' for line in sentences)
        sections.append(Section(f'Not reached: {name}', text, pictures))
    return sections


def _over_ros(rows: Sequence[Mapping[str, Any]]) -> list[Section]:
    if not rows:
        return []
    return [Section(
        'Over ROS', 'The same trajectory, controller, gains and rig by calls and through the '
        'nodes and topics of ROS 2 in lock-step, both at 500 Hz, to show that the runs without '
        'ROS stand for it.',
        [Table(('through', 'rms error (N)', 'largest (N)', 'rms at switches (N)', 'switches',
                'air (mg)'),
               [(row['through'], row['tracking_rms'], row['largest_error'],
                 row['transition_rms'], row['switches'], 1e6 * row['air_mass'])
                for row in rows])])]


def _shown_runs(result: ControlBenchmark, model: Bundle) -> list[Section]:
    sections = []
    ramp = {policy: log for (policy, scheme, trajectory, plant), log in result.logs.items()
            if (scheme, trajectory, plant) == ('orderly', 'ramp', 'nominal')}
    if len(ramp) > 1:
        sections.append(Section('The transition', '', [Picture(
            'policies', 'Ramp through the overlap and back, by policy',
            control_figures.compared(dict(sorted(
                ramp.items(), key=lambda item: item[0] == 'reversal_aware'))),
            'The same ramp at constant strain. The spikes of the error are the transitions.')]))
    items: list[Picture] = []
    for policy, scheme, trajectory, plant in SHOWN:
        log = result.logs.get((policy, scheme, trajectory, plant))
        if log is None:
            continue
        title = f'{policy}, {scheme}, {trajectory}, plant {plant}'
        items += run_pictures(log, model, f'{policy}-{scheme}-{trajectory}-{plant}', title)
    if items:
        sections.append(Section('Runs', '', items))
    return sections


def _every_run(result: ControlBenchmark) -> Table:
    keys = ('tracking_rms', 'largest_error', 'transition_rms', 'dip_depth', 'switches',
            'air_mass', 'air_over_least', 'efficiency', 'chatter')
    return Table(
        ('plant', 'trajectory', 'policy', 'scheme', 'rms', 'largest', 'rms at switches',
         'dip', 'switches', 'air (mg)', 'air over least', 'efficiency', 'chatter'),
        [(row['plant'], row['trajectory'], row['policy'], row['scheme'],
          *(1e6 * row[key] if key == 'air_mass' else row[key] for key in keys))
         for row in result.rows])
