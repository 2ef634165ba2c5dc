# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""All parameters of the package; an unknown one is refused, whereas ROS ignores it."""

from collections.abc import Iterable
import difflib

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import (
    bundle_bringup,
    model_monitor,
    pid_parameters,
    plant_simulator,
    recruitment_parameters,
    reference_generator,
    serial_parameters,
)
from fam_bundle_ros.nodes.base import BundleNode, COMMON

#: Largest number of motor units of a node.
_UNITS = 64
#: Names of all parameters; files may contain those of nodes that are not started here.
NAMES = frozenset(spec.name for spec in (
    *COMMON, *bundle_bringup.SPECS, *model_monitor.SPECS, *pid_parameters.SPECS,
    *plant_simulator.SPECS, *recruitment_parameters.SPECS, *reference_generator.SPECS,
    *serial_parameters.SPECS, *serial_parameters.scale_specs(_UNITS)))


def refuse_unknown(nodes: Iterable[BundleNode]) -> None:
    """
    Refuse parameters that were given to nodes and that no node of the package has.

    Raises
    ------
    InputError
        The message contains the unknown name and the most similar known one.
    """
    nodes = list(nodes)
    given = {name for node in nodes for name in node._parameter_overrides}
    for name in sorted(given - NAMES):
        if name.startswith('qos_overrides.') or any(node.has_parameter(name) for node in nodes):
            continue
        near = difflib.get_close_matches(name, NAMES, 1)
        raise InputError(f"no node of the bundle has the parameter '{name}'"
                         + (f"; did you mean '{near[0]}'?" if near else ''))
