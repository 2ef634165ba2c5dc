# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows of several specimens, or of one motor unit each, in one table."""

import re

from fam_bundle_ros.data.cells import cell_text
from fam_bundle_ros.data.column_names import words_of
from fam_bundle_ros.data.formats.table import Table

#: What a column is called that tells of which muscle a row is, its words joined.
_NAMES = re.compile('(specimen|muscle|actuator|muskel|aktor|probe|pruefling|dut|mu|motor ?unit|'
                    'serial|fam|pam)( (id|no|nr|num|number|name|nummer))?')
#: Most muscles of one table, and fewest rows of each on average.
_MOST, _ROWS = 50, 12


def several_muscles(table: Table) -> list[str]:
    """Return a note on each column by which the rows are of several muscles."""
    notes = []
    for header, column in table.columns.items():
        if not _NAMES.fullmatch(' '.join(words_of(header))):
            continue
        found = list(dict.fromkeys(filter(None, map(_shown, column))))
        if 1 < len(found) <= min(_MOST, len(column) // _ROWS):
            notes.append(
                f"'{header}' is {', '.join(found[:3])}{', ...' * (len(found) > 3)}: all rows are "
                'read as one muscle; expected a file for each specimen, or a column of pressure '
                'for each motor unit')
    return notes


def _shown(cell: object) -> str:
    """Return a cell as text: a number without decimals that are zero, '' for nan."""
    return ('' if cell != cell else f'{cell:g}') if isinstance(cell, float) else cell_text(cell)
