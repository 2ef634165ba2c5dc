# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Every spelling of a unit is worth what pint says of the unit that it means."""

import re

import pytest

from fam_bundle_ros.data.unit_names import _UNITS, half_width, is_unit, unit_of
from fam_bundle_ros.units import si_factor

#: By dimension: unit as pint knows it, and all spellings.
MEANT = {
    'N': {'newton': 'N newton newtons ニュートン 牛', 'kilonewton': 'kN', 'millinewton': 'mN',
          'centinewton': 'cN', 'decanewton': 'daN', 'meganewton': 'MN',
          'lbf': 'lbf lb lbs pound pounds lb-f pound-force',
          'kgf': 'kgf kg kilogram kp kg-f', 'kgf/1000': 'gf g gram', 'lbf/16': 'ozf oz'},
    'Pa': {'pascal': 'Pa N/m2 N/m^2 N/m²', 'hectopascal': 'hPa',
           'kilopascal': 'kPa kN/m2 キロパスカル 千帕',
           'megapascal': 'MPa N/mm2 N/mm²', 'newton/cm**2': 'N/cm2', 'bar': 'bar', 'mbar': 'mbar',
           'psi': 'psi psid lbf/in2 lb/in2', 'ksi': 'ksi', 'psi/144': 'psf', 'atm': 'atm',
           'kgf/cm**2': 'at kgf/cm2 kg/cm2 kp/cm2', 'torr': 'Torr mmHg', 'inHg': 'inHg',
           'cmH2O': 'cmH2O', 'cmH2O/10': 'mmH2O mmWS', 'cmH2O*2.54': 'inH2O',
           'cmH2O*100': 'mH2O mWS'},
    'm': {'m': 'm meter metre', 'dm': 'dm', 'cm': 'cm Zentimeter',
          'mm': 'mm millimeter millimetre ミリメートル ミリ 毫米', 'um': 'um µm μm', 'nm': 'nm',
          'inch': 'in inch inches Zoll "', 'inch/1000': 'mil mils', 'ft': 'ft'},
    's': {'s': 's sec secs second seconds sek Sekunde Sekunden 秒',
          'ms': 'ms msec millis milliseconds Millisekunden ミリ秒 毫秒',
          'us': 'us µs usec micros microseconds', 'ns': 'ns', 'min': 'min minutes Minuten',
          'hour': 'h hours Stunden', 'day': 'd days Tage'},
    '1': {'1': '1 - ratio mm/mm m/m in/in dimensionless unitless none L0',
          'percent': '% percent pct Prozent', 'permille': 'permille ‰',
          'ppm': 'um/m microstrain uε µε'},
    '1/s': {'1/s': '1/s /s s-1 s^-1', 'percent/s': '%/s', 'percent/min': '%/min'}}


def pint_factor(text, like):
    """Return the factor of a unit that may be a multiple or a part of one that pint knows."""
    name, sign, number = re.fullmatch(r'(.+?)(?:(?<=\w)([*/])([\d.]+))?', text).groups()
    return si_factor(name, like) * float(number or 1) ** (-1 if sign == '/' else 1)


@pytest.mark.parametrize('like', MEANT)
def test_spellings_of_a_unit_are_that_unit(like):
    """Full width or not, with a dot or blanks; as a unit of another dimension they are none."""
    for unit, spellings in MEANT[like].items():
        factor = pint_factor(unit, like)
        for text in spellings.split():
            for written in (text, f' {text}.', text.replace('/', ' / ')):
                found = unit_of(written, like)
                assert found is not None, written
                assert found.factor == pytest.approx(factor, rel=2e-6), written
                assert (found.like, found.absolute) == (like, None)
            assert is_unit(f'[{text}]')
    known = {text.casefold() for spellings in MEANT[like].values() for text in spellings.split()}
    assert set(_UNITS[like]) - known <= {''}


@pytest.mark.parametrize(('text', 'absolute'), [
    ('psia', True), ('psig', False), ('bar(a)', True), ('bar (abs.)', True), ('kPa gauge', False),
    ('bar_rel', False), ('barü', False), ('kPa absolut', True), ('bar', None), ('hPa', None)])
def test_a_unit_of_pressure_may_say_what_it_is_relative_to(text, absolute):
    """Absolute, gauge, or nothing; the factor is that of the unit before it."""
    found = unit_of(text, 'Pa')
    assert found.absolute is absolute
    assert found.factor == unit_of(text[:3], 'Pa').factor
    assert unit_of(text, 'N') is None


def test_prefixes_are_told_by_their_case_where_both_are_used():
    """Mega- and millinewton; a muscle's pressure is never in mPa."""
    assert unit_of('MN', 'N').factor == 1e6
    assert unit_of('mN', 'N').factor == 1e-3
    assert unit_of('mPa', 'Pa').factor == unit_of('MPa', 'Pa').factor == 1e6
    for text in ('', '5', 'force', '2 bar'):
        assert unit_of(text, 'N') is None
    assert not is_unit('strain of it')


def test_full_width_letters_digits_brackets_and_spaces_are_the_usual_ones():
    """All of them: from the exclamation mark to the tilde, and the space."""
    usual = ''.join(map(chr, range(0x21, 0x7f)))
    wide = ''.join(chr(ord(sign) + 0xFEE0) for sign in usual)
    assert half_width(f'{wide}\u3000') == f'{usual} '


@pytest.mark.parametrize('word', 'data dat mat px pin pins rod ch link point Pth fft mass'.split())
def test_words_that_pint_takes_for_a_unit_are_none(word):
    """'pressure_data' is in no decatechnical atmospheres absolute, 'x_px' in no 1/96 inch."""
    assert not any(unit_of(word, like) for like in ('N', 'Pa', 'm', 's', '1'))


@pytest.mark.parametrize(('text', 'like', 'factor'), [
    ('kilopascals', 'Pa', 1e3), ('millibars', 'Pa', 100.0), ('kgf/mm^2', 'Pa', 9.80665e6),
    ('micron', 'm', 1e-6), ('hrs', 's', 3600.0), ('dyne', 'N', 1e-5)])
def test_units_that_only_pint_knows_are_units(text, like, factor):
    """Those that stand in logs: of gases, forces, lengths and times."""
    assert unit_of(text, like).factor == pytest.approx(factor)
