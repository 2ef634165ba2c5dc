# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The interface of a model to a control loop: three functions and their arguments.

    force(unit, strain, strain_rate, pressure, time, dt, start,
          shape, parameters, tables, memory, after) -> tension of the motor unit, N
    volume(unit, strain, pressure, time, shape, parameters, tables) -> gas volume, m^3
    volume_slope(unit, strain, pressure, time, shape, parameters, tables) -> m^3 per strain

``unit`` is the index of the motor unit, ``pressure`` the gauge pressures (n,) of all of them in
Pa. ``start`` is True at the first sample: memory is then reset. ``time`` is in s since the start
of the log, ``dt`` since the last sample. Volumes are without tubes; the slope is at constant
pressure. Plain functions take lists (of lists); compiled ones are C function pointers that take
C-contiguous arrays of float64.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from fam_bundle_ros import kernels

FORCE = ('float64(int64, float64, float64, float64[::1], float64, float64, boolean, '
         'float64[:, ::1], float64[::1], float64[::1], float64[:, ::1], float64[:, ::1])')
CURVE = ('void(int64, float64, float64, float64[::1], float64, float64, boolean, float64[:, ::1], '
         'float64[::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[::1])')
VOLUME = ('float64(int64, float64, float64[::1], float64, float64[:, ::1], float64[::1], '
          'float64[::1])')


class Model(NamedTuple):
    """
    A model for the control loop, plain or compiled.

    ``shape`` (n, G) is the geometry of the motor units, ``parameters`` (K,) the values of all
    effects in SI, ``tables`` (T,) measured surfaces, ``memory`` (n, M) the state of the effects,
    M at least 1, and ``after`` (n, M) their state after this sample: the loop copies it to
    ``memory`` when it accepts the sample.
    """

    force: Any
    volume: Any
    volume_slope: Any
    shape: Any
    parameters: Any
    tables: Any
    memory: Any
    after: Any


def pointers(force: Callable, volume: Callable, volume_slope: Callable) -> tuple[Any, Any, Any]:
    """Return three kernels as C functions; raises `kernels.NotCompiled` if that is impossible."""
    return (kernels.pointer(force, FORCE), kernels.pointer(volume, VOLUME),
            kernels.pointer(volume_slope, VOLUME))
