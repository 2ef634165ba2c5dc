# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Maps with a column of force for each way of a loop: 'Force up', 'Force down'."""

import re

import numpy as np

from fam_bundle_ros.data.formats.table import Table

#: Words for one way and for the way back.
_WAYS = (('up', 'down'), ('auf', 'ab'), ('aufw\u00e4rts', 'abw\u00e4rts'), ('hin', 'r\u00fcck'),
         ('loading', 'unloading'), ('belastung', 'entlastung'), ('inflation', 'deflation'),
         ('inflating', 'deflating'), ('ascending', 'descending'), ('increasing', 'decreasing'),
         ('forward', 'backward'), ('forward', 'reverse'), ('forth', 'back'))


def one_way_below_the_other(table: Table) -> Table:
    """
    Return a table whose columns for the two ways of a loop are two trials; others as they are.

    Columns that are not of one way are those of both. A table with a clock holds no map.
    """
    for ways in _WAYS:
        there, back = ({name: header for header in table.columns
                        if (name := _without(header, way))} for way in ways)
        if not there or there.keys() != back.keys() or there.keys() & set(table.columns):
            continue
        if 'time' in table.quantities.values() or any(
                table.units.get(there[name]) != table.units.get(back[name]) for name in there):
            return table
        both = {header: header for header in table.columns
                if header not in (*there.values(), *back.values())}
        whole = table.stacked([{**both, **there}, {**both, **back}])
        if 'trial' not in table.quantities.values():
            whole = whole.with_column('trial', np.repeat(np.array(ways, object), len(table.rows)))
        return whole.noted(f"columns '{ways[0]}' and '{ways[1]}' are the two ways of a loop: read "
                           'one below the other')
    return table


def _without(header: str, word: str) -> str:
    """
    Return a header without a word, '' where it does not have it.

    Examples
    --------
    >>> _without('Force up [N]', 'up'), _without('Supply', 'up')
    ('Force [N]', '')
    """
    text, count = re.subn(rf'(?<![^\W_])[\s_]*{word}(?![^\W_])', ' ', header, flags=re.IGNORECASE)
    return ' '.join(text.split()).strip('_ ') if count == 1 else ''
