# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables of the safety benchmark, for the terminal and for docs/results/faults.md."""

from collections.abc import Mapping, Sequence
from typing import Any

#: Column titles of `fault_cells`; times and pressures are the largest of all runs of a fault.
FAULT_HEAD = ('fault', 'runs', 'unsafe', 'harmless', 'safe', 'detected', 'detected after (s)',
              'safe after (s)', 'pressure (kPa)', 'force (N)', 'force off by (N)', 'came back',
              'enable refused')
SOUND_HEAD = ('without a fault', 'runs', 'false alarms', 'simulated (s)', 'pressure (kPa)')
PROCESS_HEAD = ('node', 'event', 'verdict', 'detected after (s)', 'safe after (s)',
                'pressure (kPa)', 'force (N)', 'came back', 'enable afterwards')

_MEANING = """\
# Faults: what the controllers detect

Written by `fam_bundle benchmark-faults {options}--out docs/results/faults.md`; do not edit.

Each row is one fault on a simulated rig with {supply:.0f} kPa and neither a trip nor a relief
valve of its own, so that only the controllers act. The fault occurs in the middle of each phase
({phases})
under each policy ({policies}), lasts for {lasts:g} s and is
repaired. Figures are the worst of all runs; the worst fault comes first.

- **unsafe**: the true pressure exceeded {pressure:.0f} kPa (the controllers' trip of {trip:.0f}
  kPa plus the inflow of two control periods at {rate:g} Hz, at most the {relief:.0f} kPa
  at which a relief valve opens), the load reached its end stop, a latch left a valve open for
  more than 50 ms, a unit filled without `enable` after a latch or a loss of 2 s, or `enable`
  was accepted while a unit was above the trip.
- **harmless**: not detected, and within all limits. *Force off by* is the largest force error.
- **safe**: detected, and within all limits. *Detected after*: a node left ACTIVE. *Safe
  after*: all valves exhaust, or the supply is cut. Both count from the fault.

The runs use the nodes `recruitment_controller`, `pressure_pid` and `plant_simulator` on real ROS
in one process, in lock-step (simulated time, the same result each time). Faults of messages (late,
lost) are run in wall time, with one policy. In the phase *enabled*, `enable` is called during the
fault, {pressed:g} s after its onset.
"""


def fault_cells(line: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the row of a fault."""
    return (line['fault'], line['runs'], line['unsafe'], line['harmless'], line['safe'],
            line['detected'], _seconds(line['time_to_detect']), _seconds(line['time_to_safe']),
            f"{line['pressure'] / 1e3:.0f}", f"{line['force']:.0f}", _force(line['force_error']),
            line['came_back'], f"{line['enable_refused']} of {line['enable_called']}")


def sound_cells(line: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the row of a condition without a fault."""
    return (line['fault'], line['runs'], line['false_alarm'], f"{line['seconds']:.0f}",
            f"{line['pressure'] / 1e3:.0f}")


def process_cells(row: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the row of a process that was stopped."""
    return (row['node'], row['event'], row['verdict'], _seconds(row['time_to_detect']),
            _seconds(row['time_to_safe']), f"{row['pressure'] / 1e3:.0f}", f"{row['force']:.0f}",
            'yes' if row['came_back'] else 'no', row['enable'])


def markdown(result: Mapping[str, Any]) -> str:
    """Return the page of a result of the benchmark, as `benchmark-faults --json` writes it."""
    words = dict(result['conditions'])
    words['options'] = f"--policies {','.join(words['policies'])} " + (
        '--ros ' if result.get('processes') else '')
    parts = [_MEANING.format(**{**words, 'phases': ', '.join(words['phases']),
                                'policies': ', '.join(words['policies'])}),
             '\n', _rows(FAULT_HEAD, map(fault_cells, result['faults'])),
             '\n## False alarms\n\n',
             'These runs have no fault; `work` is sines up to 2 Hz on transitions between '
             'motor units.\n\n', _rows(SOUND_HEAD, map(sound_cells, result['sound']))]
    if result.get('processes'):
        parts += ['\n## Nodes that are killed, stopped and started again\n\n',
                  'One process for each node, in wall time, both motor units at a constant '
                  'force; the time-outs of sensors, setpoints and commands are 0.5 s here, for '
                  'busy machines. Detected after: a valve exhausts, or the supply is shut. '
                  'Enable: the final answer of the service; accepted is also unsafe while a '
                  'pressure loop or the rig has ended, and refused is right while the '
                  'publishers of a killed node still count, for up to 20 s. Pressures are those '
                  'of healthy sensors.\n\n',
                  _rows(PROCESS_HEAD, map(process_cells, result['processes']))]
    return ''.join(parts)


def _rows(head: Sequence[str], rows: Any) -> str:
    lines = [head, ('---',) * len(head), *rows]
    return ''.join(f"| {' | '.join(str(cell) for cell in line)} |\n" for line in lines)


def _seconds(value: float | None) -> str:
    return '–' if value is None else f'{value:.2f}'


def _force(value: float | None) -> str:
    return '–' if value is None else f'{value:.0f}'
