# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of ``fam_bundle map``."""

from pathlib import Path

import numpy as np

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.own_muscle import muscle_words
from fam_bundle_ros.report.page import Headline, Page, Picture, provenance, Section, Table
from fam_bundle_ros.report.paper import PaperFigures, readings
from fam_bundle_ros.report.paper_plots import map_pictures
from fam_bundle_ros.report.tendon_plots import tendon_pictures
from fam_bundle_ros.report.tendons import Ends
from fam_bundle_ros.told import number
from fam_bundle_ros.units import express

#: Number of isobars in addition to that of zero pressure.
_ISOBARS = 6
_POINTS = 201


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


def muscle_pictures(bundle: Bundle) -> list[Picture]:
    """Return the pictures of ``fam_bundle map`` for a model of one motor unit."""
    pressure = float(bundle.max_pressure[0]) * np.linspace(0.0, 1.0, _ISOBARS + 1)
    free = float(bundle.free_strain(bundle.max_pressure))
    strain = np.linspace(0.0, 1.1 * free if np.isfinite(free) else 0.3, _POINTS)
    ideal = readings(bundle)['ideal']
    differs = not np.allclose(ideal.force(strain, np.full((_POINTS, 1), pressure[-1])),
                              bundle.force(strain, np.full((_POINTS, 1), pressure[-1])))
    beside = ' Dashed: the braid alone, without the other effects.' if differs else ''
    models = [(bundle, 'solid', 2.0), *([(ideal, 'dash', 1.2)] if differs else [])]
    return [
        Picture('isobars', 'Force over strain at constant pressures',
                _isobars(models, strain, pressure),
                'At rest; below zero the muscle pushes back, or is slack, depending on the '
                f'model.{beside}'),
        Picture('ends', 'Blocked force and free strain over the pressure',
                _ends(models, float(pressure[-1])),
                f'The force at zero strain, and the strain at zero force.{beside}')]


def _isobars(models, strain, pressure):
    drawing = plotting.figure('strain', 'force (N)', height=440)
    drawing.add_hline(y=0.0, line={'color': palette.NEUTRAL['faint'].light, 'width': 1})
    for model, dash, width in models:
        for each in pressure:
            drawing.add_trace(plotting.line(
                strain, model.force(strain, np.full((len(strain), 1), each)),
                f'{each / 1e3:.4g} kPa', palette.isobar(each / pressure[-1]), dash, width,
                showlegend=dash == 'solid',
                hovertemplate=f'%{{y:.1f}} N at %{{x:.3f}}, {each / 1e3:.4g} kPa<extra></extra>'))
    return drawing


def _ends(models, most):
    drawing = plotting.panels(1, 2, 360, 'pressure (kPa)', horizontal_spacing=0.12)
    # without pressure there is no free strain
    pressure = np.linspace(most / _POINTS, most, _POINTS)
    for model, dash, width in models:
        ends = (model.force(0.0, pressure[:, None]), model.free_strain(pressure[:, None]))
        for column, (value, unit) in enumerate(zip(ends, ('%{y:.1f} N', '%{y:.4f}')), start=1):
            drawing.add_trace(plotting.line(
                pressure / 1e3, value, model.name, palette.effect('mesh'), dash, width,
                showlegend=False, hovertemplate=f'{unit} at %{{x:.0f}} kPa<extra></extra>'),
                row=1, col=column)
    for column, words in enumerate(('blocked force (N)', 'free strain'), start=1):
        drawing.update_yaxes(title_text=words, row=1, col=column)
    return drawing
