# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Inverse model of the bundle: from a force demand at the measured strain to a pressure per unit.

Objects around the kernels of `curves` and `inverse`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from fam_bundle_ros.control.belief import (
    Belief,
    belief_of,
    invertible,
    without_push_back,
)
from fam_bundle_ros.control.curves import (
    curve_table,
    CurveTable,
    find_branches,
    force_at,
    Moment,
    slope_at,
    tabulate,
)
from fam_bundle_ros.control.inverse import fill, place_bottoms, share, Shares
from fam_bundle_ros.control.spread import ALL_ON, SCHEMES
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle


@dataclass(frozen=True)
class Allocation:
    """
    Pressures for a demand.

    Attributes
    ----------
    pressure : ndarray (n,), Pa (gauge)
    force : ndarray (n,), N
        Model force of each motor unit at these pressures.
    missing : float, N
        Demand minus the force at these pressures: not 0 when the demand is out of reach.
    """

    pressure: np.ndarray
    force: np.ndarray
    missing: float


@dataclass(frozen=True)
class Instant:
    """
    Operating point of the model: strain, rate and memory.

    Attributes
    ----------
    strain, strain_rate : float, and 1/s
    memory : dict, optional
        From `Bundle.step`; without it forces at equilibrium.
    dt : float, s
    """

    strain: float
    strain_rate: float = 0.0
    memory: dict[str, Any] | None = None
    dt: float = 0.0


class Curves:
    """
    Force over pressure of every motor unit at one instant, and its inverse.

    Every field of `CurveTable` is here as an array: ``top``, ``floor``, ``crossing``, ``dip``,
    ``bottom_pressure``, ...

    Parameters
    ----------
    table : CurveTable
    model : Belief
    """

    def __init__(self, table: CurveTable, model: Belief):
        self.table, self.model = table, model
        self.order = tuple(table.order)

    def __getattr__(self, name: str) -> np.ndarray:
        """Return a field of the table as an array."""
        if name in ('force', 'grid', 'pressure'):
            return np.array(getattr(self.table, name.replace('pressure', 'grid'))).T
        kind = bool if name == 'useful' else None
        return np.array(getattr(self.__dict__['table'], name), kind)

    def at(self, unit: int, pressure: float) -> float:
        """Return the force of one unit (from 0) at a pressure, N, from the table."""
        return force_at(self.table, unit, pressure)

    def slope(self, unit: int, pressure: float) -> float:
        """Return dF/dP of one unit at a pressure, N/Pa, from the table."""
        return slope_at(self.table, unit, pressure)

    def fill(self, demand: float, units: Sequence[int],
             fixed: dict[int, float] | None = None) -> Allocation:
        """
        Fill units in turn: each to its limit before the next leaves the bottom of its branch.

        Parameters
        ----------
        demand : float, N
            Demand on the whole bundle.
        units : sequence of int
            Active units, first to be filled first.
        fixed : dict, optional
            Prescribed pressures (Pa) of further units, e.g. crossing ones; others are at 0.
        """
        return self._solve(fill, demand, units, fixed)

    def share(self, demand: float, units: Sequence[int],
              fixed: dict[int, float] | None = None) -> Allocation:
        """Give all useful units one common pressure (at most their limit); else as `fill`."""
        return self._solve(share, demand, units, fixed)

    def _solve(self, kernel, demand, units, fixed):
        n = len(self.order)
        given = [(fixed or {}).get(unit, math.nan) for unit in range(n)]
        shares = Shares([0.0] * n, [0.0] * n)
        kernel(self.table, self.model, float(demand), list(units), len(units), given, shares)
        return Allocation(np.array(shares.pressure), np.array(shares.force), shares.missing)


class Allocator:
    """
    Computes the `Curves` of a bundle in each tick.

    Parameters
    ----------
    bundle : Bundle
    neglect : bool
        Neglect resistive forces: the inverse of ideal models.
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
        self.pushes_back = not neglect
        self.inverted = invertible(without_push_back(bundle) if neglect else bundle)
        limit = bundle.max_pressure if max_pressure is None else np.asarray(max_pressure, float)
        if limit.shape != (bundle.n,) or not np.all(limit > 0.0):
            raise InputError(f'max_pressure is {max_pressure}; expected {bundle.n} positive '
                             'values in Pa')
        self.max_pressure = limit = np.minimum(bundle.max_pressure, limit)
        order = range(bundle.n) if order is None else order
        if sorted(order) != list(range(bundle.n)):
            raise InputError(f'order is {tuple(order)}; expected each of 0 to {bundle.n - 1} once')
        self.order = tuple(order)
        #: Pressures (n, points) of the table, Pa: one grid for all, cut at each unit's limit,
        #: since `batch` needs common pressures.
        grid = np.minimum(np.linspace(0.0, limit.max(), points), limit[:, None])
        self.grid: list[list[float]] = grid.tolist()
        self._at_rest, self._stepping = (belief_of(self.inverted, self.grid, at_rest=still)
                                         for still in (True, False))

    def curves(self, instant: Instant, asleep: np.ndarray | None = None) -> Curves:
        """
        Return the curves of an instant.

        ``asleep`` (n,) of bool: units that were not useful before, see `CurveTable.useful`.
        """
        table = curve_table(self.order, self.grid, self.pushes_back)
        memory = instant.memory
        now = (0.0, 0.0, True) if memory is None else (
            memory['time'] + instant.dt if memory['begun'] else 0.0, instant.dt,
            not memory['begun'])
        table.moment = Moment(instant.strain, instant.strain_rate, *now)
        model = self._at_rest if memory is None else self._stepping._replace(
            memory=memory['memory'])
        tabulate(table, model)
        find_branches(table, [0] * len(self.order) if asleep is None
                      else [int(each) for each in asleep])
        place_bottoms(table, model)
        return Curves(table, model)


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
        Number of active motor units, 0..n.
    strain_rate : float, 1/s
    scheme : str
        ``orderly``, ``batch`` or ``all_on``: those that invert the model.

    Examples
    --------
    >>> from fam_bundle_ros.model import load_model
    >>> bundle = load_model('config/models/spie2021.yaml')
    >>> found = allocate(bundle, 60.0, strain=0.16, state=2)
    >>> print(f'{bundle.force(0.16, found.pressure):.2f} N')
    60.00 N
    """
    inverting = SCHEMES[:ALL_ON + 1]
    if scheme not in inverting:
        raise InputError(f"scheme is '{scheme}'; expected one of {', '.join(inverting)}")
    if not 0 <= state <= bundle.n:
        raise InputError(f'state is {state}; expected 0 to {bundle.n}')
    curves = Allocator(bundle).curves(Instant(strain, strain_rate))
    if scheme == 'orderly':
        return curves.fill(demand, curves.order[:state])
    return curves.share(demand, curves.order[:bundle.n if scheme == 'all_on' else state])
