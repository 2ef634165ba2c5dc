# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The figures of the page: figures of discovery with selection, zoom, row numbers and transitions.

`for_page` converts a figure to a dict for the browser, in the colours of its theme. Points are
thinned here, for drawing only.
"""

import copy
import functools
import json
import re
from typing import Any

import numpy as np
import plotly.graph_objects as go

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.data.grouping import pressure_levels, varying_unit
from fam_bundle_ros.discovery import figures
from fam_bundle_ros.workbench.session import Session

#: Largest number of points in a figure; more make the page slow.
MOST_POINTS = 3000
#: A step of the clock above this many usual ones is a gap.
_GAP = 5.0
#: A flat list, as Plotly.react does not return with the nested list of modeBarButtons.
CONFIG = {'displaylogo': False, 'responsive': True, 'modeBarButtonsToRemove': [
    'select2d', 'lasso2d', 'zoomIn2d', 'zoomOut2d', 'autoScale2d']}
_BEFORE = palette.NEUTRAL['faint'].light
_HOVER = ('%{customdata[0]}<br>strain %{customdata[1]:.4f}, %{customdata[2]:.1f} kPa<br>'
          'measured %{customdata[3]:.2f} N, model %{customdata[4]:.2f} N<br>'
          'error %{customdata[5]:+.2f} N<extra></extra>')


def for_page(drawing: go.Figure | dict[str, Any], dark: bool, move_ms: int = 0) -> dict[str, Any]:
    """
    Return a figure, in the light colours, as a dict for the page.

    On a ``dark`` page others replace them. The transition of the curves takes ``move_ms``; 0 for
    none.
    """
    text = json.dumps(drawing) if isinstance(drawing, dict) else drawing.to_json()
    if dark:
        colours = palette.by_page()
        text = re.sub('#[0-9A-Fa-f]{6}', lambda found: colours.get(found[0].upper(), found[0]),
                      text)
    figure = json.loads(text)
    layout = figure['layout']
    # the figure fills its box on the page
    layout.pop('height', None)
    layout.update(autosize=True, margin={'l': 56, 'r': 12, 't': layout['margin'].get('t', 30),
                                         'b': 44})
    if move_ms:
        layout['transition'] = {'duration': move_ms, 'easing': 'cubic-in-out',
                                'ordering': 'traces first'}
    figure['config'] = CONFIG
    return figure


def main_figure(session: Session, over_time: bool = False, narrow: bool = False,
                ) -> dict[str, Any]:
    """
    Draw measurement (points) and model (lines), below them the error with the noise band.

    The model of the previous step is a thin dotted line. A plain dict, not a plotly object, as the
    page redraws it at every click and plotly's validation is slow. Logs may be drawn ``over_time``
    instead of strain. ``narrow`` is for a phone: names of isobars take a larger share of the
    width.
    """
    data, residual = session.data, session.residual()
    level, means = pressure_levels(data.pressure[:, varying_unit(data)])
    x = figures.running_clock(data) if over_time else data.strain
    chosen = session.rows()
    rows = np.flatnonzero(chosen)
    shown = rows[thin_groups(level[rows], residual[rows], MOST_POINTS)]
    span = max(float(np.ptp(means)), 1.0)
    traces: list[dict[str, Any]] = []
    for k, mean in enumerate(means):
        colour = palette.isobar((mean - means[0]) / span).light
        part = _stretches(x, data.trial, chosen & (level == k)) if over_time else data.trial
        traces += _isobar(session, x, shown[level[shown] == k], colour, part)
    layout = copy.deepcopy(_base_layout(over_time))
    noise = session.noise
    layout['shapes'] = [
        {'type': 'rect', 'xref': 'x2 domain', 'yref': 'y2', 'x0': 0, 'x1': 1, 'y0': -2 * noise,
         'y1': 2 * noise, 'line': {'width': 0}, 'layer': 'below',
         'fillcolor': palette.fade(_BEFORE, 0.25)},
        {'type': 'line', 'xref': 'x2 domain', 'yref': 'y2', 'x0': 0, 'x1': 1, 'y0': 0, 'y1': 0,
         'line': {'color': _BEFORE, 'width': 1}}]
    # fixed ranges while models change, or the axes would jump during the transition
    layout['yaxis']['range'] = _force_range(session, rows)
    layout['yaxis2']['range'] = _error_range(session, rows)
    layout['annotations'] = [] if over_time else _isobar_names(session, level, means, rows)
    _zoom(layout, session, x, rows, narrow)
    return {'data': traces, 'layout': layout}


@functools.lru_cache(maxsize=2)
def _base_layout(over_time: bool) -> dict[str, Any]:
    drawing = plotting.panels(2, 1, 520, showlegend=False, margin={'t': 14}, shared_xaxes=True,
                              row_heights=[0.7, 0.3], vertical_spacing=0.06)
    drawing.update_yaxes(title_text='force (N)', row=1, col=1)
    drawing.update_yaxes(title_text='error (N)', row=2, col=1)
    drawing.update_xaxes(title_text='time (s)' if over_time else 'strain', row=2, col=1)
    return json.loads(drawing.to_json())['layout']


def maps(session: Session) -> go.Figure:
    """Draw the even and odd residual maps with the free strain curve and the chosen region."""
    step = session.now
    drawing = figures.residual_maps(step.comparison, step.model)
    if session.region is not None:
        data, rows = session.data, session.rows()
        inside = data.pressure[rows, varying_unit(data)] / 1e3
        strain = data.strain[rows]
        grow = 0.02 * float(np.ptp(data.pressure[:, varying_unit(data)])) / 1e3 + 1e-9
        panels = 2 if drawing.layout.xaxis2.domain else 1
        for column in range(1, panels + 1):
            drawing.add_shape(type='rect', x0=strain.min(), x1=strain.max(),
                              y0=inside.min() - grow, y1=inside.max() + grow, row=1, col=column,
                              line={'color': plotting.INK, 'width': 2})
    drawing.update_layout(margin={'t': 34})
    return drawing


def loops(session: Session) -> go.Figure | None:
    """Draw the error in both directions for some isobars; None without data in both."""
    drawing = figures.loops(session.now.comparison)
    if drawing is not None:
        noise = session.noise
        drawing.add_hrect(-2.0 * noise, 2.0 * noise, line_width=0, layer='below',
                          fillcolor=palette.fade(_BEFORE, 0.25), row='all', col='all')
        drawing.update_yaxes(range=_error_range(session, np.arange(len(session.data))))
        drawing.update_layout(margin={'t': 64})
    return drawing


def _stretches(time: np.ndarray, trial: np.ndarray, mine: np.ndarray) -> np.ndarray:
    """
    Return the number of the stretch of each row, (T,), for a line over time without false bridges.

    A new one begins where other rows lie between, with a trial, and after a gap in the clock.
    """
    step = np.diff(time, prepend=time[:1])
    begins = np.diff(trial, prepend=trial[:1]) != 0
    return np.cumsum(~mine | begins | (step > _GAP * np.median(step[1:])))


def _isobar(session: Session, x: np.ndarray, rows: np.ndarray, colour: str, part: np.ndarray,
            ) -> list[dict[str, Any]]:
    """
    Return the traces of one isobar: model before, model, measured, error; always four.

    ``part`` is, for each row, the number of the trial or stretch between which lines have gaps.
    """
    data, residual, prediction = session.data, session.residual(), session.now.prediction
    before = (session.before or session.now).prediction
    lines = [{'type': 'scatter', 'mode': 'lines', 'name': name, 'hoverinfo': 'skip',
              'xaxis': 'x', 'yaxis': 'y', **_path(data, x, values, rows, part),
              'line': {'color': shade, 'dash': dash, 'width': width}}
             for name, values, shade, dash, width in (
                 ('model before', before, _BEFORE, 'dot', 1.2),
                 ('model', prediction, colour, 'solid', 2.0))]
    many = len(data.trial_names) > 1
    pressure = data.pressure[rows, varying_unit(data)] / 1e3
    notes = [[f'row {row + 2}' + (f', trial {data.trial_names[data.trial[row]]}' if many else ''),
              *numbers] for row, numbers in zip(rows, np.round(np.stack(
                  [data.strain[rows], pressure, data.force[rows], prediction[rows],
                   residual[rows]], axis=-1), 4).tolist())]
    symbols = np.where(data.direction[rows] < 0, 'circle-open', 'circle').tolist()
    points = [{'type': 'scatter', 'mode': 'markers', 'name': name, 'x': _plain(x[rows]),
               'y': _plain(values[rows]), 'xaxis': 'x' + axis, 'yaxis': 'y' + axis,
               'marker': {'color': colour, 'size': 4.5, 'symbol': symbols, 'opacity': 0.8},
               'customdata': notes, 'hovertemplate': _HOVER}
              for axis, name, values in (('', 'measured', data.force),
                                         ('2', 'error', residual))]
    return lines + points


def _path(data, x, values, rows, part):
    """Return x and y of a model's line, with gaps between parts; a static map by strain."""
    if data.is_static:
        rows = rows[np.argsort(x[rows], kind='stable')]
        return {'x': _plain(x[rows]), 'y': _plain(values[rows])}
    cuts = np.flatnonzero(np.diff(part[rows]) != 0) + 1
    return {'x': _plain(np.insert(x[rows], cuts, np.nan)),
            'y': _plain(np.insert(values[rows], cuts, np.nan))}


def _plain(values: np.ndarray) -> list[float | None]:
    """Return numbers for JSON (None for nan), rounded to what a screen can show."""
    return [None if v != v else v for v in np.round(values, 5).tolist()]


def _force_range(session, rows):
    every = [session.data.force, *(step.prediction for step in session.steps)]
    low = min(float(values[rows].min()) for values in every)
    high = max(float(values[rows].max()) for values in every)
    room = 0.05 * max(high - low, 1.0)
    return [low - room, high + room]


def _error_range(session, rows):
    """Return a range that fits all steps, so that a smaller error looks smaller."""
    worst = max(float(np.quantile(np.abs(session.residual(step)[rows]), 0.995))
                for step in session.steps)
    top = 1.15 * max(worst, 3.0 * session.noise)
    return [-top, top]


def _isobar_names(session, level, means, rows):
    """Return annotations that name each isobar left of its curve, if there is space."""
    data = session.data
    names = session.levels
    height = max(float(np.ptp(data.force[rows])), 1.0)
    taken: list[float] = []
    found = []
    for k in range(len(means))[::-1]:
        mine = rows[level[rows] == k]
        if not len(mine):
            continue
        left = mine[data.strain[mine] <= np.quantile(data.strain[mine], 0.04)]
        y = float(np.mean(session.now.prediction[left]))
        if any(abs(y - other) < 0.06 * height for other in taken):
            continue
        taken.append(y)
        share = (means[k] - means[0]) / max(float(np.ptp(means)), 1.0)
        found.append({
            'x': float(data.strain[mine].min()), 'y': y, 'xref': 'x', 'yref': 'y',
            'text': names[k], 'showarrow': False, 'xanchor': 'right', 'xshift': -7,
            'font': {'size': 12, 'color': palette.isobar(share).light}})
    return found


def _zoom(layout, session, x, rows, narrow):
    """Set the axes to the selection, with space for the names of the isobars on the left."""
    if session.region is None:
        if layout['annotations']:
            low, span = float(x[rows].min()), max(float(np.ptp(x[rows])), 1e-3)
            room = max(map(len, session.levels)) * (0.042 if narrow else 0.0145) * span
            for axis in ('xaxis', 'xaxis2'):
                layout[axis]['range'] = [low - room - 0.012 * span, low + 1.03 * span]
        return
    both = np.r_[session.data.force[rows], session.now.prediction[rows]]
    for values, axes in ((x[rows], ('xaxis', 'xaxis2')), (both, ('yaxis',))):
        room = 0.06 * max(float(np.ptp(values)), 1e-3)
        for axis in axes:
            layout[axis]['range'] = [float(values.min()) - room, float(values.max()) + room]


def thin(values: np.ndarray, most: int) -> np.ndarray:
    """
    Return sorted indices of at most ``most`` (4 or more) points of a series, shape (T,).

    The first point, the last one and the extremes of each interval are kept.
    """
    count = len(values)
    if count <= most:
        return np.arange(count)
    stretches = max((most - 2) // 2, 1)
    edges = np.linspace(0, count, stretches + 1).astype(int)
    starts = edges[:-1]
    # the extremes of each stretch, on a rectangle padded with the stretch's last index
    width = int(np.diff(edges).max())
    at = np.minimum(starts[:, None] + np.arange(width), edges[1:, None] - 1)
    block = values[at]
    rows = np.arange(stretches)
    lowest, highest = at[rows, block.argmin(1)], at[rows, block.argmax(1)]
    return np.unique(np.r_[0, lowest, highest, count - 1])


def thin_groups(group: np.ndarray, values: np.ndarray, most: int) -> np.ndarray:
    """
    Return indices of about ``most`` points, each group with its share and its extremes.

    ``group`` (T,) is the number of the group, such as an isobar, of each of the ``values`` (T,).
    The indices are group after group, in the order of the rows within each.
    """
    order = np.argsort(group, kind='stable')
    names, starts = np.unique(group[order], return_index=True)
    share = max(most // max(len(names), 1), 4)
    pieces = np.split(order, starts[1:])
    return np.concatenate([piece[thin(values[piece], share)] for piece in pieces])
