# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Bundles of two, three and six motor units, and one pressure chamber to control."""

import math
import random

import pytest

from fam_bundle_ros.control import PidConfig, PidGains, PressurePid
from fam_bundle_ros.control.curves import curve_table, find_branches
from fam_bundle_ros.model import Bundle, Geometry, MotorUnit
from fam_bundle_ros.model.catalogue import get
from fam_bundle_ros.model.pneumatics import ATMOSPHERE, pressure_rate, ValveFlow


@pytest.fixture(scope='session')
def paper_bundle():
    """Return two motor units of the paper's dimensions, not read from a shipped file."""
    geometry = Geometry(6.35e-3, 0.127, math.radians(33.0), 1.59e-3)
    return Bundle('paper', [MotorUnit(f'mu{k}', 1, geometry, 344.7e3) for k in (1, 2)],
                  [get(name)() for name in ('mesh', 'bladder_elasticity', 'resistive_buckling')])


@pytest.fixture(scope='session')
def bundles(paper_bundle):
    """Return bundles by number of motor units: sizes and counts differ from unit to unit."""
    def unit(k, radius, muscles):
        geometry = Geometry(radius, 0.127, math.radians(33.0), 0.25 * radius)
        return MotorUnit(f'mu{k}', muscles, geometry, 344.7e3)

    three = [unit(1, 4.0e-3, 1), unit(2, 5.0e-3, 1), unit(3, 6.35e-3, 1)]
    six = [unit(k, r, m) for k, r, m in ((1, 3.5e-3, 1), (2, 4.0e-3, 1), (3, 4.5e-3, 1),
                                         (4, 5.0e-3, 1), (5, 5.0e-3, 2), (6, 6.35e-3, 2))]
    effects = paper_bundle.effects
    return {2: paper_bundle, 3: Bundle('three', three, effects), 6: Bundle('six', six, effects)}


def straight_curves(slope=(1e-3, 2e-3)):
    """Return curves of two units that fall by 4 N up to 50 kPa and then rise to 300 kPa (N/Pa)."""
    grid = [1e3 * k for k in range(301)]
    table = curve_table([0, 1], [grid, grid], True)
    for unit in range(2):
        table.force[unit] = [-4.0 * p / 50e3 if p <= 50e3 else -4.0 + slope[unit] * (p - 50e3)
                             for p in grid]
        table.bottom[unit] = 50
    find_branches(table, [0, 0])
    return table


@pytest.fixture
def made():
    """Return `straight_curves`."""
    return straight_curves


class Chamber:
    """One chamber behind a valve with a spool, under a `PressurePid`; finely integrated."""

    def __init__(self, volume=20e-6, supply=500e3, dead_band=0.04, leak=0.0, noise=0.0,
                 pressure=0.0, period=1e-3, gains=None, config=None, delay=0.0):
        self.volume, self.supply, self.leak, self.noise = volume, supply, leak, noise
        self.valve = ValveFlow(dead_band=dead_band)
        self.pressure, self.period = pressure, period
        self.pid = PressurePid(gains or PidGains(), config or PidConfig(flow_lag=1.5e-3))
        self.time = self.air = self._spool = self._speed = 0.0
        self._late = [0.0] * round(delay / period * 10)
        self._random = random.Random(4)
        self.told_supply = supply

    def run(self, setpoint, duration):
        """Return a list of (time, pressure, command) at every fine step."""
        rows = []
        for _ in range(round(duration / self.period)):
            reading = self.pressure + self._random.gauss(0.0, self.noise)
            wanted = setpoint(self.time) if callable(setpoint) else setpoint
            command = self.pid.update(wanted, reading, self.period, self.told_supply,
                                      self.volume)
            for _ in range(10):
                self._late.append(command)
                self._advance(self._late.pop(0), self.period / 10)
                rows.append((self.time, self.pressure, command))
        return rows

    def _advance(self, command, dt):
        natural = 2.0 * math.pi * 125.0
        self._speed += dt * (natural ** 2 * (command - self._spool) - 1.4 * natural * self._speed)
        self._spool += dt * self._speed
        flow = self.valve.flow(self.valve.opening(self._spool), self.pressure + ATMOSPHERE,
                               self.supply + ATMOSPHERE)
        self.air += max(flow, 0.0) * dt
        rate = pressure_rate(self.pressure + ATMOSPHERE, self.volume, 0.0, flow)
        self.pressure += dt * (rate - self.leak * self.pressure)
        self.time += dt


@pytest.fixture
def chamber():
    """Return the class of a simulated chamber with its pressure loop."""
    return Chamber
