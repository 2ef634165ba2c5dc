# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Figures that compare fixed ends with tendons in one packaging length, with captions."""

import numpy as np
import plotly.graph_objects as go

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.report.page import Picture
from fam_bundle_ros.report.paper_plots import name_states, state_regions
from fam_bundle_ros.report.tendons import Ends
from fam_bundle_ros.told import number

STUDY = 'Mazzoleni et al., Proc. SPIE 11374 (2020)'
AXIS = 'contraction over the packaging length'


def ends_looks(ends: Ends) -> list[tuple[str, str, palette.Colour]]:
    """Return reading, words and colour of both configurations."""
    return [('fixed', 'fixed ends', palette.effect('resistive_buckling')),
            ('tendons', f'tendons of {1e3 * ends.tendon:.4g} mm', palette.effect('tendon_slack'))]


def tendon_pictures(ends: Ends) -> list[Picture]:
    """Return the pictures that ``fam_bundle map --tendon`` adds."""
    length, tendon = 1e3 * ends.packaging_length, 1e3 * ends.tendon
    own = (f'The question is that of {STUDY}; the numbers are of this model, not of that study. '
           'Our own: the tendon does not stretch, and the shorter muscle keeps radius and braid '
           'angle.')
    free = {name: float(each[-1]) for name, each in ends.free_strain.items()}
    even = (f' A tendon of {number(1e3 * ends.even_tendon)} mm gives the same free strain as '
            'fixed ends at their minimum; a shorter one gives more.' if ends.even_tendon > 1e-5
            else '')
    return [
        Picture('ends-space', 'Force–strain space with fixed ends and with tendons',
                ends_space(ends),
                f'Both in a packaging length of {length:.4g} mm. With fixed ends the muscles are '
                f'as long and push back past their free strain. On tendons of {tendon:.4g} mm '
                f'they are {length - tendon:.4g} mm long and go slack: nothing pushes back, the '
                'blocked force is the same, and every contraction is a larger strain of the '
                f'muscle. {own}'),
        Picture('ends-free-strain', 'Free strain with fixed ends and with tendons',
                ends_free_strain(ends),
                'The contraction, over the packaging length, at which no force is left, '
                + (f'while MU{ends.unit} fills and the first is at its largest pressure: '
                   if ends.unit > 1 else 'over the pressure: ')
                + f'at full pressure {free["fixed"]:.4f} with fixed ends and '
                f'{free["tendons"]:.4f} with tendons.{even} {own}'),
    ]


def ends_space(ends: Ends) -> go.Figure:
    """Draw the force range of each recruitment state: fixed ends left, tendons right."""
    drawing = plotting.panels(1, 2, 460, AXIS, legend={'y': 1.09}, shared_yaxes=True,
                              horizontal_spacing=0.05,
                              subplot_titles=[words for _, words, _ in ends_looks(ends)])
    end = float(ends.space.strain[-1])
    top = max(float(each.max()) for each in ends.space.high.values())
    for column, (name, *_) in enumerate(ends_looks(ends), start=1):
        where = {'row': 1, 'col': column}
        for trace in state_regions(ends.space, name, legend=column == 1):
            drawing.add_trace(trace, **where)
        name_states(drawing, ends.space, name, 0.0, top, where)
    drawing.update_xaxes(range=[0.0, end])
    drawing.update_yaxes(range=[0.0, 1.03 * top])
    drawing.update_yaxes(title_text='force of the bundle (N)', row=1, col=1)
    drawing.update_layout(showlegend=len(ends.space.high['fixed']) > 1)
    return drawing


def ends_free_strain(ends: Ends) -> go.Figure:
    """Draw the free strain of both configurations while a unit fills."""
    drawing = plotting.figure(f'pressure of MU{ends.unit} (kPa)',
                              'free strain over the packaging length', height=420)
    pressure = ends.pressure / 1e3
    for name, words, colour in ends_looks(ends):
        drawing.add_trace(plotting.line(pressure, ends.free_strain[name], words, colour,
                                        width=2.6, hovertemplate='%{y:.4f} at %{x:.0f} kPa'))
    every = np.concatenate(list(ends.free_strain.values()))
    low, high = np.nanmin(every), np.nanmax(every)
    drawing.update_yaxes(range=[low - 0.08 * (high - low), high + 0.08 * (high - low)],
                         tickformat='.3f')
    drawing.update_xaxes(range=[0.0, float(pressure[-1])])
    return drawing
