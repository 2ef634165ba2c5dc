# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What people call the columns of a log, in English, German, Japanese and Chinese.

`recognise` tells which quantity a header names, and its unit. A name is a set of words:
'Kraft (Ist) [N]', 'force_N' and 'Axial force / N' all say force in N. Words such as setpoint or
supply rule a column out.
"""

from functools import lru_cache
import re
from typing import NamedTuple

from fam_bundle_ros.data.unit_names import half_width, is_unit, Unit, unit_of

#: Quantity: SI unit. A 'shift' is a displacement whose sign its name does not tell.
QUANTITIES = {'time': 's', 'trial': '', 'strain': '1', 'contraction': 'm', 'elongation': 'm',
              'shift': 'm', 'length': 'm', 'pressure': 'Pa', 'force': 'N', 'strain_rate': '1/s'}
#: Quantities that each determine the strain, in order of preference.
STRAINS = ('strain', 'contraction', 'elongation', 'shift', 'length')

#: Quantity: its names, the words of each in any order.
_NAMES: dict[str, tuple[str, ...]] = {
    'time': ('time', 't', 'ts', 'zeit', 'timestamp', 'time stamp', 'stamp', 'zeitstempel',
             'uhrzeit', 'elapsed', 'elapsed time', 'clock', 'x value', 'seconds', 'sekunden',
             'datetime', 'date time', 'datum uhrzeit', 'datum zeit', 'messzeit', 'laufzeit',
             'zeitpunkt', 'relative time', 'rel time', 'test time', 'run time', 'tout', 'epoch',
             'epoch time', 'datenum', 'unix', 'unix time', 'uptime', '時間', '時刻', '时间'),
    'trial': ('trial', 'run', 'test', 'versuch', 'messung', 'lauf', 'wiederholung', 'rep',
              'repeat', 'repetition', 'experiment', 'cycle', 'zyklus', 'series', 'reihe',
              'messreihe'),
    'force': ('force', 'f', 'kraft', 'load', 'last', 'tension', 'pull', 'load cell', 'loadcell',
              'fx', 'fz', 'zugkraft', 'kraftsensor', 'kraftmessdose', 'axialkraft', 'force x',
              'force z', 'tensile', 'load force', 'load cell force',
              '張力', '荷重', '拉力', '力'),
    'pressure': ('pressure', 'p', 'druck', 'press', 'innendruck', 'ueberdruck', 'relativdruck',
                 'absolutdruck', 'pressure p', '圧力', 'ゲージ圧', '压力', '气压'),
    'strain': ('strain', 'epsilon', 'eps', '\u03b5', 'contraction ratio', 'kontraktionsgrad',
               'relative contraction', 'rel contraction', 'kontraktionsverhaeltnis',
               'contraction strain', 'relative kontraktion', 'shortening ratio',
               '収縮率', '收缩率'),
    'contraction': ('contraction', 'contr', 'shortening', 'kontraktion', 'verkuerzung',
                    'contraction length', 'kontraktionsweg', '収縮', '収縮量', '收缩量'),
    'elongation': ('elongation', 'elong', 'extension', 'ext', 'verlaengerung', 'auszug'),
    'shift': ('displacement', 'disp', 'displ', 'position', 'pos', 'weg', 'stroke', 'hub', 'travel',
              'deflection', 'verschiebung', 'auslenkung', 'x', 'y', 'z', 's', 'dehnung',
              'crosshead', 'traverse', 'traversenweg', 'standardweg', 'kolbenweg', '変位', '位移'),
    'length': ('length', 'l', 'len', 'laenge', 'stretch', 'stretch ratio', 'lambda', '\u03bb',
               '長さ', '长度'),
    'strain_rate': ('strain rate', 'contraction rate', 'dehnrate'),
}
#: Words that say nothing about which quantity it is.
_NEUTRAL = frozenset("""measured meas measurement actual act ist current gemessen mess messwert
    value wert sensor signal channel kanal ch ai raw roh reading muscle muskel pam mckibben bpa
    dmsp mas fam actuator aktor axial internal gauge relative rel absolute absolut abs inner innen
    der des the of in out am im total id nr no number nummer name avg average mean mittelwert
    filtered filt gefiltert smoothed smooth corrected korrigiert calibrated kalibriert tared
    tariert zeroed compensated kompensiert signals values data line tensile""".split())
#: In the name of a strain: positive when longer, as testing machines write it.
_LONGER = re.compile(r'\b(exten|extensions?|elong|elongations?|tensile(?! (test|machine)))\b')
_SHORTER = re.compile('contract|short|kontrakt|verkuerz|\u53ce\u7e2e|\u6536\u7f29')
#: A column with one of these words is used only if there is none without.
_LESSER = frozenset("""raw roh filtered filt gefiltert smoothed smooth avg average mean
    mittelwert line""".split())
#: A column with one of these words is as good as one without.
_BETTER = frozenset("""corrected korrigiert calibrated kalibriert tared tariert zeroed
    compensated kompensiert""".split())
#: A column with one of these words is not a reading of the muscle.
_RULED_OUT = frozenset("""setpoint set soll sollwert target desired ref reference cmd command
    demand supply versorgung versorgungs tank source speise speicher ambient umgebung umgebungs
    luft vor atm amb baro atmospheric atmosphere barometric model predicted prediction simulated
    sim residual error fehler std sd stddev deviation velocity speed geschwindigkeit acceleration
    temperature temperatur temp voltage volt spannung strom valve ventil derivative noise max min
    limit offset regulator torque moment drehmoment weight gewicht friction reibung diameter
    durchmesser radius radial thickness dicke width breite height hoehe stress modulus vacuum
    vakuum unterdruck preload vorlast theoretical theo theoretisch estimated estimate pump pumpe
    compressor kompressor uptime laufzeit betriebszeit""".split())
_GERMAN = re.compile(r'^(?P<first>\w*?)(?P<last>druck|kraft|laenge|zeit|weg|verkuerzung|'
                     r'kontraktion)$')
#: Gauge or absolute, in brackets behind the unit: 'Druck in bar (\u00dcberdruck)'.
_GAUGE_WORD = re.compile(
    r'(?<=\w)\s*\((\u00fcberdruck|ueberdruck|gauge|relativ\w*|absol\w*)\)\s*$', re.IGNORECASE)
#: 'Pressure / bar(g)', 'p [kPa] (abs)'.
_RELATIVE = re.compile(r'(?<![^\W_])(m?bar|psi|[kmh]?pa)(\s*[\])])?\s*\((g|a|abs|rel)\.?\)\s*$',
                       re.IGNORECASE)
#: What ControlDesk puts around a name: 'Model Root/Force/Out1'.
_DSPACE = re.compile(r'^.*\bModel Root/|(?<=\w)/(Out|In)\d*$')
#: The field of sensor_msgs/FluidPressure, which is in Pa.
_FIELD = re.compile(r'(^|[/.])fluid_pressure$')
_BRACKET = re.compile(r'[\[({<]\s*([^\[\](){}<>]*(?:[(\[][^()\[\]]*[)\]][^\[\](){}<>]*)?)[\])}>]')


#: A factor beside the unit, 'F [N] x10', which may be that of the readings or of the unit.
_FACTOR = re.compile(r'(?<!\w)\s*[x\u00d7*\u00b7]\s*(?:10+|0[.,]0*1)'
                     r'(?:\s*\^\s*[-+]?\d+|(?:e|\*\*)[-+]?\d+|[-+]\d+)?(?![\w.])', re.IGNORECASE)


class Match(NamedTuple):
    """What a header means."""

    #: A key of `QUANTITIES`, empty where it is not known.
    quantity: str
    #: 3 the name as it stands, 2 with words that do not matter, 1 one word among others.
    score: int = 0
    unit: Unit | None = None
    #: Which of several: the motor unit of `pressure.mu1` or `p 2`, else empty.
    part: str = ''
    #: Why it is not used.
    why: str = 'not known'
    #: What the name says of a pressure: absolute, gauge (False) or neither (None).
    absolute: bool | None = None


def words_of(name: str) -> list[str]:
    """
    Return the words of a name, in lower case, German umlauts spelt out, numbers apart.

    Examples
    --------
    >>> words_of('MU1_Pressure'), words_of('Muskell\u00e4nge (Ist)')
    (['mu1', 'pressure'], ['muskellaenge', 'ist'])
    """
    text = re.sub(r'(?<=[a-z])(?=[A-Z])', ' ', name).casefold()
    for umlaut, spelt in (('\u00e4', 'ae'), ('\u00f6', 'oe'), ('\u00fc', 'ue')):
        text = text.replace(umlaut, spelt)
    return re.findall(r'mu\d+|[^\W\d_]+|\d+', text)


def is_longer(name: str) -> bool:
    """
    Return whether the name of a strain says that it is positive when longer.

    Examples
    --------
    >>> [is_longer(name) for name in ('Tensile strain', 'Contraction strain (tensile tester)')]
    [True, False]
    """
    words = ' '.join(words_of(name))
    return bool(_LONGER.search(words)) and not _SHORTER.search(words)


@lru_cache(maxsize=4096)
def recognise(header: str, unit_text: str = '') -> Match:
    """
    Return which quantity a header names, and its unit.

    Parameters
    ----------
    header : str
        With or without a unit, in brackets or behind the name.
    unit_text : str
        The unit where it stands elsewhere (a row of units, an attribute of the file).

    Examples
    --------
    >>> recognise('Muskeldruck in bar').quantity, recognise('p_set [kPa]').why
    ('pressure', "'set' is no reading of the muscle")
    >>> recognise('pressure_psi_mu2').part
    'mu2'
    """
    if rest_length_of(f'{header} {unit_text}=1') is not None:
        return Match('', why='the rest length')
    header = _DSPACE.sub('', _plain(header))
    if header.startswith(('\u00b1', '+/-')):
        return Match('', why='an uncertainty')
    if factor := factor_of(header):
        return Match('', why=f"'{factor}' in its name: tell what one is worth")
    best = Match('')
    if header.startswith('/'):
        return _of_topic(header, unit_text)
    if _FIELD.search(header) and not unit_text:
        return _of_topic(header.replace('.', '/'), '')
    for name, unit in _splits(_GAUGE_WORD.sub('', header), unit_text):
        found = _named(name)._replace(absolute=absolute_of(header))
        if not found.quantity:
            best = found if found.why != 'not known' else best
            continue
        found = _with_unit(found, unit)
        if found.score > best.score or (found.quantity and not best.quantity):
            best = found
    name = header.removesuffix('()')  # 'min' is a minimum too
    clock = unit_of(name, 's') if len(name) > 3 or name.casefold() in _SHORT_CLOCKS else None
    return best if best.quantity or clock is None else Match('time', 2, clock)


def factor_of(header: str) -> str:
    """
    Return the factor in a header, '' for none: of the readings or of their unit, who knows.

    Examples
    --------
    >>> factor_of('F (N) x10'), factor_of('Force x [N]'), factor_of('F [x10 N]')
    ('x10', '', '')
    """
    found = _FACTOR.search(_BRACKET.sub(' () ', header))
    return found[0].strip() if found else ''


def _of_topic(path: str, unit_text: str) -> Match:
    """Return what a field of a ROS topic is, by its last names: '/cell/wrench/force/z'."""
    names = path.strip('/').split('/')
    part = max((name for name in names if re.fullmatch(r'mu\d+', name)), default='')
    if names[-1] == 'fluid_pressure':
        return Match('pressure', 3, Unit('Pa', 1.0, 'Pa', absolute=True), part, absolute=True)
    if names[-2:-1] == ['force']:
        return Match('force', 3, unit_of('N', 'N'))
    last, two = (recognise(' '.join(tail), unit_text) for tail in (names[-1:], names[-2:]))
    if 'no reading' in two.why:  # 'torque/x'
        return two
    return next((found for found in (last, two) if found.quantity and found.score), Match(''))


#: Units that do not determine the quantity: masses, ratios, accelerations.
_VAGUE = frozenset(('g', 'kg', 'lb', 'lbs', 'at', 'd', 'h', 'nm', 'um', '-', '', '1', '%'))


#: Units of time that are a column's whole name, beside the longer ones.
_SHORT_CLOCKS = ('ms', 'us', '\u00b5s', '\u03bcs', 'ns', 'sec', 'sek', 'hrs')
#: Units that are a column's whole name: 'PSIG'.
_BARE = re.compile(r'(psi|m?bar|[kmh]?pa|lbf|kgf|newtons?|mm)[ _]?([ag]|abs)?', re.IGNORECASE)


def dimension_of(header: str, unit_text: str = '') -> Unit | None:
    """
    Return the unit of a header with an unknown name, if the unit determines the quantity.

    Examples
    --------
    >>> dimension_of('Longueur (mm)').like, dimension_of('ai0', 'lbf').like, dimension_of('T [%]')
    ('m', 'N', None)
    """
    for name, text in _splits(header, unit_text):
        if text is None and _BARE.fullmatch(name.strip()):
            text = name
        if text is None or text.strip().casefold() in _VAGUE:
            continue
        for like in ('N', 'Pa', 'm', 's'):
            unit = unit_of(text, like)
            if unit is not None:
                return unit
    return None


#: The rest length above a table: 'L0 = 250 mm', 'Rest length [mm];250,0', 'L0;250;mm'.
_REST = re.compile(
    r'(?<![^\W_])(?:l_?0|(?:rest|resting|initial|original|nominal|free|slack|relaxed|deflated|'
    r'uninflated|unpressuri[sz]ed|unstretched|undeformed|unloaded|natural|vented)[ _]length'
    r'(?: of (?:the |this )?\w+)?|length at rest|(?:ruhe|anfangs|ausgangs|nenn)l(?:\u00e4|ae)nge|'
    r'(?:ungedehnt|entspannt|unbelastet|drucklos)e l(?:\u00e4|ae)nge|'
    r'l(?:\u00e4|ae)nge[ ,(]+(?:ungedehnt|entspannt|unbelastet|drucklos|in ruhe)\)?)'
    r'(?:[\s_]*[\[(]?(mm|cm|m|in)\b[\])]?)?'
    r'[\s:=;,|]+(\d+(?:[.,]\d+)?)[\s;,|]*(?:[\[(]?(mm|cm|m|in)\b)?', re.IGNORECASE)


def rest_length_of(line: str) -> float | None:
    """
    Return the rest length that a line above a table tells, m; None for none, or one without unit.

    Examples
    --------
    >>> rest_length_of('L0 [mm];250,0'), rest_length_of('Rest length: 250')
    (0.25, None)
    >>> rest_length_of('"Rest length","127.00","mm"')
    0.127
    """
    found = _REST.search(line.replace('"', ''))
    unit = unit_of(found[1] or found[3] or '', 'm') if found else None
    return float(found[2].replace(',', '.')) * unit.factor if found and unit else None


def names_rest_length(line: str) -> bool:
    """Return whether a line states a rest length, with or without a unit."""
    return _REST.search(line) is not None


def _plain(header: str) -> str:
    """
    Return a header in half width, what its pressure is relative to inside of the unit.

    Examples
    --------
    >>> _plain('Pressure / bar(g)'), _plain('p [kPa] (abs)'), _plain('Mass (g)')
    ('Pressure / bar g', 'p [kPa abs]', 'Mass (g)')
    """
    return _RELATIVE.sub(lambda unit: f'{unit[1]} {unit[3]}{(unit[2] or "").strip()}',
                         half_width(header))


def unit_text_of(header: str) -> str | None:
    """
    Return the text in place of a header's unit, whether it is a known unit or not; None for none.

    Examples
    --------
    >>> unit_text_of('Mass [kg]'), unit_text_of('F_N'), unit_text_of('F')
    ('kg', 'N', None)
    """
    header = _plain(header)
    bracket = re.search(r'[\[({<]\s*([^\[({<]*)[\])}>]\s*$', header)
    unit = dimension_of(header)
    return bracket[1] if bracket else unit.text if unit else None


def _splits(header: str, unit_text: str) -> list[tuple[str, str | None]]:
    """Return the possible pairs of name and unit of a header; the unit is None for no unit."""
    header = re.sub('(?<!_)_$', '', _plain(header).rstrip())  # 'Force_N_' of writetable
    brackets = list(_BRACKET.finditer(header))
    if unit_text:
        return [(header, unit_text)]
    for match in reversed(brackets):
        inside = match.group(1).strip()
        if match.group(0)[0] == '[' or is_unit(inside):
            return [(header[:match.start()] + ' ' + header[match.end():], inside)]
    ways: list[tuple[str, str | None]] = [(header, None)]
    for match in re.finditer(r'\s+in\s+|\s*[/,:;|]\s*|[\s_.\-]+|(?<=[a-z])(?=[A-Z])', header):
        unit = header[match.end():].strip()
        if match.start() and unit and is_unit(unit):
            ways.append((header[:match.start()], unit))
    # `pressure_psi_mu1`: the unit stands before the number of the motor unit
    number = re.search(r'[\s_.\-]+((?:mu)?\d+)\s*$', header, re.IGNORECASE)
    if number:
        ways += [(f'{name} {number[1]}', unit)
                 for name, unit in _splits(header[:number.start()], '') if unit]
    return ways


def _with_unit(found: Match, text: str | None) -> Match:
    # a name with a fitting unit scores higher than a name alone
    if text is None or found.quantity == 'trial':
        return found
    unit = unit_for(found.quantity, text)
    if unit is not None:
        # a strain in mm is a contraction
        is_length = (found.quantity, unit.like) == ('strain', 'm')
        if unit.absolute is None:
            unit = unit._replace(absolute=found.absolute)
        return found._replace(quantity='contraction' if is_length else found.quantity, unit=unit,
                              score=found.score + 1)
    return found._replace(score=0, why=f"unit '{text}' does not fit; expected a unit like "
                          f'{QUANTITIES[found.quantity]}')


def likes(quantity: str) -> tuple[str, ...]:
    """Return the SI units that a quantity may have; a length may be a ratio to the rest length."""
    if quantity in STRAINS:
        return ('1', 'm') if quantity == 'strain' else ('m', '1')
    return (QUANTITIES[quantity],)


def unit_for(quantity: str, text: str) -> Unit | None:
    """Return the unit that a text means for a quantity; None where none fits."""
    units = (unit_of(text, like) for like in likes(quantity))
    return next((unit for unit in units if unit is not None), None)


def _named(name: str) -> Match:
    # 'des' means desired at the end, and is a German article elsewhere: 'Druck des Muskels'
    words = words_of(re.sub(r'(?<=[\W_])des(?=[\W\d_]*$)', 'desired', name))
    if not words:
        return Match('', why='no name')
    for quantity, names in _NAMES.items():
        if ' '.join(words) in names:
            return Match(quantity, 3)
    dotted = re.match(r'^\s*(\w+)\.(\S+)\s*$', name)
    if dotted and dotted[1].casefold() in _NAMES['pressure']:
        return Match('pressure', 3, part=dotted[2])
    out = [word for word in words if word in _RULED_OUT or _compound(word, _RULED_OUT)]
    out += re.findall('strain gau?ge', ' '.join(words))  # of a load cell
    if out:
        return Match('', why=f"'{out[0]}' is no reading of the muscle")
    part = [word for word in words if re.fullmatch(r'(mu)?\d+', word)]
    rest = [_last_of(word) for word in words if word not in part]
    core = [word for word in rest if word not in _NEUTRAL] or rest
    number = part[0].removeprefix('mu') if len(part) == 1 else ''
    score = 1 if _LESSER & set(words) else 3 if _BETTER & set(words) else 2
    for quantity, names in _NAMES.items():
        if any(sorted(core) == sorted(known.split()) for known in names):
            return Match(quantity, score, part=f'mu{number}' if number else '')
    for quantity, names in _NAMES.items():
        if any(word in names and len(word) > 2 for word in core):
            return Match(quantity, 1, part=f'mu{number}' if number else '')
    return Match('')


#: Words for absolute and gauge, of European languages and Chinese characters.
_IS_ABSOLUTE = re.compile(r'\babs|absol|\bass(olut\w*)?\b|bezwzgl|\u7d76\u5bfe|\u7edd\u5bf9')
_IS_GAUGE = re.compile(r'\b(gauge|rel|relat\w*|ueberdruck|manom\w*)\b')


def absolute_of(name: str) -> bool | None:
    """
    Return whether a name says that a pressure is absolute, gauge (False) or neither (None).

    Examples
    --------
    >>> absolute_of('Pression absolue (bar)'), absolute_of('p_rel'), absolute_of('Pressione')
    (True, False, None)
    """
    words = ' '.join(words_of(name))
    # fluid_pressure is the field of ROS's FluidPressure, which is absolute
    if _IS_ABSOLUTE.search(words) or re.search(r'\bfluid_pressure\b', name):
        return True
    return False if _IS_GAUGE.search(words) else None


def _last_of(word: str) -> str:
    """Return the last part of a German compound: `druck` of `muskeldruck`."""
    match = _GERMAN.match(word)
    return match['last'] if match and match['first'] else word


def _compound(word: str, firsts: frozenset[str]) -> bool:
    """Return whether a German compound begins with one of some words: `solldruck`."""
    match = _GERMAN.match(word)
    first = match['first'].rstrip('s') if match else ''
    return bool(first) and first in {one.rstrip('s') for one in firsts}
