# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What a user tells for a quantity: a column, a column with its calibration, or a constant.

``L [mm]``, ``-Kanal 3 [N]``, ``AI1 [V] * 50 N - 2 N``, ``position [mm] - 12 mm``, ``F1 + F2``,
``300 kPa``.
"""

from collections.abc import Mapping
from dataclasses import dataclass
import re

from fam_bundle_ros.data.cells import is_text, looks_like_time
from fam_bundle_ros.data.column_names import likes, QUANTITIES, unit_for
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.unit_names import Unit, unit_of, VOLTS
from fam_bundle_ros.errors import InputError

_NUMBER = r'[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?'
_CONSTANT = re.compile(rf'({_NUMBER})\s*([^\s\[].*)?')
#: A column, its scale (the value of one count), and an offset.
_CALIBRATED = re.compile(rf'(?P<words>.*?\S)(?:\s*\*\s*(?P<scale>{_NUMBER})(?:\s*(?P<unit>'
                         rf'[^\s\d+*-]\S*))?)?(?:\s+(?P<sign>[-+])\s*(?P<zero>{_NUMBER})'
                         rf'(?:\s*(?P<zero_unit>[^\s\d+*-]\S*))?)?')


@dataclass
class Choice:
    """A column that is used, or a constant."""

    #: None for a constant.
    header: str | None
    #: Its factor is that of a calibration, where one is told.
    unit: Unit | None = None
    #: By which readings are multiplied.
    sign: int = 1
    #: Added to readings that are in SI units and have their sign.
    offset: float = 0.0
    #: Of a constant, SI.
    value: float = 0.0
    #: What header and unit say of a pressure.
    absolute: bool | None = None
    #: Where it comes from, in words.
    why: str = ''

    @property
    def in_lengths(self) -> bool:
        """Whether readings are in m, and no ratios."""
        return self.unit is not None and self.unit.like == 'm'


def with_sums(table: Table, told: Mapping[str, str]) -> Table:
    """
    Return a table with a column for each sum or difference of two that is told.

    Raises
    ------
    InputError
        Where the two have not the same unit.
    """
    columns, whole = table.columns, table
    for text in map(str.strip, told.values()):
        parts = re.fullmatch(r'(.*?\S)\s+([-+])\s+(\S.*)', text)
        if parts is None or _header(table, text)[0]:
            continue
        one, other = (_header(table, parts[at])[0] for at in (1, 3))
        if not one or not other or is_text(columns[one]) or is_text(columns[other]):
            continue
        unit, second = table.unit_text(one), table.unit_text(other)
        if unit != second:
            raise InputError(f"{table.name}: '{one}' is in {unit}, '{other}' in {second}; "
                             'expected one unit')
        if unit and parts[2] == '-' and (measure := unit_of(unit, 'Pa')):
            unit = f'{measure.text} gauge'  # whatever both are relative to
        whole = whole.with_column(
            text, columns[one] + (1 if parts[2] == '+' else -1) * columns[other], unit or '')
    return whole


def told_column(table: Table, key: str, text: str) -> Choice:
    """
    Return the column of a table that a user's words mean, or a constant.

    Parameters
    ----------
    key : str
        Quantity, ``pressure.<motor unit>`` for one of several pressures.
    text : str
        A header, or its name, or its number; with a unit in brackets, a minus before it where
        the sign is to be turned round, and a calibration behind it: ``* 50 N``, ``- 12 mm``, or
        both in this order. Or a number with a unit.

    Raises
    ------
    InputError
        Where no column or more than one is meant, and where a unit does not fit.
    """
    base = key.partition('.')[0]
    plain = _column(table, base, text)
    if plain is not None:
        return plain
    calibrated = _CALIBRATED.fullmatch(text)
    if calibrated and (calibrated['scale'] or calibrated['zero']) and base != 'trial':
        choice = _column(table, base, calibrated['words'],
                         _worth(table, base, calibrated) if calibrated['scale'] else None)
        if choice is not None:
            return _shifted(table, base, choice, calibrated)
    number = _CONSTANT.fullmatch(text)
    if number and base != 'trial' and (number[2] or base == 'strain'):
        unit_text = (number[2] or '').strip()
        if base == 'time' and unit_text in ('Hz', 'kHz', 'Sa/s', '1/s'):
            rate = float(number[1]) * (1e3 if unit_text == 'kHz' else 1.0)
            if rate > 0:
                return Choice(None, Unit('s', 1.0, 's'), value=1.0 / rate, why='as told')
        unit = _fitting(table, base, unit_text, text)
        return Choice(None, unit, value=float(number[1]) * unit.factor, why='as told')
    have = ', '.join(f"'{header}'" for header in table.columns)
    raise InputError(f"{table.name}: no column '{text}' for {key}; expected one of {have}, or its "
                     'number')


def name_of(header: str) -> str:
    """Return a header without the brackets at its end."""
    return re.sub(r'\s*[\[({<][^\[({<]*[\])}>]\s*$', '', header).strip()


def _column(table: Table, base: str, text: str, unit: Unit | None = None) -> Choice | None:
    """Return the choice of a column, its unit as given, told, or as the header says."""
    (header, unit_text), sign = _header(table, text), 1
    if not header and text.startswith('-'):
        (header, unit_text), sign = _header(table, text[1:].strip()), -1
    if not header:
        return None
    match = table.meaning(header)
    if unit is None:
        unit = match.unit
        if unit_text is None and (unit is None or unit.like not in likes(base)):
            square = re.search(r'\[([^\[\]]*)\]\s*$', header)
            unit_text = table.units.get(header) or (square and square[1])
            # what stands in round brackets may be a remark
            said = table.unit_text(header)
            unit = unit_for(base, said) if said else None
        if unit_text is not None and base != 'trial' and not (
                base == 'time' and looks_like_time(table.columns[header])):  # 't [min:s]'
            unit = _fitting(table, base, unit_text, header)
        if unit is not None and base != 'trial' and unit.like not in likes(base):
            unit = None
    absolute = match.absolute if unit is None or unit.absolute is None else unit.absolute
    # an elongation lengthens the muscle: its sign is turned for a strain
    sign = -sign if base == 'elongation' else sign
    return Choice(header, unit, sign, absolute=absolute, why='as told')


def _worth(table: Table, base: str, told: re.Match[str]) -> Unit:
    """Return the unit of one count of a column: '* 50 N', or '* 50 N/V' of one in V or mV."""
    text, header = told['unit'] or '', _header(table, told['words'].removeprefix('-').strip())[0]
    own = table.unit_text(header) or ''
    unit_text, _, per = text.rpartition('/')
    share = 1.0
    if per == own or {per, own} <= set(VOLTS):  # 'N/mm' is no force per anything
        text, share = unit_text or text, VOLTS.get(own, 1.0) / VOLTS.get(per, 1.0)
    unit = _fitting(table, base, text, told['words'])
    return unit._replace(factor=float(told['scale']) * unit.factor * share)


def _shifted(table: Table, base: str, choice: Choice, told: re.Match[str]) -> Choice:
    """Return a choice with the offset of its calibration, and the calibration in words."""
    if told['zero']:
        zero = _fitting(table, base, told['zero_unit'] or '', told['words'])
        if choice.unit is not None and choice.unit.like != zero.like:
            raise InputError(f"{table.name}: column '{choice.header}' is in {choice.unit.text}, "
                             f"and {zero.text or 'a plain number'} is added; expected units of "
                             'one kind')
        offset = float(told['zero']) * zero.factor * (-1.0 if told['sign'] == '-' else 1.0)
        choice.offset = -offset if base == 'elongation' else offset
    choice.why = 'as told: ' + told.string.removeprefix(told['words']).strip()
    return choice


def _fitting(table: Table, base: str, text: str, header: str) -> Unit:
    unit = unit_for(base, text)
    if unit is not None:
        return unit
    raise InputError(f"{table.name}: column '{header}': unit '{text}' does not fit; expected a "
                     f'unit like {QUANTITIES[base]}')


def _header(table: Table, words: str) -> tuple[str, str | None]:
    """Return the header that a text names, '' for none, and the unit in the text, if any."""
    headers = list(table.columns)
    if not words:
        return '', None
    same = ' '.join(words.split())
    if same in headers:
        return same, None
    match = re.fullmatch(r'(.*?)\s*\[([^\[\]]*)\]', same)
    name, unit = (match[1], match[2]) if match else (same, None)
    if name in headers:
        return name, unit
    # the whole header in another case, or its name without the unit in brackets
    for plain, wanted, own in ((str, same, None), (name_of, name, unit)):
        alike = [header for header in headers
                 if plain(header).casefold() == plain(wanted).casefold()]
        if len(alike) == 1:
            return alike[0], own
        if len(alike) > 1:
            raise InputError(f"{table.name}: '{words}' may be "
                             f"{' or '.join(repr(header) for header in alike)}; expected the "
                             'whole header')
    number = re.fullmatch(r'(?:column )?(\d+)', name)
    if number and 1 <= int(number[1]) <= len(headers):
        return headers[int(number[1]) - 1], unit
    return '', None
