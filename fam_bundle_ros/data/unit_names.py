# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Spellings of units in logs and their factors to SI: 'psia', 'kg/cm2', 'mm WS'."""

from functools import lru_cache
import re
from typing import NamedTuple

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.units import registry, si_factor

#: Units of voltages, in V.
VOLTS = {'V': 1.0, 'Volt': 1.0, 'Volts': 1.0, 'mV': 1e-3, 'uV': 1e-6, '\u00b5V': 1e-6}
#: Units of readings that need a calibration.
ELECTRIC = frozenset((*VOLTS, 'mV/V', 'A', 'mA', 'counts', 'count', 'digits', 'ADC', 'px', 'pixel',
                      'pixels'))
#: SI unit: {spelling in lower case without blanks: factor}. Others are left to pint.
_UNITS: dict[str, dict[str, float]] = {
    'N': {'n': 1.0, 'newton': 1.0, 'newtons': 1.0, 'kn': 1e3, 'mn': 1e-3, 'cn': 1e-2,
          'dan': 10.0, 'lbf': 4.4482216, 'lb': 4.4482216, 'lbs': 4.4482216, 'pound': 4.4482216,
          'pounds': 4.4482216, 'kgf': 9.80665, 'kg': 9.80665, 'kilogram': 9.80665,
          'kp': 9.80665, 'gf': 9.80665e-3, 'g': 9.80665e-3, 'gram': 9.80665e-3,
          'ozf': 0.27801385, 'oz': 0.27801385, 'ニュートン': 1.0, '牛': 1.0},
    'Pa': {'pa': 1.0, 'hpa': 100.0, 'kpa': 1e3, 'mpa': 1e6, 'n/m2': 1.0, 'n/mm2': 1e6,
           'n/cm2': 1e4, 'kn/m2': 1e3, 'bar': 1e5, 'mbar': 100.0, 'psi': 6894.757,
           'psid': 6894.757, 'lbf/in2': 6894.757, 'lb/in2': 6894.757, 'psf': 47.88026,
           'ksi': 6894757.0, 'atm': 101325.0, 'at': 98066.5,
           'kgf/cm2': 98066.5, 'kg/cm2': 98066.5, 'kp/cm2': 98066.5,
           'torr': 133.32237, 'mmhg': 133.32237, 'inhg': 3386.389, 'cmh2o': 98.0665,
           'mmh2o': 9.80665, 'inh2o': 249.08891, 'mh2o': 9806.65, 'mmws': 9.80665, 'mws': 9806.65,
           'キロパスカル': 1e3, '千帕': 1e3},
    'm': {'m': 1.0, 'meter': 1.0, 'metre': 1.0, 'dm': 0.1, 'cm': 1e-2, 'zentimeter': 1e-2,
          'mm': 1e-3, 'millimeter': 1e-3, 'millimetre': 1e-3, 'um': 1e-6, 'nm': 1e-9,
          'in': 0.0254, 'inch': 0.0254, 'inches': 0.0254, 'zoll': 0.0254, '"': 0.0254,
          'mil': 2.54e-5, 'mils': 2.54e-5, 'ft': 0.3048,
          'ミリメートル': 1e-3, 'ミリ': 1e-3, '毫米': 1e-3},
    's': {'s': 1.0, 'sec': 1.0, 'secs': 1.0, 'second': 1.0, 'seconds': 1.0, 'sek': 1.0,
          'sekunde': 1.0, 'sekunden': 1.0, 'ms': 1e-3, 'msec': 1e-3, 'millis': 1e-3,
          'milliseconds': 1e-3, 'millisekunden': 1e-3, 'us': 1e-6, 'usec': 1e-6,
          'micros': 1e-6, 'microseconds': 1e-6, 'ns': 1e-9,
          'min': 60.0, 'minutes': 60.0, 'minuten': 60.0, 'h': 3600.0, 'hours': 3600.0,
          'stunden': 3600.0, 'd': 86400.0, 'days': 86400.0, 'tage': 86400.0,
          '秒': 1.0, 'ミリ秒': 1e-3, '毫秒': 1e-3},
    '1': {'1': 1.0, '-': 1.0, '': 1.0, 'ratio': 1.0, 'mm/mm': 1.0, 'm/m': 1.0, 'in/in': 1.0,
          'dimensionless': 1.0, 'unitless': 1.0, 'none': 1.0, '%': 1e-2, 'percent': 1e-2,
          'pct': 1e-2, 'prozent': 1e-2, 'permille': 1e-3, '\u2030': 1e-3, 'l0': 1.0},
    '1/s': {'1/s': 1.0, '/s': 1.0, 's-1': 1.0, 's^-1': 1.0, '%/s': 1e-2, '%/min': 1e-2 / 60.0},
}
#: Units of pint that stand in logs, those that take a prefix first. Others are words: 'dat' of
#: 'data' is no decatechnical atmosphere, a 'px' no 1/96 inch.
_PREFIXED = frozenset("""pascal bar newton meter second gram strain dyne torr force_gram meter_Hg
    meter_H2O pound_force_per_square_inch""".split())
_MEASURES = _PREFIXED | frozenset("""minute hour day inch foot yard micron pound ounce
    force_pound force_ounce force_kilogram force_metric_ton kip kip_per_square_inch inch_Hg
    inch_H2O standard_atmosphere technical_atmosphere percent permille ppm""".split())
_PREFIXES = frozenset("""giga mega kilo hecto deca deci centi milli micro nano""".split()) | {''}
#: Letters of a unit that is no word.
_ABBREVIATION = 4
_ABSOLUTE = re.compile(r'^(?P<unit>.*?)[\s_(\[]*(?:(?P<abs>absolute|absolut|abs|a)|'
                       r'(?P<gauge>gauge|relative|relativ|rel|g|\u00fc))[.)\]]*$', re.IGNORECASE)


class Unit(NamedTuple):
    """
    A unit as written, its factor to SI, and the SI unit that it is like.

    ``absolute`` is what the unit says of a pressure: absolute, gauge (False) or neither (None).
    """

    text: str
    factor: float
    like: str
    absolute: bool | None = None


#: Full-width letters, digits and brackets of East Asian text, and the usual ones.
_HALF = {0x3000: 0x20, **{code: code - 0xFEE0 for code in range(0xFF01, 0xFF5F)}}


def half_width(text: str) -> str:
    """
    Return a text with full-width letters, digits and brackets as the usual ones.

    Examples
    --------
    >>> half_width('圧力（ＭＰａ）')
    '圧力(MPa)'
    """
    return text.translate(_HALF)


@lru_cache(maxsize=4096)
def unit_of(text: str, like: str) -> Unit | None:
    """
    Return the unit that a text means, of the dimension of ``like``; None where it is none.

    Examples
    --------
    >>> unit_of('psia', 'Pa').absolute, unit_of('kg', 'N').factor, unit_of('mm', 'N')
    (True, 9.80665, None)
    """
    text = half_width(text).strip()
    found = _factor(text, like)
    if found is not None:
        return Unit(text, found, like)
    match = _ABSOLUTE.match(text) if like == 'Pa' else None
    if match and match['unit']:
        found = _factor(match['unit'], like)
        if found is not None:
            return Unit(match['unit'].strip(), found, like, match['abs'] is not None)
    return None


def _factor(text: str, like: str) -> float | None:
    plain = re.sub(r'[\s^*\u00b7]', '', text).replace('\u00b2', '2')
    plain = plain.replace('\u00b5', 'u').replace('\u03bc', 'u').rstrip('.')
    plain = re.sub(r'(?<=[a-z])-f(orce)?$', '', plain)  # kg-f, pound-force
    plain = re.sub('_(?=[cm]?m2$)', '/', plain)  # kgf_cm2 of MATLAB, whose names have no slash
    if plain == 'MN' and like == 'N':
        return 1e6
    key = plain.casefold()
    if like in _UNITS and key in _UNITS[like]:
        return _UNITS[like][key]
    if like not in _UNITS or not re.search('[A-Za-z]', plain) or re.match(r'\d', plain):
        return None  # 'P 2 kPa' is a second pressure
    if text.istitle() and len(text) > _ABBREVIATION:
        text = text.casefold()  # 'Millibar', not 'Pa'
    try:
        return si_factor(text, like) if _is_measure(text) else None
    except InputError:
        return None


def _is_measure(text: str) -> bool:
    """
    Return whether a text that pint may know as a unit consists of units that stand in logs.

    Examples
    --------
    >>> [_is_measure(text) for text in ('kilopascals', 'kN/m^2', 'dat', 'px', 'Pth')]
    [True, True, False, False, False]
    """
    units = registry()
    try:
        names = list(units.parse_units(text)._units)
    except Exception:  # pint raises many kinds, also its tokenizer's own
        return False
    return all(any(unit in _MEASURES and prefix in (_PREFIXES if unit in _PREFIXED else ('',))
                   for prefix, unit, _ in units.parse_unit_name(name)) for name in names)


def unbracketed(cell: str) -> str:
    """Return the unit that a cell holds, without the brackets around it."""
    return cell.strip().strip('[](){}<>')


def is_unit(text: str) -> bool:
    """Return whether a cell of a row of units holds a unit, with or without brackets."""
    plain = unbracketed(half_width(text))
    return any(unit_of(plain, like) is not None for like in _UNITS)
