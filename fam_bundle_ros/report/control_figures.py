# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of a closed-loop run: tracking, pressures, recruitment states, force-strain track."""

from collections.abc import Mapping
from typing import Any

import plotly.graph_objects as go

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.report.paper import force_strain_space
from fam_bundle_ros.report.paper_plots import state_regions
from fam_bundle_ros.simulation import Log

#: Largest number of points in one line; more only slow the page down.
MOST_POINTS = 2500
#: Largest number of intervals of recruitment states that are labelled.
_MOST_NAMES = 14
#: Largest number that are tinted; of more (chatter has thousands), the state is a line.
_MOST_TINTED = 150


def run(log: Log) -> go.Figure:
    """
    Draw a run over time: tracking, error, pressures, recruitment state.

    The state is shown as a strip below and a tint behind the tracking; as a line if it chatters.
    """
    drawing = plotting.panels(4, 1, 680, shared_xaxes=True, vertical_spacing=0.035,
                              row_heights=[0.40, 0.17, 0.33, 0.10])
    keep = _thin(len(log.time))
    time, scale = log.time[keep], _scale(log.kind)
    reached = (log.force if log.kind == 'force' else log.strain)[keep] * scale
    what = 'force (N)' if log.kind == 'force' else 'strain (%)'

    def add(row: int, values: Any, name: str, colour: Any, dash: str = 'solid', width: float = 2.0,
            hover: str = '%{y:.2f}', **more: Any) -> None:
        drawing.add_trace(plotting.line(time, values, name, colour, dash, width,
                                        hovertemplate=hover, **more), row=row, col=1)

    add(1, reached, 'reached', palette.CONTROLLERS[0], width=2.2)
    add(1, log.reference[keep] * scale, 'reference', plotting.INK, 'dash', 1.3)
    add(2, log.error[keep] * scale, 'error', palette.CONTROLLERS[0], width=1.3,
        hover='%{y:.3f}', showlegend=False)
    drawing.add_hline(0.0, row=2, col=1, line={'color': palette.NEUTRAL['faint'].light,
                                               'width': 1})
    for unit in range(log.pressure.shape[1]):
        colour, name = palette.recruitment_state(unit + 1), f'MU{unit + 1}'
        add(3, log.pressure[keep, unit] / 1e3, name, colour, hover='%{y:.1f} kPa',
            legendgroup=name)
        add(3, log.setpoint[keep, unit] / 1e3, f'{name} setpoint', colour, 'dot', 1.2,
            '%{y:.1f} kPa', legendgroup=name, showlegend=False)
    _strip(drawing, log, keep)
    for row, title in ((1, what), (2, f'error ({what.partition("(")[2]}'), (3, 'pressure (kPa)'),
                       (4, 'state')):
        drawing.update_yaxes(title_text=title, row=row, col=1)
    drawing.update_xaxes(range=[float(log.time[0]), float(log.time[-1])])
    drawing.update_xaxes(title_text='time (s)', showgrid=False, row=4, col=1)
    drawing.update_layout(hovermode='x')
    return drawing


def _strip(drawing: go.Figure, log: Log, keep: Any) -> None:
    """Draw the recruitment state into the lowest panel, and behind the tracking."""
    time, stretches = log.time[keep], _stretches(log)
    if len(stretches) > _MOST_TINTED:
        drawing.add_trace(plotting.line(log.time, log.state, 'state', plotting.INK, width=0.6,
                                        showlegend=False, line_shape='hv',
                                        hovertemplate='RS%{y}'), row=4, col=1)
        drawing.update_yaxes(dtick=1, row=4, col=1)
        return
    # an invisible trace, as plotly does not draw shapes in a panel without a trace
    drawing.add_trace(go.Scatter(x=time, y=log.state[keep], mode='none', showlegend=False,
                                 name='state', hovertemplate='RS%{y}'), row=4, col=1)
    for start, end, state in stretches:
        tint = palette.recruitment_state(state).light
        drawing.add_vrect(start, end, row=4, col=1, line_width=0, layer='below',
                          fillcolor=palette.fade(tint, 0.85))
        drawing.add_vrect(start, end, row=1, col=1, line_width=0, layer='below',
                          fillcolor=palette.fade(tint, 0.10))
        wide = end - start > 0.035 * (log.time[-1] - log.time[0])
        if len(stretches) <= _MOST_NAMES and wide:
            plotting.label(drawing, 0.5 * (start + end), 0.5, f'RS{state}',
                           palette.NEUTRAL['paper'].light, row=4, col=1)
    drawing.update_yaxes(range=[0.0, 1.0], showticklabels=False, ticks='', showgrid=False,
                         row=4, col=1)


def track(log: Log, model: Bundle) -> go.Figure:
    """Draw the force-strain track over the regions of the recruitment states."""
    space = force_strain_space(model)
    drawing = plotting.figure('strain', 'force of the bundle (N)', height=460)
    for trace in state_regions(space, 'included'):
        drawing.add_trace(trace)
    keep = _thin(len(log.time))
    drawing.add_trace(plotting.line(log.strain[keep], log.force[keep], 'track', plotting.INK,
                                    width=1.6, hovertemplate='%{y:.1f} N at %{x:.3f}'))
    low, high = float(log.strain.min()), float(log.strain.max())
    margin = max(0.12 * (high - low), 0.02)
    top = max(1.15 * float(log.force.max()), 1.0)
    drawing.update_xaxes(range=[max(low - margin, 0.0), min(high + margin,
                                                            float(space.strain[-1]))])
    drawing.update_yaxes(range=[min(0.0, 1.1 * float(log.force.min())), top])
    return drawing


def compared(logs: Mapping[str, Log]) -> go.Figure:
    """Draw one trajectory under several named controllers: tracking, and the error below."""
    first = next(iter(logs.values()))
    scale = _scale(first.kind)
    drawing = plotting.panels(2, 1, 480, shared_xaxes=True, row_heights=[0.6, 0.4],
                              vertical_spacing=0.05)
    keep = _thin(len(first.time))
    drawing.add_trace(plotting.line(first.time[keep], first.reference[keep] * scale, 'reference',
                                    plotting.INK, 'dash', 1.3), row=1, col=1)
    # the last one is drawn on top, in the colour of a single run
    for k, (name, log) in zip(reversed(range(len(logs))), logs.items(), strict=True):
        keep = _thin(len(log.time))
        reached = (log.force if log.kind == 'force' else log.strain)[keep] * scale
        for row, values in ((1, reached), (2, log.error[keep] * scale)):
            drawing.add_trace(plotting.line(
                log.time[keep], values, name, palette.CONTROLLERS[k % 4], width=1.7,
                legendgroup=name, showlegend=row == 1), row=row, col=1)
    unit = '(N)' if first.kind == 'force' else '(%)'
    drawing.update_yaxes(title_text=f'{first.kind} {unit}', row=1, col=1)
    drawing.update_yaxes(title_text=f'error {unit}', row=2, col=1)
    drawing.update_xaxes(title_text='time (s)', row=2, col=1)
    drawing.update_xaxes(range=[float(first.time[0]), float(first.time[-1])])
    return drawing


def _stretches(log: Log) -> list[tuple[float, float, int]]:
    """Return start, end and state of every interval with one recruitment state."""
    cuts = [0, *(int(k) for k in log.switches), len(log.time)]
    return [(float(log.time[a]), float(log.time[min(b, len(log.time) - 1)]), int(log.state[a]))
            for a, b in zip(cuts, cuts[1:], strict=False)]


def _scale(kind: str) -> float:
    return 1.0 if kind == 'force' else 100.0


def _thin(count: int) -> Any:
    return slice(None, None, max(1, -(-count // MOST_POINTS)))
