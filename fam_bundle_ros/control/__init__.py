# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Recruitment, allocation and pressure control of a bundle. No ROS here."""

from fam_bundle_ros.control.adaptation import AdaptationConfig
from fam_bundle_ros.control.allocation import allocate, Allocation, Allocator, Curves, Instant
from fam_bundle_ros.control.controller import ControllerConfig, RecruitmentController
from fam_bundle_ros.control.outer import LoadModel, OuterConfig
from fam_bundle_ros.control.pid import PidConfig, PidDiagnostics, PidGains, PressurePid
from fam_bundle_ros.control.recruitment import RecruitmentMachine, SwitchingConfig
from fam_bundle_ros.control.signals import Command, Measurement, Reference
from fam_bundle_ros.control.switching import Margins
from fam_bundle_ros.control.tuning import tune, TuneResult

__all__ = [
    'AdaptationConfig', 'allocate', 'Allocation', 'Allocator', 'Command', 'ControllerConfig',
    'Curves', 'Instant',
    'LoadModel', 'Margins', 'Measurement', 'OuterConfig', 'PidConfig', 'PidDiagnostics',
    'PidGains', 'PressurePid', 'RecruitmentController', 'RecruitmentMachine', 'Reference',
    'SwitchingConfig', 'tune', 'TuneResult',
]
