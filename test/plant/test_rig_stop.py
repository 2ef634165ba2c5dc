# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What stops a rig and vents it, and when it may go on."""

import numpy as np

from fam_bundle_ros.plant import SupplyConfig

from .rigs import drive, make


def test_emergency_stop_vents_and_stays(bundle):
    """After e_stop all chambers fall below 5 kPa and no command fills them, until the reset."""
    rig = make(bundle)
    drive(rig, [300e3, 200e3], 0.5)
    rig.e_stop('button')
    rig.step([1.0, 1.0], 0.15)
    assert np.all(rig.truth.pressure < 5e3)
    rig.step([1.0, 1.0], 1.0)
    assert np.all(rig.truth.pressure < 5e3)
    assert rig.e_stopped == 'button'
    assert rig.e_stop_reset()
    rig.step([0.1, 0.1], 0.1)
    assert np.all(rig.truth.pressure > 50e3)
    assert rig.e_stopped == ''


def test_a_supply_that_was_shut_stays_shut_while_the_rig_is_stopped(bundle):
    """Shut, it is dumped and no valve fills; it can be opened after the reset of a stop only."""
    rig = make(bundle)
    rig.open_supply(False)
    rig.step([1.0, 1.0], 0.5)
    assert np.all(rig.truth.pressure < 5e3)
    rig.e_stop()
    rig.open_supply(True)
    rig.step([1.0, 1.0], 0.5)
    assert max(rig.truth.supply, *rig.truth.pressure) < 5e3
    assert rig.e_stop_reset()
    rig.open_supply(True)
    rig.step([0.1, 0.1], 0.1)
    assert np.all(rig.truth.pressure > 50e3)


def test_emergency_stop_vents_through_a_valve_that_is_stuck_open(bundle):
    """A valve stuck on fill vents backwards, through the manifold's dump valve."""
    rig = make(bundle)
    drive(rig, [300e3, 0.0], 0.5)
    rig.faults.stuck_valve[0] = 0.5
    rig.e_stop()
    rig.step([0.0, 0.0], 0.5)
    assert np.all(rig.truth.pressure < 5e3)


def test_overpressure_trips_the_rig(bundle):
    """A chamber above 450 kPa stops the rig, with the motor unit named, and never bursts it."""
    rig = make(bundle, supply=SupplyConfig(pressure=700e3))
    highest = max(max(rig.step([0.0, 1.0], 1e-3).pressure) for _ in range(200))
    assert rig.e_stopped.startswith('mu2 at 4')
    assert highest < 500e3
    assert rig.truth.pressure[1] < 5e3
    assert rig.truth.supply < 5e3


def test_reset_of_the_stop_is_refused_above_the_trip_pressure(bundle):
    """While a chamber is still above the trip pressure the rig stays stopped."""
    rig = make(bundle, supply=SupplyConfig(pressure=700e3))
    while not rig.e_stopped:
        rig.step([1.0, 0.0], 1e-3)
    assert not rig.e_stop_reset()
    assert rig.e_stopped
