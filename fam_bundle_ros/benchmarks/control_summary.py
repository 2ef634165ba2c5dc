# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Summary of the control benchmark: a line for each plant and for each figure with a target."""

from typing import Any

import numpy as np

#: Trajectories with jumps of the reference, whose error hides that of the transition.
_JUMPS = ('steps', 'load_step')


def summarise(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """
    Return the figures of our controller compared with equal pressure.

    Returns
    -------
    dict
        ``figures``: one dict for each figure with a target: ``figure``, ``median``,
        ``nine_in_ten`` (90 % quantile), ``worst``, ``where`` (the worst case), ``must`` (the
        target as text), ``reached`` (None if it was not run), ``cases``. ``plants``: one dict for
        each plant, the worst first, `nominal` last:
        ``plant``, ``model_error`` (N), ``cases``, and median and worst of ``rms_ratio``,
        ``air_ratio``, ``dip_excess``, ``moved_ratio``, ``switches``, ``chatter``, ...
        ``diagnosed``: for each plant and number of units on which `diagnosed` ran, the worst
        first: ``plant``, ``units``, ``model`` (names of effects), ``model_error`` (N) and that of
        the model before, ``cases``, and median and worst of its ``rms_ratio`` and ``air_ratio`` to
        `reversal_aware`. ``not_reached``: sentences.
    """
    cases = _by_case(rows)
    figures = _figures(cases)
    return {'figures': figures, 'plants': _plants(cases), 'diagnosed': _diagnosed(cases),
            'not_reached': [_sentence(figure) for figure in figures
                            if figure['reached'] is False]}


def _by_case(rows):
    """Return for each case its rows by controller."""
    found: dict[tuple, dict[str, Any]] = {}
    for row in rows:
        key = (row['plant'], row['trajectory'], row['units'], row['seed'])
        found.setdefault(key, {})[row['controller']] = row
    return found


def _ratio(quantity, of='reversal_aware', over='equal_pressure'):
    """Return a function of a case: a figure of a controller over that of another, if both ran."""
    def value(case: dict[str, Any]) -> Any:
        return case[of][quantity] / case[over][quantity] if of in case and over in case else None
    return value


rms_ratio, air_ratio = _ratio('tracking_rms'), _ratio('air_mass')
rms_diagnosed, air_diagnosed = (_ratio(quantity, 'diagnosed', 'reversal_aware')
                                for quantity in ('tracking_rms', 'air_mass'))


def _transition(row):
    """Return whether the largest errors of a run are those of transitions, N."""
    return row['kind'] == 'force' and row['trajectory'] not in _JUMPS


def dip_excess(case: dict[str, Any]) -> float | None:
    """Return our largest error around our switches minus that of equal pressure, N."""
    ours, beside = case['reversal_aware'], case['equal_pressure']
    if not _transition(ours) or ours['error_there'] is None:
        return None
    return ours['error_there'] - beside['error_there']


def dip_of_neglect(case: dict[str, Any]) -> float | None:
    """Return the ratio of our deepest dip at switches to that of the policy `neglect`."""
    ours, neglect = case['reversal_aware'], case.get('neglect')
    if not (neglect and _transition(ours) and ours['dip_depth'] and neglect['dip_depth']):
        return None
    return ours['dip_depth'] / neglect['dip_depth']


def _one(wanted, value):
    return lambda case: value(case) if wanted(case['reversal_aware']) else None


#: Statistics of a figure over all cases, and their names.
_STATISTICS = {'median': 'median', 'nine_in_ten': '90 % quantile', 'worst': 'worst'}
_USUAL = {'median': 0.8, 'nine_in_ten': 1.0, 'worst': 1.3}
#: Figure, its value in a case (None if it has none), and upper limits of the statistics.
FIGURES = (
    ('tracking rms over equal pressure', rms_ratio, _USUAL),
    ('strain, load not known: rms over equal pressure',
     _one(lambda r: r['kind'] == 'strain', _ratio('tracking_rms', 'untold_load')), _USUAL),
    ('air over equal pressure', air_ratio, {'worst': 1.05}),
    ('air over equal pressure, one unit is enough', _one(lambda r: r['one_unit'], air_ratio),
     {'worst': 0.7}),
    ('error at switches minus that of equal pressure (N)', dip_excess, {'worst': 1.0}),
    ('dip at switches over that of neglect', dip_of_neglect, {'worst': 1.0 / 3.0}),
    ('with the model of a record: rms over that before', rms_diagnosed, {'median': 0.8}),
    ('with the model of a record: air over that before', air_diagnosed, {'worst': 1.05}),
    ('runs with chatter', lambda case: float(case['reversal_aware']['chatter']), {'worst': 0.0}),
    ('constant force, strain moved: rms over equal pressure',
     _one(lambda r: r['trajectory'] == 'moved', rms_ratio), {'worst': 1.2}),
    ('nominal: rms over that without feedback', _ratio('tracking_rms', over='no_feedback'),
     {'worst': 1.08}),
    ('nominal: air over that without feedback', _ratio('air_mass', over='no_feedback'),
     {'worst': 1.08}),
    ('nominal: air over the least that any allocation needs',
     lambda case: case['reversal_aware'].get('air_over_least'), {'worst': 1.10}),
)


def _figures(cases):
    found = []
    for name, value, limits in FIGURES:
        values = {key: v for key, case in cases.items() if (v := value(case)) is not None}
        must = ', '.join(f'{_STATISTICS[each]} at most {limit:.3g}'
                         for each, limit in limits.items())
        figure: dict[str, Any] = {'figure': name, 'must': must, 'cases': len(values),
                                  **dict.fromkeys(_STATISTICS), 'where': '', 'reached': None}
        if values:
            numbers = np.array(list(values.values()))
            key = max(values, key=lambda k: values[k])
            told = {'median': float(np.median(numbers)),
                    'nine_in_ten': float(np.quantile(numbers, 0.9, method='higher')),
                    'worst': float(numbers.max())}
            figure.update(told, where=f'{key[0]} {key[1]}, {key[2]} units',
                          reached=all(told[each] <= limit + 1e-9
                                      for each, limit in limits.items()))
        found.append(figure)
    return found


def _sentence(figure):
    return (f"{figure['figure']}: median {figure['median']:.3g}, 90 % quantile "
            f"{figure['nine_in_ten']:.3g}, worst {figure['worst']:.3g} ({figure['where']}); "
            f"target: {figure['must']}")


def _plants(cases):
    """Return a line for each plant, sorted by the median tracking ratio, nominal last."""
    names = list(dict.fromkeys(key[0] for key in cases))
    lines = []
    for name in names:
        own = [case for key, case in cases.items() if key[0] == name]
        moved = [rms_ratio(case) for case in own
                 if case['reversal_aware']['trajectory'] == 'moved']
        ours = [case['reversal_aware'] for case in own]
        beside = [case['equal_pressure'] for case in own]
        ratios, air = [rms_ratio(case) for case in own], [air_ratio(case) for case in own]
        excess = [v for case in own if (v := dip_excess(case)) is not None]
        lines.append({
            'plant': name, 'cases': len(own),
            'model_error': max(row['model_error'] for row in ours if row['units'] == min(
                other['units'] for other in ours)),
            'rms_N': _median_of_forces(ours), 'rms_N_equal_pressure': _median_of_forces(beside),
            'rms_ratio': float(np.median(ratios)), 'rms_ratio_worst': max(ratios),
            'air_ratio': float(np.median(air)), 'air_ratio_worst': max(air),
            'error_at_switches': _largest(ours, 'error_there'),
            'error_at_switches_equal_pressure': _largest(beside, 'error_there'),
            'dip_excess': max(excess) if excess else None,
            'moved_ratio': max(moved) if moved else None,
            'switches': sum(row['switches'] for row in ours),
            'chatter': sum(row['chatter'] for row in ours)})
    return sorted(lines, key=lambda line: (line['plant'] == 'nominal', -line['rms_ratio']))


def _diagnosed(cases):
    """Return a line for each plant and number of units with `diagnosed`, the worst first."""
    found: dict[tuple[str, int], list[Any]] = {}
    for key, case in cases.items():
        if 'diagnosed' in case:
            found.setdefault((key[0], key[2]), []).append(case)
    lines = []
    for (plant, units), own in found.items():
        rms, air = map(rms_diagnosed, own), map(air_diagnosed, own)
        line = {'plant': plant, 'units': units, 'model': own[0]['diagnosed']['model'],
                'model_error_before': own[0]['reversal_aware']['model_error'],
                'model_error': own[0]['diagnosed']['model_error'], 'cases': len(own)}
        for name, values in (('rms_ratio', list(rms)), ('air_ratio', list(air))):
            line |= {name: float(np.median(values)), f'{name}_worst': max(values)}
        lines.append(line)
    return sorted(lines, key=lambda line: -line['rms_ratio'])


def _median_of_forces(rows):
    values = [row['tracking_rms'] for row in rows if row['kind'] == 'force']
    return float(np.median(values)) if values else None


def _largest(rows, key):
    values = [row[key] for row in rows if _transition(row) and row[key] is not None]
    return max(values) if values else None
