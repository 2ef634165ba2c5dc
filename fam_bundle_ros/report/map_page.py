# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of ``fam_bundle map``."""

from pathlib import Path

from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.own_muscle import muscle_words
from fam_bundle_ros.report.muscle_plots import muscle_pictures
from fam_bundle_ros.report.page import Headline, Page, Section, Table
from fam_bundle_ros.report.paper import PaperFigures
from fam_bundle_ros.report.paper_plots import map_pictures
from fam_bundle_ros.report.provenance import provenance
from fam_bundle_ros.report.tendon_plots import tendon_pictures
from fam_bundle_ros.report.tendons import Ends
from fam_bundle_ros.told import number
from fam_bundle_ros.units import express


def map_page(bundle: Bundle, figures: PaperFigures, model_file: str | Path,
             ends: Ends | None = None) -> Page:
    """Return the page: forces and strains of the bundle, with tendons if given, and its model."""
    found = figures.summary()
    headline = [Headline(f'Blocked force, RS{k + 1}', f'{force[0]:.1f} N', 'at zero strain')
                for k, force in enumerate(figures.space.high['included'])]
    if bundle.n == 1:
        lead, pictures = 'Forces and strains of this motor unit.', muscle_pictures(bundle)
    else:
        lead = ('Forces and strains of this bundle, drawn as in the paper on resistive forces and '
                'gradient reversal, for a comparison of the figures.')
        pictures = map_pictures(figures)
    lead = f'{lead} Model {muscle_words(bundle)}.'
    f = figures.free_strain
    if f is not None:
        headline += [
            Headline('Free strain dip', f'{f.dip:.4f}', f.words),
            Headline('Widest overlap of RS1 and RS2', f'{number(found["overlap_widest_N"])} N',
                     f'at strain {number(found["overlap_widest_at_strain"])}')]
    return Page(
        f'Map of {bundle.name}', lead, headline,
        [Section('Figures', '', pictures),
         *([] if ends is None else
           [Section('Fixed ends or tendons', '', tendon_pictures(ends))]),
         model_section(bundle)],
        provenance([('model file', model_file)],
                   [('kind of numbers', 'all computed from the model; nothing here is measured')]))


def model_section(bundle: Bundle, title: str = 'Model') -> Section:
    """Return a model: its motor units with their dimensions, its effects with their sources."""
    return Section(title, '', [_units(bundle), _effects(bundle)])


def _units(bundle: Bundle) -> Table:
    return Table(
        ('motor unit', 'muscles', 'radius (mm)', 'length (mm)', 'braid angle (°)', 'wall (mm)',
         'largest pressure (kPa)'),
        [(unit.name, unit.muscles, 1e3 * float(unit.geometry.radius),
          1e3 * float(unit.geometry.length), float(unit.geometry.braid_angle) * 57.29577951308232,
          1e3 * float(unit.geometry.wall_thickness), f'{unit.max_pressure / 1e3:.1f}')
         for unit in bundle.motor_units])


def _effects(bundle: Bundle) -> Table:
    return Table(
        ('effect', 'values', 'what it is', 'source'),
        [(('effect', effect.name),
          ', '.join(f'{p.name} {express(effect.values[p.name], p.unit, 4)}'
                    for p in effect.active(bundle.n)) or '–',
          effect.summary, effect.source) for effect in bundle.effects])
