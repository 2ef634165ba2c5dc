# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Discovery: which physical effect is a model missing, judged on measured data.

    data = read_measurement('data.csv')
    print(compare(model, data))
"""

from fam_bundle_ros.discovery.compare import compare, Comparison
from fam_bundle_ros.discovery.locate import locate, Region
from fam_bundle_ros.discovery.measurement import Measurement, read_measurement, write_csv
from fam_bundle_ros.discovery.noise import noise_floor, NoiseFloor

__all__ = ['compare', 'Comparison', 'locate', 'Measurement', 'noise_floor', 'NoiseFloor',
           'read_measurement', 'Region', 'write_csv']
