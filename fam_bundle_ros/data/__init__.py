# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Measured data: what was measured, in SI units, and nothing about models.

    data = read_measurement('data.csv')
    print(data, noise_floor(data))
"""

from fam_bundle_ros.data.bagfile import write_bag
from fam_bundle_ros.data.joined import join
from fam_bundle_ros.data.measurement import Measurement, Taken, write_csv
from fam_bundle_ros.data.noise import noise_floor, NoiseFloor
from fam_bundle_ros.data.protocol import duration, Protocol, read_protocol, save_protocol, segments
from fam_bundle_ros.data.reading import (
    Preview,
    preview,
    read_measurement,
    read_recordings,
    taken_words,
)
from fam_bundle_ros.data.recipe import load_recipe, Recipe, recipe_of, save_recipe

__all__ = ['duration', 'join', 'load_recipe', 'Measurement', 'noise_floor', 'NoiseFloor',
           'Preview', 'preview', 'Protocol', 'read_measurement', 'read_protocol',
           'read_recordings', 'Recipe', 'recipe_of', 'save_protocol', 'save_recipe', 'segments',
           'Taken', 'taken_words', 'write_bag', 'write_csv']
