# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Pressure control of one motor unit: setpoint and reading in, valve command out.

PID demands a pressure rate in Pa/s; the chamber model converts the rate into a flow and the valve
model the flow into a command. So gains do not depend on volume, pressure or supply (gain
scheduling), and feed-forward compensates for moving setpoints and moving muscles. A setpoint of 0
opens to exhaust, whatever the sensor shows. Independent of recruitment and ROS. Pressures are
gauge.
"""

from dataclasses import dataclass, field
import math

from fam_bundle_ros.control.pressure_loop import (
    ANTI_WINDUP,
    forget,
    PidDiagnostics,
    PidSettings,
    PidState,
    pressure_step,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import ATMOSPHERE, ValveFlow

#: s: lag from command to flow without the dead time: 2 zeta/omega of a spool of 125 Hz and 0.7.
_SPOOL_LAG = 1.8e-3


@dataclass(frozen=True)
class PidGains:
    """
    Gains from pressure error to pressure rate.

    The defaults here and in `PidConfig` are the only ones: the result of `tune` with its defaults,
    a loop over topics at 200 Hz whose readings are one period old.

    Parameters
    ----------
    p : float, 1/s
    i : float, 1/s^2
    d : float, dimensionless
        Acts on the measured pressure rate, never on the setpoint.
    """

    p: float = 54.0
    i: float = 365.0
    d: float = 0.02

    def __post_init__(self):
        """Check the ranges of the gains."""
        for name in ('p', 'i', 'd'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f'gain {name} is {value}; expected a finite number, 0 or more')


@dataclass(frozen=True)
class PidConfig:
    """
    Valve, chamber and limits of a pressure loop.

    Parameters
    ----------
    valve : ValveFlow
    anti_windup : str
        ``none``, ``back_calculation`` (the integral tracks the saturated command) or
        ``conditional_integration`` (it stops while it would increase the saturation). Except with
        ``none`` it is also limited to a small share of the valve's rate, in case the pressure
        does not respond.
    tracking_time : float, s
        Time constant of the back calculation.
    volume : float, m^3
        Gas volume with tubing, unless given to `PressurePid.update`.
    supply : float, Pa (gauge)
        Unless given to `PressurePid.update`.
    ambient : float, Pa (absolute)
    setpoint_rate : float, Pa/s
        Largest rate of the followed setpoint, in addition to the valve's own limit.
    setpoint_bandwidth : float, 1/s
        Bandwidth of the followed setpoint.
    transport_delay : float, s
        Dead time from a reading through the valve to the next reading, as in `tune`.
    flow_lag : float, s, optional
        Lag from command to reading: spool and dead time (plus one sample); by default
        ``transport_delay`` plus 1.8 ms, a spool of 125 Hz. Feedback uses the pressure predicted
        over this lag (Smith predictor).
    quiet_error : float, Pa
        Half-width of the dead zone of the error: no air is used for sensor noise, and the valve
        stays shut at rest. About three standard deviations of the filtered reading.
    filter_time : float, s
        Low-pass filter of the reading, before the derivative and the dead zone.
    feed_forward : bool
    dead_band_compensation : bool
        Jump over the dead band: that of ``valve`` with the learnt correction (`valve_learning`).
    ceiling : float, Pa (gauge)
    reach : float, s
        The valve opening is limited so that a command that is held for ``reach`` fills to at most
        ``ceiling``, in case the loop stalls. 0 for no such limit.
    """

    valve: ValveFlow = field(default_factory=ValveFlow)
    anti_windup: str = 'back_calculation'
    tracking_time: float = 0.02
    volume: float = 20e-6
    supply: float = 600e3
    ambient: float = ATMOSPHERE
    setpoint_rate: float = 50e6
    setpoint_bandwidth: float = 500.0
    transport_delay: float = 5e-3
    flow_lag: float | None = None
    quiet_error: float = 800.0
    filter_time: float = 4e-3
    feed_forward: bool = True
    dead_band_compensation: bool = True
    ceiling: float = 1.5e6
    reach: float = 0.0

    def __post_init__(self):
        """Check the ranges of the settings."""
        if self.anti_windup not in ANTI_WINDUP:
            raise InputError(f"anti_windup is '{self.anti_windup}'; expected one of "
                             f"{', '.join(ANTI_WINDUP)}")
        for name in ('tracking_time', 'volume', 'supply', 'ambient', 'setpoint_rate',
                     'setpoint_bandwidth'):
            if not getattr(self, name) > 0.0:
                raise InputError(f'{name} is {getattr(self, name)}; expected more than 0')
        for name in ('transport_delay', 'quiet_error', 'filter_time', 'flow_lag', 'reach'):
            value = getattr(self, name)
            if value is not None and not value >= 0.0:
                raise InputError(f'{name} is {value}; expected 0 or more')


def pid_settings(gains: PidGains, config: PidConfig) -> PidSettings:
    """Return the record that `pressure_step` takes."""
    valve = config.valve
    lag = config.flow_lag
    values = {
        **vars(gains), **vars(config), 'anti_windup': ANTI_WINDUP.index(config.anti_windup),
        'valve': ValveFlow(valve.conductance, valve.critical_ratio, valve.dead_band),
        'flow_lag': _SPOOL_LAG + config.transport_delay if lag is None else lag}
    del values['transport_delay']
    return PidSettings(**values)


class PressurePid:
    """
    PID with feed-forward for the pressure of one motor unit.

    Parameters
    ----------
    gains : PidGains
        See `fam_bundle_ros.control.tuning.tune`.
    config : PidConfig

    Examples
    --------
    >>> pid = PressurePid()
    >>> pid.update(setpoint=100e3, pressure=100e3, dt=2e-3)
    0.0
    >>> pid.update(setpoint=300e3, pressure=100e3, dt=2e-3) > 0.5
    True
    """

    def __init__(self, gains: PidGains = PidGains(), config: PidConfig = PidConfig()):
        self._gains, self._config = gains, config
        #: The records that `pressure_step` takes.
        self.settings = pid_settings(gains, config)
        self.state = PidState()

    @property
    def gains(self) -> PidGains:
        """Gains; they may change while the loop runs."""
        return self._gains

    @gains.setter
    def gains(self, gains: PidGains) -> None:
        self._gains = gains
        self.settings = pid_settings(gains, self._config)

    @property
    def config(self) -> PidConfig:
        """Settings; they may change while the loop runs."""
        return self._config

    @config.setter
    def config(self, config: PidConfig) -> None:
        self._config = config
        self.settings = pid_settings(self._gains, config)

    @property
    def diagnostics(self) -> PidDiagnostics:
        """Return the diagnostics of the last update."""
        return PidDiagnostics(**vars(self.state.shown))

    def reset(self, command: float = 0.0) -> None:
        """
        Reset, and continue from a valve command (bumpless transfer).

        The followed setpoint starts at the next pressure reading.
        """
        forget(self.state, command)

    def update(self, setpoint: float, pressure: float, dt: float, supply: float | None = None,
               volume: float | None = None, volume_rate: float = 0.0) -> float:
        """
        Return the valve command, -1 exhaust .. 0 closed .. 1 fill.

        Parameters
        ----------
        setpoint, pressure : float, Pa (gauge)
            A setpoint of 0 or less ends in full exhaust.
        dt : float, s
            Time since the last update; if not positive (clock reset) the command is repeated.
        supply : float, Pa (gauge), optional
        volume : float, m^3, optional
            Present gas volume of the motor unit with its tubing.
        volume_rate : float, m^3/s

        Notes
        -----
        A setpoint or reading that is not finite, or a volume of 0, shuts the valve; whether to
        hold or to vent is the caller's decision.
        """
        return pressure_step(self.settings, self.state, setpoint, pressure, dt,
                             self._config.supply if supply is None else supply,
                             self._config.volume if volume is None else volume, volume_rate)
