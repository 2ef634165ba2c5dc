# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Figures of one motor unit: isobars; blocked force and free strain over pressure."""

import numpy as np

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.report.page import Picture
from fam_bundle_ros.report.paper import readings

#: Number of isobars in addition to that of zero pressure.
_ISOBARS = 6
_POINTS = 201


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
