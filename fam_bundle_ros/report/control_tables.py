# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows of the tables of the control benchmark, for the terminal and the page."""

from collections.abc import Mapping
from typing import Any

#: Column titles of `plant_cells`; pairs are reversal_aware and equal_pressure.
PLANT_HEAD = ('plant', 'model error (N rms)', 'rms (N)', 'of equal pressure', 'ratio', 'worst',
              'air ratio', 'worst air', 'at switches (N)', 'the same, equal pressure',
              'moved ratio', 'switches', 'chatter')
FIGURE_HEAD = ('figure', 'median', '90 % quantile', 'worst', 'target', 'worst on', '')
_KEYS = ('model_error', 'rms_N', 'rms_N_equal_pressure', 'rms_ratio', 'rms_ratio_worst',
         'air_ratio', 'air_ratio_worst', 'error_at_switches',
         'error_at_switches_equal_pressure', 'moved_ratio')


def plant_cells(line: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the row of a plant."""
    return (line['plant'], *(_short(line[key]) for key in _KEYS), line['switches'],
            line['chatter'])


def figure_cells(figure: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the row of a figure with its target."""
    verdict = {None: 'not run', True: 'reached', False: 'not reached'}[figure['reached']]
    return (figure['figure'], *(_short(figure[key]) for key in ('median', 'nine_in_ten',
                                                                'worst')),
            figure['must'], figure['where'], verdict)


def _short(value: float | None) -> str:
    """Return a number with two decimals, or a dash."""
    return '–' if value is None else f'{value:.2f}'
