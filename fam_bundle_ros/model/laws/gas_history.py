# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Effects of past pressure: creep after a change, hysteresis between filling and venting."""

from fam_bundle_ros.model.laws.base import law, Parameter
from fam_bundle_ros.model.vocabulary import dahl, lag, play

#: Half width of the play (dead zone) of the pressure, Pa.
_NOISE = 100.0
_BUILD_UP = Parameter(20.0, 'kPa', 1.0, 400.0, 'change of pressure over which it builds up')


@law('pressure', family='pressure_creep', leaves=('pressure_rate', 'decay'),
     memory=('lagged', 'last'), off={'share': 0.0}, look=('teal', 'dot'),
     summary='part of a change of pressure acts with a lag: creep at a fixed length',
     source='derived: one Kelvin-Voigt element in the braid',
     signature='after each change of pressure the force creeps, at a fixed length',
     share=Parameter(0.05, '1', 0.0, 0.5, 'share of the pressure that acts with a lag'),
     time_constant=Parameter(5.0, 's', 0.2, 300.0, 'time constant of the creep'))
def pressure_creep(pressure, start, dt, lagged, last, share, time_constant):
    """P -> P - s (P - p), tau dp/dt = P - p."""
    slow = lag(lagged, last, pressure, time_constant, start, dt)
    return share * (slow - pressure), slow, pressure


@law('pressure', family='pressure_hysteresis', leaves=('friction', 'decay'),
     memory=('centre',), off={'half_width': 0.0}, look=('teal', 'dashdot'),
     summary='dry friction in the pressure: filling and venting differ',
     source='Hunt 2017 (hysteresis of Festo muscles in the pressure); play operator',
     signature='at a fixed length the force is lower while filling than while venting',
     half_width=Parameter(5.0, 'kPa', 0.0, 60.0, 'half the difference of filling and venting'))
def pressure_hysteresis(pressure, start, centre, half_width):
    """P -> p, the output of a play operator of half width w, p in [P - w, P + w]."""
    felt = play(centre, pressure, half_width, start)
    return felt - pressure, felt


@law('pressure', family='pressure_hysteresis', leaves=('friction', 'decay'),
     variant_of='pressure_hysteresis', memory=('centre', 'built_up'),
     off={'half_width': 0.0}, look=('teal', 'longdash'),
     summary='dry friction in the pressure that builds up gradually after a reversal',
     source='Dahl 1968 solid friction model, first order, in the pressure',
     signature='at a fixed length the force is lower while filling than while venting, with a '
               'gradual transition after each reversal',
     half_width=Parameter(5.0, 'kPa', 0.0, 60.0, 'half the difference of filling and venting'),
     width=_BUILD_UP)
def pressure_dahl(pressure, start, centre, built_up, half_width, width):
    """
    P -> P - w z, dz/dP = (1 - z sgn(dP))/d.

    The pressure in dz/dP first passes a play of half width 0.1 kPa, against noise.
    """
    built, path = dahl(centre, built_up, pressure, _NOISE, width, start)
    return -half_width * built, path, built


@law('pressure', family='pressure_hysteresis', leaves=('friction', 'decay'),
     variant_of='pressure_hysteresis', memory=('centre', 'built_up'),
     off={'share': 0.0}, look=('teal', 'longdashdot'),
     summary='dry friction in the pressure in proportion to the pressure between threads',
     source='Tondu and Lopez 2000 (friction of threads in proportion to the pressure between '
            'them); Dahl 1968, first order, in the pressure',
     signature='at a fixed length the force is lower while filling than while venting, and the '
               'difference grows with pressure',
     share=Parameter(0.02, '1', 0.0, 0.3, 'half the relative difference of filling and venting'),
     width=_BUILD_UP)
def pressure_friction(pressure, start, centre, built_up, share, width):
    """
    P -> P (1 - s z), dz/dP = (1 - z sgn(dP))/d.

    The pressure in dz/dP first passes a play of half width 0.1 kPa, against noise.
    """
    built, path = dahl(centre, built_up, pressure, _NOISE, width, start)
    return -share * built * pressure, path, built
