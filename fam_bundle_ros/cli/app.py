# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The commands put together."""

from typing import Annotated

import typer

import fam_bundle_ros
from fam_bundle_ros.cli import (
    bench_commands,
    campaign_commands,
    data_commands,
    fault_commands,
    improve_commands,
    model_commands,
    rig_commands,
)

app = typer.Typer(
    name='fam_bundle', add_completion=False, no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={'help_option_names': ['-h', '--help']})

for _module in (rig_commands, model_commands, data_commands, improve_commands, campaign_commands,
                bench_commands, fault_commands):
    _module.register(app)


def _version(wanted: bool) -> None:
    if wanted:
        print(f'fam_bundle {fam_bundle_ros.__version__}')
        raise typer.Exit


@app.callback()
def fam_bundle(
    version: Annotated[bool, typer.Option('--version', callback=_version, is_eager=True,
                                          help='Show the version and leave.')] = False,
    debug: Annotated[bool, typer.Option('--debug', help='Show the traceback of an unexpected '
                                        'error.')] = False,
) -> None:
    """
    Bundles of fluidic artificial muscles with variable recruitment: model, control, discovery.

    Start with [bold]fam_bundle demo[/bold]. A MODEL is a model file (YAML) or the name of one
    that ships, such as spie2021.
    """
