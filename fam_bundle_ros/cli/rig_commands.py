# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands that speak ROS 2: `run`."""

from pathlib import Path
from typing import Annotated

import typer

from fam_bundle_ros.errors import InputError

PANEL = 'Rig and ROS 2'


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    app.command('run', rich_help_panel=PANEL, context_settings={
        'allow_extra_args': True, 'ignore_unknown_options': True})(run)


def run(
    context: typer.Context,
    model: Annotated[str | None, typer.Option('--model', '-m', metavar='MODEL', help='Model of '
                                              'the controller, and of the simulated rig.')] = None,
    plant_model: Annotated[str | None, typer.Option(metavar='MODEL', help='Model of the '
                                                    'simulated rig: a hidden effect.')] = None,
    trajectory: Annotated[str | None, typer.Option('--trajectory', '-t', metavar='FILE',
                                                   help='Trajectory file, or one that ships.'
                                                   )] = None,
    policy: Annotated[str | None, typer.Option(help='neglect, hysteresis or reversal_aware.'
                                               )] = None,
    rig: Annotated[bool, typer.Option('--rig', help='A real rig is there: do not simulate one.'
                                      )] = False,
    params_file: Annotated[Path | None, typer.Option(metavar='FILE', help='ROS parameter file.'
                                                     )] = None,
) -> None:
    """
    Run all nodes in one process until Ctrl-C, then vent.

    What follows --ros-args goes to ROS, as with ros2 run:
    fam_bundle run --ros-args -p load.kind:=mass_spring -r __ns:=/left
    """
    if params_file is not None and not params_file.is_file():
        raise InputError(f'{params_file}: no such parameter file')
    own = [item for name, value in (
        ('model', None if model is None else _file(model)),
        ('plant_model', None if plant_model is None else _file(plant_model)),
        ('trajectory', trajectory), ('policy', policy), ('simulate', 'false' if rig else None))
        if value is not None for item in ('-p', f'{name}:={value}')]
    given = ['--params-file', str(params_file)] if params_file else []
    arguments = ['fam_bundle run', *context.args]
    if own or given:
        arguments += ['--ros-args', *given, *own, '--']
    from fam_bundle_ros.nodes import bundle_bringup
    raise typer.Exit(bundle_bringup.main(arguments))


def _file(name: str) -> str:
    from fam_bundle_ros.cli.common import model_path
    return str(model_path(name).resolve())
