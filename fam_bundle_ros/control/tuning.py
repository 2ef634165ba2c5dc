# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Gains of the pressure loop from the linearised chamber, with their margins.

The controller demands a pressure rate (see `pid`), so its plant is an integrator behind spool and
dead time, times the gain of the true chamber over the scheduled one. python-control (the extra
``control``) gives the margins at every operating point.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
import math
from typing import Any

from fam_bundle_ros.control.pid import PidConfig, PidGains
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import pressure_rate


@dataclass(frozen=True)
class OperatingPoint:
    """
    Margins of the loop at one state of the chamber.

    Attributes
    ----------
    volume : float, m^3
    pressure : float, Pa (gauge)
    filling : bool
        Fill or exhaust side of the valve.
    rate_per_opening : float, Pa/s
        dp/dt with the valve fully open.
    loop_gain : float
        Gain of the true chamber over the controller's model of it: 1 with scheduling.
    gain_margin_db, phase_margin_deg, crossover_hz : float
    """

    volume: float
    pressure: float
    filling: bool
    rate_per_opening: float
    loop_gain: float
    gain_margin_db: float
    phase_margin_deg: float
    crossover_hz: float


@dataclass(frozen=True)
class TuneResult:
    """
    Gains and their margins; see `tune`.

    Attributes
    ----------
    gains : PidGains
    sample_period, dead_time : float, s
        Dead time is transport delay plus half a sample.
    spool_frequency : float, Hz
    points : tuple of OperatingPoint
    """

    gains: PidGains
    sample_period: float
    dead_time: float
    spool_frequency: float
    points: tuple[OperatingPoint, ...]

    @property
    def gain_margin_db(self) -> float:
        """Smallest gain margin of all operating points."""
        return min(point.gain_margin_db for point in self.points)

    @property
    def phase_margin_deg(self) -> float:
        """Smallest phase margin of all operating points."""
        return min(point.phase_margin_deg for point in self.points)

    @property
    def crossover_hz(self) -> tuple[float, float]:
        """Lowest and highest crossover frequency."""
        values = [point.crossover_hz for point in self.points]
        return min(values), max(values)

    def rows(self) -> list[dict[str, Any]]:
        """Return one dict per operating point, for tables and JSON."""
        return [asdict(point) for point in self.points]

    def __str__(self) -> str:
        gains = self.gains
        low, high = self.crossover_hz
        return (f'p {gains.p:.4g} 1/s, i {gains.i:.4g} 1/s^2, d {gains.d:.3g}: gain margin '
                f'{self.gain_margin_db:.1f} dB, phase margin {self.phase_margin_deg:.0f} deg at '
                f'least, crossover {low:.1f}..{high:.1f} Hz over {len(self.points)} operating '
                f'points')


def tune(sample_period: float = 5e-3, transport_delay: float = 5e-3,
         spool_frequency: float = 125.0, spool_damping: float = 0.7,
         gain_margin_db: float = 8.0, phase_margin_deg: float = 55.0, derivative: float = 0.02,
         config: PidConfig = PidConfig(),
         volumes: Sequence[float] = (11e-6, 16e-6, 24e-6),
         pressures: Sequence[float] = (0.0, 100e3, 200e3, 300e3, 400e3),
         scheduled: bool = True) -> TuneResult:
    """
    Return the fastest gains that keep both margins at every operating point.

    Parameters
    ----------
    sample_period, transport_delay : float, s
        Sample time of the pressure loop; delay from reading to command at the valve.
    spool_frequency : float, Hz
    spool_damping : float
    gain_margin_db, phase_margin_deg : float
        Least margins at every operating point.
    derivative : float
        Gain d on the measured pressure rate.
    config : PidConfig
        Valve, supply and filter.
    volumes : sequence of float, m^3
    pressures : sequence of float, Pa (gauge)
    scheduled : bool
        False for a controller that does not know the volume and uses ``config.volume``.

    Raises
    ------
    InputError
        When no gain keeps the margins, or python-control is not installed.
    """
    ct = python_control()
    if not (sample_period > 0.0 and transport_delay >= 0.0 and spool_frequency > 0.0):
        raise InputError('tune needs a sample period and a spool frequency above 0 and a '
                         f'transport delay of 0 or more; got {sample_period}, '
                         f'{spool_frequency}, {transport_delay}')
    dead_time = transport_delay + 0.5 * sample_period
    states = [(v, p, fill) for v in volumes for p in pressures for fill in (True, False)
              if fill or p > 20e3]
    ratios = {(v, p, fill): _loop_gain(config, v, p, fill, scheduled) for v, p, fill in states}
    extremes = sorted({ratios[state][1] for state in states})
    open_loop = _actuator(ct, dead_time, spool_frequency, spool_damping)

    def margins(p, gain):
        return _margins(ct, open_loop, PidGains(p, p * p / 8.0, derivative), config, gain)

    def kept(p):
        found = [margins(p, gain) for gain in {extremes[0], extremes[-1]}]
        return all(gm >= gain_margin_db and pm >= phase_margin_deg for gm, pm, _ in found)

    low, high = 1.0, 2000.0
    if not kept(low):
        raise InputError(f'no gain keeps {gain_margin_db:g} dB and {phase_margin_deg:g} deg '
                         f'with {1e3 * dead_time:g} ms of dead time')
    while high / low > 1.005:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if kept(middle) else (low, middle)
    gains = PidGains(low, low * low / 8.0, derivative)
    by_gain = {gain: margins(low, gain) for gain in extremes}
    points = tuple(OperatingPoint(v, p, fill, *ratios[v, p, fill], *by_gain[ratios[v, p, fill][1]])
                   for v, p, fill in states)
    return TuneResult(gains, sample_period, dead_time, spool_frequency, points)


def python_control() -> Any:
    """Return the module `control`; InputError where it is not installed."""
    try:
        import control
    except ImportError:
        raise InputError('tuning needs python-control: pip install control') from None
    return control


def _actuator(ct, dead_time, spool_frequency, spool_damping):
    """Return spool and dead time: wanted rate in, true rate out."""
    natural = 2.0 * math.pi * spool_frequency
    spool = ct.tf([natural ** 2], [1.0, 2.0 * spool_damping * natural, natural ** 2])
    return spool * ct.tf(*ct.pade(dead_time, 3))


def _loop(ct, open_loop, gains, config, gain):
    """Return the loop, cut at the pressure: PID on an integrator."""
    pi_part = ct.tf([gains.p, gains.i], [1.0, 0.0])
    filtered_rate = ct.tf([gains.d, 0.0], [config.filter_time, 1.0])
    return gain * open_loop * ct.tf([1.0], [1.0, 0.0]) * (pi_part + filtered_rate)


def _margins(ct, open_loop, gains, config, gain):
    """Return gain margin (dB), phase margin (deg), crossover (Hz)."""
    gain_margin, phase_margin, _, crossover = ct.margin(
        _loop(ct, open_loop, gains, config, gain))
    return (20.0 * math.log10(gain_margin), float(phase_margin),
            float(crossover) / (2.0 * math.pi))


def _loop_gain(config, volume, pressure, fill, scheduled):
    """Return dp/dt per opening, and the true chamber's gain over the controller's model."""
    absolute, source = pressure + config.ambient, config.supply + config.ambient
    flow = config.valve.flow(1.0 if fill else -1.0, absolute, source, config.ambient)
    rate = pressure_rate(absolute, volume, 0.0, flow)
    return rate, 1.0 if scheduled else config.volume / volume
