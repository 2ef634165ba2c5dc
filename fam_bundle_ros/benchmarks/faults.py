# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Cases of the safety benchmark: faults, phases of a trajectory, policies.

A case is (fault, phase, policy). The fault occurs at `ONSET` and is repaired at `REPAIR`, later
than `resume_within`, so that no pressure may return without `enable`. The rig has 6 bar and
neither a trip nor a relief valve of its own, so that only the controllers act. The limits of a run
are computed from the model and the valve.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import math
from typing import Any

import numpy as np

from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import (
    ChamberConfig,
    Dynamometer,
    Faults,
    MassSpring,
    RigConfig,
    SupplyConfig,
)
from fam_bundle_ros.simulation import Trajectory

#: Times of the trajectory at which the fault occurs, is repaired, and the run ends, s.
ONSET, REPAIR, END = 0.8, 3.3, 4.5
PREPARE = 0.8
#: Supply pressure, and a limit above it for "no trip" and "no relief valve", Pa (gauge).
SUPPLY, NEVER = 600e3, 1.4e6
#: Sample rate of the runs, Hz.
RATE = 200.0
#: Default of `resume_within`, s; after a shorter loss, pressure may return without `enable`.
RESUME_WITHIN = 2.0

POLICIES = ('neglect', 'hysteresis', 'reversal_aware')
#: Phases of the trajectory; in the last one, `enable` is called during the fault, at `PRESSED`.
PHASES = ('hold', 'ramp', 'sine', 'transition', 'enabled')
PRESSED = ONSET + 1.5
#: Additional phase without faults: sines up to 2 Hz on transitions.
WORK = 'work'

#: The faults; mu1 carries the load in every phase.
FAULTS: dict[str, Faults] = {
    'mu1 pressure nan': Faults(dropout={'mu1/pressure'}),
    'mu1 pressure silent': Faults(silent={'mu1/pressure'}),
    'mu1 pressure frozen': Faults(frozen={'mu1/pressure'}),
    'mu1 pressure frozen with noise': Faults(plugged={'mu1/pressure'}),
    'mu1 pressure range ends at 340 kPa': Faults(range_end={'mu1/pressure': 340e3}),
    'mu1 pressure range ends at 300 kPa': Faults(range_end={'mu1/pressure': 300e3}),
    'mu1 pressure reads half': Faults(gain={'mu1/pressure': 0.5}),
    'mu1 pressure in kPa': Faults(units={'mu1/pressure': 'kPa'}),
    'mu1 pressure in psi': Faults(units={'mu1/pressure': 'psi'}),
    'mu1 pressure 100 kPa low': Faults(offset={'mu1/pressure': -100e3}),
    'mu1 pressure with the wrong sign': Faults(gain={'mu1/pressure': -1.0}),
    'mu1 pressure drifts by -50 kPa/s': Faults(drift={'mu1/pressure': -50e3}),
    'mu1 pressure with spikes': Faults(spike={'mu1/pressure': -200e3}),
    'mu1 pressure 0.1 s late': Faults(delay={'mu1/pressure': 0.1}),
    'pressures exchanged': Faults(exchanged={'mu1/pressure': 'mu2/pressure'}),
    'all pressures in kPa': Faults(units={'mu1/pressure': 'kPa', 'mu2/pressure': 'kPa',
                                          'supply': 'kPa'}),
    'force nan': Faults(dropout={'force'}),
    'force silent': Faults(silent={'force'}),
    'force frozen': Faults(frozen={'force'}),
    'force reads half': Faults(gain={'force': 0.5}),
    'force with the wrong sign': Faults(gain={'force': -1.0}),
    'force drifts by -20 N/s': Faults(drift={'force': -20.0}),
    'force in kN': Faults(units={'force': 'kN'}),
    'strain nan': Faults(dropout={'strain'}),
    'strain silent': Faults(silent={'strain'}),
    'strain frozen': Faults(frozen={'strain'}),
    'strain in percent': Faults(units={'strain': 'percent'}),
    'supply reading nan': Faults(dropout={'supply'}),
    'supply reading in psi': Faults(units={'supply': 'psi'}),
    'mu1 valve stuck where it is': Faults(stuck_valve={0: None}),
    'mu1 valve stuck open': Faults(stuck_valve={0: 1.0}),
    'mu1 valve stuck shut': Faults(stuck_valve={0: 0.0}),
    'mu1 valve leaking': Faults(leaking_valve={0: 0.1}),
    'mu1 valve reversed': Faults(reversed_valve={0}),
    'valves exchanged': Faults(exchanged_valves={0: 1}),
    'mu1 burst': Faults(burst={0}),
    'mu1 leaks': Faults(leak={0: 0.5}),
    'supply hose off': Faults(supply=0.0),
    'all readings 0.1 s late': Faults(delay=dict.fromkeys(
        ('force', 'strain', 'supply', 'mu1/pressure', 'mu2/pressure'), 0.1)),
}
#: Faults of messages, which need wall time.
MESSAGES: dict[str, Faults] = {
    'all messages 0.05 s late': Faults(late=dict.fromkeys(
        ('force', 'strain', 'supply', 'mu1/pressure', 'mu2/pressure'), 0.05)),
    'all messages 0.3 s late': Faults(late=dict.fromkeys(
        ('force', 'strain', 'supply', 'mu1/pressure', 'mu2/pressure'), 0.3)),
    'half of the mu1 pressures lost': Faults(lost={'mu1/pressure': 0.5}),
}
#: Conditions without a fault, in which a reaction is a false alarm.
SOUND: dict[str, Faults] = {
    'nothing': Faults(),
    'twice the noise': Faults(noise_factor=2.0),
    'valve conductance 30 % high': Faults(),
    'valve conductance 30 % low': Faults(),
}
EVERY = FAULTS | MESSAGES | SOUND
_CONDUCTANCE = {'valve conductance 30 % high': 1.3, 'valve conductance 30 % low': 0.7}


@dataclass(frozen=True)
class Case:
    """A case: fault, phase, policy, seed."""

    fault: str
    phase: str
    policy: str
    seed: int = 1
    #: s, of the trajectory.
    seconds: float = END

    def __str__(self):
        return f'{self.fault}, {self.phase}, {self.policy}'

    @property
    def lock_step(self) -> bool:
        """Whether it runs in lock-step, else in wall time."""
        return self.fault not in MESSAGES

    @property
    def enable_at(self) -> float | None:
        """Time of the trajectory at which `enable` is called, s; None for never."""
        return PRESSED if self.phase == 'enabled' and not self.sound else None

    @property
    def sound(self) -> bool:
        """Whether the case has no fault."""
        return self.fault in SOUND

    @property
    def faults(self) -> Faults:
        """Faults between `ONSET` and `REPAIR`."""
        return EVERY[self.fault]


def cases_of(faults: Sequence[str], phases: Sequence[str], policies: Sequence[str],
             seed: int = 1) -> list[Case]:
    """Return every combination; slow faults of messages are run with one policy only."""
    return [Case(fault, phase, policy, seed) for fault in faults for phase in phases
            for policy in (policies if fault not in MESSAGES else policies[-1:])]


def work_cases(minutes: float, policy: str, seed: int = 1) -> list[Case]:
    """Return ``minutes`` of operation without faults, to count false alarms."""
    share = 60.0 * minutes / len(SOUND)
    return [Case(fault, WORK, policy, seed, share) for fault in SOUND] if share > 0.0 else []


def rig_of(case: Case) -> RigConfig:
    """Return the rig of a case: 6 bar, no trip and no relief valve."""
    rig = RigConfig(supply=SupplyConfig(pressure=SUPPLY), trip_pressure=NEVER,
                    chamber=ChamberConfig(relief_pressure=NEVER))
    factor = _CONDUCTANCE.get(case.fault, 1.0)
    return replace(rig, valve=replace(rig.valve, conductance=factor * rig.valve.conductance))


def node_parameters(case: Case) -> dict[str, Any]:
    """Return the parameters of the nodes in addition to those of the rig."""
    values: dict[str, Any] = {'policy': case.policy}
    if case.fault in _CONDUCTANCE:
        values['valve.conductance'] = RigConfig().valve.conductance
    return values


def trajectory_of(case: Case, model: Bundle) -> Trajectory:
    """Return the trajectory of the phase, with the fault."""
    strain = 0.1
    one = float(model.force(strain, _first_unit(model)))
    every = float(model.force(strain, model.max_pressure))
    broken = (((ONSET, case.faults), (REPAIR, Faults())) if not case.sound
              else ((-PREPARE, case.faults),))
    load = Dynamometer(strain)
    if case.phase == 'hold':
        # A constant strain with a mass, so that a fall or jump shows in the strain.
        mass = 0.5 * float(model.force(0.08, _first_unit(model))) / 9.80665
        return Trajectory('hold', 'strain', END, lambda t: 0.08, lambda t: 0.0,
                          MassSpring(mass=mass, damping=40.0), prepare=PREPARE, faults=broken)
    value, rate = _force(case.phase, one, every)
    return Trajectory(case.phase, 'force', case.seconds, value, rate, load, prepare=PREPARE,
                      faults=broken)


def _force(phase: str, one: float, every: float) -> tuple[Callable, Callable]:
    """Return force and rate over time; ``one``, ``every``: forces of the first, all units, N."""
    if phase == 'ramp':
        slope = 0.6 * one / END
        return (lambda t: 0.15 * one + slope * t), (lambda t: slope)
    if phase == 'sine':
        turn = 2.0 * math.pi * 0.5
        # The fault occurs where the force rises fastest.
        return ((lambda t: one * (0.45 + 0.25 * math.sin(turn * (t - ONSET)))),
                (lambda t: one * 0.25 * turn * math.cos(turn * (t - ONSET))))
    if phase == 'enabled':
        # All units pull.
        held = one + 0.3 * (every - one)
        return (lambda t: held), (lambda t: 0.0)
    # Transition and work: up and down through the overlap, with a crossing just after the fault.
    low, high = 0.7 * one, one + 0.5 * (every - one)
    half = 1.2 if phase == 'transition' else 5.0
    wave = 0.0 if phase == 'transition' else 0.15 * one

    def value(t: float) -> float:
        x = (t / half) % 2.0
        return (low + (high - low) * (x if x < 1.0 else 2.0 - x)
                + wave * math.sin(_sweep(t)[0]))

    def rate(t: float) -> float:
        phase, frequency = _sweep(t)
        return ((high - low) / half * (1.0 if (t / half) % 2.0 < 1.0 else -1.0)
                + wave * frequency * math.cos(phase))
    return value, rate


def _sweep(t: float) -> tuple[float, float]:
    """Return phase and rate (rad/s) of a sine that goes from 0.1 to 2 Hz in every 20 s."""
    span, low, high = 20.0, 2.0 * math.pi * 0.1, 2.0 * math.pi * 2.0
    turns, x = divmod(t, span)
    slope = (high - low) / span
    whole = low * span + 0.5 * slope * span ** 2
    return turns * whole + low * x + 0.5 * slope * x * x, low + slope * x


def _first_unit(model: Bundle) -> np.ndarray:
    pressure = np.zeros(model.n)
    pressure[0] = model.max_pressure[0]
    return pressure
