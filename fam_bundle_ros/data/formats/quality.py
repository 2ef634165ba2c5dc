# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Columns that say which readings are good: OPC quality, 'valid', a flag of outliers."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fam_bundle_ros.data.column_names import words_of
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.told import counted

#: What columns are called whose cells say 'good', the words of each joined.
_QUALITY = frozenset('quality validity valid isvalid opcquality gueltig'.split())
#: Those that may tell the state of the rig as well.
_STATE = frozenset('status'.split())
#: What columns are called whose cells say 'bad'.
_FAULTS = frozenset("""invalid exclude excluded outlier isoutlier reject rejected discard bad
    ungueltig ausreisser ausgeschlossen""".split())
#: Words for a good reading.
GOOD = frozenset('good ok valid true 1 192 yes ja'.split())
#: Words for a good state: numbers may count states.
_WELL = frozenset('good ok valid'.split())
_YES = frozenset('true 1 yes ja x'.split())


def of_bad_quality(table: Table, headers: Sequence[str], rows: np.ndarray, states: frozenset[str],
                   ) -> tuple[np.ndarray, list[str]]:
    """
    Return which of some rows are bad, and the columns that say so; most rows are good.

    ``headers`` are columns that may say so, ``states`` words for good rows in a column 'status'.
    """
    bad, used = np.zeros(len(rows), bool), []
    for header in headers:
        name = ''.join(words_of(header))
        words, good = (states, True) if name in _STATE else (GOOD, True) if (
            name in _QUALITY) else (_YES, False)
        if good or name in _FAULTS:
            found = np.array([_word(cell) in words for cell in table.columns[header]], bool)
            marked = found != good
            if marked[rows].mean() < 0.5:
                bad |= rows & marked
                used.append(header)
    return bad, used


def without_bad(table: Table) -> Table:
    """Return a table without the rows that one of its columns calls bad, and this column."""
    bad, used = of_bad_quality(table, list(table.columns), np.ones(len(table.rows), bool), _WELL)
    if not bad.any():
        return table
    return replace(table, rows=table.rows[~bad], columns={
        header: cells[~bad] for header, cells in table.columns.items() if header not in used},
        ).noted(
        f"{counted(int(bad.sum()), 'row')} left out that {' and '.join(map(repr, used))} "
        f'{"calls" if len(used) == 1 else "call"} bad (first row {table.rows[np.argmax(bad)]})')


def _word(cell: Any) -> str:
    return f'{cell:g}' if isinstance(cell, float) else str(cell).strip().casefold()
