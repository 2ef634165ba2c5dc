# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The record of a plant of the benchmark, from which `diagnose` makes a model."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.benchmarks.plant_record import record
from fam_bundle_ros.benchmarks.plants import model_of, PLANTS


def test_a_minute_of_every_unit_at_its_pressures():
    """Sweeps, fast ones too, are isobars within 5 % of the largest pressure; ramps fill all."""
    data = record('everything', 2)
    largest = model_of('everything', 2).max_pressure
    assert 50.0 < np.ptp(data.time) < 60.0
    filled = []
    for trial in np.unique(data.trial):
        own = data.trial == trial
        if np.ptp(data.strain[own]) > 0.1:
            off = data.pressure[own] - np.median(data.pressure[own], axis=0)
            assert np.abs(off).max() < 0.05 * largest[0]
        else:
            assert (data.pressure[own].min(axis=0) < 0.01 * largest).all()
        filled.append(data.pressure[own].max(axis=0) / largest)
    assert np.median(filled, axis=0)[0] > 0.95
    assert np.sum(np.min(filled, axis=1) > 0.95) == 5


def test_a_rig_that_trips_makes_no_record(monkeypatch):
    """After the trip all units are vented, and the record would be that of an empty bundle."""
    kind = PLANTS['snap']
    monkeypatch.setitem(PLANTS, 'snap', replace(kind, rig=replace(kind.rig, trip_pressure=250e3)))
    with pytest.raises(RuntimeError, match='snap: mu1 at .*above the trip of 250 kPa'):
        record('snap', 2)
