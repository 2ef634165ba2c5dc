# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Lines above a table that say what its columns are: 'CH1 = load cell [N]', '# col 2: strain'."""

from collections.abc import Collection
from dataclasses import replace
import re

from fam_bundle_ros.data.column_names import recognise, unit_text_of
from fam_bundle_ros.data.formats.table import names_column, Table, unique

#: 'CH1 = load cell [N]', 'column 3: pressure (kPa)', 'AI0 -> F [N]'.
_ENTRY = re.compile(r'[#%!/;*"\s]*(?P<key>[^\W\d_]+[\s_.]?\d+|\d+)\s*(?:=|:|->|\)|\s-\s)\s*'
                    r'(?P<name>\S.*?)["\s,;]*')
#: What a column is called in a list of all, by its place.
_PLACE = re.compile(r'(?:col(?:umn)?|spalte|field|#)?\s*(\d+)', re.IGNORECASE)


def with_legend(table: Table, told: Collection[str] = ()) -> Table:
    """
    Return a table with the names that lines above it give to its columns; others as they are.

    A legend names each column by its place, or some by headers that say nothing ('CH1'). Headers
    that the user names (in one of ``told``) stay.
    """
    entries = {match['key']: match['name'] for line in table.above
               if (match := _ENTRY.fullmatch(line.strip()))}
    places = {int(match[1]): name for key, name in entries.items()
              if (match := _PLACE.fullmatch(key))}
    headers = list(table.columns)
    known = [header for header in headers if table.meaning(header).quantity]
    first = min(places, default=1)
    if first in (0, 1) and list(places) == list(range(first, first + len(headers))) and (
            sum(recognise(name).quantity != '' for name in places.values()) > len(known)):
        names = dict(zip(headers, places.values()))
    else:
        keys = {_plain(key): name for key, name in entries.items() if recognise(name).quantity}
        names = {header: keys[_plain(header)] for header in headers
                 if header not in known and _plain(header) in keys}
    others = [text for text in told
              if not any(names_column(text, name) for name in names.values())]
    names = {header: name for header, name in names.items()
             if not any(names_column(text, header) for text in others)}
    if not names:
        return table
    new = unique([names.get(header, header) for header in headers])
    return replace(
        table, columns=dict(zip(new, table.columns.values())), blanks=None,
        units={name: table.units[header] for name, header in zip(new, headers)
               if header in table.units and unit_text_of(name) is None},
        notes=(*table.notes, 'names as lines above the table tell: ' + ', '.join(
            f"'{header}' is '{name}'" for header, name in names.items())))


def _plain(key: str) -> str:
    return re.sub(r'[\W_]', '', key).casefold()
