# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands that use ROS 2: `run`, `call`, `record`, `check-rig`."""

from collections.abc import Mapping
from pathlib import Path
import re
from typing import Annotated, Any

from rich.text import Text
import typer
import yaml

from fam_bundle_ros.atomic import refuse_unwritable, write_whole
from fam_bundle_ros.cli.common import (
    AllowPython,
    chosen_model,
    confirm,
    console,
    ControllerModel,
    JsonFile,
    Namespace,
    open_model,
    PAPER,
    PlantModel,
    progress_bar,
    quantity,
    save_json,
    table,
    wrote,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.resources import config_path, model_path


def run(
    context: typer.Context,
    model: ControllerModel = None,
    plant_model: PlantModel = None,
    trajectory: Annotated[str | None, typer.Option('--trajectory', '-t', metavar='FILE',
                                                   help='Trajectory file, or a shipped one.'
                                                   )] = None,
    policy: Annotated[str | None, typer.Option(help='neglect, hysteresis or reversal_aware.'
                                               )] = None,
    rig: Annotated[bool, typer.Option('--rig', help='Use a real rig instead of a simulated one; '
                                      'needs --params-file.')] = False,
    params_file: Annotated[Path | None, typer.Option(metavar='FILE', help='ROS parameter file.'
                                                     )] = None,
) -> None:
    """
    Run all nodes in one process until Ctrl-C, then vent.

    A strain trajectory is run with a mass on the simulated rig, unless a load is given, as the
    default dynamometer fixes the strain. Arguments after --ros-args go to ROS, as with ros2 run:
    fam_bundle run --ros-args -p load.kind:=mass_spring -r __ns:=/left
    """
    from fam_bundle_ros.nodes import bundle_bringup
    from fam_bundle_ros.nodes.profile import load_profile
    if params_file is not None and not params_file.is_file():
        raise InputError(f'{params_file}: no such parameter file')
    if rig and params_file is None and '--params-file' not in context.args:
        raise InputError('--rig needs --params-file: copy '
                         f"{config_path('rig.yaml')} and fill in what your rig has")
    # The default load, a dynamometer, fixes the strain, so a strain could not be controlled.
    free = (trajectory is not None and not rig and params_file is None
            and load_profile(trajectory).kind == 'strain'
            and not any('load' in word for word in context.args))
    # The default supply and trip of the simulated rig are for muscles up to 344.7 kPa.
    suited = (not rig and params_file is None
              and not any('pressure' in word or 'params-file' in word for word in context.args))
    own = [item for name, value in (
        ('model', None if model is None else _file(model)),
        ('plant_model', None if plant_model is None else _file(plant_model)),
        ('trajectory', trajectory), ('policy', policy),
        *(_mass(model or PAPER).items() if free else ()),
        *(_pressures(model or PAPER).items() if suited else ()),
        ('simulate', 'false' if rig else None))
        if value is not None for item in ('-p', f'{name}:={value}')]
    # in front: of two values of a parameter ROS takes the last
    given = ['--ros-args', '--params-file', str(params_file), '--'] if params_file else []
    # if a parameter file or --ros-args may name another model, the nodes log it
    if model is not None or not (given or any('model' in word or 'params-file' in word
                                              for word in context.args)):
        chosen_model(model)
    arguments = ['fam_bundle run', *given, *context.args]
    if own:
        arguments += ['--ros-args', *own, '--']
    console.print(f"running on {'a real' if rig else 'a simulated'} rig; Ctrl-C vents and stops")
    raise typer.Exit(bundle_bringup.main(arguments))


def call(
    service: Annotated[str, typer.Argument(metavar='SERVICE', help='Such as enable, e_stop_reset '
                                           'or diagnose.')],
    value: Annotated[bool | None, typer.Argument(metavar='[true|false]', help='For enable.')
                     ] = None,
    namespace: Namespace = 'bundle',
) -> None:
    """
    Call a service of a running bundle, as ros2 service call does; 1 if it refuses.

    The message of the answer is printed.
    """
    from fam_bundle_ros.nodes import calling
    success, message = calling.call(service, value, namespace.strip('/'))
    console.print(message or ('done' if success else 'refused, without a reason'), markup=False)
    if not success:
        raise typer.Exit(1)


def record(
    out: Annotated[Path, typer.Argument(metavar='FOLDER', help='New folder for the bag (mcap).')],
    seconds: Annotated[float | None, typer.Option(help='How long; until Ctrl-C by default.',
                                                  min=0.1)] = None,
    namespace: Namespace = 'bundle',
    json_file: JsonFile = None,
) -> None:
    """Record the topics of a running bundle into a bag that `diagnose` reads."""
    from fam_bundle_ros.nodes import recording
    with progress_bar('record') as tick:
        count = recording.record(
            out, seconds, namespace.strip('/'), progress=lambda elapsed, messages: tick(
                elapsed / seconds if seconds else 0.0, f'{messages} messages'))
    console.print(f'{count} messages')
    wrote(out)
    save_json(json_file, {'folder': out, 'messages': count})


def check_rig(
    namespace: Namespace = 'bundle',
    seconds: Annotated[float, typer.Option(help='How long readings are collected.', min=0.5,
                                           max=600.0)] = 3.0,
    model: Annotated[str | None, typer.Option('--model', '-m', metavar='MODEL', help='Model file, '
                                              'or a shipped one, for number of units, length '
                                              'and possible force; needed with --active.'
                                              )] = None,
    gauge: Annotated[bool, typer.Option('--gauge', help='The rig sends gauge pressure, and '
                                        'pressure_is_gauge is set.')] = False,
    active: Annotated[bool, typer.Option('--active', help='Then open the valves, one at a time, '
                                         'and measure them.')] = False,
    supply: Annotated[str, typer.Option(metavar='PRESSURE', help='With --active: present setting '
                                        'of the regulator.')] = '100 kPa',
    tube_volume: Annotated[str, typer.Option(metavar='VOLUME', help='With --active: volume of '
                                             'tube and fittings of a motor unit.')] = '5 ml',
    yes: Annotated[bool, typer.Option('--yes', help='With --active: do not ask.')] = False,
    out: Annotated[Path, typer.Option('--out', '-o', metavar='FILE', help='With --active: new '
                                      'parameter file for controllers.')] = Path('my_rig.yaml'),
    json_file: JsonFile = None,
    allow_python: AllowPython = False,
) -> None:
    """
    Check whether a rig conforms to the interface: names, types, rates, units, signs, noise.

    A note is something that you must check, such as the sign of a force at rest. With --active
    the muscles are filled to detect reversed, exchanged and scaled channels, dead time, leaks, and
    drivers that do not vent in silence; the measured parameters go into a parameter file.
    """
    from fam_bundle_ros.nodes import rig_check
    from fam_bundle_ros.nodes.recruitment_parameters import force_limits
    if active and model is None:
        raise InputError('--active without --model; expected the model file of the muscles on the '
                         'rig')
    bundle = chosen_model(model, allow_python)
    low = quantity(supply, 'Pa', '--supply')
    tube = quantity(tube_volume, 'm^3', '--tube-volume')
    if active and out.exists():
        raise InputError(f'{out} exists already; expected a new file (--out)')
    if active:
        refuse_unwritable(out)
    with progress_bar('check-rig') as tick:
        findings = rig_check.check_rig(
            namespace.strip('/'), seconds, units=bundle.n, length=bundle.length, gauge=gauge,
            forces=force_limits(bundle.largest_force),
            progress=lambda elapsed: tick(elapsed / seconds))
    _show(findings)
    failed = ', '.join(finding.what for finding in findings if not finding.ok)
    result: dict[str, Any] = {'ok': not failed, 'findings': findings}
    if active and failed:
        console.print(f'air test not started, {out} not written: first correct {failed}',
                      markup=False, soft_wrap=True)
    elif active and model is not None:
        confirm('The valves will be opened one at a time, up to the supply: is the regulator at '
                  f'{low / 1e3:.0f} kPa, is everybody away from the muscles, are hoses tied down '
                  'and the stop button within reach?', yes)
        from fam_bundle_ros.nodes.rig_probe import probe_rig
        with progress_bar('check-rig --active') as tick:
            probe = probe_rig(bundle, low, namespace=namespace.strip('/'), tube_volume=tube,
                              progress=tick)
        _show(probe.findings)
        result['findings'] = [*findings, *probe.findings]
        result['ok'] = all(finding.ok for finding in probe.findings)
        result['parameters'] = probe.parameters
        if probe.parameters:
            _write_rig(out, model, low, probe.parameters)
    save_json(json_file, result)
    if not result['ok']:
        raise typer.Exit(1)


def _show(findings: Any) -> None:
    styles = {'ok': 'green', 'note': 'yellow', 'FAIL': 'bold red'}
    table(('', 'what', 'seen'), [(Text(finding.verdict, style=styles[finding.verdict]),
                                  finding.what, finding.detail) for finding in findings])


def _write_rig(out: Path, model: str, supply: float, parameters: dict[str, Any]) -> None:
    head = (f'Measured by fam_bundle check-rig --active at a supply of {supply / 1e3:.0f} kPa.\n'
            'Not measured: supply.pressure in operation, load_model, policy, time-outs. Check '
            'these.')
    write_whole(out, fill_in(config_path('rig.yaml').read_text(),
                             {**parameters, 'model': _file(model)}, head))
    wrote(out)


def _mass(model: str) -> dict[str, Any]:
    """Return parameters of a mass on the bundle, for the simulated rig and for the controller."""
    from fam_bundle_ros.nodes.rig_parameters import LOAD, load_from, load_model_parameters
    kind = {'load.kind': 'mass_spring'}
    load = load_from({spec.name: spec.default for spec in LOAD} | kind)
    return {**kind, **{name: round(value, 6) for name, value in load_model_parameters(
        load, open_model(model).length).items()}}


def _pressures(model: str) -> dict[str, Any]:
    from fam_bundle_ros.nodes.rig_parameters import pressure_parameters
    return pressure_parameters(open_model(model))


def _file(name: str) -> str:
    return str(model_path(name).resolve())


def fill_in(template: str, values: Mapping[str, Any], head: str) -> str:
    r"""
    Return a ROS parameter file with other values, and a comment at its head.

    Its other comments and values are kept. The template has all parameters below ``/**``, one per
    line; further ones are added.

    Examples
    --------
    >>> print(fill_in('/**:\n  ros__parameters:\n    # Hz\n    rate: 200.0\n',
    ...               {'rate': 500.0, 'tube_volume': 4e-6}, 'Measured.'), end='')
    # Measured.
    /**:
      ros__parameters:
        # Hz
        rate: 500.0
        tube_volume: 4.0e-06
    """
    for name, value in values.items():
        # in YAML, 5e-06 would be a string
        line = f'    {name}: {yaml.safe_dump(value, width=1e9).splitlines()[0]}\n'
        template, found = re.subn(rf'^    {re.escape(name)}: .*\n', line.replace('\\', r'\\'),
                                  template, flags=re.MULTILINE)
        template += '' if found else line
    return ''.join(f'# {row}\n' for row in head.splitlines()) + template
