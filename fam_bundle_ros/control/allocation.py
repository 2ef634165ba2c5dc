# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The inverse of the bundle: a force demand at the measured strain -> one gauge pressure per unit.

At one strain the force of a motor unit over its own pressure first falls (it pushes back more
and more) and then rises. `Curves` holds those curves for one tick, from one vectorised call of
the model with the memory it has now, and answers with pressures on the rising branch only.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle

SCHEMES = ('orderly', 'batch', 'all_on')
#: A cell of the table is divided by so many pressures, and the one found so again: a muscle that
#: leaves its free strain has a kink there of up to 20 N/kPa.
_FINE, _ROUNDS = 9, 2
#: A unit that could only pull less than when vented comes back when it could pull more by this
#: share of its push-back, and by so many N: strain noise must not fill and empty it in turn.
_WAKE_SHARE, _WAKE_FORCE = 0.1, 0.5


@dataclass(frozen=True)
class Allocation:
    """
    Pressures for a demand.

    Attributes
    ----------
    pressure : ndarray (n,), Pa (gauge)
    force : ndarray (n,), N
        What the model gives for them, per motor unit.
    missing : float, N
        Demand minus the force that the pressures give: not 0 when out of reach.
    """

    pressure: np.ndarray
    force: np.ndarray
    missing: float


@dataclass(frozen=True)
class Instant:
    """
    What the model is asked about: strain, rate, and the memory it has.

    Attributes
    ----------
    strain, strain_rate : float, and 1/s
    memory : dict, optional
        From `Bundle.step`; without it the forces at equilibrium.
    dt : float, s
    """

    strain: float
    strain_rate: float = 0.0
    memory: dict[str, Any] | None = None
    dt: float = 0.0

    def unit_forces(self, bundle: Bundle, pressure: np.ndarray) -> np.ndarray:
        """Return forces (k, n) in N for candidate pressures (k, n)."""
        if self.memory is None:
            return np.asarray(bundle.unit_forces(self.strain, pressure, self.strain_rate))
        return bundle.step(self.memory, self.dt, self.strain, pressure, self.strain_rate)[0]


class Curves:
    """
    Force over pressure of every motor unit at one instant, and its inverse.

    Parameters
    ----------
    bundle : Bundle
    instant : Instant
    pressure : ndarray (k, n), Pa (gauge)
        Rising from 0 to each unit's limit.
    order : sequence of int
        Units in the order of recruitment: RSk has the first k of them.
    pushes_back : bool
        False for a controller that reckons without resistive forces: none below zero.
    asleep : ndarray (n,) of bool, optional
        Units that were of no use in the tick before: see `useful`.
    """

    def __init__(self, bundle: Bundle, instant: Instant, pressure: np.ndarray,
                 order: Sequence[int], pushes_back: bool = True,
                 asleep: np.ndarray | None = None):
        self._bundle, self._instant, self._pushes_back = bundle, instant, pushes_back
        self.order = tuple(order)
        self.pressure = pressure
        self.force = self._forces(pressure)
        count, units = self.force.shape
        columns = np.arange(units)
        # The last of the smallest: where a slack or threshold makes the curve flat, its end.
        tied = self.force <= self.force.min(axis=0) + 1e-9
        bottom = count - 1 - np.argmax(tied[::-1], axis=0)
        #: N at zero pressure (n,).
        self.rest_force = self.force[0]
        gain = self.force[-1] - self.rest_force
        wake = np.zeros(units) if asleep is None else np.where(asleep, np.maximum(
            _WAKE_SHARE * (self.rest_force - self.force[bottom, columns]), _WAKE_FORCE), 0.0)
        #: Which units (n,) can pull more than when vented: past the free strain none can, their
        #: curves only fall. The others have no branch to be on and stay empty.
        self.useful = gain > wake
        #: Index (n,) of the beginning of the rising branch.
        self.bottom = np.where(self.useful, bottom, 0)
        #: N and Pa there (n,).
        self.bottom_force = self.force[self.bottom, columns]
        self.bottom_pressure = pressure[self.bottom, columns]
        #: N at the limit (n,).
        self.top_force = np.where(self.useful, self.force[-1], self.rest_force)
        #: How far the force falls while the unit fills (n,), N.
        self.dip = self.rest_force - self.bottom_force

    def _forces(self, pressure):
        force = self._instant.unit_forces(self._bundle, pressure)
        return force if self._pushes_back else np.maximum(force, 0.0)

    @cached_property
    def top(self) -> np.ndarray:
        """Return the largest force of RS0..RSn, shape (n + 1,), N."""
        gain = (self.top_force - self.rest_force)[list(self.order)]
        return self.rest_force.sum() + np.concatenate([[0.0], np.cumsum(gain)])

    @cached_property
    def floor(self) -> np.ndarray:
        """Return the smallest force of RS0..RSn on rising branches, shape (n + 1,), N."""
        return self.rest_force.sum() - np.concatenate(
            [[0.0], np.cumsum(self.dip[list(self.order)])])

    @cached_property
    def crossing(self) -> np.ndarray:
        """
        Return the largest demands at which RSk -> RSk+1 needs no dip, k = 0..n-1, N.

        Up to there the units before the next have the room to make up for its push-back.
        """
        return self.top[:-1] - self.dip[list(self.order)]

    def at(self, unit: int, pressure: float) -> float:
        """Return the force of one unit (from 0) at a pressure, N, from the table."""
        return float(np.interp(pressure, self.pressure[:, unit], self.force[:, unit]))

    def slope(self, unit: int, pressure: float) -> float:
        """Return dF/dP of one unit at a pressure, N/Pa, from the table."""
        grid = self.pressure[:, unit]
        i = min(max(int(np.searchsorted(grid, pressure, side='right')), 1), len(grid) - 1)
        step = grid[i] - grid[i - 1]
        return float((self.force[i, unit] - self.force[i - 1, unit]) / step) if step else 0.0

    def fill(self, demand: float, units: Sequence[int],
             fixed: dict[int, float] | None = None) -> Allocation:
        """
        Fill units in turn: each to its limit before the next leaves the bottom of its branch.

        Parameters
        ----------
        demand : float, N
            Of the whole bundle.
        units : sequence of int
            Active units, first to be filled first.
        fixed : dict, optional
            Pressures (Pa) of further units, say one that is just being filled; others are at 0.
        """
        pressure, force = self._begin(fixed)
        for unit in units:
            pressure[unit], force[unit] = self.bottom_pressure[unit], self.bottom_force[unit]
        missing = demand - float(np.add.reduce(force))
        for unit in units:
            if missing <= 0.0:
                break
            room = self.top_force[unit] - self.bottom_force[unit]
            if missing >= room:
                if room > 0.0:
                    pressure[unit] = self.pressure[-1, unit]
                    force[unit] = self.top_force[unit]
                    missing -= room
                continue
            wanted = self.bottom_force[unit] + missing
            pressure[unit] = self._invert(unit, wanted)
            force[unit], missing = wanted, 0.0
        return Allocation(pressure, force, missing)

    def share(self, demand: float, units: Sequence[int],
              fixed: dict[int, float] | None = None) -> Allocation:
        """Give the units of use one common pressure (at most their limit); else as `fill`."""
        pressure, force = self._begin(fixed)
        units = [i for i in units if self.useful[i]]
        if not units:
            return Allocation(pressure, force, demand - float(force.sum()))
        common = self.pressure[:, units].max(axis=1)
        total = self.force[:, units].sum(axis=1)
        bottom = len(total) - 1 - int(np.argmax((total <= total.min() + 1e-9)[::-1]))
        wanted = demand - float(force.sum() - force[units].sum())
        rising = np.maximum.accumulate(total[bottom:])
        i = bottom + max(int(np.searchsorted(rising, wanted)), 1)
        chosen = float(np.interp(wanted, rising, common[bottom:]))
        if rising[0] < wanted < rising[-1]:
            # Within the cell too each unit stops at its own limit.
            chosen = _refine(
                wanted, common[i - 1], common[i],
                lambda fine: self._forces(np.minimum(fine[:, None], self.pressure[-1]))[:, units]
                .sum(axis=1))
        for unit in units:
            pressure[unit] = min(chosen, self.pressure[-1, unit])
            force[unit] = self.at(unit, pressure[unit])
        return Allocation(pressure, force, wanted - min(max(wanted, rising[0]), rising[-1]))

    def _begin(self, fixed):
        """Return pressures and forces with the fixed units set and all others at rest."""
        pressure, force = np.zeros(len(self.rest_force)), self.rest_force.copy()
        if fixed:
            for unit, value in fixed.items():
                pressure[unit] = value
            exact = self._forces(pressure[None])[0]
            for unit in fixed:
                force[unit] = exact[unit]
        return pressure, force

    def _invert(self, unit, wanted):
        """Return the pressure on the rising branch, refined within its cell of the table."""
        bottom = int(self.bottom[unit])
        rising = np.maximum.accumulate(self.force[bottom:, unit])
        i = min(bottom + max(int(np.searchsorted(rising, wanted)), 1), len(self.force) - 1)
        pressure = np.tile(self.pressure[i], (_FINE, 1))

        def force(fine):
            pressure[:, unit] = fine
            return self._forces(pressure)[:, unit]
        return _refine(wanted, self.pressure[i - 1, unit], self.pressure[i, unit], force)


def _refine(wanted, low, high, force):
    """Return the pressure of a force within one cell, which may hold a bottom and kinks."""
    for _ in range(_ROUNDS):
        fine = np.linspace(low, high, _FINE)
        found = force(fine)
        bottom = int(np.argmin(found))
        rising = np.maximum.accumulate(found[bottom:])
        i = bottom + min(max(int(np.searchsorted(rising, wanted)), 1), len(rising) - 1)
        low, high = fine[max(i - 1, 0)], fine[i]
    return float(np.interp(wanted, rising, fine[bottom:]))


class Allocator:
    """
    Makes the `Curves` of a bundle, tick by tick.

    Parameters
    ----------
    bundle : Bundle
    neglect : bool
        Reckon without resistive forces: the inverse that ideal models lead to.
    max_pressure : ndarray (n,), Pa (gauge), optional
        Lower limits than those of the model file.
    order : sequence of int, optional
        Order of recruitment; that of the model file by default.
    points : int
        Pressures per unit in the table.

    Raises
    ------
    InputError
        When a limit is not positive or has the wrong number of values, or the order does not
        name each unit once.
    """

    def __init__(self, bundle: Bundle, neglect: bool = False,
                 max_pressure: Sequence[float] | None = None,
                 order: Sequence[int] | None = None, points: int = 97):
        self.bundle = bundle
        self._neglect = neglect
        model = bundle
        if neglect:
            for effect in bundle.effects:
                if effect.pushes_back:
                    model = model.without_effect(effect.name)
        self._model = model
        limit = bundle.max_pressure if max_pressure is None else np.minimum(
            bundle.max_pressure, np.asarray(max_pressure, float))
        if limit.shape != (bundle.n,) or not np.all(limit > 0.0):
            raise InputError(f'max_pressure is {max_pressure}; expected {bundle.n} positive '
                             'values in Pa')
        self.max_pressure = limit
        order = range(bundle.n) if order is None else order
        if sorted(order) != list(range(bundle.n)):
            raise InputError(f'order is {tuple(order)}; expected each of 0 to {bundle.n - 1} once')
        self.order = tuple(order)
        # One grid for all, cut at each unit's limit: `batch` needs common pressures.
        self._grid = np.minimum(np.linspace(0.0, limit.max(), points)[:, None], limit)

    def step(self, memory: dict[str, Any], dt: float, strain: float, pressure: np.ndarray,
             strain_rate: float) -> tuple[float, dict[str, Any]]:
        """Return the force that the controller believes to be there, N, and the memory after."""
        forces, after = self._model.step(memory, dt, strain, pressure, strain_rate)
        if self._neglect:
            forces = np.maximum(forces, 0.0)
        return float(np.add.reduce(forces)), after

    def curves(self, instant: Instant, asleep: np.ndarray | None = None) -> Curves:
        """Return the curves of this tick; ``asleep`` as for `Curves`."""
        return Curves(self._model, instant, self._grid, self.order, not self._neglect, asleep)


def allocate(bundle: Bundle, demand: float, strain: float, state: int,
             strain_rate: float = 0.0, scheme: str = 'orderly') -> Allocation:
    """
    Return pressures for a demand in recruitment state RS``state`` at equilibrium.

    Parameters
    ----------
    bundle : Bundle
    demand : float, N
    strain : float
    state : int
        0..n: how many motor units are active.
    strain_rate : float, 1/s
    scheme : str
        ``orderly``, ``batch`` or ``all_on``.

    Examples
    --------
    >>> from fam_bundle_ros.model import load_model
    >>> bundle = load_model('config/models/spie2021.yaml')
    >>> found = allocate(bundle, 60.0, strain=0.16, state=2)
    >>> print(f'{bundle.force(0.16, found.pressure):.2f} N')
    60.00 N
    """
    if scheme not in SCHEMES:
        raise InputError(f"scheme is '{scheme}'; expected one of {', '.join(SCHEMES)}")
    if not 0 <= state <= bundle.n:
        raise InputError(f'state is {state}; expected 0 to {bundle.n}')
    curves = Allocator(bundle).curves(Instant(strain, strain_rate))
    if scheme == 'orderly':
        return curves.fill(demand, curves.order[:state])
    return curves.share(demand, curves.order[:bundle.n if scheme == 'all_on' else state])
