# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Measured data: what was measured, in SI units, and nothing about models.

    data = read_measurement('data.csv')
    print(data, noise_floor(data))
"""

from fam_bundle_ros.data.bagfile import write_bag
from fam_bundle_ros.data.measurement import Measurement, write_csv
from fam_bundle_ros.data.noise import noise_floor, NoiseFloor
from fam_bundle_ros.data.reading import as_measurement, read_measurement

__all__ = ['as_measurement', 'Measurement', 'noise_floor', 'NoiseFloor', 'read_measurement',
           'write_bag', 'write_csv']
