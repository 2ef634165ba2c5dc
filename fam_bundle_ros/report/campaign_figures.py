# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of a campaign: missing effects by muscle, correlations of parameters, errors."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.campaign import Campaign
from fam_bundle_ros.campaign.trends import Trend

#: Largest number of effects with a column, the most frequent ones.
_MOST_EFFECTS = 14
#: Largest number of muscles that are named on the axis; of more, only hovering shows names.
_MOST_NAMES = 60
_COLUMNS = 3
#: Factor by which the axis of a parameter extends beyond its values.
_AROUND = 2.0
_BLUE = palette.recruitment_state(1)


def lacking(result: Campaign) -> go.Figure | None:
    """
    Draw the probability of each effect for each muscle, and mark named and tied effects.

    Muscles that lack the same effects are adjacent. None if no effect is named or tied.
    """
    names = [share.effect for share in result.shares][:_MOST_EFFECTS]
    muscles = result.muscles
    if not names:
        return None
    row = {muscle: k for k, muscle in enumerate(muscles)}
    column = {name: k for k, name in enumerate(names)}
    files = {each['file'] for each in result.counted}
    total = {kind: np.zeros((len(row), len(column))) for kind in ('probability', 'named', 'tied')}
    for each in result.effects:
        if each['file'] in files and each['effect'] in column:
            place = row[each['muscle']], column[each['effect']]
            for kind, values in total.items():
                values[place] += each[kind] / muscles[each['muscle']]
    order = np.lexsort([*total['probability'].T[::-1], *(total['named'] >= 0.5).T[::-1]])[::-1]
    labels = [list(muscles)[k] for k in order]
    drawing = plotting.figure(height=int(np.clip(150 + 18 * len(row), 260, 1100)),
                              margin={'l': 120, 'r': 24, 't': 110, 'b': 24})
    drawing.add_trace(go.Heatmap(
        z=total['probability'][order], x=names, y=labels, zmin=0.0, zmax=1.0, xgap=1,
        ygap=1 if len(row) <= _MOST_NAMES else 0,
        colorscale=[[0.0, palette.NEUTRAL['paper'].light], [1.0, _BLUE.light]],
        colorbar={'title': {'text': 'probability', 'side': 'right'}, 'thickness': 12,
                  'outlinewidth': 0},
        hovertemplate='%{y}: %{x} %{z:.2f}<extra></extra>'))
    for kind, symbol, word in (('named', 'circle', 'missing'), ('tied', 'circle-open', 'tied')):
        at = [(labels[i], names[j]) for i, j in zip(*np.nonzero(
            (total[kind][order] >= 0.5) & ((kind == 'named') | (total['named'][order] < 0.5))))]
        drawing.add_trace(plotting.points(
            [name for _, name in at], [muscle for muscle, _ in at], word, plotting.INK,
            6.0 if len(row) <= _MOST_NAMES else 3.0, symbol, hoverinfo='skip'))
    drawing.update_xaxes(side='top', showgrid=False, tickangle=-30, type='category')
    drawing.update_yaxes(showgrid=False, type='category', tickmode='array', tickvals=labels,
                         range=[len(row) - 0.5, -0.5], tickfont={'size': 11}, automargin=True,
                         showticklabels=len(row) <= _MOST_NAMES)
    drawing.update_layout(legend={'y': -0.01, 'yanchor': 'top'})
    return drawing


def over_facts(found: Sequence[Trend]) -> go.Figure:
    """Draw parameters over the number that they correlate with, by muscle, and the fit."""
    columns = min(_COLUMNS, len(found))
    rows = -(-len(found) // columns)
    drawing = plotting.panels(rows, columns, 60 + 280 * rows, showlegend=False,
                              horizontal_spacing=0.09, vertical_spacing=0.28 / rows)
    for k, trend in enumerate(found):
        where = {'row': k // columns + 1, 'col': k % columns + 1}
        x, y = np.array(trend.fact_values), np.array(trend.values)
        drawing.add_trace(go.Scatter(
            x=x, y=y, mode='markers', marker={'color': _BLUE.light, 'size': 6},
            error_y={'type': 'data', 'symmetric': False, 'array': np.array(trend.high) - y,
                     'arrayminus': y - np.array(trend.low), 'width': 0, 'thickness': 1.2,
                     'color': palette.fade(_BLUE.light, 0.5)},
            hovertemplate='%{y:.4g} at %{x:.4g}<extra></extra>'), **where)
        ends = np.geomspace(x.min(), x.max(), 40)
        drawing.add_trace(plotting.line(ends, trend.factor * ends ** trend.power, 'fit',
                                        plotting.INK, 'dash', 1.4, hoverinfo='skip'), **where)
        unit = f' ({trend.unit})' if trend.unit else ''
        drawing.update_xaxes(type='log', title_text=trend.fact, nticks=6, **where)
        # the range ignores intervals, as a very wide one would compress the points to a line
        ends = np.log10([y.min() / _AROUND, y.max() * _AROUND]).tolist()
        drawing.update_yaxes(type='log', title_text=f'{trend.parameter}{unit}', nticks=6,
                             range=ends, **where)
    return drawing


def errors(result: Campaign) -> go.Figure:
    """Draw for each recording the model's error, recalibrated and best, and the noise."""
    rows = sorted(result.counted, key=lambda row: -row['model_error_N'])
    drawing = plotting.figure('recording, the worst first', 'error (N)', 380)
    for key, name, colour, symbol in (
            ('model_error_N', 'present model', palette.CONTROLLERS[1], 'circle'),
            ('recalibrated_error_N', 'recalibrated', palette.CONTROLLERS[2], 'diamond'),
            ('best_error_N', 'with the effects found', _BLUE, 'circle'),
            ('noise_floor_N', 'noise floor', palette.NEUTRAL['faint'], 'line-ew-open')):
        drawing.add_trace(plotting.points(
            list(range(1, len(rows) + 1)), [row[key] for row in rows], name, colour, 6.0, symbol,
            text=[row['file'] for row in rows],
            hovertemplate='%{text}: %{y:.3g} N<extra></extra>'))
    drawing.update_yaxes(type='log')
    return drawing
