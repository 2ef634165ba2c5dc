# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Figures 2, 3 and 4 of Kim, Mazzoleni and Bryant (2021) drawn, each with its caption.

A caption separates the statements of the paper's text from this project's own work.
"""

import numpy as np
import plotly.graph_objects as go

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.report.page import Picture
from fam_bundle_ros.report.paper import ForceStrainSpace, FreeStrain, Isobars, PaperFigures

PAPER = 'Kim, Mazzoleni and Bryant, Proc. SPIE 11586, 115860L (2021)'
IDEAL, BLADDER, RESISTIVE, NEGLECTED = (
    palette.effect(name)
    for name in ('mesh', 'bladder_elasticity', 'resistive_buckling', 'tendon_slack'))
#: Strain near which raising MU2 lowers the force in the paper's figure 3d.
FALLS_NEAR = 0.195


def map_pictures(figures: PaperFigures) -> list[Picture]:
    """Return the pictures of ``fam_bundle map``."""
    own = _own(figures)
    pictures = [
        Picture('muscle', 'Force of one muscle at constant pressures (figure 2a)',
                muscle_isobars(figures.muscle),
                f'After figure 2a of {PAPER}, where these curves are measured; here they are '
                'computed. From the text: isobars from 0 to 60 psi (413.7 kPa) in steps of 10 '
                'psi; the muscle is compressed past its free strain, up to the largest of the '
                'bundle; '
                'its resistive force has a peak and then drops as it collapses, near strains of '
                f'0.05 at 0 kPa and 0.20 at 68.95 kPa. {own}'),
        Picture('isobars', 'Ideal, Klute–Hannaford and with resistive force (figure 2b)',
                isobars(figures.isobars),
                f'After figure 2b of {PAPER}. From the text: ideal and Klute–Hannaford muscle '
                'over-predict blocked force and free strain; Klute–Hannaford over-predicts the '
                'size of the resistive force and misses its drop. The paper prints 68.1 kPa for '
                f'10 psi; it is 68.95 kPa, which is drawn. {_over(figures)} Klute–Hannaford is '
                f'the braid and the rubber bladder, continued below zero. {own}'),
        Picture('space', 'Force–strain space of the recruitment states (figure 3)',
                force_strain_space(figures.space),
                f'After figure 3 of {PAPER}. Left: a unit past its free strain gives no force, '
                'so one state ends where the next begins. Right: it pushes back; the lower state '
                'loses force, and while the next unit fills the force first falls below what the '
                'lower state gives, so the two overlap (hatched). Only tension is drawn. '
                f'{_falls(figures.space)} {own}'),
    ]
    if figures.free_strain is not None:
        f = figures.free_strain
        fall = (f'Here it falls by {f.dip:.4f} to {f.dip_strain:.4f} at '
                f'{f.dip_pressure / 1e3:.0f} kPa and then returns: the free strain gradient '
                'reversal.' if f.dip > 1e-4 else 'This model shows no reversal.')
        pictures.append(Picture(
            'free_strain', 'Free strain of the bundle while MU2 fills (figure 4)',
            free_strain(f),
            f'After figure 4 of {PAPER}; MU1 stays at its largest pressure. From the text: ideal '
            'and Klute–Hannaford lines neglect resistive forces and are constant; with them the '
            f'free strain falls first and then returns. {fall} {own}'))
    return pictures


def _own(figures):
    """Return what in these figures is not from the paper."""
    said = ('Our own: the form of the resistive force (the paper names its regions, post-buckling '
            'and post-collapse, but its formulas were not available) and its constants.'
            if figures.resistive else
            'This model has no resistive effect: its curves below zero are the elastic ones.')
    if figures.beyond:
        said += (f' Not from the paper either: {", ".join(figures.beyond)}, in which this model '
                 'differs from Klute–Hannaford in tension.')
    return said


def _over(figures):
    """Return the comparison of Klute and Hannaford's muscle with the model at 10 psi."""
    found, forces = figures.summary(), figures.isobars.forces
    blocked, free = found['blocked_force_10_psi_N'], found['free_strain_10_psi']
    lowest = {name: -float(force[-1].min()) for name, force in forces.items()}
    return (f'Here at 68.95 kPa, Klute–Hannaford against the model: blocked force '
            f'{blocked["klute_hannaford"]:.1f} and {blocked["included"]:.1f} N, free strain '
            f'{free["klute_hannaford"]:.4f} and {free["included"]:.4f}, largest resistive force '
            f'up to a strain of {figures.isobars.strain[-1]:.2f}: '
            f'{lowest["klute_hannaford"]:.1f} and {max(lowest["included"], 0.0):.1f} N.')


def _falls(space):
    """Return a description of MU2's isobars at the strain named in the paper's text."""
    if not len(space.pressure):
        return ''
    said = ('Thin lines: MU1 at its largest pressure, MU2 at that of the legend; at zero and at '
            'its largest pressure they are the upper edges of RS1 and RS2. From the text: raising '
            f'MU2 lowers the force near strains of {FALLS_NEAR} (figure 3d).')
    force = np.array([np.interp(FALLS_NEAR, space.strain, each)
                      for each in space.isobars['included']])
    lowest = int(np.argmin(force))
    least = max(float(force[lowest]), 0.0)
    if FALLS_NEAR < space.strain[-1] and force[0] > least + 0.05:
        said += (f' Here it is {force[0]:.1f} N there at 0 kPa and {least:.1f} N at '
                 f'{space.pressure[lowest] / 1e3:.4g} kPa.')
    return said


def muscle_isobars(data: Isobars) -> go.Figure:
    """Draw figure 2a: the whole range left, the range near zero force right."""
    drawing = plotting.panels(1, 2, 440, 'strain', legend={'y': 1.09}, horizontal_spacing=0.09,
                              subplot_titles=('', 'the same about zero force'))
    forces = data.forces['included']
    for column in (1, 2):
        for pressure, force in zip(data.pressure, forces, strict=True):
            drawing.add_trace(plotting.line(
                data.strain, force, f'{pressure / 1e3:.4g} kPa',
                palette.isobar(pressure / data.pressure[-1]), showlegend=column == 1,
                legendgroup=f'{pressure:.0f}',
                hovertemplate=f'%{{y:.1f}} N at %{{x:.3f}}, {pressure / 1e3:.4g} kPa'
                              '<extra></extra>'), row=1, col=column)
    drawing.add_hline(y=0.0, line={'color': palette.NEUTRAL['faint'].light, 'width': 1})
    drawing.update_xaxes(range=[0.0, float(data.strain[-1])])
    lowest = min(float(forces.min()), -1.0)
    drawing.update_yaxes(title_text='force of one muscle (N)', row=1, col=1)
    drawing.update_yaxes(range=[1.2 * lowest, -1.2 * lowest], row=1, col=2)
    return drawing


def isobars(data: Isobars) -> go.Figure:
    """Draw figure 2b."""
    drawing = plotting.figure('strain', 'force of one muscle (N)', height=440)
    drawing.add_hline(y=0.0, line={'color': palette.NEUTRAL['faint'].light, 'width': 1})
    looks = (('included', 'resistive force included', RESISTIVE, 3.4),
             ('klute_hannaford', 'Klute–Hannaford', BLADDER, 1.8), ('ideal', 'ideal', IDEAL, 1.8))
    for name, title, colour, width in looks:
        for k, pressure in enumerate(data.pressure):
            drawing.add_trace(plotting.line(
                data.strain, data.forces[name][k], f'{title}, {pressure / 1e3:.4g} kPa', colour,
                'dot' if k == 0 else 'solid', width,
                legendgroup=name, hovertemplate='%{y:.1f} N at %{x:.3f}'))
    lowest = min(float(force.min()) for force in data.forces.values())
    highest = max(float(force.max()) for force in data.forces.values())
    drawing.update_yaxes(range=[lowest - 3.0, highest + 3.0])
    drawing.update_xaxes(range=[0.0, float(data.strain[-1])])
    return drawing


def force_strain_space(data: ForceStrainSpace) -> go.Figure:
    """
    Draw figure 3: whole range above, large strain below; neglected left, included right.

    With the isobars of the second unit, the first one at its largest pressure.
    """
    n = len(data.high['included'])
    drawing = plotting.panels(
        2, 2, 820, legend={'y': 1.045}, shared_yaxes='rows', horizontal_spacing=0.05,
        vertical_spacing=0.13,
        subplot_titles=('resistive force neglected', 'resistive force included',
                        'the same at large strain', 'the same at large strain'))
    end = float(data.strain[-1])
    # the zoom shows the overlap, which is at large strain
    start = 0.68 * end
    inside = data.strain >= start
    tops = (float(data.high['neglected'].max()), float(data.high['neglected'][:, inside].max()))
    for row, (left, top) in enumerate(zip((0.0, start), tops), start=1):
        for column, reading in enumerate(('neglected', 'included'), start=1):
            where = {'row': row, 'col': column}
            for trace in state_regions(data, reading, legend=row == 1 and column == 2):
                drawing.add_trace(trace, **where)
            for trace in _second_unit(data, reading, legend=row == 1 and column == 2):
                drawing.add_trace(trace, **where)
            drawing.update_xaxes(range=[left, end], **where)
            drawing.update_yaxes(range=[0.0, 1.03 * top], **where)
            name_states(drawing, data, reading, left, top, where)
        drawing.update_yaxes(title_text='force of the bundle (N)', row=row, col=1)
    drawing.update_xaxes(title_text='strain', row=2)
    drawing.update_layout(showlegend=n > 1)
    return drawing


def state_regions(data: ForceStrainSpace, reading: str, legend: bool = True) -> list[go.Scatter]:
    """
    Return fills and edges of every recruitment state, and the overlaps, as traces.

    Also used as the background of a closed-loop run's force-strain track.
    """
    traces = []
    low, high = data.low[reading], data.high[reading]
    for k in range(len(high)):
        colour = palette.recruitment_state(k + 1)
        # one strain past the last positive force, so that the edge meets the axis
        held = np.roll(high[k] > 0.0, 1) | (high[k] > 0.0)
        bottom = np.maximum(low[k], 0.0) if k else np.zeros_like(high[k])
        top = np.maximum(high[k], 0.0)
        traces.append(plotting.band(data.strain[held], bottom[held], top[held], f'RS{k + 1}',
                                 colour, 0.16, legendgroup=f'RS{k + 1}', showlegend=legend))
        traces.append(plotting.line(data.strain[held], top[held], f'largest of RS{k + 1}',
                                 colour, width=1.8, legendgroup=f'RS{k + 1}', showlegend=False,
                                 hovertemplate='%{y:.1f} N at %{x:.3f}'))
    for k in range(1, len(high)):
        width = data.overlap(reading, k)
        shared = width > 0.05
        if not shared.any():
            continue
        colour = palette.recruitment_state(k + 1)
        bottom = np.maximum(low[k], 0.0)
        traces.append(plotting.line(data.strain[shared], bottom[shared], f'smallest of RS{k + 1}',
                                 colour, 'dash', 1.5, legendgroup=f'RS{k + 1}', showlegend=False,
                                 hovertemplate='%{y:.1f} N at %{x:.3f}'))
        fill = plotting.band(data.strain[shared], bottom[shared], high[k - 1][shared],
                          f'overlap of RS{k} and RS{k + 1}', plotting.INK, 0.0,
                          legendgroup='overlap', showlegend=legend)
        fill.fillpattern = {'shape': '/', 'fgcolor': plotting.INK, 'fgopacity': 0.55, 'size': 5,
                            'solidity': 0.16, 'bgcolor': 'rgba(0,0,0,0)'}
        traces.append(fill)
    return traces


def _second_unit(data, reading, legend):
    """Return the isobars of MU2 without the first and last, which are edges of the states."""
    traces = []
    for pressure, force in list(zip(data.pressure, data.isobars[reading], strict=True))[1:-1]:
        held = np.roll(force > 0.0, 1) | (force > 0.0)
        traces.append(plotting.line(
            data.strain[held], force[held], f'MU2 at {pressure / 1e3:.4g} kPa',
            palette.isobar(pressure / data.pressure[-1]), width=1.3, showlegend=legend,
            legendgroup=f'isobar {pressure:.0f}',
            hovertemplate=f'%{{y:.1f}} N at %{{x:.3f}}, MU2 at {pressure / 1e3:.4g} kPa'
                          '<extra></extra>'))
    return traces


def free_strain(data: FreeStrain) -> go.Figure:
    """Draw figure 4."""
    drawing = plotting.figure('pressure of MU2 (kPa)', 'free strain of the bundle', height=460)
    pressure = data.pressure / 1e3
    looks = [('ideal', 'ideal', IDEAL, 'solid', 1.8),
             ('klute_hannaford', 'Klute–Hannaford', BLADDER, 'solid', 1.8),
             ('neglected', 'this model, resistive force neglected', NEGLECTED, 'dash', 1.6),
             ('included', 'this model, resistive force included', RESISTIVE, 'solid', 3.4)]
    for name, title, colour, dash, width in looks:
        drawing.add_trace(plotting.line(pressure, data.strain[name], title, colour, dash, width,
                                     hovertemplate='%{y:.4f} at %{x:.0f} kPa'))
    if data.dip > 1e-4:
        at = data.dip_pressure / 1e3
        drawing.add_trace(plotting.points([at], [data.dip_strain], 'dip', RESISTIVE, 10,
                                       showlegend=False,
                                       hovertemplate='%{y:.4f} at %{x:.0f} kPa'))
        drawing.add_annotation(
            x=at, y=data.dip_strain, ax=60, ay=-72, axref='pixel', ayref='pixel', showarrow=True,
            arrowhead=0, arrowwidth=1, arrowcolor=plotting.MUTED, xanchor='left', align='left',
            text=f'dip of {data.dip:.4f}<br>at {at:.0f} kPa', standoff=8,
            font={'color': RESISTIVE.light, 'size': 12.5})
    every = np.concatenate([data.strain[name] for name, *_ in looks])
    low, high = np.nanmin(every), np.nanmax(every)
    drawing.update_yaxes(range=[low - 0.08 * (high - low), high + 0.06 * (high - low)],
                         tickformat='.2f')
    drawing.update_xaxes(range=[0.0, float(pressure[-1])])
    return drawing


def name_states(drawing, data, reading, left, top, where):
    """Write each state's name inside its region, the last one's outside."""
    end, forces = float(data.strain[-1]), data.high[reading]
    for k, high in enumerate(forces):
        last = 0 < k == len(forces) - 1
        # isobars fill the last region, so its name is outside
        at = left + (0.25 if last else 0.12) * (end - left)
        below = max(float(np.interp(at, data.strain, forces[k - 1])), 0.0) if k else 0.0
        above = float(np.interp(at, data.strain, high))
        if above - below > 0.06 * top:
            plotting.label(
                drawing, at, above + 0.08 * top if last else 0.5 * (below + above), f'RS{k + 1}',
                palette.recruitment_state(k + 1), font={
                    'size': 14, 'color': palette.recruitment_state(k + 1).light}, **where)
