# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The palette keeps what it promises: contrast, no confusion for the colour-blind, one meaning."""

from itertools import combinations
from pathlib import Path
import re

import numpy as np
import pytest

from fam_bundle_ros import palette
from fam_bundle_ros.model import catalogue

# Machado, Oliveira and Fernandes 2009, severity 1.0, linear RGB.
BLINDNESS = {
    'none': np.eye(3),
    'protanopia': np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                            [-0.003882, -0.048116, 1.051998]]),
    'deuteranopia': np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                              [-0.011820, 0.042940, 0.968881]]),
}
#: As plotly names them.
DASHES = ('solid', 'dash', 'dot', 'dashdot', 'longdash', 'longdashdot')
# What meets in one picture with solid lines: the steps of a ladder, the states of one bundle.
TOGETHER = {
    'ladder': ['mesh', 'bladder_elasticity', 'resistive_buckling', 'coulomb_friction'],
    'states': [1, 2],
    'directions': [palette.DIRECTIONS[1], palette.DIRECTIONS[-1]],
}


def colour_of(item):
    """Return the colour of an effect, of a recruitment state, or a colour itself."""
    if isinstance(item, palette.Colour):
        return item
    return palette.effect(item) if isinstance(item, str) else palette.recruitment_state(item)


def linear(colour):
    """Return linear RGB of '#RRGGBB'."""
    value = np.array([int(colour[k:k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def lab(rgb):
    """Return CIE L*a*b* (D65) of linear RGB."""
    matrix = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722],
                       [0.0193, 0.1192, 0.9505]])
    xyz = matrix @ np.clip(rgb, 0.0, 1.0) / np.array([0.9505, 1.0, 1.089])
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


def contrast(one, other):
    """Return the contrast ratio of WCAG 2."""
    weights = np.array([0.2126, 0.7152, 0.0722])
    high, low = sorted((weights @ linear(one), weights @ linear(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize('theme', ['light', 'dark'])
def test_every_colour_stands_out_from_its_page(theme):
    """A line of any effect or state has 3 to 1 against the page, text 4.5 to 1."""
    paper = getattr(palette.NEUTRAL['paper'], theme)
    colours = [palette.effect(name) for name in (*catalogue.names(), 'a_users_own')]
    colours += [palette.recruitment_state(k) for k in range(8)]
    colours += [palette.isobar(k / 12) for k in range(13)]
    assert min(contrast(getattr(c, theme), paper) for c in colours) >= 3.0
    for name in ('ink', 'muted'):
        assert contrast(getattr(palette.NEUTRAL[name], theme), paper) >= 4.5


@pytest.mark.parametrize('theme', ['light', 'dark'])
@pytest.mark.parametrize('sight', BLINDNESS)
@pytest.mark.parametrize('group', TOGETHER)
def test_colours_that_meet_are_told_apart(group, sight, theme):
    """What is drawn side by side differs by 15 in L*a*b*, with every kind of sight."""
    colours = [colour_of(item) for item in TOGETHER[group]]
    seen = [lab(BLINDNESS[sight] @ linear(getattr(c, theme))) for c in colours]
    assert min(np.linalg.norm(a - b) for a, b in combinations(seen, 2)) >= 15.0


def test_no_colour_stands_outside_the_palette():
    """What is changed there changes everywhere."""
    package = Path(palette.__file__).parent
    assert [f'{path.relative_to(package)}: {found}' for path in sorted(package.rglob('*.py'))
            if path != Path(palette.__file__)
            for found in re.findall(r'#[0-9A-Fa-f]{6}\b', path.read_text())] == []


def test_no_two_effects_look_the_same():
    """Colour and dash together name one effect, and every built-in has its own."""
    looks: dict[tuple[str, str], list[str]] = {}
    for name, law in catalogue.available().items():
        looks.setdefault(law.look, []).append(name)
    free = [f'{hue} {dash}' for hue in palette._HUES for dash in DASHES
            if (hue, dash) not in looks]
    assert {dash for _, dash in looks} <= set(DASHES)
    alike = '; '.join(' and '.join(names) for names in looks.values() if len(names) > 1)
    assert not alike, f'{alike}; free: {free}'
    assert len(set(palette._HUES.values())) == len(palette._HUES)
    own = palette.effect('a_users_own')
    assert [name for name in catalogue.names() if palette.effect(name) == own] == []
