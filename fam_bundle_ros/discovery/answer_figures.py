# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Figures on the reliability of a diagnosis (plotly, extra `tools`).

Predicted forces of held-out folds, the discrepancy before and after, the most probable sets of
effects, and prior and posterior of every parameter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.data.folds import KINDS
from fam_bundle_ros.discovery.figures import DIVERGING, MOST_POINTS, small_titles, thin
from fam_bundle_ros.discovery.leftover import Leftover, PARTS

if TYPE_CHECKING:
    from fam_bundle_ros.discovery.posterior import LikelySet
    from fam_bundle_ros.discovery.result import Diagnosis

__all__ = ['discrepancy', 'priors', 'sets', 'unseen']

_MODEL = palette.effect('mesh')
_FAINT = palette.NEUTRAL['faint'].light
#: Limit of the parameter axis, in widths of the prior; values beyond it are drawn at the limit.
_FARTHEST = 6.0


def unseen(result: Diagnosis) -> go.Figure | None:
    """
    Draw predicted against measured forces of held-out cells, and the residual below.

    For the recommended model and the empirical form, on all kinds of folds; None if the data have
    no folds.
    """
    kinds = result.held_out.unseen
    if not kinds:
        return None
    drawing = make_subplots(2, 1, shared_xaxes=True, row_heights=[0.6, 0.4],
                            vertical_spacing=0.05)
    plotting.dress(drawing, 560)
    plotting.style_axes(drawing)
    every = np.concatenate([each.measured for each in kinds.values()])
    ends = [float(every.min()), float(every.max())]
    for row, y in ((1, ends), (2, [0.0, 0.0])):
        drawing.add_trace(go.Scatter(
            x=ends, y=y, mode='lines', line={'color': _FAINT, 'width': 1.2}, showlegend=False,
            hoverinfo='skip'), row=row, col=1)
    for source, name, colour, symbol in (
            ('empirical', 'six-parameter form', plotting.MUTED, 'x-thin-open'),
            (result.recommended.kind, 'recommended model', _MODEL, 'circle')):
        for kind, each in kinds.items():
            rows = thin(np.arange(len(each.measured)), MOST_POINTS // 6)
            measured, predicted = each.measured[rows], each.predicted[source][rows]
            for row, values in ((1, predicted), (2, measured - predicted)):
                drawing.add_trace(plotting.points(
                    np.round(measured, 3), np.round(values, 3), name, colour, 4.5, symbol,
                    legendgroup=name, showlegend=row == 1 and kind == next(iter(kinds)),
                    hovertemplate=f'%{{y:.1f}} N at %{{x:.1f}} N, {KINDS[kind]} left out'),
                    row=row, col=1)
    drawing.update_yaxes(automargin=True)
    drawing.update_yaxes(title_text='predicted (N)', row=1, col=1)
    drawing.update_yaxes(title_text='residual (N)', row=2, col=1)
    drawing.update_xaxes(title_text='measured (N)', row=2, col=1)
    return drawing


def discrepancy(result: Diagnosis) -> go.Figure | None:
    """
    Draw the discrepancy of the recalibrated model as given and of the best model.

    Each has its own colour scale. One row for each motor unit and nonzero part; None if all are
    zero.
    """
    before, after = result.leftover_before, result.leftover
    rows = [(part, unit) for unit in range(len(after.pressure)) for part in PARTS
            if any(np.any(getattr(each, part)[unit]) for each in (before, after))]
    if not rows:
        return None
    same = after is before or all(np.array_equal(getattr(before, part), getattr(after, part))
                                  for part in PARTS)
    columns = [before] if same else [before, after]
    names = result.best.motor_units
    reach = [max(float(np.abs(getattr(each, part)[unit]).max()) for part, unit in rows)
             for each in columns]
    # short, as both titles must fit side by side on a narrow page
    heads = [when if most else f'{when}: none' for when, most in zip(('before', 'after'), reach)]
    only_even = all(part == 'even' for part, _ in rows)
    titles = [', '.join(filter(None, (names[unit].name if len(names) > 1 else '',
                                      '' if only_even else part, when)))
              for part, unit in rows for when in heads]
    plot, below = 210 * len(rows), 110  # px
    drawing = make_subplots(len(rows), len(columns), shared_xaxes=True, shared_yaxes=True,
                            horizontal_spacing=0.06, vertical_spacing=0.24 / len(rows),
                            subplot_titles=titles)
    plotting.dress(drawing, plot + below + 40, showlegend=False)
    plotting.style_axes(drawing)
    for column, (each, most) in enumerate(zip(columns, reach), start=1):
        axis = f'coloraxis{column}'
        for row, (part, unit) in enumerate(rows, start=1):
            drawing.add_trace(_map(each, part, unit, axis), row=row, col=column)
        drawing.update_xaxes(title_text='strain', row=len(rows), col=column)
        left, right = drawing.get_subplot(len(rows), column).xaxis.domain
        drawing.update_layout({axis: {
            'cmin': -(most or 1.0), 'cmax': most or 1.0, 'colorscale': DIVERGING, 'colorbar': {
                'orientation': 'h', 'x': (left + right) / 2, 'len': right - left,
                'y': -60 / plot, 'yanchor': 'top', 'thickness': 10, 'outlinewidth': 0,
                'nticks': 5, 'ticksuffix': ' N'}}})
    for row in range(1, len(rows) + 1):
        drawing.update_yaxes(title_text='pressure (kPa)', row=row, col=1)
    drawing.update_xaxes(showgrid=False, nticks=4, tickangle=0)
    drawing.update_yaxes(showgrid=False, automargin=True)
    drawing.update_layout(margin_b=below)
    small_titles(drawing)
    return drawing


def _map(leftover: Leftover, part: str, unit: int, axis: str) -> go.Heatmap:
    return go.Heatmap(
        x=np.round(leftover.strain, 5), y=np.round(leftover.pressure[unit] / 1e3, 3),
        z=np.round(getattr(leftover, part)[unit].T, 3), coloraxis=axis,
        customdata=np.round(leftover.sd[unit].T, 3),
        hovertemplate='%{z:.2f} N at strain %{x:.3f}, %{y:.0f} kPa; even part ± %{customdata:.2f}'
                      ' N<extra></extra>')


def sets(result: Diagnosis) -> go.Figure | None:
    """Draw the probabilities of the most probable sets of effects; None for a single set."""
    shown = [each for each in result.likely if each.probability >= 5e-4 or each.chosen][::-1]
    if len(shown) < 2:
        return None
    chosen = next(each for each in shown if each.chosen)
    labels = [plotting.stacked(_beside(each, chosen), 30) for each in shown]
    pitch = 16 + 18 * max(label.count('<br>') + 1 for label in labels)
    drawing = plotting.figure('probability', '', height=110 + pitch * len(shown),
                              showlegend=False)
    drawing.add_trace(go.Bar(
        x=[each.probability for each in shown], y=list(range(len(shown))), orientation='h',
        width=min(0.62, 22 / pitch), cliponaxis=False, textposition='outside',
        marker={'color': [_MODEL.light if each.chosen else _FAINT for each in shown]},
        text=[f'{each.probability:.2f}' if each.probability >= 0.005 else
              f'{each.probability:.1g}' for each in shown], textfont={'size': 12},
        hovertext=[str(each) for each in shown], hoverinfo='text'))
    drawing.update_xaxes(range=[0.0, 1.2], tickvals=[0.0, 0.5, 1.0])
    # by number, as several labels may be equal
    drawing.update_yaxes(showgrid=False, ticks='', showline=False, automargin=True,
                         ticklabelstandoff=6, tickvals=list(range(len(shown))), ticktext=labels)
    return drawing


def _beside(other: LikelySet, chosen: LikelySet) -> str:
    """Return the difference of a set to the chosen one, in words."""
    if other.chosen:
        return 'the reported set' if chosen.changes else 'nothing missing'
    if not chosen.changes or not other.changes:
        return str(other)
    mine, theirs = ({change.label: change for change in each.changes}
                    for each in (chosen, other))
    shapes = [f'{theirs[label]} instead of {mine[label]}' for label in mine
              if label in theirs and theirs[label] != mine[label]]
    gone = [str(mine[label]) for label in mine if label not in theirs]
    new = [str(theirs[label]) for label in theirs if label not in mine]
    if len(gone) == len(new) == 1:
        shapes.append(f'{new.pop()} instead of {gone.pop()}')
    return ', '.join([*shapes, *(f'without {each}' for each in gone),
                      *(f'with {each}' for each in new)])


def priors(result: Diagnosis) -> go.Figure | None:
    """
    Draw prior and posterior of every parameter, in widths of the prior; None without parameters.

    Bars are 95 % intervals, cut at the limit of the axis.
    """
    parameters = result.parameters[::-1]
    if not parameters:
        return None
    after = np.clip([each.moved for each in parameters], -_FARTHEST, _FARTHEST)
    drawing = plotting.figure('widths of the prior', '',
                              height=120 + 40 * len(parameters))
    rows = list(range(len(parameters)))
    drawing.add_trace(_bars(rows, [each.reach for each in parameters], 'before the data', _FAINT,
                            11.0, 0.45))
    drawing.add_trace(_bars(rows, after[:, 1:], 'after', _MODEL.light, 4.0, 1.0))
    drawing.add_trace(plotting.points(
        after[:, 0], rows, 'value', _MODEL, 8.0, showlegend=False,
        hovertext=[f'{each.key} {each.value:.4g} {each.unit} ({each.interval[0]:.4g} to '
                   f'{each.interval[1]:.4g}); before {each.prior[0]:.4g} ({each.prior[1]:.4g} to '
                   f'{each.prior[2]:.4g})' for each in parameters], hoverinfo='text'))
    far = max(2.3, 1.08 * float(np.abs(after).max()))
    drawing.update_xaxes(range=[-far, far])
    drawing.update_yaxes(showgrid=False, ticks='', showline=False, automargin=True,
                         ticklabelstandoff=6, tickvals=rows,
                         range=[-0.7, len(rows) - 0.3],
                         ticktext=[plotting.stacked(each.key, 24) for each in parameters])
    return drawing


def _bars(rows: list[int], ends: np.ndarray | list[tuple[float, float]], name: str, colour: str,
          width: float, opacity: float) -> go.Scatter:
    """Return one trace of horizontal bars, with gaps between them."""
    x = [value for low, high in ends for value in (float(low), float(high), None)]
    y = [value for row in rows for value in (row, row, None)]
    return go.Scatter(x=x, y=y, mode='lines', name=name, opacity=opacity, hoverinfo='skip',
                      line={'color': colour, 'width': width}, connectgaps=False)
