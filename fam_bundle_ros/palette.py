# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
One colour per effect and per recruitment state, in all figures and pages.

Hues are from Okabe and Ito's set, darkened for white paper and lightened for dark pages to a
contrast of at least 3 to 1. Alternative shapes of the same physics share the hue of the first and
are dashed, so that colour is never the only difference between them.
"""

from typing import NamedTuple


class Colour(NamedTuple):
    """A colour for light pages and its counterpart for dark pages, '#RRGGBB'."""

    light: str
    dark: str

    def on(self, dark: bool) -> str:
        """Return the colour for a dark or a light page."""
        return self.dark if dark else self.light


#: Neutral colours from paper to ink.
NEUTRAL = {
    'paper': Colour('#FFFFFF', '#15181B'),
    'surface': Colour('#F6F6F4', '#1D2125'),
    'ink': Colour('#1B1D1F', '#ECEDEE'),
    'muted': Colour('#5E6469', '#A3AAB0'),
    'faint': Colour('#8E9499', '#787F86'),
    'rule': Colour('#D5D6D3', '#3A4147'),
    'grid': Colour('#EAEAE7', '#2A3035'),
}

_BLUE = Colour('#0072B2', '#4FA8DE')
_GREEN = Colour('#008F68', '#22B58B')
_ORANGE = Colour('#BF7A00', '#F0AE33')
_VERMILLION = Colour('#D55E00', '#FF8B45')
_PURPLE = Colour('#B5538C', '#EDA4CC')
_SKY = Colour('#2E93C7', '#8CCDF2')
_OLIVE = Colour('#7D7A00', '#D9D25A')
_INDIGO = Colour('#4B3F9E', '#A79DF0')
_WINE = Colour('#7F2253', '#CF6FA2')
_TEAL = Colour('#1F7F86', '#63C6CC')
_BROWN = Colour('#80583A', '#C9A083')
_GREY = Colour('#6E757B', '#99A1A8')

#: Names of hues for the laws of the catalogue.
_HUES = {'blue': _BLUE, 'green': _GREEN, 'orange': _ORANGE, 'vermillion': _VERMILLION,
         'purple': _PURPLE, 'sky': _SKY, 'olive': _OLIVE, 'indigo': _INDIGO, 'wine': _WINE,
         'teal': _TEAL, 'brown': _BROWN, 'grey': _GREY}
_OWN = Colour('#A0343C', '#F08A8F')
_STATES = (_GREY, _BLUE, _ORANGE, _GREEN, _PURPLE, _SKY, _VERMILLION)

#: Directions of motion: the bundle shortens (+1), rests (0), lengthens (-1).
DIRECTIONS = {1: _BLUE, 0: _GREY, -1: _VERMILLION}
#: Closed-loop runs in comparison, ours first; blue and orange denote motor units there.
CONTROLLERS = (_INDIGO, _VERMILLION, _GREEN, _PURPLE)
#: Axes and line of the workbench's icon.
ICON = (_BLUE, _PURPLE)
#: Low to high pressure, after viridis; the ends are adapted for contrast with the page.
_RAMP_LIGHT = ('#46206B', '#3B528B', '#21818C', '#3C8F48', '#8C8400')
_RAMP_DARK = ('#A896E0', '#7FA0E0', '#3FB8B0', '#7FDB83', '#FDE725')
_RAMP_STEPS = 49


def effect(name: str) -> Colour:
    """Return the colour of an effect of the catalogue, or that of users' own effects."""
    return _HUES.get(_look(name)[0], _OWN)


def dash(name: str) -> str:
    """Return plotly's name of the dash of an effect's line."""
    return _look(name)[1]


def _look(name: str) -> tuple[str, str]:
    # imported here because the catalogue searches entry points, which takes time
    from fam_bundle_ros.model import catalogue
    law = catalogue.available().get(name)
    return law.look if law is not None else ('', 'solid')


def recruitment_state(state: int) -> Colour:
    """
    Return the colour of recruitment state RSk, and of motor unit k, which it recruits.

    RS0 (all off) is grey; from seven units on the hues repeat.
    """
    return _STATES[0] if state <= 0 else _STATES[1 + (state - 1) % (len(_STATES) - 1)]


def isobar(share: float) -> Colour:
    """Return the colour of a pressure: 0 for the lowest of a figure, 1 for the highest."""
    step = round(min(max(share, 0.0), 1.0) * (_RAMP_STEPS - 1)) / (_RAMP_STEPS - 1)
    return Colour(_between(_RAMP_LIGHT, step), _between(_RAMP_DARK, step))


def fade(colour: str, opacity: float) -> str:
    """
    Return '#RRGGBBAA' for fills.

    Examples
    --------
    >>> fade('#0072B2', 0.2)
    '#0072B233'
    """
    return f'{colour}{round(255 * opacity):02X}'


def by_page() -> dict[str, str]:
    """
    Return the light colour -> the dark one, for pages that change theme after drawing.

    Fills made by `fade` change with their first seven characters.
    """
    colours = [*NEUTRAL.values(), *_HUES.values(), *_STATES, _OWN,
               *(isobar(step / (_RAMP_STEPS - 1)) for step in range(_RAMP_STEPS))]
    return {colour.light: colour.dark for colour in colours}


def _between(ramp: tuple[str, ...], share: float) -> str:
    index = min(int(share * (len(ramp) - 1)), len(ramp) - 2)
    part = share * (len(ramp) - 1) - index
    ends = [[int(colour[k:k + 2], 16) for k in (1, 3, 5)] for colour in ramp[index:index + 2]]
    return '#' + ''.join(f'{round(a + part * (b - a)):02X}' for a, b in zip(*ends, strict=True))
