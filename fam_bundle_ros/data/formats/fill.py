# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Levels that stand in the first row of their block only, as merged cells are saved."""

import numpy as np

from fam_bundle_ros.data.column_names import STRAINS
from fam_bundle_ros.data.formats.table import Table

#: Fewer readings than this are no channel of a slow sensor; larger shares are gaps.
_FEWEST, _SHARE = 12, 0.34


def filled_down(table: Table) -> Table:
    """
    Return a table with the level of each block in all of its rows; others as they are.

    It is a pressure, or a strain, that has a number in the first row of readings and in few
    others, with blanks below each: in less than 12, or in a map without a clock.
    """
    meant = table.quantities
    force = next((column for header, column in table.columns.items()
                  if meant[header] == 'force' and column.dtype.kind == 'f'), None)
    if force is None or len(force) < _FEWEST:
        return table
    rows = np.isfinite(force)
    whole = table
    for header, column in table.columns.items():
        if meant[header] not in ('pressure', *STRAINS) or column.dtype.kind != 'f':
            continue
        known = np.flatnonzero(np.isfinite(column))
        few = 1 < len(known) <= _SHARE * rows.sum()
        if few and known[0] <= np.argmax(rows) and np.diff(known).min() > 1 and (
                len(known) < _FEWEST or 'time' not in meant.values()):
            last = np.searchsorted(known, np.arange(len(column)), 'right') - 1
            whole = whole.with_column(
                header, np.where(rows & (last >= 0), column[known[last]], column)).noted(
                    f"'{header}' stands in {len(known)} of {rows.sum()} rows: taken for the rows "
                    'below each')
    return whole
