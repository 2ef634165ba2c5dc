# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Node bundle_bringup: the whole bundle in one process, with a quarter of the CPU time of six.

Starts recruitment_controller, one pressure_pid per motor unit and model_monitor, with ``simulate``
also plant_simulator, and with ``generate`` reference_generator. All take their parameters from the
command line and parameter files as if each ran alone. Without a parameter file, the shipped file
for the simulation is used.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
import difflib
from functools import partial
from itertools import pairwise
import re
import sys
from typing import Any

from rclpy.context import Context
import yaml

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import (
    interface,
    model_monitor,
    plant_simulator,
    pressure_pid,
    recruitment_controller,
    reference_generator,
    serial_parameters,
)
from fam_bundle_ros.nodes.base import BundleNode, COMMON, MODEL
from fam_bundle_ros.nodes.models import bundle_from
from fam_bundle_ros.nodes.parameters import Spec, table
from fam_bundle_ros.nodes.process import run
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.told import counted

SPECS = (
    MODEL,
    Spec('simulate', True, 'start plant_simulator; false on a rig'),
    Spec('generate', True, 'start reference_generator'),
    Spec('monitor', True, 'start model_monitor'),
)
#: Names of all parameters of the package; files may have those of nodes that do not start here.
NAMES = frozenset(spec.name for spec in (
    *COMMON, *SPECS, *model_monitor.SPECS, *plant_simulator.SPECS, *pressure_pid.SPECS,
    *recruitment_controller.SPECS, *reference_generator.SPECS, *serial_parameters.SPECS,
    *serial_parameters.scale_specs(interface.MOST_UNITS)))


class BundleBringup(BundleNode):
    """Holds the parameters that say which nodes to start."""

    def __init__(self, **keywords: Any):
        super().__init__('bundle_bringup', SPECS, **keywords)
        self.units = bundle_from(self.p['model']).n


def make_nodes(context: Context, namespace: str = interface.NAMESPACE, *,
               overrides: Mapping[str, Any] | None = None,
               simulator: Mapping[str, Any] | None = None,
               generator: Mapping[str, Any] | None = None,
               files: Sequence[str] = ()) -> list[BundleNode]:
    """
    Return the nodes of a bundle, in the order in which they are to be stopped.

    Parameters
    ----------
    overrides : mapping, optional
        Parameters for all nodes (those that know them).
    simulator, generator : mapping, optional
        Further arguments of `PlantSimulator` and `ReferenceGenerator`.
    files : sequence of str
        Parameter files of the context; each must have a section for one of the nodes.

    Raises
    ------
    InputError
        When a parameter or a file is wrong or unknown; all nodes are destroyed then.
    """
    nodes: list[BundleNode] = []
    common: dict[str, Any] = {'context': context, 'namespace': namespace,
                              'overrides': dict(overrides or {})}
    try:
        bringup = BundleBringup(**common)
        nodes.append(bringup)
        # Subscribers first, so that in lock-step no message is lost or repeated. Messages are
        # delivered in this order: the fastest loops first.
        nodes += [pressure_pid.PressurePidNode(unit + 1, **common)
                  for unit in range(bringup.units)]
        nodes.append(recruitment_controller.RecruitmentNode(**common))
        if bringup.p['monitor']:
            nodes.append(model_monitor.ModelMonitor(**common))
        if bringup.p['generate']:
            nodes.append(reference_generator.ReferenceGenerator(**common, **(generator or {})))
        if bringup.p['simulate']:
            plant = plant_simulator.PlantSimulator(**common, **(simulator or {}))
            nodes.append(plant)
            if plant.units != bringup.units:
                raise InputError(f'plant_model has {counted(plant.units, "motor unit")}, the '
                                 f'model of the controller {bringup.units}; expected as many')
        refuse_unknown(nodes)
        refuse_unheard(nodes, files)
    except Exception:
        for node in nodes:
            node.destroy_node()
        raise
    return nodes


def main(args: list[str] | None = None) -> int:
    """Run all nodes; return the exit status."""
    argv = list(sys.argv if args is None else args)
    # This file starts at once and repeats a trajectory: never used by default on a real rig.
    if '--params-file' not in argv and not any('simulate:=false' in a.lower() for a in argv):
        # In front, so that what the user gives wins.
        argv[1:1] = ['--ros-args', '--params-file', str(config_path('simulation.yaml')), '--']
    files = [name for option, name in pairwise(argv) if option == '--params-file']
    return run(partial(make_nodes, files=files), f'{__doc__}\nParameters:\n{table(SPECS)}', argv)


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
