# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Figures 2, 3 and 4 of Kim, Mazzoleni and Bryant (2021), for any model file: the numbers.

Each figure is computed from four readings (variants) of one model:

ideal
    the braid alone (`mesh`; Chou and Hannaford 1996) with the model's geometry;
klute_hannaford
    the braid and the rubber of the model's bladder (Klute and Hannaford 2000), continued below
    zero, and nothing else of the model;
neglected
    all elastic effects of the model, without resistive forces: each unit's force is zero past
    its free strain;
included
    the complete model, at rest.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fam_bundle_ros.model import Bundle, Place

PSI = 6894.757293168
#: 10 psi; the paper prints 68.1 kPa.
STEP = 10.0 * PSI
#: The paper's highest isobar, 60 psi, and the pressure up to which its bundle works, 50 psi.
HIGHEST, WORKING = 6 * STEP, 5 * STEP


@dataclass(frozen=True)
class Isobars:
    """Figure 2: force of one muscle over strain."""

    #: Shape (s,).
    strain: np.ndarray
    #: Shape (p,), Pa (gauge).
    pressure: np.ndarray
    #: By reading, shape (p, s), N.
    forces: dict[str, np.ndarray]


@dataclass(frozen=True)
class ForceStrainSpace:
    """Figure 3: the range of forces of each recruitment state."""

    #: Shape (s,).
    strain: np.ndarray
    #: By reading (``neglected``, ``included``): smallest and largest force of RS1..RSn, N, shape
    #: (n, s). The last unit of a state goes from zero to its largest pressure, the units before it
    #: are at theirs.
    low: dict[str, np.ndarray]
    high: dict[str, np.ndarray]
    #: Of the second unit, shape (p,), Pa (gauge); empty for a bundle of one unit.
    pressure: np.ndarray
    #: By reading: force at these pressures with the first unit at its largest pressure, N, (p, s).
    isobars: dict[str, np.ndarray]

    def overlap(self, reading: str, state: int) -> np.ndarray:
        """Return the width (s,), N, of the range of forces that RSk and RSk+1 share."""
        return np.maximum(self.high[reading][state - 1]
                          - np.maximum(self.low[reading][state], 0.0), 0.0)


@dataclass(frozen=True)
class FreeStrain:
    """Figure 4: free strain of the bundle while the second unit fills, the first one full."""

    #: Of the second unit, shape (p,), Pa (gauge).
    pressure: np.ndarray
    #: By reading, shape (p,).
    strain: dict[str, np.ndarray]
    #: Pressure (Pa) at the smallest free strain of the reading ``included``, this strain, and its
    #: difference from the start.
    dip_pressure: float
    dip_strain: float
    dip: float

    @property
    def words(self) -> str:
        """How far it dips and where; a dip of less than is shown is none."""
        if self.dip < 5e-5:
            return 'does not dip while MU2 fills'
        return (f'dips by {self.dip:.4f} to {self.dip_strain:.4f} while MU2 fills, lowest at '
                f'{self.dip_pressure / 1e3:.0f} kPa')


@dataclass(frozen=True)
class PaperFigures:
    """All three figures; ``free_strain`` is None for a bundle of one unit."""

    model: str
    #: Whether an effect of the model pushes back.
    resistive: bool
    #: Elastic effects of the model that are not in the reading ``klute_hannaford``.
    beyond: tuple[str, ...]
    #: Figure 2a: the reading ``included``, up to the largest free strain.
    muscle: Isobars
    #: Figure 2b: three readings at zero and 10 psi.
    isobars: Isobars
    space: ForceStrainSpace
    free_strain: FreeStrain | None

    def summary(self) -> dict[str, Any]:
        """Return the numbers for the terminal."""
        i, s, f = self.isobars, self.space, self.free_strain
        two = len(s.high['included']) > 1
        width = s.overlap('included', 1) if two else np.zeros(1)
        widest = int(np.argmax(width))
        found: dict[str, Any] = {
            'model': self.model,
            'blocked_force_N': {f'RS{k + 1}': float(force[0])
                                for k, force in enumerate(s.high['included'])},
            'blocked_force_10_psi_N': {name: float(force[-1][0])
                                       for name, force in i.forces.items()},
            'free_strain_10_psi': {name: float(np.interp(0.0, -force[-1], i.strain))
                                   for name, force in i.forces.items()},
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
    """Return the four readings of a model as bundles; see the module's docstring."""
    rubber = [e for e in bundle.effects if e.family == 'bladder']
    return {
        'ideal': Bundle(bundle.name, bundle.motor_units, []).with_effect('mesh'),
        'klute_hannaford': Bundle(bundle.name, bundle.motor_units, rubber).with_effect('mesh'),
        'neglected': Bundle(bundle.name, bundle.motor_units,
                            _elastic(bundle)).with_effect('tendon_slack'),
        'included': bundle,
    }


def _elastic(bundle):
    return [e for e in bundle.effects
            if e.place in (Place.PRESSURE, Place.GEOMETRY, Place.FORCE)]


def paper_figures(bundle: Bundle, points: int = 401) -> PaperFigures:
    """Return figures 2, 3 and 4 for a model, with this number of strains or pressures."""
    models = readings(bundle)
    resistive = any(e.pushes_back for e in bundle.effects)
    beyond = tuple(e.name for e in _elastic(bundle) if e.family not in ('mesh', 'bladder'))
    return PaperFigures(bundle.name, resistive, beyond, _muscle(bundle, points),
                        _isobars(models, points), _space(models, points),
                        _free_strain(models, points) if bundle.n > 1 else None)


def force_strain_space(bundle: Bundle) -> ForceStrainSpace:
    """Return only the force ranges of the recruitment states over strain (figure 3)."""
    return _space(readings(bundle), 401)


def state_forces(bundle: Bundle, strain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return smallest and largest force of RS1..RSn, N, two arrays (n, s), at strains (s,)."""
    low, high = (np.empty((bundle.n, len(strain))) for _ in range(2))
    for state in range(1, bundle.n + 1):
        last = np.linspace(0.0, bundle.max_pressure[state - 1], 201)
        force = bundle.force(strain[:, None], bundle.state_pressures(state, last))
        low[state - 1], high[state - 1] = force.min(axis=1), force.max(axis=1)
    return low, high


def _steps(most):
    """Return the pressures of the isobars, Pa: the paper's if they apply, else six steps."""
    return np.linspace(0.0, HIGHEST if np.isclose(most, WORKING, rtol=1e-2) else most, 7)


def _of_one_muscle(model, strain, pressure):
    """Return the force (p, s), N, of a muscle of the first unit."""
    every = np.zeros((len(pressure), 1, model.n))
    every[..., 0] = pressure[:, None]
    return model.unit_forces(strain, every)[..., 0] / model.motor_units[0].muscles


def _muscle(bundle, points):
    pressure = _steps(bundle.max_pressure[0])
    end = float(bundle.free_strain(np.full(bundle.n, pressure[-1])))
    strain = np.linspace(0.0, end if np.isfinite(end) else 0.3, points)
    return Isobars(strain, pressure, {'included': _of_one_muscle(bundle, strain, pressure)})


def _isobars(models, points):
    strain, pressure = np.linspace(0.0, 0.32, points), np.array([0.0, STEP])
    return Isobars(strain, pressure, {
        name: _of_one_muscle(models[name], strain, pressure)
        for name in ('ideal', 'klute_hannaford', 'included')})


def _space(models, points):
    bundle = models['included']
    free = models['neglected'].free_strain(bundle.max_pressure)
    # slightly beyond the largest strain that can be held, to show this limit; a table of measured
    # forces may end before the free strain
    end = float(np.nanmax(free)) if np.isfinite(free).any() else 0.3
    strain = np.linspace(0.0, end + 0.01, points)
    second = np.zeros(0)
    if bundle.n > 1:
        second = _steps(bundle.max_pressure[1])
        # 50 psi is 344.74 kPa, a model may have 344.7
        second = np.unique(np.minimum(second, bundle.max_pressure[1]))
    low, high, isobars = {}, {}, {}
    for name in ('neglected', 'included'):
        low[name], high[name] = state_forces(models[name], strain)
        isobars[name] = models[name].force(strain, bundle.state_pressures(
            2, second)[:, None]) if len(second) else np.zeros((0, points))
    return ForceStrainSpace(strain, low, high, second, isobars)


def _free_strain(models, points):
    bundle = models['included']
    pressure = np.linspace(0.0, bundle.max_pressure[1], points)
    every = bundle.state_pressures(2, pressure)
    # the paper's ideal and Klute-Hannaford lines neglect resistive forces, so they are constant
    strain = {name: (model if name == 'included' else model.with_effect('tendon_slack')
                     ).free_strain(every) for name, model in models.items()}
    reach = strain['included']
    lowest = int(np.nanargmin(reach))
    return FreeStrain(pressure, strain, float(pressure[lowest]), float(reach[lowest]),
                      float(reach[0] - reach[lowest]))
