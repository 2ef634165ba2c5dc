# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The figure of the page "Live": force, residual, pressures and strain over the last seconds."""

from collections.abc import Iterable, Sequence
from typing import Any

from fam_bundle_ros import palette, plotting

#: Half-width of the noise band, in standard deviations of the noise.
_BAND = 2.0
#: Time span of the figure, s.
_SHOWN = 20.0


def live_figure(samples: Sequence[dict[str, Any]], noise: float | None) -> dict[str, Any]:
    """
    Return the figure as a dict, with the standard deviation of the residual's noise, N.

    A missing value of a sample, or None, makes a gap.
    """
    samples = list(samples)
    last = samples[-1]['time'] if samples else 0.0
    time = [round(sample['time'] - last, 3) for sample in samples]

    def of(key: str, scale: float = 1.0) -> list[float | None]:
        return [None if sample.get(key) is None else scale * sample[key] for sample in samples]

    def unit(key: str, k: int) -> list[float | None]:
        return [sample[key][k] / 1e3 if k < len(sample[key]) and sample[key][k] is not None
                else None for sample in samples]

    drawing = plotting.panels(4, 1, 700, hovermode='x unified', shared_xaxes=True,
                              margin={'l': 62, 'r': 16, 't': 34, 'b': 44},
                              vertical_spacing=0.045, row_heights=[0.36, 0.24, 0.24, 0.16])
    kind = next((sample.get('reference_kind') for sample in reversed(samples)), None)
    ink, muted, faint = (palette.NEUTRAL[name] for name in ('ink', 'muted', 'faint'))

    def add(row: int, values: Iterable[float | None], name: str, colour: Any, dash: str = 'solid',
            width: float = 1.8) -> None:
        drawing.add_trace(plotting.line(time, list(values), name, colour, dash, width,
                                        hovertemplate='%{y:.4g}'), row=row, col=1)

    if kind == 'force':
        add(1, of('reference'), 'reference', muted, 'dot', 1.4)
    add(1, of('force'), 'measured', faint, width=2.4)
    add(1, of('model'), 'model', palette.recruitment_state(1))
    if noise:
        drawing.add_trace(plotting.band(
            [-_SHOWN, 0.0], [-_BAND * noise] * 2, [_BAND * noise] * 2, 'noise, 95 %', faint),
            row=2, col=1)
    add(2, of('residual'), 'residual', palette.effect('resistive_buckling'))
    units = max((len(sample['pressure']) for sample in samples), default=0)
    for k in range(units):
        colour = palette.recruitment_state(k + 1)
        add(3, unit('pressure', k), f'MU{k + 1}', colour)
        add(3, unit('setpoint', k), f'MU{k + 1} asked', colour, 'dot', 1.2)
    if kind == 'strain':
        add(4, of('reference', 100.0), 'reference', muted, 'dot', 1.4)
    add(4, of('strain', 100.0), 'strain', ink)
    for row, title in enumerate(('force (N)', 'residual (N)', 'pressure (kPa)', 'strain (%)'), 1):
        drawing.update_yaxes(title_text=title, row=row, col=1)
    drawing.update_xaxes(range=[-_SHOWN, 0.0])
    drawing.update_xaxes(title_text='time before now (s)', row=4, col=1)
    return drawing.to_dict()
