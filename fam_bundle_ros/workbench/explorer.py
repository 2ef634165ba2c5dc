# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The force-strain space of a bundle with an operating point that is set by sliders.

Sliders set the strain and each motor unit's pressure; the figures show this point among the
recruitment states, how the next unit first resists, and the dip of the free strain. A tendon
length adds the same muscles on tendons in the same packaging length.
"""

from functools import cached_property, lru_cache
import json
from typing import Any

import numpy as np

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.model import Bundle, Overlap
from fam_bundle_ros.report.paper import paper_figures, PaperFigures
from fam_bundle_ros.report.paper_plots import state_regions
from fam_bundle_ros.report.tendons import compare_ends, Ends
from fam_bundle_ros.told import number
from fam_bundle_ros.units import parse, spaced

_HERE = palette.NEUTRAL['ink'].light
_TENDON = palette.effect('tendon_slack').light


class Explorer:
    """A bundle at one strain and one set of pressures."""

    def __init__(self, bundle: Bundle):
        self.bundle = bundle
        self.paper: PaperFigures = paper_figures(bundle, 161)
        #: Strain, and gauge pressures in Pa, shape (n,).
        self.strain = 0.16
        self.pressure = np.zeros(bundle.n)
        self.pressure[0] = bundle.max_pressure[0]
        #: Comparison of fixed ends with tendons, None without a tendon length.
        self.ends: Ends | None = None

    def set_tendon(self, told: str) -> None:
        """
        Set the length of the tendons from text with a unit; empty for none.

        InputError when the text is not a length, or too long for any muscle to remain.
        """
        self.ends = None
        if told.strip():
            self.ends = compare_ends(self.bundle, parse(spaced(told), 'm'), 161)

    @property
    def highest_strain(self) -> float:
        """Upper end of the strain slider."""
        return float(self.paper.space.strain[-1])

    @property
    def state(self) -> int:
        """Recruitment state: how many units are under pressure, in order."""
        on = np.flatnonzero(self.pressure > 0.02 * self.bundle.max_pressure)
        return int(on[-1]) + 1 if len(on) else 0

    @property
    def force(self) -> float:
        """Force of the bundle at this point, N."""
        return float(self.bundle.force(self.strain, self.pressure))

    @property
    def unit(self) -> int:
        """Motor unit that is filled next, from 1; the last one if all are on."""
        return min(max(self.state, 1) + 1, self.bundle.n)

    def overlap(self) -> Overlap | None:
        """Return the overlap of the states without and with this unit, None for a single unit."""
        return self.bundle.overlap(self.strain, self.unit - 1) if self.unit > 1 else None

    def sentences(self) -> list[str]:
        """Return a description of the figures at this point."""
        told = [f'RS{self.state}: {self.state} of {self.bundle.n} motor units on, '
                f'{self.force:.1f} N at {100 * self.strain:.1f} % strain.']
        unit, overlap = self.unit, self.overlap()
        if overlap is None:
            return told
        onset = overlap.onset_pressure
        if overlap.dip > 0.05:
            back = f'The loss is recovered at {onset / 1e3:.0f} kPa, its onset pressure.' \
                if np.isfinite(onset) else 'At this strain the loss is never recovered.'
            told.append(f'While MU{unit} fills, it is compressed past its own free strain and '
                        f'pushes back: the bundle loses up to {overlap.dip:.1f} N (at '
                        f'{overlap.dip_pressure / 1e3:.0f} kPa). {back}')
            told.append(f'So RS{unit - 1} and RS{unit} overlap from {overlap.low:.1f} to '
                        f'{overlap.high:.1f} N: in this range both states can hold the force.')
        else:
            told.append(f'At this strain MU{unit} adds force from zero pressure on: no dip, no '
                        'overlap. Increase the strain to see them.')
        return told

    def free_strain_sentence(self) -> str:
        """Return a description of the free strain while the second unit fills."""
        free = self.paper.free_strain
        if free is None:
            return ''
        if free.dip < 1e-4:
            return 'In this model the free strain does not dip: it has no resistive force.'
        return (f'With MU1 full, filling MU2 first reduces the free strain from '
                f'{float(free.strain["included"][0]):.4f} to {free.dip_strain:.4f} at '
                f'{free.dip_pressure / 1e3:.0f} kPa, and then increases it again: the free strain '
                'gradient reversal.')

    def tendon_sentence(self) -> str:
        """Return a description of the change by tendons; empty without a length."""
        if self.ends is None:
            return ''
        ends, told = self.ends, self.ends.summary()
        least = (f', {told["fixed"]["free_strain_least"]:.4f} at the minimum'
                 if ends.unit > 1 else '')
        even = (f' Only tendons shorter than {number(1e3 * ends.even_tendon)} mm give more free '
                'strain than the minimum with fixed ends.' if ends.even_tendon > 1e-5 else '')
        return (f'On tendons of {1e3 * ends.tendon:.4g} mm the muscles are '
                f'{1e3 * (ends.packaging_length - ends.tendon):.4g} mm long and nothing pushes '
                f'back: the free strain is {told["tendons"]["free_strain_full"]:.4f} of the '
                f'packaging length, with fixed ends {told["fixed"]["free_strain_full"]:.4f}'
                f'{least}.{even}')

    # --- figures -------------------------------------------------------------------------------

    def space_figure(self) -> dict[str, Any]:
        """Draw the regions of the recruitment states with the present point and its strain."""
        figure = json.loads(self._space)
        figure['data'][-2:-2] = self._tendon_edges()
        figure['data'][-2].update(x=[self.strain, self.strain])
        figure['data'][-1].update(x=[self.strain], y=[self.force])
        return figure

    def _tendon_edges(self) -> list[dict[str, Any]]:
        """Return the largest force of each state on tendons as traces."""
        if self.ends is None:
            return []
        strain, words = self.ends.space.strain, f'with tendons of {1e3 * self.ends.tendon:.4g} mm'
        return [_line(strain[high > 0.0], high[high > 0.0], _TENDON, 1.8, 'dash', name=words,
                      legendgroup='tendons', showlegend=k == 0, hovertemplate=f'RS{k + 1} '
                      f'{words}: %{{y:.1f}} N at %{{x:.3f}}<extra></extra>')
                for k, high in enumerate(self.ends.space.high['tendons'])]

    @cached_property
    def _space(self) -> str:
        space = self.paper.space
        drawing = plotting.figure('strain', 'force of the bundle (N)', height=420)
        for trace in state_regions(space, 'included'):
            drawing.add_trace(trace)
        top = 1.04 * float(space.high['included'].max())
        drawing.add_trace(plotting.line([0, 0], [0, top], 'here', _HERE, 'dot', 1.2,
                                        showlegend=False, hoverinfo='skip'))
        drawing.add_trace(plotting.points([0], [0], 'this bundle, here', _HERE, 13,
                                          'diamond', hovertemplate='%{y:.1f} N at %{x:.3f}'))
        drawing.update_yaxes(range=[0.0, top])
        drawing.update_xaxes(range=[0.0, self.highest_strain])
        return drawing.to_json()

    def crossing_figure(self) -> dict[str, Any]:
        """Draw the force at this strain while the next unit fills, with its dip and onset."""
        unit = self.unit
        pressure = np.linspace(0.0, self.bundle.max_pressure[unit - 1], 161)
        force = self.bundle.force(self.strain, self.bundle.state_pressures(unit, pressure))
        colour = palette.recruitment_state(unit).light
        figure = json.loads(_empty(f'pressure of MU{unit} (kPa)', 'force at this strain (N)'))
        x = pressure / 1e3
        here = self.pressure[unit - 1]
        figure['data'] = [
            _line(x, force, colour, 2.4, name=f'MU{unit} fills',
                  hovertemplate='%{y:.1f} N at %{x:.0f} kPa<extra></extra>'),
            _line(x[[0, -1]], force[[0, 0]], _HERE, 1, 'dot', hoverinfo='skip'),
            _marker(here / 1e3, np.interp(here, pressure, force))]
        onset = self.bundle.onset_pressure(self.strain, unit)
        if np.isfinite(onset) and onset > 0:
            figure['layout']['annotations'] = [{
                'x': onset / 1e3, 'y': float(force[0]), 'ax': 0, 'ay': -28, 'arrowhead': 0,
                'text': f'onset {onset / 1e3:.0f} kPa', 'showarrow': True, 'arrowcolor': _HERE,
                'font': {'size': 12, 'color': _HERE}}]
        return figure

    def free_strain_figure(self) -> dict[str, Any]:
        """Draw the free strain while the second unit fills (if there is one), and its pressure."""
        free = self.paper.free_strain
        assert free is not None
        figure = json.loads(_empty('pressure of MU2 (kPa)', 'free strain'))
        x = free.pressure / 1e3
        looks = (('neglected', 'resistive force neglected', palette.effect('tendon_slack').light,
                  'dash', 1.6),
                 ('included', 'as the model has it', palette.effect('resistive_buckling').light,
                  'solid', 2.8))
        hover = '%{y:.4f} at %{x:.0f} kPa<extra></extra>'
        figure['data'] = [
            _line(x, free.strain[name], colour, width, dash, name=title, hovertemplate=hover)
            for name, title, colour, dash, width in looks]
        if self.ends is not None:
            figure['data'].append(_line(
                self.ends.pressure / 1e3, self.ends.free_strain['tendons'], _TENDON, 2.2,
                name=f'tendons of {1e3 * self.ends.tendon:.4g} mm', hovertemplate=hover))
        at = float(self.pressure[1]) / 1e3
        figure['data'].append(_marker(at, np.interp(at, x, free.strain['included'])))
        figure['layout'].update(showlegend=True)
        figure['layout']['yaxis'].update(tickformat='.3f', automargin=True)
        return figure


def _line(x: np.ndarray, y: np.ndarray, colour: str, width: float, dash: str = 'solid',
          **more: Any) -> dict[str, Any]:
    """Return a line trace; nan is a gap."""
    return {'type': 'scatter', 'mode': 'lines', 'x': x.tolist(),
            'y': [None if v != v else v for v in y.tolist()],
            'line': {'color': colour, 'width': width, 'dash': dash}, **more}


def _marker(x: float, y: float) -> dict[str, Any]:
    """Return the marker of the present point."""
    return {'type': 'scatter', 'mode': 'markers', 'x': [float(x)], 'y': [float(y)],
            'showlegend': False, 'hoverinfo': 'skip',
            'marker': {'symbol': 'diamond', 'size': 12, 'color': _HERE}}


@lru_cache(maxsize=8)
def _empty(x: str, y: str) -> str:
    drawing = plotting.figure(x, y, height=300, showlegend=False)
    drawing.update_layout(margin={'t': 26})
    return drawing.to_json()
