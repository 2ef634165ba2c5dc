# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The command line as one typer application."""

from typing import Annotated

import typer

import fam_bundle_ros
from fam_bundle_ros.cli.bench_commands import bench, benchmark_control, benchmark_discovery
from fam_bundle_ros.cli.campaign_commands import campaign
from fam_bundle_ros.cli.data_commands import compare, convert, workbench
from fam_bundle_ros.cli.demo import demo
from fam_bundle_ros.cli.diagnose_command import diagnose
from fam_bundle_ros.cli.fault_commands import benchmark_faults
from fam_bundle_ros.cli.improve_commands import add, ladder
from fam_bundle_ros.cli.measure_command import measure
from fam_bundle_ros.cli.model_commands import draw_map, effects, tune
from fam_bundle_ros.cli.new_model import new_model
from fam_bundle_ros.cli.outputs import CheckedCommand
from fam_bundle_ros.cli.rig_commands import call, check_rig, record, run

#: Panels of the help and their commands, in the order of the help; `_` in a name is shown as `-`.
_COMMANDS = {
    'Rig and ROS 2': (demo, run, call, measure, record, check_rig),
    'Model': (new_model, draw_map, effects, tune),
    'Discovery': (compare, diagnose, convert, workbench, add, ladder, campaign),
    'Benchmarks': (benchmark_control, benchmark_discovery, bench, benchmark_faults)}
#: Settings of `run`, which passes unknown options to ROS.
_PASSES_ON = {'allow_extra_args': True, 'ignore_unknown_options': True}

app = typer.Typer(
    name='fam_bundle', add_completion=False, no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={'help_option_names': ['-h', '--help']})

for _panel, _commands in _COMMANDS.items():
    for _command in _commands:
        app.command('map' if _command is draw_map else None, cls=CheckedCommand,
                    rich_help_panel=_panel,
                    context_settings=_PASSES_ON if _command is run else None)(_command)


def _version(wanted: bool) -> None:
    if wanted:
        print(f'fam_bundle {fam_bundle_ros.__version__}')
        raise typer.Exit


@app.callback()
def fam_bundle(
    version: Annotated[bool, typer.Option('--version', callback=_version, is_eager=True,
                                          help='Show the version and exit.')] = False,
    debug: Annotated[bool, typer.Option('--debug', help='Show the traceback of an unexpected '
                                        'error.')] = False,
) -> None:
    """
    Bundles of fluidic artificial muscles with variable recruitment: model, control, discovery.

    Start with [bold]fam_bundle demo[/bold]. A MODEL is a model file (YAML) or the name of a
    shipped model, such as spie2021.
    """
