# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pages and tables of benchmarks: control on plants that are not the model, speed."""

from collections.abc import Mapping, Sequence
from typing import Any

from fam_bundle_ros.benchmarks.control import ControlBenchmark
from fam_bundle_ros.benchmarks.plants import PLANTS
from fam_bundle_ros.benchmarks.speed import FIGURE_HEAD as SPEED_HEAD
from fam_bundle_ros.benchmarks.speed import Result
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.report import control_figures
from fam_bundle_ros.report.page import Headline, Page, Picture, provenance, Section, Table
from fam_bundle_ros.simulation import Log

#: Column titles of `plant_cells`; pairs are reversal_aware and equal_pressure.
PLANT_HEAD = ('plant', 'model error (N rms)', 'rms (N)', 'of equal pressure', 'ratio', 'worst',
              'air ratio', 'worst air', 'at switches (N)', 'the same, equal pressure',
              'moved ratio', 'switches', 'chatter')
FIGURE_HEAD = ('figure', 'median', '90 % quantile', 'worst', 'target', 'worst on', '')
#: With the model of a record, see `control_summary.summarise`.
DIAGNOSED_HEAD = ('plant', 'units', 'model error before (N rms)', 'now', 'rms over that before',
                  'worst', 'air', 'worst air', 'effects of the new model')
_KEYS = ('model_error', 'rms_N', 'rms_N_equal_pressure', 'rms_ratio', 'rms_ratio_worst',
         'air_ratio', 'air_ratio_worst', 'error_at_switches',
         'error_at_switches_equal_pressure', 'moved_ratio')


def plant_cells(line: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the row of a plant."""
    return (line['plant'], *(_short(line[key]) for key in _KEYS), line['switches'],
            line['chatter'])


def diagnosed_cells(line: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the row of a plant and a number of units with the model of a record."""
    return (line['plant'], line['units'], *(_short(line[key]) for key in (
        'model_error_before', 'model_error', 'rms_ratio', 'rms_ratio_worst', 'air_ratio',
        'air_ratio_worst')), ', '.join(line['model']))


def figure_cells(figure: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the row of a figure with its target."""
    verdict = {None: 'not run', True: 'reached', False: 'not reached'}[figure['reached']]
    return (figure['figure'], *(_short(figure[key]) for key in ('median', 'nine_in_ten',
                                                                'worst')),
            figure['must'], figure['where'], verdict)


def _short(value: float | None) -> str:
    """Return a number with two decimals, or a dash."""
    return '–' if value is None else f'{value:.2f}'


def run_pictures(log: Log, model: Bundle, key: str, title: str) -> list[Picture]:
    """Return a run over time and its track over the regions of the recruitment states."""
    return [
        Picture(f'{key}-run', f'{title}: over time', control_figures.run(log),
                'Tint and lowest panel: the recruitment state. Dotted: pressure setpoints.'),
        Picture(f'{key}-track', f'{title}: over the regions of the recruitment states',
                control_figures.track(log, model),
                'The line is the run. Hatched: forces that both states can give; in this region a '
                'controller without hysteresis chatters.')]


def benchmark_page(result: ControlBenchmark, model: Bundle, seeds: str,
                   over_ros: Sequence[Mapping[str, Any]] = (),
                   files: Sequence[tuple[str, Any]] = ()) -> Page:
    """
    Return the page of ``fam_bundle benchmark-control``.

    ``over_ros`` has one row of the benchmark and the same run over ROS, named by ``through``.
    """
    figures, plants = result.summary['figures'], result.summary['plants']
    asked = [figure for figure in figures if figure['reached'] is not None]
    reached = sum(figure['reached'] for figure in asked)
    headline = [Headline(figure['figure'], '–' if figure['median'] is None
                         else f"{figure['median']:.3g}",
                         f"median; worst {figure['worst']:.3g} on {figure['where']}; target: "
                         f"{figure['must']}") for figure in asked[:3]]
    sections = [
        Section('The worst plant first', 'Controller reversal_aware compared with equal_pressure, '
                'a PI on the error that sets one pressure for all units, with gains optimised on '
                'each plant at a gain margin of at least ours or 6 dB. Ratios are medians over '
                'the trajectories; below 1 is better than equal pressure. The error of the model '
                'is measured at rest, over slow pressure sweeps.',
                [Table(PLANT_HEAD, [plant_cells(line) for line in plants]),
                 Table(('plant', 'what it is'),
                       [(line['plant'], PLANTS[line['plant']].words) for line in plants])]),
        Section('Targets', 'Over all plants and trajectories.',
                [Table(FIGURE_HEAD, [figure_cells(figure) for figure in figures])]),
        *_with_records(result), *_margins(result), *_over_ros(over_ros),
        *_shown_runs(result, model),
        Section('Every run', 'Errors in N for a force, in strain for a strain. Gains: of the '
                'baselines, gain, integral (1/s) and filter time (s).',
                [_every_run(result)], folded=True)]
    return Page(
        'Recruitment control on plants that are not its model',
        f'{len(result.rows)} closed-loop runs in simulation, the same trajectories for every '
        f'controller; {reached} of {len(asked)} targets are reached.',
        headline, sections,
        provenance(files, [('seeds', seeds),
                           ('kind of numbers', 'all simulated; nothing here is measured')]))


def _with_records(result: ControlBenchmark) -> list[Section]:
    """Return the controller with the models that `diagnose` makes of records, if it was run."""
    lines = result.summary['diagnosed']
    return [Section('With the model of a record', 'A minute of each plant is recorded, and the '
                    'effects that diagnose names on it are added to the model. Ratios are medians '
                    'over the trajectories; below 1 is better than with the model before.',
                    [Table(DIAGNOSED_HEAD, [diagnosed_cells(line) for line in lines])]
                    )] if lines else []


def _margins(result: ControlBenchmark) -> list[Section]:
    """Return the gain margins of our controller, the smallest first."""
    rows = sorted(dict.fromkeys(
        (row['plant'], row['units'], row['kind'], row['gain_margin']) for row in result.rows
        if 'gain_margin' in row), key=lambda row: row[-1])
    return [Section('Gain margins', 'Factor on the loop gain at which the response to a small '
                    'step no longer settles, measured in the closed loop; 64: 64 or more. '
                    'Baselines have at least this margin or 2 (6 dB), whichever is less.',
                    [Table(('plant', 'units', 'reference', 'gain margin'), rows)], folded=True)]


def _over_ros(rows: Sequence[Mapping[str, Any]]) -> list[Section]:
    if not rows:
        return []
    return [Section(
        'Over ROS', 'The same trajectory, controller, gains and rig by Python calls and through '
        'the nodes and topics of ROS 2 in lock-step, both at 500 Hz, to show that the runs '
        'without ROS represent it.',
        [Table(('through', 'rms error (N)', 'largest (N)', 'rms at switches (N)', 'switches',
                'air (mg)'),
               [(row['through'], row['tracking_rms'], row['largest_error'],
                 row['transition_rms'], row['switches'], 1e6 * row['air_mass'])
                for row in rows])])]


def _shown_runs(result: ControlBenchmark, model: Bundle) -> list[Section]:
    cases = list(dict.fromkeys((trajectory, plant) for _, trajectory, plant in result.logs))
    sections = []
    for trajectory, plant in cases:
        logs = {name: log for (name, *case), log in result.logs.items()
                if (trajectory, plant) == tuple(case)}
        # The last one is drawn on top.
        ordered = dict(sorted(logs.items(), key=lambda item: item[0] == 'reversal_aware'))
        items = [Picture(f'compared-{trajectory}-{plant}', 'Every controller',
                         control_figures.compared(ordered), PLANTS[plant].words)]
        items += run_pictures(logs['reversal_aware'], model, f'{trajectory}-{plant}',
                              'reversal_aware')
        sections.append(Section(f'{trajectory} on plant {plant}', '', items))
    return sections


def _every_run(result: ControlBenchmark) -> Table:
    keys = ('tracking_rms', 'rms_ratio', 'largest_error', 'error_there', 'dip_depth', 'switches',
            'chatter')
    return Table(
        ('plant', 'trajectory', 'units', 'seed', 'controller', 'rms', 'over equal pressure',
         'largest', 'at our switches', 'dip', 'switches', 'chatter', 'air (mg)', 'gains'),
        [(row['plant'], row['trajectory'], row['units'], row['seed'], row['controller'],
          *(row[key] for key in keys), 1e6 * row['air_mass'],
          ', '.join(f'{gain:.3g}' for gain in row.get('gains', ()))) for row in result.rows])


def bench_page(results: Sequence[Result], machine: Mapping[str, Any]) -> Page:
    """Return the page of measured rows on a machine, which `speed.machine` describes."""
    asked = [figure for result in results for figure in result.figures
             if figure.reached is not None]
    reached = sum(figure.reached is True for figure in asked)
    sections = [
        Section(f'{result.row.name}: {result.row.what}', '; '.join(result.remarks), [
            Table(SPEED_HEAD, [figure.cells for figure in result.figures])]
                if result.figures else [])
        for result in results]
    return Page('Speed of the parts',
                f'{reached} of {len(asked)} targets are reached. Ratios were measured in one run '
                'on one machine; the shortest of several repeats is used.', (), sections,
                provenance((), [(name, str(value)) for name, value in machine.items()]))
