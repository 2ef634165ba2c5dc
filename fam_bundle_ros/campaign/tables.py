# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Results of recordings as tidy tables: one row for each recording, effect, or parameter.

Column names have the unit; columns of the table of specimens come last.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fam_bundle_ros.atomic import whole
from fam_bundle_ros.campaign.recordings import Recording
from fam_bundle_ros.discovery.specimen_table import Specimen

Row = dict[str, Any]
_TEXT, _NUMBER, _COUNT, _BOOL = 'string', 'float64', 'Int64', 'bool'
#: Columns of each table and their pandas types; further columns are from the table of specimens.
COLUMNS: dict[str, dict[str, str]] = {
    'recordings': {
        **dict.fromkeys(('file', 'muscle', 'status', 'error', 'duplicate_of', 'check_first'),
                        _TEXT),
        'counted': _BOOL, 'in_table': _BOOL,
        **dict.fromkeys(('rows', 'trials', 'rows_dropped'), _COUNT),
        **dict.fromkeys(('model_error_N', 'recalibrated_error_N', 'best_error_N', 'held_out_N',
                         'noise_floor_N', 'relative_error', 'bias_N', 'largest_N',
                         'lack_of_fit'), _NUMBER),
        **dict.fromkeys(('worst_region', 'verdict', 'summary', 'effects', 'replaced', 'removed',
                         'tied', 'notes', 'next_experiment'), _TEXT),
        'seconds': _NUMBER, 'data_sha256': _TEXT, 'address': _TEXT},
    'effects': {
        **dict.fromkeys(('file', 'muscle', 'effect', 'shape', 'family'), _TEXT),
        'named': _BOOL, 'tied': _BOOL, 'probability': _NUMBER, 'replaces': _TEXT,
        'error_N': _NUMBER, 'reason': _TEXT},
    'parameters': {
        **dict.fromkeys(('file', 'muscle', 'parameter'), _TEXT), 'value': _NUMBER, 'unit': _TEXT,
        'low': _NUMBER, 'high': _NUMBER, 'flag': _TEXT, 'tolerances_moved': _NUMBER,
        'sure': _BOOL, **dict.fromkeys(('data_value', 'data_low', 'data_high'), _NUMBER)}}
#: Flags of parameters whose value is not determined by the data.
UNSURE = ('at bound',)


def facts_of(specimen: Specimen | None) -> Row:
    """Return a specimen's row in the table of specimens: ``{'length [mm]': 127.0, ...}``."""
    if specimen is None:
        return {}
    units = specimen.units
    return {f'{name} [{units[name]}]' if name in units else name: value
            for name, value in {**specimen.remarks, **specimen.facts}.items()}


def recording_row(recording: Recording, result: Mapping[str, Any], address: str,
                  duplicate_of: str, as_read: bool = False) -> Row:
    """
    Return the row of a recording, from the result of `job.run` and the address of the job.

    ``duplicate_of`` is the first file with the same content, empty if there is none. ``as_read``:
    a recording counts that looks as if a unit or sign were wrong.
    """
    data, compared, diagnosed = (result.get(key, {}) for key in ('data', 'compare', 'diagnose'))
    error, recommended = diagnosed.get('error_N', {}), diagnosed.get('recommended', {})
    slips = '; '.join(compared.get('slips', []))
    row: Row = {
        'file': recording.file, 'muscle': recording.muscle,
        'status': 'failed' if result['error'] else 'done',
        'error': result['error'].removeprefix(f'{recording.path.name}: '),
        'duplicate_of': duplicate_of, 'check_first': slips,
        'counted': not (result['error'] or duplicate_of or slips and not as_read),
        'in_table': recording.specimen is not None,
        'rows': data.get('rows'), 'trials': data.get('trials'),
        'rows_dropped': sum(data.get('dropped', {}).values()) if data else None,
        'model_error_N': error.get('model'), 'recalibrated_error_N': error.get('recalibrated'),
        'best_error_N': error.get('best'), 'held_out_N': recommended.get('held_out_N'),
        **{key: compared.get(key) for key in ('relative_error', 'bias_N', 'largest_N',
                                              'lack_of_fit')},
        'worst_region': next((each['where'] for each in compared.get('located', [])), ''),
        **{key: diagnosed.get(key, '') for key in ('verdict', 'summary', 'next_experiment')},
        'effects': ', '.join(diagnosed.get('effects', [])),
        'replaced': ', '.join(f'{old}={new}'
                              for old, new in diagnosed.get('replaced', {}).items()),
        'removed': ', '.join(diagnosed.get('removed', [])),
        'tied': '; '.join(', '.join(group) for group in diagnosed.get('tied', [])),
        'notes': '; '.join(diagnosed.get('notes', [])),
        'noise_floor_N': diagnosed.get('noise_floor_N'), 'seconds': diagnosed.get('seconds'),
        'data_sha256': recording.sha256, 'address': address}
    return {**facts_of(recording.specimen), **row}


def effect_rows(recording: Recording, result: Mapping[str, Any]) -> list[Row]:
    """Return a row for each effect in the ranking of a recording."""
    diagnosed = result.get('diagnose', {})
    tied = {name for group in diagnosed.get('tied', []) for name in group}
    named = {*diagnosed.get('effects', []), *diagnosed.get('replaced', {}).values(),
             *(f'no {name}' for name in diagnosed.get('removed', []))}
    rows: dict[str, Row] = {}
    for entry in diagnosed.get('ranking', []):
        name = f"no {entry['shape']}" if entry['removes'] else entry['effect']
        if name in rows and rows[name]['probability'] >= entry['probability']:
            continue
        rows[name] = {
            'file': recording.file, 'muscle': recording.muscle, 'effect': name,
            'named': name in named, 'tied': name in tied,
            **{key: entry[key] for key in ('shape', 'family', 'probability', 'replaces',
                                           'error_N', 'reason')}}
    return list(rows.values())


def parameter_rows(recording: Recording, result: Mapping[str, Any]) -> list[Row]:
    """Return a row for each fitted parameter of a recording's best model."""
    return [{'file': recording.file, 'muscle': recording.muscle, 'parameter': key,
             'value': each['value'], 'unit': each['unit'], 'low': each['interval'][0],
             'high': each['interval'][1], 'flag': each['flag'],
             'tolerances_moved': each['tolerances'],
             'sure': bool(each['data_alone']) and each['flag'] not in UNSURE,
             **dict(zip(('data_value', 'data_low', 'data_high'), each['data_alone']))}
            for key, each in result.get('diagnose', {}).get('parameters', {}).items()]


def write_parquet(name: str, rows: list[Row], path: Path) -> None:
    """
    Write rows as a Parquet table (pandas and pyarrow), atomically; ``name`` is a key of `COLUMNS`.

    The columns and their types are those of `COLUMNS`, also if all recordings failed. A column of
    the table of specimens has numbers if any of its cells is a number.
    """
    import pandas
    types = dict(COLUMNS[name])
    others = dict.fromkeys(key for row in rows for key in row if key not in types)
    frame = pandas.DataFrame(rows, columns=[*types, *others])
    for key in others:
        numbers = frame[key].where(frame[key].map(lambda cell: isinstance(cell, float)))
        types[key] = 'float64' if numbers.notna().any() else 'string'
        if types[key] == 'float64':
            frame[key] = numbers
    with whole(path) as draft:
        frame.astype(types).to_parquet(draft, engine='pyarrow', index=False)
