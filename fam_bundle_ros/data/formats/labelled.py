# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Lines of a microcontroller in which each value has its name: 't:12 L:120.5 p:250 F:31.2'.

A clock without a name before them is kept: '[0.050] p=...', '10:15:42.123 -> p: ...'.
"""

from collections import Counter
from collections.abc import Sequence
import re

import numpy as np

from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.unit_names import is_unit
from fam_bundle_ros.told import counted

_PAIR = re.compile(r'([^\W\d][\w.]*(?: ?[\[(][^\])]*[\])])?)[\'"]?\s*[:=]\s*'
                   r'([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[Nn]a[Nn]|inf)'
                   r'(?:\s*([A-Za-z%\u00b0]+[/\w\u00b2^]*)(?![\w:=]|\s*[:=]))?')
#: A row of numbers without names.
_ROW = re.compile(r'\s*[-+]?[\d.,]+(?:[eE][-+]?\d+)?\s*[,;\t| ]\s*[-+.\d]')
#: What a terminal or Python's logging writes before each line.
_CLOCK = re.compile(r'\s*[\[(]?\s*((?:\d{4}-\d\d-\d\d[ T])?\d[\d.:]*(?:,\d{3})?)\s*[\])]?\s*'
                    r'(?:->|[-:,;>|])?\s*(?:[\[(]?(?:INFO|DEBUG)[\])]?[\s:-]*)?(?=[^\W\d])')


def labelled(name: str, lines: Sequence[str]) -> Table | None:
    """
    Return the table of lines that name their values, None where most lines are no such.

    Examples
    --------
    >>> table = labelled('log', ['p:1.5bar F:2', 'p:1.6bar F:3', 'p:1.7bar F:4'])
    >>> table.columns['F'], table.units
    (array([2., 3., 4.]), {'p': 'bar'})
    >>> list(labelled('log', ['[0.1] p=1 F=2', '[0.2] p=1 F=3', '[0.3] p=1 F=4']).columns['time'])
    ['0.1', '0.2', '0.3']
    """
    pairs = [_PAIR.findall(line) for line in lines]
    counts = Counter(tuple(key for key, _, _ in found) for found in pairs if len(found) > 1)
    if not counts:
        return None
    keys, often = counts.most_common(1)[0]
    rows = [k for k, found in enumerate(pairs) if tuple(key for key, _, _ in found) == keys]
    plain = sum(not found and _ROW.match(line) is not None
                for found, line in zip(pairs[rows[0]:], lines[rows[0]:]))
    if often < 3 or plain > often or len(set(keys)) < len(keys):  # titles of blocks of rows
        return None
    values = np.array([[float(value) for _, value, _ in pairs[k]] for k in rows])
    units = {key: unit for key, (_, _, unit) in zip(keys, pairs[rows[0]])
             if unit and is_unit(unit)}
    columns = dict(zip(keys, values.T))
    clock = [_CLOCK.match(lines[k]) for k in rows]
    if all(clock) and not any(recognise(key).quantity == 'time' for key in keys):
        columns = {'time': np.array([found[1] for found in clock if found], object), **columns}
    read = set(rows)
    lost = [k for k in range(rows[0], len(lines)) if k not in read and lines[k].strip()]
    notes = (f'{counted(len(lost), "line")} between the rows without a value for each of '
             f'{", ".join(keys)}, not read (the first is line {lost[0] + 1}: '
             f"'{lines[lost[0]].strip()[:40]}')",) if lost else ()
    return Table(name, 'text with a name beside each value', columns, units, np.array(rows) + 1,
                 notes=notes)
