# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Regulator, manifold, valves and chambers together; and the energy taken from the supply."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import RT
from fam_bundle_ros.plant import (
    air_energy,
    available_energy,
    ChamberConfig,
    fastest_fall,
    fastest_rise,
    liquid_energy,
    SupplyConfig,
    ValveConfig,
)
from fam_bundle_ros.plant.checks import require
from fam_bundle_ros.plant.circuit import Air, AirConfig, circuit_step, line_rate, substeps

AMBIENT = 101325.0
V = [14e-6, 30e-6]
CALM = [0.0, 0.0]


class Circuit:
    """A circuit of two motor units at rest."""

    def __init__(self, valve=None, chamber=None, supply=None, droop=0.0, volume=V):
        self.config = AirConfig.of(valve or ValveConfig(), chamber or ChamberConfig(),
                                   supply or SupplyConfig(), AMBIENT, droop)
        self.air = Air.at_rest(self.config, volume)

    def advance(self, dt, commands, volume=V, leaks=CALM):
        """Advance by dt while the volumes go to ``volume``."""
        circuit_step(self.config, self.air, commands, volume, leaks, dt)

    def run(self, commands, seconds, volume=V, leaks=CALM, dt=1e-3):
        """Advance with everything held."""
        for _ in range(round(seconds / dt)):
            self.advance(dt, commands, volume, leaks)

    @property
    def gauge(self):
        """The chambers' gauge pressures, Pa."""
        return np.array(self.air.pressure) - AMBIENT


def ample(**values):
    """Return a supply that does not droop."""
    return SupplyConfig(volume=1.0, flow_limit=1.0, **values)


def seconds_to(c, level, command, dt=1e-4):
    """Return the time until the first chamber has crossed a gauge pressure."""
    rises, time = level > c.gauge[0], 0.0
    while (level > c.gauge[0]) == rises:
        before = c.gauge[0]
        c.advance(dt, [command, command])
        time += dt
    return time - dt * (c.gauge[0] - level) / (c.gauge[0] - before)


@pytest.mark.parametrize(('into', 'out'), [(1.2, 1.2), (1.0, 1.4)])
def test_open_valve_fills_and_vents_in_the_least_time(into, out):
    """With a quick spool 300 and 100 kPa are reached when the closed forms say so."""
    c = Circuit(valve=ValveConfig(bandwidth=1e5), supply=ample(),
                chamber=ChamberConfig(inflow_exponent=into, outflow_exponent=out))
    c.run([1.0, 1.0], 1e-4, dt=1e-5)
    least = fastest_rise(c.gauge[0], 300e3, V[0], 500e3, exponent=into)
    assert seconds_to(c, 300e3, 1.0) == pytest.approx(least, rel=2e-3)
    c.run([-1.0, -1.0], 1e-4, dt=1e-5)
    least = fastest_fall(c.gauge[0], 100e3, V[0], exponent=out)
    assert seconds_to(c, 100e3, -1.0) == pytest.approx(least, rel=2e-3)


@pytest.mark.parametrize('command', [-1.0, -0.3, 0.5, 1.0])
def test_a_spool_answers_every_command_alike(command):
    """From rest, x'' = w^2 (u - x) - 2 z w x': the same share of any command after a time."""
    c = Circuit()
    w, z = c.config.spool_frequency, c.config.spool_damping
    damped = w * math.sqrt(1.0 - z * z)
    for time in 1e-3 * np.arange(1, 6):
        c.advance(1e-3, [command, 0.0])
        left = math.exp(-z * w * time) * (math.cos(damped * time)
                                          + z * w / damped * math.sin(damped * time))
        assert c.air.spool == pytest.approx([command * (1.0 - left), 0.0], abs=1e-12)


def test_relief_valve_that_is_fully_open_passes_as_much_as_the_valve():
    """A chamber far above its band vents through it as fast as through the open valve."""
    c = Circuit(chamber=ChamberConfig(relief_pressure=300e3, relief_band=20e3))
    c.air.pressure = [AMBIENT + 600e3] * 2
    assert seconds_to(c, 400e3, 0.0) == pytest.approx(fastest_fall(600e3, 400e3, V[0]), rel=2e-3)


TINY = [1e-7, 1.5e-7]


@pytest.mark.parametrize('case', ['fill', 'vent', 'seep', 'leak', 'dump', 'lost supply'])
def test_three_long_steps_are_as_good_as_many_short_ones(case):
    """Whatever settles much faster than a step is divided: nothing swings or runs away."""
    quick = ValveConfig(bandwidth=1e4)
    small = (SupplyConfig(volume=5e-6, resistance=1e9, dump_conductance=3e-8)
             if case in ('dump', 'lost supply') else None)
    found = []
    for dt in (10e-3, 0.5e-3):
        c = Circuit(quick, ChamberConfig(relief_pressure=900e3), small, volume=TINY)
        c.air.pressure = [AMBIENT + 200e3, AMBIENT + 100e3]
        if case == 'seep':
            c.air.seep = [0.5, 0.2]
        c.air.dumping = case == 'dump'
        if case == 'lost supply':
            c.air.supply_share = 0.0
        command = {'fill': 0.5, 'vent': -0.5}.get(case, 0.0)
        c.run([command] * 2, 30e-3, TINY, [2e4, 1e4] if case == 'leak' else CALM, dt)
        found.append([*c.air.pressure, c.air.manifold])
    assert found[0] == pytest.approx(found[1], abs=100.0)


@pytest.mark.parametrize('line', [0.0, 3e-6], ids=['one volume', 'line apart'])
def test_flows_add_up_to_fourth_order(line):
    """Manifold, lines, chambers and moving volumes together: half the step, a sixteenth."""
    def found(dt):
        c = Circuit(chamber=ChamberConfig(line_volume=line, line_conductance=5e-10),
                    supply=SupplyConfig(volume=2e-5, resistance=2e8))
        c.air.pressure, c.air.line = ([AMBIENT + 60e3, AMBIENT + 200e3],
                                      [AMBIENT + 300e3, AMBIENT + 120e3])
        c.air.spool = [0.3, -0.2]
        for k in range(round(8e-3 / dt)):
            share = (k + 1) * dt / 8e-3
            assert substeps(c.config, c.air, c.air.spool, V, [5.0, 0.0], dt) == 1
            c.advance(dt, [0.3, -0.2], [v * (1.0 + 0.2 * share) for v in V], [5.0, 0.0])
        return np.array([*c.air.pressure, c.air.manifold, *(c.air.line if line else ())])

    exact = found(5e-5)
    coarse, fine = (np.abs(found(dt) - exact) for dt in (8e-4, 4e-4))
    assert np.all(fine < 0.12 * coarse)


def _wander(c, exponent, moving):
    """Drive valves (and volumes) at random; return the largest error of the air balance, kg."""
    rng = np.random.default_rng(3)
    leaks = [0.2, 0.0]

    def content(volume):
        return (sum(p * v for p, v in zip(c.air.pressure, volume, strict=True)) / (exponent * RT)
                + c.air.manifold * c.config.supply.volume / RT)

    volume = list(V)
    start = content(volume)
    worst = 0.0
    for k in range(400):
        c.air.dumping = 300 < k < 320
        commands = rng.uniform(-1.0, 1.0, 2).tolist()
        after = [v * rng.uniform(0.97, 1.03) for v in volume] if moving else volume
        for _ in range(5):
            step = [v + (w - v) / 5.0 for v, w in zip(volume, after, strict=True)]
            c.advance(1e-3, commands, step, leaks)
            volume = step
        b = c.air.balance
        change = b.drawn - b.exhausted - b.leaked - b.dumped
        worst = max(worst, abs(content(volume) - start - change))
    assert c.air.balance.drawn > 1e-3
    assert c.air.balance.leaked > 0.0
    assert c.air.balance.dumped > 0.0
    return worst


def test_no_air_is_lost_or_made_in_isothermal_chambers_of_changing_volume():
    """Supply = chambers + manifold + exhaust + leaks + dump, while p V = m R T holds."""
    isothermal = ChamberConfig(inflow_exponent=1.0, outflow_exponent=1.0, volume_exponent=1.0)
    c = Circuit(chamber=isothermal)
    assert _wander(c, 1.0, moving=True) < 1e-5 * c.air.balance.drawn


def test_no_air_is_lost_or_made_in_polytropic_chambers_of_constant_volume():
    """With the exponent 1.2 a chamber holds p V/(1.2 R T) of the air that went in."""
    c = Circuit()
    assert _wander(c, 1.2, moving=False) < 1e-9 * c.air.balance.drawn


def test_no_air_is_lost_or_made_in_lines_apart_from_the_muscles():
    """Muscles and lines at constant volume, filled and vented through valve and restriction."""
    line = 3e-6
    c = Circuit(chamber=ChamberConfig(5e-6, 1.0, 1.0, 1.0, line_volume=line,
                                      line_conductance=2e-9))
    rng = np.random.default_rng(6)

    def content():
        return (np.dot(c.air.pressure, V) + line * sum(c.air.line)
                + c.air.manifold * c.config.supply.volume) / RT
    start, apart = content(), 0.0
    for _ in range(60):
        c.run(rng.uniform(-1.0, 1.0, 2).tolist(), 10e-3, leaks=[0.2, 0.0])
        b = c.air.balance
        left = content() - start - (b.drawn - b.exhausted - b.leaked - b.dumped)
        assert abs(left) < 1e-6 * b.drawn
        apart = max(apart, np.abs(np.subtract(c.air.line, c.air.pressure)).max())
    assert apart > 50e3
    c.run(CALM, 1.0)
    assert np.array(c.air.line) == pytest.approx(np.array(c.air.pressure), rel=1e-3)


@pytest.mark.parametrize(('flow', 'inside', 'expected'), [
    (1e-4, 3e-5, 1.1e-4 - 3.9e-5), (-1e-4, 3e-5, -1.3e-4 - 3.9e-5),
    (1e-4, -3e-5, 1.1e-4 + 3.3e-5), (-1e-4, -3e-5, -1.3e-4 + 3.3e-5)])
def test_what_comes_into_a_line_and_what_leaves_it_have_their_own_exponents(flow, inside,
                                                                            expected):
    """From either end: 1.1 for air that comes in, 1.3 for air that goes."""
    chamber = ChamberConfig(inflow_exponent=1.1, outflow_exponent=1.3, line_volume=2e-6)
    assert line_rate(chamber, flow, inside) == pytest.approx(RT * expected / 2e-6)


def test_pressure_never_exceeds_the_supply():
    """Whatever the valves do at constant volume, a chamber stays between ambient and supply."""
    c = Circuit(chamber=ChamberConfig(relief_pressure=900e3))
    rng = np.random.default_rng(5)
    for k in range(300):
        commands = [1.0, 1.0] if k < 50 else rng.uniform(-1.0, 1.0, 2).tolist()
        c.run(commands, 5e-3)
        assert np.all(c.gauge <= 500e3 + 1e-3)
        assert np.all(c.gauge >= -1e-3)
    assert c.air.manifold - AMBIENT <= 500e3 + 1e-3


def test_closed_chamber_is_compressed_along_the_polytrope():
    """With the valve closed p V^1.2 stays as it is."""
    c = Circuit()
    c.air.pressure = [3e5, 3e5]
    v = list(V)
    for _ in range(100):
        w = [x * 0.9955 for x in v]
        c.advance(1e-3, CALM, w)
        v = w
    expected = 3e5 * (V[0] / v[0]) ** 1.2
    assert c.air.pressure[0] == pytest.approx(expected, rel=1e-7)


def test_leak_lets_gauge_pressure_decay_exponentially():
    """A closed chamber of constant volume loses gauge pressure as exp(-t/tau)."""
    c = Circuit()
    c.air.pressure = [4e5, 4e5]
    c.run(CALM, 2.0, leaks=[1.0 / 4.0, 0.0])
    assert c.gauge[0] == pytest.approx((4e5 - AMBIENT) * np.exp(-0.5), rel=1e-9)
    assert c.air.pressure[1] == 4e5


def test_steady_flow_lowers_the_manifold_by_resistance_times_flow():
    """In steady flow the manifold hangs back by the regulator's and the effect's resistance."""
    droop = 2e7
    c = Circuit(supply=SupplyConfig(resistance=1e6, flow_limit=1.0), droop=droop,
                chamber=ChamberConfig(relief_pressure=20e3))
    c.run([0.3, 0.0], 1.0)
    drawn = c.air.balance.drawn
    c.run([0.3, 0.0], 0.1)
    flow = (c.air.balance.drawn - drawn) / 0.1
    assert flow > 1e-4
    assert 500e3 - (c.air.manifold - AMBIENT) == pytest.approx((1e6 + droop) * flow, rel=1e-6)


def test_units_that_fill_together_fill_slower():
    """The manifold is shared: the first unit rises slower while the second fills too."""
    alone, together = (Circuit(droop=2e7, supply=SupplyConfig(volume=3e-5)) for _ in range(2))
    alone.run([1.0, 0.0], 0.01)
    together.run([1.0, 1.0], 0.01)
    assert together.air.pressure[0] < alone.air.pressure[0] - 5e3


def test_regulator_gives_no_more_than_its_limit():
    """An emptied manifold refills at the flow limit."""
    c = Circuit(supply=SupplyConfig(flow_limit=1e-3))
    c.air.manifold = AMBIENT
    c.run(CALM, 0.1)
    assert c.air.balance.drawn == pytest.approx(1e-4, rel=1e-9)


def test_relief_valve_limits_a_chamber_on_too_high_a_supply():
    """On a supply of 700 kPa the relief valve holds a trickle near 500 kPa."""
    c = Circuit(supply=SupplyConfig(pressure=700e3))
    c.run([0.3, 0.0], 1.0)
    assert 500e3 < c.gauge[0] < 520e3


def test_pressures_do_not_depend_on_the_step():
    """Halving the internal step moves no pressure by more than 300 Pa, at small chambers."""
    rng = np.random.default_rng(8)
    commands = rng.uniform(-1.0, 1.0, (60, 2)).tolist()
    small = [3e-6, 8e-6]
    coarse, fine = Circuit(volume=small), Circuit(volume=small)
    worst = 0.0
    for command in commands:
        coarse.run(command, 0.01, volume=small, dt=1e-3)
        fine.run(command, 0.01, volume=small, dt=5e-4)
        worst = max(worst, np.max(np.abs(coarse.gauge - fine.gauge)))
    assert worst < 300.0


def test_liquid_pays_for_volume_and_not_for_pressure():
    """Only what a pressurised unit grows by costs P_s V; a vented unit grows for free."""
    volume = np.array([[10e-6, 10e-6], [15e-6, 15e-6], [12e-6, 12e-6], [16e-6, 16e-6]])
    pressure = np.array([[3e5, 0.0]] * 4)
    assert liquid_energy(volume, pressure, 5e5) == pytest.approx(5e5 * 9e-6)
    assert liquid_energy(volume[:1], pressure[:1], 5e5) == 0.0
    filled = liquid_energy(volume[:2], [[0.0, 0.0], [3e5, 0.0]], 5e5)
    emptied = liquid_energy(volume[:2], [[3e5, 0.0], [0.0, 0.0]], 5e5)
    assert (filled, emptied) == (pytest.approx(5e5 * 5e-6), 0.0)


def test_liquid_needs_volume_and_pressure_of_one_shape_fails():
    """Logs that do not belong together are refused."""
    with pytest.raises(InputError, match='shape'):
        liquid_energy(np.zeros((4, 2)), np.zeros((4, 3)), 5e5)


def test_air_can_do_more_than_its_volume_at_supply_pressure_by_expanding():
    """P_s V counts the push of the supply, the available energy the expansion too."""
    volume = 1e-3 * RT / (5e5 + AMBIENT)
    assert air_energy(1e-3, 5e5) == pytest.approx(5e5 * volume)
    assert available_energy(1e-3, 5e5) > air_energy(1e-3, 5e5)


def test_a_small_chamber_asks_for_short_steps_where_its_valve_opens_to_the_supply():
    """Below a tenth of a millilitre its rate, flow over volume, exceeds that of the manifold."""
    circuit = Circuit()

    def count(command, volume):
        return substeps(circuit.config, circuit.air, [command, 0.0], [volume, V[1]], CALM, 0.1)
    assert count(1.0, 1e-7) > 2 * count(0.0, 1e-7)
    assert count(1.0, 5e-8) == pytest.approx(2 * count(1.0, 1e-7), rel=0.01)


def test_a_relief_valve_asks_for_short_steps_only_where_it_opens():
    """Below its pressure it costs nothing; above, the steps follow its steep opening."""
    circuit = Circuit(chamber=ChamberConfig(relief_pressure=500e3, relief_band=1e3))

    def count(gauge):
        circuit.air.pressure[0] = AMBIENT + gauge
        return substeps(circuit.config, circuit.air, [0.0, 0.0], V, CALM, 5e-3)
    assert count(400e3) == count(0.0)
    assert count(510e3) > 2 * count(400e3)


@pytest.mark.parametrize(('bounds', 'words'), [
    ({}, 'expected a finite number$'), ({'above': 0.0}, 'finite number, above 0$'),
    ({'least': 1.0, 'most': 2.0}, 'finite number, at least 1, at most 2$')])
def test_a_wrong_value_is_told_what_was_expected(bounds, words):
    """Those bounds that there are, and no others."""
    owner = SimpleNamespace(step=math.nan)
    with pytest.raises(InputError, match=words):
        require(owner, 'step', **bounds)
