# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The model that a controller inverts, as its kernels take it."""

from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.model import Bundle, Place

#: Numbers of strains up to the largest free strain, of pressures at which the pressure turns, and
#: of pressures up to the limit (as in the controller's table), for `turns_back`.
_STRAINS, _TURNS, _PRESSURES = 8, 16, 97


class Belief(NamedTuple):
    """
    Model of the recruitment controller: see `fam_bundle_ros.model.seam.Model`.

    Attributes
    ----------
    force, shape, parameters, tables, memory, after
        As there; ``after`` is work space here.
    next : (n, M)
        Memory after this tick.
    followed : (n, M)
        Memory along the reference of a strain, in place of the measured strain.
    path : (k,) of int
        Fields of the memory for which the two differ: dry friction that builds up.
    frictionless : as parameters
        Parameters of the model without that friction.
    pressure : (n,), Pa (gauge)
        Work space for candidate pressures.
    curve : C function or None
        Forces of one unit at all pressures of the table; see `fam_bundle_ros.model.seam.CURVE`.
    rows : callable or None
        Forces (m, n) of the whole table at a `Moment` with a memory, with or without that
        friction, in one call on arrays; not compiled.
    """

    force: Any
    shape: Any
    parameters: Any
    tables: Any
    memory: Any
    after: Any
    next: Any
    followed: Any
    path: Any
    frictionless: Any
    pressure: Any
    curve: Any
    rows: Any


def without_push_back(bundle: Bundle) -> Bundle:
    """Return a bundle without the laws of push-back."""
    for effect in bundle.effects:
        if effect.law.pushes_back:
            bundle = bundle.without_effect(effect.name)
    return bundle


def invertible(bundle: Bundle) -> Bundle:
    """
    Return a bundle without the laws that have no useful inverse.

    A law that only delays the pressure lets hardly any change of it through in one tick; its delay
    is a lag of the controller, see `delay_of`. The inverse of a hysteresis in the pressure crosses
    it to and fro with each change of sign of the noise: many times the air. So does that of dry
    friction of the braid that the pressure reverses, if there is one: see `turns_back`.
    """
    for effect in bundle.effects:
        if effect.law.delay or effect.law.remembers_pressure:
            bundle = bundle.without_effect(effect.name)
    rubbing = [effect.name for effect in bundle.effects if effect.law.remembers_path]
    if rubbing and turns_back(bundle):
        for name in rubbing:
            bundle = bundle.without_effect(name)
    return bundle


def turns_back(bundle: Bundle) -> bool:
    """
    Return whether a force somewhere falls as the pressure rises again after a fall.

    At a constant length the pressure moves the braid where fittings yield or ends are tapered, and
    dry friction that builds up changes its sign over some pressure. If it changes by more than the
    muscle gains over that pressure, no inverse exists. At the bottom of a rising branch, where the
    force rises less than half as steeply as on average, any friction does so.
    """
    if not any(part.place is Place.GEOMETRY and part.changes == 'strain'
               and 'pressure' in part.arguments
               for effect in bundle.effects for part in effect.law.parts):
        return False
    without = without_path_friction(bundle)
    grid = np.linspace(0.0, 1.0, _PRESSURES)[:, None] * bundle.max_pressure
    highest = float(np.max(bundle.free_strain(bundle.max_pressure)))
    for strain in np.linspace(0.0, highest, _STRAINS, endpoint=False).tolist():
        rise = np.diff(without.unit_forces(strain, grid), axis=0)
        branch = rise > 0.5 * np.mean(rise, axis=0, where=rise > 0.0)
        _, full = bundle.step(bundle.start_state(), 1.0, strain, grid[-1])
        for turn in range(0, _PRESSURES - 1, _PRESSURES // _TURNS):
            _, fallen = bundle.step(full, 1.0, strain, grid[turn])
            force, _ = bundle.step(fallen, 1.0, strain, grid[turn:])
            if (branch[turn:] & (np.diff(force, axis=0) < 0.0)).any():
                return True
    return False


def without_path_friction(bundle: Bundle) -> Bundle:
    """Return a bundle whose dry friction that builds up is zero, with the same memory."""
    return bundle.with_parameters({
        f'{effect.name}.{name}': value * effect.law.parameter(name).scale
        for effect in bundle.effects if effect.law.remembers_path
        for name, value in effect.law.off.items()})


def delay_of(bundle: Bundle) -> float:
    """Return the delay of the pressure by the laws of a bundle, s."""
    return sum(effect.values[effect.law.delay] for effect in bundle.effects if effect.law.delay)


def belief_of(bundle: Bundle, grid: list, compiled: bool = False,
              at_rest: bool = False) -> Belief:
    """
    Return a bundle as kernels take it, with initial memory.

    Parameters
    ----------
    bundle : Bundle
    grid : list (n, m), Pa (gauge)
        Pressures of the table.
    compiled : bool
        See `Bundle.model`.
    at_rest : bool
        Forces at equilibrium, without memory; not compiled.
    """
    model, pressures = bundle.model(compiled), np.transpose(grid)
    without = without_path_friction(bundle)
    frictionless = without.model(compiled).parameters
    if compiled:
        return Belief(model.force, *model[3:], np.zeros_like(model.memory),
                      np.zeros_like(model.memory), np.array(bundle.path_memory, int),
                      frictionless, np.zeros(bundle.n), bundle.curve, None)

    def rows(now, memory, rubs):
        state = {'memory': memory, 'time': now.time - now.dt, 'begun': not now.start}
        return (bundle if rubs else without).step(state, now.dt, now.strain, pressures,
                                                  now.strain_rate)[0]

    def rows_at_rest(now, memory, rubs):
        return bundle.unit_forces(now.strain, pressures, now.strain_rate)

    def force_at_rest(unit, strain, strain_rate, pressure, *_):
        return float(bundle.unit_forces(strain, pressure, strain_rate)[unit])
    # Without memory a first sample is at equilibrium, and faster.
    at_rest = at_rest and bundle.has_memory
    return Belief(force_at_rest if at_rest else model.force, *model[3:],
                  [list(row) for row in model.memory], [list(row) for row in model.memory],
                  bundle.path_memory, frictionless, [0.0] * bundle.n, None,
                  rows_at_rest if at_rest else rows)
