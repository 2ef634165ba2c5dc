# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Discovery: which physical effect is a model missing, judged on measured data.

    data = read_measurement('data.csv')
    print(compare(model, data))
    result = diagnose(model, data)
    print(result)
    result.recommended.save('better.yaml')
"""

from fam_bundle_ros.data import (
    Measurement,
    noise_floor,
    NoiseFloor,
    read_measurement,
    write_bag,
    write_csv,
)
from fam_bundle_ros.discovery.add import add_effect, Added, Ladder, ladder, orders
from fam_bundle_ros.discovery.compare import compare, Comparison
from fam_bundle_ros.discovery.diagnose import diagnose
from fam_bundle_ros.discovery.locate import locate, Region
from fam_bundle_ros.discovery.result import Candidate, Diagnosis
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.discovery.specimen_table import read_specimens, Specimen
from fam_bundle_ros.discovery.specimens import diagnose_specimens, Together

__all__ = ['add_effect', 'Added', 'Candidate', 'Choices', 'compare', 'Comparison', 'diagnose',
           'diagnose_specimens', 'Diagnosis', 'ladder', 'Ladder', 'locate', 'Measurement',
           'noise_floor', 'NoiseFloor', 'orders', 'read_measurement', 'read_specimens', 'Region',
           'Specimen', 'Together', 'write_bag', 'write_csv']
