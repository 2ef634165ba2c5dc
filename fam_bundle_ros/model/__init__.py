# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Models of muscles and bundles: NumPy only, SI units, gauge pressures."""

from fam_bundle_ros.model import catalogue
from fam_bundle_ros.model.bundle import Bundle
from fam_bundle_ros.model.effect import Effect
from fam_bundle_ros.model.geometry import Geometry
from fam_bundle_ros.model.laws.base import Law, law, Parameter, Place
from fam_bundle_ros.model.modelfile import dumps_model, load_model, loads_model, save_model
from fam_bundle_ros.model.parts import Motion, MotorUnit, Overlap

__all__ = ['Bundle', 'catalogue', 'dumps_model', 'Effect', 'Geometry', 'law', 'Law', 'load_model',
           'loads_model', 'Motion', 'MotorUnit', 'Overlap', 'Parameter', 'Place', 'save_model']
