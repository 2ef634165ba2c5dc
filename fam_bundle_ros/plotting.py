# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Common look of the plotly figures: axes, legend, fonts, lines, points, bands.

Figures are drawn in the light colours; dark pages replace them by `palette.by_page`.
"""

from collections.abc import Iterable
from textwrap import wrap
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from fam_bundle_ros import palette

FONT = ('system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", "Noto Sans", '
        '"Liberation Sans", Arial, sans-serif')
INK = palette.NEUTRAL['ink'].light
MUTED = palette.NEUTRAL['muted'].light
#: Arguments of `panels` for the layout.
LAYOUT = ('legend', 'showlegend', 'margin', 'hovermode')


def figure(x: str = '', y: str = '', height: int = 380, **layout: Any) -> go.Figure:
    """
    Return an empty figure of a height, px, with the project's look; ``layout`` has more of it.

    Axis titles have units in brackets; they are empty where `style_axes` sets them for each panel.
    """
    drawing = go.Figure()
    dress(drawing, height, **layout)
    style_axes(drawing, x, y)
    return drawing


def panels(rows: int, columns: int, height: int, x: str = '', **more: Any) -> go.Figure:
    """
    Return an empty figure of several panels with the project's look.

    Parameters
    ----------
    rows, columns : int
    height : int, px
    x : str
        Title of every horizontal axis.
    **more
        Entries of the plotly layout (`LAYOUT`), and arguments of plotly's ``make_subplots``.
    """
    look = {name: more.pop(name) for name in LAYOUT if name in more}
    drawing = make_subplots(rows, columns, **more)
    dress(drawing, height, **look)
    style_axes(drawing, x)
    for title in drawing.layout.annotations:
        title.font = {'size': 13, 'color': MUTED}
    return drawing


def dress(drawing: go.Figure, height: int, **layout: Any) -> go.Figure:
    """Give a figure (also one from ``make_subplots``) the project's fonts, legend, margins."""
    legend = {'orientation': 'h', 'x': 0.0, 'xanchor': 'left', 'y': 1.02, 'yanchor': 'bottom',
              'bgcolor': 'rgba(0,0,0,0)', 'font': {'size': 12.5}, 'tracegroupgap': 4}
    drawing.update_layout(
        template='none', height=height, autosize=True,
        font={'family': FONT, 'size': 13, 'color': INK},
        paper_bgcolor='rgba(0,0,0,0)', plot_bgcolor='rgba(0,0,0,0)',
        margin={'l': 64, 'r': 24, 't': 44, 'b': 52},
        modebar={'bgcolor': 'rgba(0,0,0,0)', 'color': palette.NEUTRAL['rule'].light,
                 'activecolor': MUTED},
        hoverlabel={'font': {'family': FONT, 'size': 12.5}},
        legend={**legend, **layout.pop('legend', {})},
        hovermode=layout.pop('hovermode', 'closest'),
        colorway=[palette.recruitment_state(k).light for k in range(1, 7)])
    drawing.update_layout(**layout)
    return drawing


def stacked(name: str, width: int) -> str:
    """Return a name in lines of at most ``width`` characters, broken at spaces and underscores."""
    lines = wrap(name.replace('_', '_ '), width, break_long_words=False)
    return '<br>'.join(line.replace('_ ', '_') for line in lines)


def style_axes(drawing: go.Figure, x: str = '', y: str = '', **where: Any) -> None:
    """Style axes (all, or those at ``row``, ``col``) and set their titles."""
    common = {'showline': True, 'linecolor': palette.NEUTRAL['faint'].light, 'linewidth': 1,
              'ticks': 'outside', 'ticklen': 4, 'tickcolor': palette.NEUTRAL['faint'].light,
              'gridcolor': palette.NEUTRAL['grid'].light, 'gridwidth': 1,
              'zeroline': False, 'title': {'standoff': 8, 'font': {'size': 13}}}
    drawing.update_xaxes(**common, **where)
    drawing.update_yaxes(**common, **where)
    if x:
        drawing.update_xaxes(title_text=x, **where)
    if y:
        drawing.update_yaxes(title_text=y, **where)


def line(x: Iterable[Any], y: Iterable[Any], name: str, colour: palette.Colour | str,
         dash: str = 'solid', width: float = 2.2, **more: Any) -> go.Scatter:
    """Return a line trace."""
    colour = colour if isinstance(colour, str) else colour.light
    return go.Scatter(x=x, y=y, name=name, mode='lines',
                      line={'color': colour, 'dash': dash, 'width': width,
                            'simplify': False}, **more)


def points(x: Iterable[Any], y: Iterable[Any], name: str, colour: palette.Colour | str,
           size: float = 5.0, symbol: str = 'circle', **more: Any) -> go.Scatter:
    """Return a trace of points."""
    colour = colour if isinstance(colour, str) else colour.light
    return go.Scatter(x=x, y=y, name=name, mode='markers',
                      marker={'color': colour, 'size': size, 'symbol': symbol}, **more)


def band(x: Iterable[Any], low: Iterable[Any], high: Iterable[Any], name: str,
         colour: palette.Colour | str, opacity: float = 0.18, **more: Any) -> go.Scatter:
    """Return one filled trace between two curves."""
    colour = colour if isinstance(colour, str) else colour.light
    return go.Scatter(x=[*x, *list(x)[::-1]], y=[*low, *list(high)[::-1]], name=name,
                      mode='lines', line={'width': 0}, fill='toself',
                      fillcolor=palette.fade(colour, opacity), hoverinfo='skip', **more)


def label(drawing: go.Figure, x: float, y: float, text: str,
          colour: palette.Colour | str = INK, **more: Any) -> None:
    """Add a text at a point of the figure."""
    colour = colour if isinstance(colour, str) else colour.light
    drawing.add_annotation(**{'x': x, 'y': y, 'text': text, 'showarrow': False,
                              'font': {'size': 12.5, 'color': colour}, **more})
