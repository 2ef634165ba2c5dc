# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A record of 60 s of a benchmark's plant, and the model that a user makes of it.

Half a minute of strain sweeps at constant pressures, from one unit at a third of its largest
pressure to all at the largest, then pressure ramps through all units and back at constant strains:
of friction at constant strain the sweeps show nothing. Every other trial is three times as fast,
as friction, damping and lag are alike at one speed. The pressures are those of the plant's
pressure loops, which are told volume and its rate by the model, the readings those of its
instruments.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np

from fam_bundle_ros.benchmarks.margins import PID_PERIOD, pid_settings, pressure_gains
from fam_bundle_ros.benchmarks.plants import model_of, plant_of, PLANTS
from fam_bundle_ros.control import PressurePid
from fam_bundle_ros.data.measurement import build, Measurement
from fam_bundle_ros.discovery import diagnose
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import Dynamometer, Faults, Rig

#: s: duration of the sweeps, and of the ramps; time to settle before each, which is not recorded.
_HALF, _SETTLE = 30.0, 0.6
#: Largest strain of the sweeps; shares of a unit's largest pressure; strains of the ramps.
_MOST, _SHARES, _STRAINS = 0.2, (1 / 3, 2 / 3, 1.0), (0.04, 0.08, 0.12, 0.16)
#: Duration of every other trial over that of the others.
_FASTER = 1 / 3
#: Samples of the pressure loops per recorded row.
_EVERY = 5


@cache
def diagnosed_model(name: str, units: int) -> Bundle:
    """Return the effects that `diagnose` names on a `record`, as `fam_bundle add` writes them."""
    return diagnose(model_of(name, units), record(name, units)).best


def record(name: str, units: int, seed: int = 1) -> Measurement:
    """
    Return a record of a plant of the benchmark; ``seed`` is that of the sensors' noise.

    Raises
    ------
    RuntimeError
        A pressure trips the rig: what comes after it is no record of the plant.
    """
    kind, model = PLANTS[name], model_of(name, units)
    rig = Rig(plant_of(name, units), replace(kind.rig, load=Dynamometer(0.0)), seed,
              Faults(noise_factor=kind.noise_factor))
    loops = [PressurePid(pressure_gains(kind.delay), pid_settings(
        kind.rig, kind.delay, kind.noise_factor)) for _ in range(units)]
    tube = kind.rig.chamber.tube_volume
    rows, reading = [], rig.readings
    for trial, (duration, motion) in enumerate(_trials(model)):
        times = np.arange(round(duration / PID_PERIOD)) * PID_PERIOD - _SETTLE
        path = [motion(max(time, 0.0) / (duration - _SETTLE)) for time in times]
        volumes = model.gas_volume(np.array([strain for strain, _ in path])) + tube
        rates = np.gradient(volumes, PID_PERIOD, axis=0)
        for k, (time, (strain, pressure)) in enumerate(zip(times, path)):
            rig.impose_strain(strain)
            reading = rig.step([
                loop.update(goal, now, PID_PERIOD, reading.supply, volume, rate)
                for loop, goal, now, volume, rate in zip(
                    loops, pressure, reading.pressure, volumes[k], rates[k])], PID_PERIOD)
            if rig.e_stopped:
                raise RuntimeError(f'the record of {name}: {rig.e_stopped}')
            if time >= 0.0 and k % _EVERY == 0:
                rows.append((reading.time, trial, reading.strain, reading.force,
                             *reading.pressure))
    time, trial, strain, force, *pressures = np.array(rows).T
    return build(f'{name}, {units} units', strain, np.array(pressures).T, force, trial.astype(int),
                 time)


def _trials(model: Bundle) -> Iterator[tuple[float, Callable[[float], tuple[float, np.ndarray]]]]:
    """Yield the duration (s) of each trial, and strain and pressures (Pa) over the share of it."""
    def filled(count):
        """Return the pressures with ``count`` units filled in turn; a part fills the next."""
        return np.clip(count - np.arange(model.n), 0.0, 1.0) * model.max_pressure

    def there_and_back(share):
        return 1.0 - abs(2.0 * share - 1.0)

    def swept(level: float, share: float) -> tuple[float, np.ndarray]:
        return _MOST * there_and_back(share), filled(level)

    def ramped(strain: float, share: float) -> tuple[float, np.ndarray]:
        return strain, filled(model.n * there_and_back(share))

    levels = [0.0, *(k + share for k in range(model.n) for share in _SHARES)]
    for motion, values in ((swept, levels), (ramped, _STRAINS)):
        shares = np.where(np.arange(len(values)) % 2, _FASTER, 1.0)
        for value, duration in zip(values, _HALF * shares / shares.sum()):
            yield duration, partial(motion, value)
