# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Comparison of fixed ends with tendons in one packaging length: the numbers.

The question is that of Mazzoleni et al., Proc. SPIE 11374 (2020). With fixed ends a muscle fills
the packaging length and pushes back past its free strain. On a tendon it goes slack instead, but
the tendon takes part of the length, so that the muscle is shorter.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, Place
from fam_bundle_ros.model.geometry import geometry_problem
from fam_bundle_ros.report.paper import ForceStrainSpace, state_forces


@dataclass(frozen=True)
class Ends:
    """
    A bundle with fixed ends and the same bundle with tendons, in one packaging length.

    Strains are contractions over the packaging length, so that both can be compared.
    """

    model: str
    #: m.
    packaging_length: float
    tendon: float
    #: Readings ``fixed`` and ``tendons``.
    space: ForceStrainSpace
    #: Motor unit that fills in ``free_strain``, from 1; units before it are full.
    unit: int
    #: Of that unit, shape (p,), Pa (gauge).
    pressure: np.ndarray
    #: By reading, shape (p,).
    free_strain: dict[str, np.ndarray]
    #: Tendon (m) with which both have the same free strain where that of fixed ends is smallest;
    #: shorter tendons give more. 0 if fixed ends give more than the muscle without push-back.
    even_tendon: float

    def summary(self) -> dict[str, Any]:
        """Return the numbers for the terminal, by configuration."""
        found: dict[str, Any] = {
            'packaging_length_m': self.packaging_length, 'tendon_m': self.tendon,
            'even_tendon_m': self.even_tendon}
        for name, free in self.free_strain.items():
            found[name] = {'blocked_force_N': float(self.space.high[name][-1][0]),
                           'free_strain_full': float(free[-1])}
            if self.unit > 1:
                found[name]['free_strain_least'] = float(np.nanmin(free))
        return found


def with_tendons(bundle: Bundle, tendon: float) -> Bundle:
    """
    Return the muscles of a bundle on tendons, in the packaging length of the bundle.

    The tendon takes a part of the length: the muscle is L0 - Lt long, with unchanged radius, braid
    angle and wall (fewer turns of the same thread). `tendon_slack`, F = max(0, F), replaces every
    resistive effect: each muscle has a tendon of its own (Mazzoleni et al. 2020, SPIE 11374).
    Effects with a length, such as the dead ends of `end_caps`, are scaled.

    Parameters
    ----------
    bundle : Bundle
        With fixed ends; its rest length is the packaging length.
    tendon : float, m
        Length Lt of both ends together, not stretching.

    Returns
    -------
    Bundle
        Its strain is that of the shorter muscle: e_muscle = e L0/(L0 - Lt) for a contraction e
        of the packaging length (derived: the tendon does not shorten).

    Raises
    ------
    InputError
        For a negative length, and one that leaves too short a muscle.
    """
    if not tendon >= 0.0:
        raise InputError(f'tendon is {1e3 * tendon:g} mm; expected zero or more')
    left = bundle.length - tendon
    words = (f'tendon is {1e3 * tendon:.4g} mm and the packaging length {1e3 * bundle.length:.4g} '
             f'mm (the rest length of {bundle.name})')
    if left <= 0.0:
        raise InputError(f'{words}; expected a shorter tendon: no muscle is left')
    shorter = bundle.with_parameters({'geometry.length': left})
    for unit in shorter.motor_units:
        g = unit.geometry
        if geometry_problem(g.radius, g.length, g.braid_angle, g.wall_thickness) is not None:
            raise InputError(f'{words}; the remaining {1e3 * left:.4g} mm of muscle are too '
                             f'short for the radius of {unit.name}, {1e3 * g.radius:.4g} mm')
    kept = [e for e in shorter.effects if not (e.place is Place.LIMIT and e.pushes_back)]
    return Bundle(bundle.name, shorter.motor_units, kept, bundle.error,
                  bundle.notes).with_effect('tendon_slack')


def compare_ends(bundle: Bundle, tendon: float, points: int = 401) -> Ends:
    """
    Compare force and free strain of a bundle with fixed ends and with tendons.

    Parameters
    ----------
    bundle : Bundle
        With fixed ends.
    tendon : float, m
        See `with_tendons`.
    points : int
        Number of strains and of pressures.
    """
    models = {'fixed': bundle, 'tendons': with_tendons(bundle, tendon)}
    share = {'fixed': 1.0, 'tendons': 1.0 - tendon / bundle.length}
    unit = min(2, bundle.n)
    pressure = np.linspace(0.0, bundle.max_pressure[unit - 1], points)
    every = bundle.state_pressures(unit, pressure)
    free = {name: share[name] * model.free_strain(every) for name, model in models.items()}
    # a single unit has no free strain at zero pressure
    least = (int(np.nanargmin(free['fixed'])) if bundle.n > 1 else points - 1)

    slack = with_tendons(bundle, 0.0)
    reach = [float(each) for each in (slack.free_strain(slack.max_pressure), *(
        each[-1] for each in free.values())) if np.isfinite(each)]
    strain = np.linspace(0.0, max(reach, default=0.3) + 0.01, points)
    low, high = {}, {}
    for name, model in models.items():
        low[name], high[name] = state_forces(model, strain / share[name])
    return Ends(bundle.name, bundle.length, tendon,
                ForceStrainSpace(strain, low, high, np.zeros(0), {}), unit, pressure, free,
                _even_tendon(bundle, every[least], float(free['fixed'][least])))


def _even_tendon(bundle, pressure, reach):
    """Return the tendon, m, with which the free strain at a pressure (n,) is ``reach``."""
    # leaves a muscle whose radius is less than 0.4 of its length, with a margin
    longest = bundle.length - 2.6 * max(float(u.geometry.radius) for u in bundle.motor_units)

    def further(tendon):
        return float(with_tendons(bundle, tendon).free_strain(pressure)
                     ) * (1.0 - tendon / bundle.length) - reach

    if not np.isfinite(reach) or not further(0.0) > 0.0:
        return 0.0
    return float(brentq(further, 0.0, longest, xtol=1e-6)) if further(longest) < 0.0 else longest
