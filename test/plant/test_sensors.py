# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the instruments show."""

import math

import numpy as np
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant import Readings, SensorConfig
from fam_bundle_ros.plant.faults import fault_record, Faults
from fam_bundle_ros.plant.sensors import (
    Draws,
    read_sensors,
    SensorRecord,
    SensorState,
)

LENGTH = 0.127
DT = 5e-3


class Instruments:
    """Instruments of a rig of two motor units at 80 N, 2 and 1 bar."""

    def __init__(self, config, seed=1):
        self.record = SensorRecord.of(config, [1.0] * 5, [0.0] * 5, [0.0] * 5, [0.0] * 5)
        self.state = SensorState.fresh(5)
        self.draws = Draws(seed, 5)

    def read(self, k, strain, faults):
        """Return the k-th sample."""
        read_sensors(self.record, self.state, [80.0, strain, 5e5, 2e5, 1e5], k * DT,
                     fault_record(faults, 0.0, 2), *self.draws.row())
        force, shown, supply, *pressure = self.state.shown
        return Readings(k * DT, force, shown, shown * LENGTH, self.state.strain_rate,
                        np.array(pressure), supply)


def read(config, count=1, seed=1, faults=None, strain=lambda k: 0.1):
    """Return a list of readings."""
    instruments = Instruments(config, seed)
    return [instruments.read(k, strain(k), faults or Faults()) for k in range(count)]


def column(readings, name):
    """Return one channel of many readings."""
    return np.array([getattr(r, name) for r in readings])


def test_noise_has_the_stated_standard_deviation_and_no_bias():
    """Force 0.9 N, pressure 0.35 kPa, strain 5e-5, white: over 6000 samples within 4 %."""
    readings = read(SensorConfig(), 6000)
    for name, sd, mean in (('force', 0.9, 80.0), ('strain', 5e-5, 0.1), ('supply', 350.0, 5e5)):
        shown = column(readings, name)
        assert np.std(shown) == pytest.approx(sd, rel=0.04)
        assert np.mean(shown) == pytest.approx(mean, abs=5.0 * sd / math.sqrt(6000))
    pressure = column(readings, 'pressure')
    assert np.std(pressure, axis=0) == pytest.approx(350.0, rel=0.04)
    assert abs(np.corrcoef(pressure.T)[0, 1]) < 0.05


def test_same_seed_gives_the_same_readings_and_another_seed_others():
    """Readings are a function of seed and truth, to the last bit."""
    one, same, other = (column(read(SensorConfig(), 3000, seed=s), 'force') for s in (4, 4, 5))
    assert one.tobytes() == same.tobytes()
    assert one.tobytes() != other.tobytes()


def test_ideal_instruments_show_the_truth():
    """Without noise and quantisation the readings are the truth."""
    shown = read(SensorConfig.ideal())[0]
    assert (shown.force, shown.strain, shown.supply) == (80.0, 0.1, 5e5)
    assert shown.pressure.tolist() == [2e5, 1e5]
    assert shown.contraction == pytest.approx(0.0127)


def test_bias_shifts_and_resolution_rounds():
    """A bias adds, and readings are multiples of the resolution."""
    config = SensorConfig(force_bias=1.5, force_noise=0.3, force_resolution=0.25)
    force = column(read(config, 2000), 'force')
    assert np.mean(force) == pytest.approx(81.5, abs=0.05)
    assert np.all(force % 0.25 == 0.0)


def test_noise_factor_scales_the_same_noise():
    """Doubled noise is the same random numbers twice as large."""
    config = SensorConfig(force_resolution=0.0)
    once = column(read(config, 500), 'force') - 80.0
    twice = column(read(config, 500, faults=Faults(noise_factor=2.0)), 'force') - 80.0
    assert twice == pytest.approx(2.0 * once, abs=1e-9)


def test_lost_channel_is_nan_and_leaves_the_others_as_they_were():
    """A dropout blanks its channel alone; the noise of the others does not change."""
    whole = read(SensorConfig(), 50)
    lost = read(SensorConfig(), 50, faults=Faults(dropout={'force', 'mu2/pressure'}))
    assert np.all(np.isnan(column(lost, 'force')))
    assert np.all(np.isnan(column(lost, 'pressure')[:, 1]))
    assert np.array_equal(column(lost, 'pressure')[:, 0], column(whole, 'pressure')[:, 0])
    assert np.array_equal(column(lost, 'strain_rate'), column(whole, 'strain_rate'))


def test_instrument_that_holds_repeats_its_last_reading():
    """With on_dropout 'hold' a lost sample shows the one before."""
    force = column(read(SensorConfig(dropout=0.5, on_dropout='hold'), 400), 'force')
    repeated = np.mean(np.diff(force[20:]) == 0.0)
    assert 0.4 < repeated < 0.6
    assert not np.any(np.isnan(force[20:]))


def test_random_dropout_comes_as_often_as_stated():
    """One sample in five is lost at a probability of 0.2."""
    force = column(read(SensorConfig(dropout=0.2), 5000), 'force')
    assert np.mean(np.isnan(force)) == pytest.approx(0.2, abs=0.02)


def test_rate_follows_a_ramp_with_the_time_constant_of_its_filter():
    """The rate reaches 1 - 1/e of a ramp's slope after 1/(2 pi f)."""
    readings = read(SensorConfig.ideal(), 100, strain=lambda k: 0.05 + 0.2 * k * DT)
    rate = column(readings, 'strain_rate')
    expected = 0.2 * -np.expm1(-2.0 * np.pi * 20.0 * DT * np.arange(100))
    assert rate == pytest.approx(expected, abs=1e-9)


def test_rate_starts_afresh_after_a_lost_strain():
    """A lost strain gives no rate, and the first reading after it no jump."""
    instruments = Instruments(SensorConfig.ideal())
    out = Faults(dropout={'strain'})
    rates = [instruments.read(k, 0.02 * k if k < 5 else 0.3, out if k == 5 else Faults())
             .strain_rate for k in range(8)]
    assert rates[4] > 1.0
    assert math.isnan(rates[5])
    assert rates[6:] == [0.0, 0.0]


@pytest.mark.parametrize(('values', 'word'), [
    ({'force_noise': -1.0}, 'force_noise'), ({'dropout': 1.5}, 'dropout'),
    ({'rate_cutoff': 0.0}, 'rate_cutoff'), ({'on_dropout': 'zero'}, 'on_dropout'),
    ({'strain_bias': math.nan}, 'strain_bias')])
def test_impossible_sensor_fails(values, word):
    """A sensor that cannot be is refused with the name of what is wrong."""
    with pytest.raises(InputError, match=word):
        SensorConfig(**values)


def test_dropout_of_an_unknown_channel_fails():
    """The error lists the channels that there are."""
    with pytest.raises(InputError, match='mu2/pressure'):
        read(SensorConfig(), faults=Faults(dropout={'mu3/pressure'}))
