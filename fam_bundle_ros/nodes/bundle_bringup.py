# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Node bundle_bringup: the whole bundle in one process, with a quarter of the CPU time of six.

Starts recruitment_controller, one pressure_pid per motor unit and model_monitor, with ``simulate``
also plant_simulator, and with ``generate`` reference_generator. All take their parameters from the
command line and parameter files as if each ran alone. Without a parameter file, the shipped file
for the simulation is used.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
import sys
from typing import Any

from rclpy.context import Context

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode, MODEL
from fam_bundle_ros.nodes.model_monitor import ModelMonitor
from fam_bundle_ros.nodes.models import bundle_from
from fam_bundle_ros.nodes.parameters import Spec, table
from fam_bundle_ros.nodes.plant_simulator import PlantSimulator
from fam_bundle_ros.nodes.pressure_pid import PressurePidNode
from fam_bundle_ros.nodes.process import run
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode
from fam_bundle_ros.nodes.reference_generator import ReferenceGenerator
from fam_bundle_ros.resources import config_path

SPECS = (
    MODEL,
    Spec('simulate', True, 'start plant_simulator; false on a rig'),
    Spec('generate', True, 'start reference_generator'),
    Spec('monitor', True, 'start model_monitor'),
)


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
        nodes += [PressurePidNode(unit + 1, **common) for unit in range(bringup.units)]
        nodes.append(RecruitmentNode(**common))
        if bringup.p['monitor']:
            nodes.append(ModelMonitor(**common))
        if bringup.p['generate']:
            nodes.append(ReferenceGenerator(**common, **(generator or {})))
        if bringup.p['simulate']:
            nodes.append(PlantSimulator(**common, **(simulator or {})))
        # Imported here, as that module imports every node, this one too.
        from fam_bundle_ros.nodes.known import refuse_unheard, refuse_unknown
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
