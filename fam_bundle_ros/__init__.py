# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Variable-recruitment control of fluidic artificial muscle bundles on ROS 2.

The names used in notebooks are available here; each is imported at its first use.
"""

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from fam_bundle_ros.control import ControllerConfig
    from fam_bundle_ros.data import read_measurement
    from fam_bundle_ros.discovery import add_effect, diagnose_specimens, ladder
    from fam_bundle_ros.discovery.compare import compare
    from fam_bundle_ros.discovery.diagnose import diagnose
    from fam_bundle_ros.model import Bundle, load_model, save_model
    from fam_bundle_ros.plant import Dynamometer, MassSpring
    from fam_bundle_ros.simulation import ClosedLoop, Trajectory

__version__ = '0.2.0'
__all__ = ['add_effect', 'Bundle', 'ClosedLoop', 'compare', 'ControllerConfig', 'diagnose',
           'diagnose_specimens', 'Dynamometer', 'ladder', 'load_model', 'MassSpring',
           'read_measurement', 'save_model', 'Trajectory']

_FROM = {'control': ('ControllerConfig',), 'data': ('read_measurement',),
         'discovery': ('add_effect', 'compare', 'diagnose', 'diagnose_specimens', 'ladder'),
         'model': ('Bundle', 'load_model', 'save_model'), 'plant': ('Dynamometer', 'MassSpring'),
         'simulation': ('ClosedLoop', 'Trajectory')}


def __getattr__(name: str) -> Any:
    for module, names in _FROM.items():
        if name in names:
            return getattr(import_module(f'{__name__}.{module}'), name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*globals(), *__all__]
