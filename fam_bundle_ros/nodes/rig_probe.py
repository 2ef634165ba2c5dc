# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Opens the valves of a rig one at a time, at low pressure, and reports what is right and wrong.

First, with hardly any air: do pressures stay low while all valves are shut, and does any exhaust
fill. Then for each motor unit: which reading rises at which command, how fast, up to what, and
whether the unit empties when commands stop. A failure ends the check with all units vented.
"""

from collections.abc import Callable
from contextlib import closing

import numpy as np

from fam_bundle_ros.control.rig_fit import (
    apart_words,
    bands_apart_words,
    split_volume,
    ValveFit,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.pneumatics import ATMOSPHERE
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.process import ros_context, Spinner, StopSignals
from fam_bundle_ros.nodes.rig_hand import Channel, Hand, Session, Vented
from fam_bundle_ros.nodes.rig_unit import COME_UP, Probe, UnitProbe

#: Smallest supply at which motion stands out from friction and noise, Pa.
_LEAST = 40e3
#: A reading above the supply by more than this share plus this offset (Pa) is wrong.
_OVER, _OVER_MORE = 0.3, 10e3
#: Time for the valves to shut after `supply_enable`, s; share of the supply above which a pressure
#: is more than the air that entered before.
_SHUT, _OPEN = 0.15, 0.8
#: Readings older than this mean that the clocks disagree, s.
_AGREE = 0.1
#: Duration of the readings at rest, and lag of the spool beside the dead time (`PressurePid`), s.
_REST_TIME, _SPOOL = 0.6, 2e-3


def probe_rig(bundle: Bundle, supply: float, *, namespace: str = interface.NAMESPACE,
              tube_volume: float = 5e-6, domain: int | None = None,
              patience: float = 5.0, progress: Callable[[float, str], None] = (
                  lambda share, what: None)) -> Probe:
    """
    Open the valves of a rig; return what is right and wrong, and parameters for the controllers.

    Nobody may be near the rig. The supply must be low; no controller may run.

    Parameters
    ----------
    bundle : Bundle
        Its gas volumes convert pressure rates to a conductance.
    supply : float, Pa (gauge)
        Present setting of the regulator.
    namespace : str
    tube_volume : float, m^3
        Of each motor unit, from its dimensions; identified if the gas volumes differ.
    domain : int, optional
    patience : float, s
        Time-out for the topics of the rig.
    progress : callable
        Called with the share that is done, and the next step.

    Raises
    ------
    InputError
        When the supply is not low, a controller is running, the emergency stop is on, or the rig
        sends no pressure.
    """
    most = 0.6 * float(np.min(bundle.max_pressure))
    if not _LEAST <= supply <= most:
        raise InputError(f'supply is {supply / 1e3:g} kPa; expected a low one, '
                         f'{_LEAST / 1e3:g} to {most / 1e3:.0f} kPa')
    with ros_context(domain) as context:
        hand = Hand(context, namespace, bundle.n, bundle.length)
        with closing(Spinner(context, [hand])) as spinner, StopSignals() as signals:
            session = Session(hand, spinner, lambda: signals.received)
            result = Probe()
            try:
                _Work(session, result, bundle, supply, tube_volume, progress).do(patience)
            except Vented as why:
                result.say(False, 'vented', str(why))
                result.parameters = {}
            finally:
                session.let_go()
            return result


class _Work:
    """The steps, in order."""

    def __init__(self, session: Session, result: Probe, bundle: Bundle, supply: float,
                 tube_volume: float, progress: Callable[[float, str], None]):
        self._session, self._hand, self._result = session, session.hand, result
        self._bundle, self._supply = bundle, supply
        self._unit = UnitProbe(session, result, bundle, supply, tube_volume)
        self._tube, self._progress = tube_volume, progress
        #: Fitted valves by motor unit, from 0; only of units that passed.
        self._fits: dict[int, ValveFit] = {}
        self._units = range(bundle.n)

    def do(self, patience: float) -> None:
        """Take all steps; a fault of one motor unit does not end the tests of the others."""
        hand = self._hand
        if not self._session.wait(patience, lambda: all(c.rows for c in hand.pressure)):
            raise InputError('no pressures from the rig: see what check-rig says without --active')
        # Other publishers are discovered a little later than the pressures.
        self._session.wait(0.3)
        if others := hand.others():
            raise InputError(f"another node publishes {', '.join(others)}: end the controllers")
        if hand.stopped:
            raise InputError('the emergency stop is on: call e_stop_reset first')
        hand.begin()
        self._rest()
        sound = [i for i in self._units
                 if i not in self._unit.left_out and self._unit.exhaust_does_not_fill(i)]
        for i in sound:
            self._progress((i + 0.5) / (len(self._units) + 0.5), f'mu{i + 1}')
            if fit := self._unit.probe(i):
                self._fits[i] = fit
        if self._fits:
            self._progress(0.95, 'supply_enable')
            tight = min(self._fits, key=lambda unit: self._unit.loss[unit])
            self._unit.answers_silent_permission(tight, self._fits[tight])
        self._session.let_go()
        if len(self._fits) == len(self._units) and all(f.ok for f in self._result.findings):
            self._sum_up()

    # --- before any air ------------------------------------------------------------------------

    def _rest(self) -> None:
        """Take readings without air, then open the supply onto shut valves."""
        hand, wait = self._hand, self._session.wait
        self._progress(0.0, 'at rest')
        wait(0.3)
        channels = [*hand.pressure, hand.force, hand.strain, hand.supply]
        for channel in channels:
            channel.rows.clear()
        wait(_REST_TIME)
        for channel in channels:
            if channel.rows:
                channel.rest()
        most = (1.0 + _OVER) * self._supply
        hand.limit = most + _OVER_MORE
        # Twice the largest force of the model at this supply, for the error of the model.
        hand.most_force = 20.0 + 2.0 * float(self._bundle.blocked_force(
            [most] * len(self._units)))
        # The drivers exhaust until `supply_enable` is true: commanded to shut before, a reversed
        # valve is open to the supply for no longer than it takes to shut.
        hand.command = [0.0] * len(self._units)
        wait(_SHUT)
        hand.permit(True)
        wait(_SHUT)
        early = [channel.level(3) for channel in hand.pressure]
        wait(COME_UP)
        if hand.supply.rows:
            shown = hand.supply.level() + self._above_ambient(hand.supply)
            if abs(shown - self._supply) > 0.2 * self._supply + 5e3:
                hand.vent(f'supply/pressure shows {shown / 1e3:.1f} kPa; --supply says '
                          f'{self._supply / 1e3:.0f} kPa')
                wait(0.0)
        for i, channel in enumerate(hand.pressure):
            rise = self._unit.rise(channel)
            if channel.level() > min(early[i] + rise, _OPEN * self._supply):
                hand.vent(f'mu{i + 1}/pressure rises with all valves commanded to shut: a valve '
                          'is stuck open, or leaks')
                wait(0.0)
            elif early[i] > rise:
                self._result.say(False, f'mu{i + 1} valve', 'reversed: commanded to exhaust, it '
                                 'was open to the supply when that came')
                self._unit.left_out.add(i)

    def _above_ambient(self, channel: Channel) -> float:
        """Return the gauge pressure of a channel at rest, Pa; not 0 if a shut line holds air."""
        absolute = self._hand.pressure[0].zero > 0.5 * ATMOSPHERE
        return channel.zero - (ATMOSPHERE if absolute else 0.0)

    # --- parameters for the controllers --------------------------------------------------------

    def _sum_up(self) -> None:
        """Compute the parameters from the measurements."""
        hand, fits = self._hand, list(self._fits.values())
        tube, gas = self._tube, [self._unit.gas(i) for i in self._units]
        conductance = float(np.mean([fit.conductance for fit in fits]))
        how, names = ('as given; only its ratio to the conductance matters',
                      [f'mu{i + 1}' for i in self._units])
        if found := split_volume([fit.conductance for fit in fits], gas, tube):
            conductance, tube = found
            how = ('by motor units of different size; with it the conductance is '
                   f'{conductance:.3g} m^3/(s Pa)')
        elif apart := apart_words([fit.conductance for fit in fits], names):
            self._result.say(False, 'valves', apart)
        if apart := bands_apart_words([fit.dead_band for fit in fits], names):
            self._result.say(False, 'valves', apart)
        self._result.say(True, 'tube volume', f'{1e6 * tube:.1f} ml, {how}', note=not found)
        stamps = hand.pressure[0].since(0)[:, 1]
        rate = 1.0 / float(np.median(np.diff(stamps)))
        noise = max(channel.noise for channel in hand.pressure)
        gauge = hand.pressure[0].zero < 0.5 * ATMOSPHERE
        parameters = self._result.parameters
        if not gauge:
            parameters['ambient_pressure'] = round(float(np.mean(
                [channel.zero for channel in hand.pressure])), 0)
        parameters |= {
            'pressure_is_gauge': gauge, 'rate': round(rate, 1),
            'valve.conductance': float(f'{conductance:.3g}'),
            'valve.dead_band': round(float(np.mean([fit.dead_band for fit in fits])), 3),
            'tube_volume': float(f'{tube:.3g}'),
            'volume': float(f'{np.mean(gas) + tube:.3g}'),
            'transport_delay': round(max(max(fit.delay for fit in fits) - _SPOOL, 0.0), 4),
            # At least 100 Pa, for the resolution of an instrument without noise.
            'quiet_error': round(max(3.0 * noise, 100.0), 0)}
        if noise == 0.0:
            parameters['stuck_time'] = 0.0
        self._judge_age(rate)
        self._tune(rate)

    def _judge_age(self, rate: float) -> None:
        """Set the largest age of readings if three samples are not enough."""
        late = max((c.late for c in (*self._hand.pressure, self._hand.force, self._hand.strain)),
                   key=abs)
        if abs(late) <= 2.0 / rate:
            return
        agree = 0.0 < late < _AGREE
        self._result.parameters |= ({'max_latency': round(1.5 * late, 4)} if agree else
                                    {'clocks_synchronised': False})
        self._result.say(True, 'age of readings', f'up to {1e3 * late:.0f} ms when they come: '
                         + ('max_latency is half as much again' if agree else
                            'the clocks disagree, clocks_synchronised is false'), note=True)

    def _tune(self, rate: float) -> None:
        """Set dead time and gains: for the measured dead time, or one sample if that is longer."""
        from fam_bundle_ros.control.tuning import tune
        parameters = self._result.parameters
        delay = max(parameters['transport_delay'], 1.0 / rate)
        parameters['outer.delay'] = round(delay, 4)
        try:
            gains = tune(1.0 / rate, delay).gains
        except InputError as error:
            self._result.say(True, 'gains', f'as they were: {error}', note=True)
            return
        parameters |= {'gains.p': float(f'{gains.p:.3g}'), 'gains.i': float(f'{gains.i:.3g}'),
                       'gains.d': float(f'{gains.d:.3g}')}
        self._result.say(True, 'gains', f'p {gains.p:.3g}, i {gains.i:.3g}, d {gains.d:.3g} for '
                         f'{1e3 * delay:.1f} ms from reading to command')
