# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""All parameters of the package; an unknown one is refused, whereas ROS ignores it."""

from collections.abc import Iterable, Iterator, Sequence
import difflib
import re
from typing import Any

import yaml

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import (
    bundle_bringup,
    interface,
    model_monitor,
    pid_parameters,
    plant_simulator,
    recruitment_parameters,
    reference_generator,
    serial_parameters,
)
from fam_bundle_ros.nodes.base import BundleNode, COMMON

#: Names of all parameters; files may contain those of nodes that are not started here.
NAMES = frozenset(spec.name for spec in (
    *COMMON, *bundle_bringup.SPECS, *model_monitor.SPECS, *pid_parameters.SPECS,
    *plant_simulator.SPECS, *recruitment_parameters.SPECS, *reference_generator.SPECS,
    *serial_parameters.SPECS, *serial_parameters.scale_specs(interface.MOST_UNITS)))


def refuse_unknown(nodes: Iterable[BundleNode]) -> None:
    """Refuse parameters that were given to nodes and that no node of the package has."""
    nodes = list(nodes)
    given = {name for node in nodes for name in node._parameter_overrides}
    for name in sorted(given - NAMES):
        if name.startswith('qos_overrides.') or any(node.has_parameter(name) for node in nodes):
            continue
        near = difflib.get_close_matches(name, NAMES, 1)
        raise InputError(f"no node of the bundle has the parameter '{name}'"
                         + (f"; did you mean '{near[0]}'?" if near else ''))


def refuse_unheard(nodes: Iterable[BundleNode], files: Sequence[str]) -> None:
    """Refuse a parameter file of which no section is for one of the nodes."""
    names = [node.get_fully_qualified_name() for node in nodes]
    for path in files:
        with open(path, encoding='utf-8') as file:
            sections = list(_sections(yaml.safe_load(file)))
        if sections and not any(_matches(section, name) for section in sections
                                for name in names):
            raise InputError(f"{path}: section {', '.join(sections)} is for no node that starts "
                             f"here ({', '.join(names)}); expected '/**', for all nodes, or one "
                             'of these names')


def _sections(content: Any, name: str = '') -> Iterator[str]:
    """Yield the node names of a ROS parameter file; namespaces may be nested."""
    for key, value in content.items() if isinstance(content, dict) else ():
        if key == 'ros__parameters':
            yield name
        else:
            yield from _sections(value, f'{name}/{str(key).strip("/")}')


def _matches(section: str, name: str) -> bool:
    """Return whether a section, in which ** stands for any names and * for one, is for a node."""
    pattern = re.escape(section).replace(r'/\*\*', '(/[^/]+)*').replace(r'\*', '[^/]+')
    return re.fullmatch(pattern, name) is not None
