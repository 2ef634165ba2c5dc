# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Wrong units, signs or columns within all ranges, found by a far better fit without them."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.unit_names import unit_of
from fam_bundle_ros.told import number
from fam_bundle_ros.units import FASTEST, si_factor

_TURNED = 'with the sign of the force turned round (tension is positive)'
#: Force as it may have been meant: (factor, words).
_FORCES = (
    (-1.0, _TURNED),
    (4.448222, 'with a force in lbf, not in N'), (1.0 / 4.448222, 'with a force in N, not in lbf'),
    (9.80665, 'with a force in kgf, not in N'), (1.0 / 9.80665, 'with a force in N, not in kgf'))
#: Units that pressures may have been meant in, and read in where no file names one: Pa of each.
_PRESSURES = {unit: si_factor(unit, 'Pa') for unit in ('kPa', 'psi', 'bar')}
#: Pa: where the lowest pressure is above this the gauge may show absolute pressure.
_NEVER_VENTED = 85e3
#: Pa: taken off absolute pressures.
_AMBIENT = 101325.0
#: A slip is reported if the error falls to less than these shares of itself, and of the force.
_BETTER, _GOOD = 0.4, 0.25


def slips(predict: Callable[[Measurement], np.ndarray], data: Measurement,
          residual: np.ndarray) -> tuple[str, ...]:
    """
    Return what the data were probably meant to be, in words; empty where they fit as they are.

    A strain that moves faster than any muscle is told from the clock alone.

    ``predict`` returns the force, (T,) N, of a measurement: a model knows how, this module does
    not. The residual (T,), N, is measured minus modelled force.
    """
    prediction = data.force - residual
    tries = [(rms(factor * data.force - prediction), rms(factor * data.force), words)
             for factor, words in _FORCES]
    if data.pressure.min() > _NEVER_VENTED:
        vented = replace(data, pressure=data.pressure - _AMBIENT)
        tries.append((rms(data.force - predict(vented)), rms(data.force),
                      'with pressures that are absolute, not gauge'))
    now = rms(residual)
    if now > _GOOD * rms(data.force):  # these make a large error
        for read, meant in product(_named_pressures(data) or _PRESSURES.items(),
                                   _PRESSURES.items()):
            meant_so = replace(data, pressure=meant[1] / read[1] * data.pressure)
            tries.append((rms(data.force - predict(meant_so)), rms(data.force),
                          f'with pressures in {meant[0]}, not in {read[0]}'))
        back = replace(data, strain=data.strain.max() + data.strain.min() - data.strain)
        tries.append((rms(data.force - predict(back)), rms(data.force),
                      'with the strain turned round (positive when shorter)'))
        if data.pressure.shape[1] == 1:
            other = replace(data, force=1e-3 * data.pressure[:, 0],
                            pressure=1e3 * data.force[:, None])
            tries.append((rms(other.force - predict(other)), rms(other.force),
                          'with force and pressure exchanged'))
    # by the share of the force: of small numbers (kgf) the error is small too
    error, force, words = min(tries, key=lambda each: each[0] / (each[1] or np.inf))
    # the model may be poor, but that a muscle pushes where it says that it pulls is no misfit
    if error > _BETTER * now or error > _GOOD * force and words != _TURNED:
        return _clock_slip(data)
    return (*_clock_slip(data),
            f'{words} the model would be off by {number(error)} N ({100 * error / force:.0f} % of '
            f'the force), not {number(now)} N')


def _named_pressures(data: Measurement) -> set[tuple[str, float]]:
    """Return the units that the file itself names for its pressures, and their factors to Pa."""
    named = [unit_of(taken.unit, 'Pa') for taken in data.taken
             if taken.quantity.startswith('pressure') and not taken.why]
    return {(unit.text, unit.factor) for unit in named if unit is not None}


def _clock_slip(data: Measurement) -> tuple[str, ...]:
    moves = np.abs(data.strain_rate[data.strain_rate != 0.0])
    if not len(moves) or np.median(moves) <= FASTEST:
        return ()
    return (f'the strain moves at {number(float(np.median(moves)))} 1/s, faster than any muscle '
            f'({FASTEST:g} 1/s): in which unit is the time?',)
