# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Figures of comparisons and diagnoses (plotly, extra `tools`).

Points are measured data, lines are the model; every residual is measured minus model. Long logs
are thinned for drawing only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from typing import Any, TYPE_CHECKING

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.data.grouping import pressure_levels, varying_unit
from fam_bundle_ros.model import Bundle

if TYPE_CHECKING:
    from fam_bundle_ros.data.measurement import Measurement
    from fam_bundle_ros.discovery.compare import Comparison
    from fam_bundle_ros.discovery.result import Diagnosis

__all__ = ['candidates', 'comparison', 'confounding', 'diagnosis', 'has_isobars', 'ladder',
           'loops', 'residual_maps']

#: Most points in one figure; more would slow the page down.
MOST_POINTS = 6000
#: Most isobars in a legend.
_ENTRIES = 12
_MODEL = palette.effect('mesh')
_NOISE = palette.NEUTRAL['faint'].light
DIVERGING = [[0.0, palette.DIRECTIONS[1].light], [0.5, palette.NEUTRAL['paper'].light],
              [1.0, palette.DIRECTIONS[-1].light]]


def comparison(result: Comparison) -> go.Figure:
    """Draw measured and modelled force, and below the residual with the noise floor."""
    drawing = make_subplots(2, 1, shared_xaxes=True, row_heights=[0.68, 0.32],
                            vertical_spacing=0.05)
    plotting.dress(drawing, 560)
    plotting.style_axes(drawing)
    if has_isobars(result.measurement):
        _isobars(drawing, result)
    else:
        _record(drawing, result)
    noise = result.noise.value
    drawing.add_hrect(-2.0 * noise, 2.0 * noise, row=2, col=1, line_width=0, layer='below',
                      fillcolor=palette.fade(_NOISE, 0.22))
    drawing.add_hline(0.0, row=2, col=1, line={'color': _NOISE, 'width': 1})
    drawing.update_yaxes(title_text='force (N)', row=1, col=1)
    drawing.update_yaxes(title_text='residual (N)', row=2, col=1)
    return drawing


def residual_maps(result: Comparison, model: Bundle | None = None) -> go.Figure:
    """
    Draw the residual over strain and pressure: even and odd in the direction of motion.

    A static map has no direction and one panel. With ``model``, its free strain is drawn over
    the map.
    """
    maps = result.maps()
    odd = not result.measurement.is_static and bool(np.isfinite(maps['odd']).any())
    parts = ['even', 'odd'] if odd else ['even']
    titles = ('even part: equal in both directions',
              f'odd part: half of {" minus ".join(result.measurement.ways)}')
    drawing = make_subplots(1, len(parts), shared_yaxes=True, horizontal_spacing=0.05,
                            subplot_titles=titles[:len(parts)] if odd else None)
    plotting.dress(drawing, 420, showlegend=False)
    plotting.style_axes(drawing, x='strain')
    # not the maximum: a few outlying cells would make all others pale
    largest = max(float(np.nanpercentile(np.abs(maps[part]), 98)) for part in parts)
    for column, part in enumerate(parts, start=1):
        drawing.add_trace(go.Heatmap(
            x=maps['strain'], y=maps['pressure'] / 1e3, z=maps[part], zmin=-largest, zmax=largest,
            colorscale=DIVERGING, hoverongaps=False, showscale=column == len(parts),
            colorbar={'title': {'text': 'N', 'side': 'top'}, 'thickness': 12, 'outlinewidth': 0},
            hovertemplate='%{z:.2f} N at strain %{x:.3f}, %{y:.0f} kPa<extra></extra>'),
            row=1, col=column)
        if model is not None and model.n == 1:
            _free_strain_curve(drawing, model, maps, column)
    drawing.update_xaxes(showgrid=False)
    drawing.update_yaxes(showgrid=False)
    drawing.update_yaxes(title_text=_pressure_title(result.measurement), row=1, col=1)
    small_titles(drawing)
    return drawing


def loops(result: Comparison, most: int = 4) -> go.Figure | None:
    """Draw the residual over strain by direction, isobar by isobar; None for a static map."""
    data = result.measurement
    if data.is_static or not has_isobars(data):
        return None
    level, means = pressure_levels(data.pressure[:, varying_unit(data)])
    both = [k for k in range(len(means)) if {1, -1} <= set(data.direction[level == k])]
    if not both:
        return None
    shown = [both[i] for i in np.unique(np.linspace(0, len(both) - 1, most).astype(int))]
    drawing = make_subplots(1, len(shown), shared_yaxes=True, horizontal_spacing=0.02,
                            subplot_titles=[f'{round(means[k] / 1e3)} kPa' for k in shown])
    plotting.dress(drawing, 360)
    plotting.style_axes(drawing, x='strain')
    for column, k in enumerate(shown, start=1):
        for direction, name in ((1, 'shortening'), (-1, 'lengthening')):
            rows = thin(np.flatnonzero((level == k) & (data.direction == direction)),
                         MOST_POINTS // 8)
            drawing.add_trace(plotting.points(
                data.strain[rows], result.residual[rows], name, palette.DIRECTIONS[direction],
                4.0, 'circle' if direction > 0 else 'triangle-down', legendgroup=name,
                showlegend=column == 1, hovertemplate='%{y:.2f} N at %{x:.3f}'),
                row=1, col=column)
        drawing.add_hline(0.0, row=1, col=column, line={'color': _NOISE, 'width': 1})
    drawing.update_yaxes(title_text='residual (N)', row=1, col=1)
    small_titles(drawing)
    drawing.update_layout(legend={'y': 1.1})
    return drawing


def ladder(steps: Sequence[Mapping[str, Any]], noise: float | None = None,
           empirical: float | None = None) -> go.Figure:
    """
    Draw the error after each step of a model against the noise floor and the empirical form.

    Parameters
    ----------
    steps : sequence of mapping
        ``step`` (name), ``error_N`` and, if computed, ``held_out_N``.
    noise : float, N, optional
    empirical : float, N, optional
        Held-out error of the six-parameter empirical form.
    """
    names = [str(step['step']) for step in steps]
    errors = [float(step['error_N']) for step in steps]
    held = [step.get('held_out_N') for step in steps]
    drawing = plotting.figure('', 'error (N rms)', height=400)
    looks: list[tuple[Sequence[float | None], str, str, str]] = [
        (errors, 'on all rows', plotting.INK, 'circle')]
    if any(value is not None for value in held):
        looks.append((held, 'on rows held out', _MODEL.light, 'diamond'))
    for k, (values, title, colour, symbol) in enumerate(looks):
        drawing.add_trace(go.Scatter(
            x=list(range(len(names))), y=values, name=title, mode='lines+markers+text',
            line={'color': colour, 'width': 1.6}, marker={'size': 9, 'symbol': symbol},
            text=_ladder_labels(values, errors if k else None),
            textposition=_ladder_places(values, held if k == 0 else errors, k == 0),
            textfont={'size': 12, 'color': colour},
            customdata=names, hovertemplate='%{y:.3g} N<extra>%{customdata}</extra>'))
    seen = [float(value) for value in [*errors, *held, noise, empirical] if value]
    low, high = 0.55 * min(seen), 1.9 * max(seen)
    for value, words, dash in ((noise, 'noise floor', 'dash'),
                               (empirical, 'six-parameter form, held out,', 'dot')):
        if value:
            drawing.add_hline(value, line={'color': plotting.MUTED, 'dash': dash, 'width': 1.4})
            plotting.label(drawing, 0.0, np.log10(value), f'{words} {value:.3g} N',
                           plotting.MUTED, xref='paper', xanchor='left', yanchor='top', yref='y',
                           xshift=6)
    # on a log scale a reduction from 150 to 8 N and one from 0.9 to 0.6 N are both visible
    decades = [m * 10.0 ** e for e in range(-4, 6) for m in (1, 2, 5)]
    ticks = [tick for tick in decades if low <= tick <= high]
    drawing.update_yaxes(type='log', range=[np.log10(low), np.log10(high)], tickvals=ticks,
                         ticktext=[f'{tick:g}' for tick in ticks])
    # by number, as two steps may have the same name
    drawing.update_xaxes(range=[-0.45, len(names) - 0.55], showgrid=False, automargin=True,
                         tickvals=list(range(len(names))),
                         ticktext=[plotting.stacked(name, 16) for name in names])
    return drawing


def candidates(result: Diagnosis, most: int = 8) -> go.Figure | None:
    """Draw the probability of every candidate and its error; None without candidates."""
    shown = list(result.ranking[:most])[::-1]
    if not shown or not result.shortlist:
        return None
    title = ('probability among these' if result.verdict == 'unexplained' else 'probability')
    drawing = plotting.figure(title, '', height=110 + 34 * len(shown), showlegend=False)
    drawing.add_trace(go.Bar(
        x=[entry.probability for entry in shown], y=[entry.effect for entry in shown],
        orientation='h', width=0.62,
        marker={'color': [palette.effect(entry.effect).light for entry in shown]},
        text=[f'{entry.probability:.2f} · leaves {entry.error_N:.3g} N' for entry in shown],
        textposition='outside', cliponaxis=False, textfont={'size': 12},
        hovertext=[entry.reason for entry in shown], hoverinfo='text'))
    drawing.update_xaxes(range=[0.0, 1.28], tickvals=[0.0, 0.25, 0.5, 0.75, 1.0])
    drawing.update_yaxes(showgrid=False, ticks='', showline=False, automargin=True,
                         ticklabelstandoff=6)
    return drawing


def confounding(result: Diagnosis) -> go.Figure | None:
    """Draw the correlations of the parameter estimates; None for fewer than two parameters."""
    names, matrix = result.confounding
    if len(names) < 2:
        return None
    matrix = np.asarray(matrix, float)
    shown = np.where(np.tri(len(names), k=-1, dtype=bool), matrix, np.nan)[1:, :-1]
    drawing = plotting.figure(height=150 + 42 * len(names))
    shown = np.where(np.abs(shown) < 0.005, 0.0, shown)
    drawing.add_trace(go.Heatmap(
        x=_short(names[:-1]), y=names[1:], z=shown, zmin=-1.0, zmax=1.0, colorscale=DIVERGING,
        text=np.where(np.isfinite(shown), np.char.mod('%.2f', shown), ''), texttemplate='%{text}',
        hoverongaps=False, xgap=2, ygap=2, hovertemplate='%{y} and %{x}: %{z:.2f}<extra></extra>',
        colorbar={'title': {'text': 'correlation', 'side': 'right'}, 'thickness': 12,
                  'outlinewidth': 0}))
    drawing.update_xaxes(showgrid=False, automargin=True, ticks='', showline=False,
                         tickangle=-30 if len(names) > 5 else 0)
    drawing.update_yaxes(showgrid=False, autorange='reversed', automargin=True, ticks='',
                         showline=False)
    return drawing


def diagnosis(result: Diagnosis) -> go.Figure:
    """Draw the candidates, or the comparison if there are none."""
    return candidates(result) or comparison(result.comparison)


def _short(keys: Sequence[str]) -> list[str]:
    """Return parameter names without their effect, if they are unique without it."""
    last = [key.partition('.')[2] for key in keys]
    return [name if last.count(name) == 1 else key for name, key in zip(last, keys, strict=True)]


def has_isobars(data: Measurement) -> bool:
    """Return whether the pressure stays at levels, so that the data can be drawn by isobar."""
    column = data.pressure[:, varying_unit(data)]
    span = float(np.ptp(column))
    level, _ = pressure_levels(column)
    spread = max(float(np.ptp(column[level == k])) for k in range(level.max() + 1))
    return span == 0.0 or spread < 0.05 * span


def _isobars(drawing: go.Figure, result: Comparison) -> None:
    data = result.measurement
    level, means = pressure_levels(data.pressure[:, varying_unit(data)])
    every = math.ceil(len(means) / _ENTRIES)
    span = max(float(np.ptp(means)), 1.0)
    for k, mean in enumerate(means):
        rows = thin(np.flatnonzero(level == k), MOST_POINTS // len(means))
        colour = palette.isobar((mean - means[0]) / span)
        group = f'{round(mean / 1e3) + 0} kPa'
        x, y = _line(data, result.prediction, rows)
        drawing.add_trace(plotting.line(x, y, group, colour, width=1.6, legendgroup=group,
                                        showlegend=False, hoverinfo='skip'), row=1, col=1)
        for row, values in ((1, data.force), (2, result.residual)):
            drawing.add_trace(plotting.points(
                data.strain[rows], values[rows], group, colour, 4.5, legendgroup=group,
                showlegend=row == 1 and k % every == 0,
                hovertemplate='%{y:.2f} N at %{x:.3f}'), row=row, col=1)
    drawing.update_xaxes(title_text='strain', row=2, col=1)
    drawing.update_layout(legend={'title': {
        'text': f'{_pressure_title(data)}', 'font': {'size': 12.5}}})
    for trace in drawing.data:
        if trace.showlegend:
            trace.name = trace.name.removesuffix(' kPa')


def _record(drawing: go.Figure, result: Comparison) -> None:
    data = result.measurement
    rows = thin(np.arange(len(data)), MOST_POINTS)
    time = running_clock(data)[rows]
    drawing.add_trace(plotting.points(time, data.force[rows], 'measured', plotting.INK, 3.0,
                                      hovertemplate='%{y:.2f} N at %{x:.2f} s'), row=1, col=1)
    drawing.add_trace(plotting.line(time, result.prediction[rows], 'model', _MODEL, width=1.6,
                                    hovertemplate='%{y:.2f} N at %{x:.2f} s'), row=1, col=1)
    drawing.add_trace(plotting.points(time, result.residual[rows], 'residual', _MODEL, 2.5,
                                      showlegend=False,
                                      hovertemplate='%{y:.2f} N at %{x:.2f} s'), row=2, col=1)
    drawing.update_xaxes(title_text='time (s)', row=2, col=1)


def running_clock(data: Measurement) -> np.ndarray:
    """Return the time, (T,), s, with trials joined end to end if their clocks restart."""
    clock = np.array(data.clock, float)
    for first in np.flatnonzero(data.start)[1:]:
        if clock[first] < clock[first - 1]:
            clock[first:] += clock[first - 1] - clock[first] + 1.0
    return clock


def _line(data: Measurement, values: np.ndarray, rows: np.ndarray) -> tuple[Any, Any]:
    """Return x and y of the model's line, interrupted where a new pass begins."""
    if data.is_static:
        rows = rows[np.argsort(data.strain[rows], kind='stable')]
        return data.strain[rows], values[rows]
    cuts = np.flatnonzero((np.diff(data.trial[rows]) != 0) | (np.diff(rows) > 50)) + 1
    return (np.insert(data.strain[rows], cuts, np.nan), np.insert(values[rows], cuts, np.nan))


def _free_strain_curve(drawing: go.Figure, model: Bundle, maps: Mapping[str, np.ndarray],
                       column: int) -> None:
    pressure = np.linspace(maps['pressure'][0], maps['pressure'][-1], 60)
    strain = model.free_strain(pressure[:, None])
    inside = (strain >= maps['strain'][0]) & (strain <= maps['strain'][-1])
    if not inside.any():
        return
    drawing.add_trace(plotting.line(
        strain[inside], pressure[inside] / 1e3, 'free strain of the model', plotting.INK, 'dot',
        1.6, hoverinfo='skip'), row=1, col=column)
    if column == 1:
        at = np.flatnonzero(inside)[-1]
        drawing.add_annotation(x=strain[at], y=pressure[at] / 1e3, text='free strain',
                               showarrow=False, xanchor='right', yanchor='top', xshift=-6,
                               font={'size': 12, 'color': plotting.INK}, row=1, col=1)


def _ladder_labels(values: Sequence[float | None], beside: Sequence[float] | None) -> list[str]:
    """Return a label for each value, empty where the other line has nearly the same value."""
    return ['' if value is None or (beside is not None and abs(value / beside[k] - 1.0) < 0.03)
            else f'{value:.3g}' for k, value in enumerate(values)]


def _ladder_places(values: Sequence[float | None], other: Sequence[float | None],
                   tie: bool) -> list[str]:
    """Return the position of each label: on the side away from the other line."""
    return ['top center' if value is None or (value > (other[k] or 0.0))
            or (tie and value == other[k]) else 'bottom center'
            for k, value in enumerate(values)]


def _pressure_title(data: Measurement) -> str:
    if data.pressure.shape[1] == 1:
        return 'pressure (kPa)'
    return f'pressure of {data.motor_units[varying_unit(data)]} (kPa)'


def small_titles(drawing: go.Figure) -> None:
    """Set the titles of panels in the small font."""
    for annotation in drawing.layout.annotations:
        if annotation.yref == 'paper':
            annotation.font = {'size': 13, 'color': plotting.MUTED}


def thin(rows: np.ndarray, most: int) -> np.ndarray:
    """Return evenly spaced rows, at most ``most``."""
    return rows[::max(1, -(-len(rows) // max(most, 1)))]
