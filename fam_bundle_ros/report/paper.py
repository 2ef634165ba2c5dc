# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Figures 2b, 3 and 4 of Kim, Mazzoleni and Bryant (2021), for any model file: the numbers.

What is drawn for each figure comes from four readings of one model:

ideal
    the braid alone (`mesh`) with the model's geometry;
continued
    the elastic effects simply continued below zero, for the paper's bundle the muscle of Klute
    and Hannaford;
neglected
    the same, with no unit pushing back: each unit's force is zero past its free strain;
included
    the model as it is, at rest.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fam_bundle_ros.model import Bundle, Place

__all__ = ['force_strain_space', 'ForceStrainSpace', 'FreeStrain', 'Isobars', 'paper_figures',
           'PaperFigures', 'readings']

PSI = 6894.757293168
#: 10 psi; the paper prints 68.1 kPa.
FIGURE_2_PRESSURES = (0.0, 10.0 * PSI)


@dataclass(frozen=True)
class Isobars:
    """
    Figure 2b: force of one muscle over strain.

    Attributes
    ----------
    strain : array (s,)
    pressure : array (p,), Pa (gauge)
    forces : dict of str to array (p, s), N
        By reading.
    """

    strain: np.ndarray
    pressure: np.ndarray
    forces: dict[str, np.ndarray]


@dataclass(frozen=True)
class ForceStrainSpace:
    """
    Figure 3: what each recruitment state can give.

    Attributes
    ----------
    strain : array (s,)
    low, high : dict of str to array (n, s), N
        By reading (``neglected``, ``included``): least and largest force of RS1..RSn. A state's
        last unit goes from zero to its largest pressure, those before it are at theirs.
    """

    strain: np.ndarray
    low: dict[str, np.ndarray]
    high: dict[str, np.ndarray]

    def overlap(self, reading: str, state: int) -> np.ndarray:
        """Return the width (s,), N, of the forces that RSk and RSk+1 can both give."""
        return np.maximum(self.high[reading][state - 1]
                          - np.maximum(self.low[reading][state], 0.0), 0.0)


@dataclass(frozen=True)
class FreeStrain:
    """
    Figure 4: the bundle's free strain while the second unit fills and the first is at its most.

    Attributes
    ----------
    pressure : array (p,), Pa (gauge)
        Of the second unit.
    strain : dict of str to array (p,)
        By reading.
    dip_pressure : float, Pa
        Where the model as it is reaches least.
    dip_strain, dip : float
        The strain there, and how far that is below the start.
    """

    pressure: np.ndarray
    strain: dict[str, np.ndarray]
    dip_pressure: float
    dip_strain: float
    dip: float


@dataclass(frozen=True)
class PaperFigures:
    """All three; ``free_strain`` is None for a bundle of one unit."""

    model: str
    resistive: bool
    isobars: Isobars
    space: ForceStrainSpace
    free_strain: FreeStrain | None

    def summary(self) -> dict[str, Any]:
        """Return the numbers that the terminal shows."""
        i, s, f = self.isobars, self.space, self.free_strain
        two = len(s.high['included']) > 1
        width = s.overlap('included', 1) if two else np.zeros(1)
        widest = int(np.argmax(width))
        free = {name: float(np.interp(0.0, -force[-1], i.strain))
                for name, force in i.forces.items()}
        found: dict[str, Any] = {
            'model': self.model,
            'blocked_force_N': {f'RS{k + 1}': float(force[0])
                                for k, force in enumerate(s.high['included'])},
            'free_strain_10_psi': free,
        }
        if two:
            found['overlap_widest_N'] = float(width[widest])
            found['overlap_widest_at_strain'] = float(s.strain[widest])
        if f is not None:
            found['free_strain_start'] = float(f.strain['included'][0])
            found['free_strain_dip'] = f.dip_strain
            found['free_strain_dip_at_Pa'] = f.dip_pressure
            found['free_strain_end'] = float(f.strain['included'][-1])
        return found


def readings(bundle: Bundle) -> dict[str, Bundle]:
    """Return the four readings of a model as bundles; see the module's text."""
    elastic = [e for e in bundle.effects
               if e.place in (Place.PRESSURE, Place.GEOMETRY, Place.FORCE)]
    continued = Bundle(bundle.name, bundle.motor_units, elastic)
    return {
        'ideal': Bundle(bundle.name, bundle.motor_units, []).with_effect('mesh'),
        'continued': continued,
        'neglected': continued.with_effect('tendon_slack'),
        'included': bundle,
    }


def paper_figures(bundle: Bundle, points: int = 401) -> PaperFigures:
    """
    Return the numbers of figures 2b, 3 and 4 for a model.

    Parameters
    ----------
    bundle : Bundle
    points : int
        Strains (figures 2b and 3) and pressures (figure 4).
    """
    models = readings(bundle)
    resistive = any(e.pushes_back for e in bundle.effects)
    return PaperFigures(bundle.name, resistive, _isobars(models, points), _space(models, points),
                        _free_strain(models, points) if bundle.n > 1 else None)


def force_strain_space(bundle: Bundle) -> ForceStrainSpace:
    """Return what each recruitment state can give at every strain (figure 3) alone."""
    return _space(readings(bundle), 401)


def _isobars(models, points):
    strain = np.linspace(0.0, 0.32, points)
    pressure = np.array(FIGURE_2_PRESSURES)
    forces = {}
    for name in ('ideal', 'continued', 'included'):
        unit = models[name].motor_units[0]
        every = np.zeros((len(pressure), 1, models[name].n))
        every[..., 0] = pressure[:, None]
        forces[name] = models[name].unit_forces(strain, every)[..., 0] / unit.muscles
    return Isobars(strain, pressure, forces)


def _space(models, points):
    bundle = models['included']
    free = models['neglected'].free_strain(bundle.max_pressure)
    # a little beyond, so that the largest strain that can be held is seen to be the last; a table
    # of measured forces may end before the free strain
    end = float(np.nanmax(free)) if np.isfinite(free).any() else 0.3
    strain = np.linspace(0.0, end + 0.01, points)
    low, high = {}, {}
    for name in ('neglected', 'included'):
        low[name], high[name] = (np.empty((bundle.n, points)) for _ in range(2))
        for state in range(1, bundle.n + 1):
            last = np.linspace(0.0, bundle.max_pressure[state - 1], 201)
            force = models[name].force(strain[:, None], bundle.state_pressures(state, last))
            low[name][state - 1] = force.min(axis=1)
            high[name][state - 1] = force.max(axis=1)
    return ForceStrainSpace(strain, low, high)


def _free_strain(models, points):
    bundle = models['included']
    pressure = np.linspace(0.0, bundle.max_pressure[1], points)
    every = bundle.state_pressures(2, pressure)
    strain = {name: model.free_strain(every) for name, model in models.items()}
    reach = strain['included']
    lowest = int(np.nanargmin(reach))
    return FreeStrain(pressure, strain, float(pressure[lowest]), float(reach[lowest]),
                      float(reach[0] - reach[lowest]))
