# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The command `new-model`: a model file of the user's own muscle, from options or questions."""

from pathlib import Path
import sys
from typing import Annotated

from rich.markup import escape
import typer

from fam_bundle_ros.cli.common import (
    console,
    JsonFile,
    notes,
    open_model,
    quantity,
    save_json,
    table,
    wrote,
    yaml_to_write,
)
from fam_bundle_ros.errors import InputError


def new_model(
    out: Annotated[Path | None, typer.Argument(metavar='OUT', help='Model file (.yaml) to write.'
                                               )] = None,
    part: Annotated[str | None, typer.Option(metavar='NAME', help='Part of the catalogue, such as '
                                             'dmsp-20 (--list).')] = None,
    start: Annotated[str | None, typer.Option('--from', metavar='MODEL', help='Model of one '
                                              'muscle, such as `add` writes: its geometry and '
                                              'effects for all motor units of a bundle; with '
                                              '--muscles, --max-pressure.')] = None,
    tendons: Annotated[bool, typer.Option('--tendons', help='With --from: the ends of the bundle '
                                          'transmit tension only. Otherwise a muscle that was '
                                          'measured in tension only pushes back where it is '
                                          'slack.')] = False,
    radius: Annotated[str | None, typer.Option(metavar='LENGTH', help='Initial outer radius, half '
                                               'the diameter: "6.35 mm".')] = None,
    length: Annotated[str | None, typer.Option(metavar='LENGTH', help='Active length between the '
                                               'fittings, vented and without load: "127 mm".'
                                               )] = None,
    braid_angle: Annotated[str | None, typer.Option(metavar='ANGLE', help='Angle of the threads '
                                                    'to the axis, at that length: "33 deg".'
                                                    )] = None,
    wall: Annotated[str | None, typer.Option(metavar='LENGTH', help='Wall thickness of the '
                                             'bladder: "1.59 mm".')] = None,
    muscles: Annotated[str | None, typer.Option(metavar='N[,N]...', help='Number of equal muscles '
                                                'of each motor unit, in order of recruitment: "1" '
                                                'or "1,2".')] = None,
    max_pressure: Annotated[str | None, typer.Option(metavar='PRESSURE', help='Highest gauge '
                                                     'pressure: "400 kPa".')] = None,
    effects: Annotated[list[str] | None, typer.Option('--effect', metavar='NAME', help='Effect of '
                                                      'the catalogue to start with; mesh, the '
                                                      'ideal braid, by default. May be given '
                                                      'several times.')] = None,
    name: Annotated[str | None, typer.Option(help="Name of the model; the file's by default."
                                             )] = None,
    force: Annotated[bool, typer.Option('--force', help='Overwrite an existing file.')] = False,
    ask: Annotated[bool | None, typer.Option('--ask/--no-ask', show_default=False, help='Ask for '
                                             'missing values; in a terminal by default.'
                                             )] = None,
    listed: Annotated[bool, typer.Option('--list', help='Show the parts with the source of each '
                                         'value, and exit.')] = False,
    json_file: JsonFile = None,
) -> None:
    """
    Write a model file of your own muscle, from options or questions.

    The file has a comment on each value and can be used in every command: map, diagnose, run.
    """
    from fam_bundle_ros.atomic import write_whole
    from fam_bundle_ros.model import own_muscle
    if listed:
        _list()
        return
    if out is None:
        raise InputError('new-model: no OUT; expected the name of the model file (.yaml) to write')
    yaml_to_write(out)
    if out.exists() and not force:
        raise InputError(f'{out}: exists already; expected another name, or --force')
    given = {'radius': radius, 'length': length, 'braid_angle': braid_angle,
             'wall_thickness': wall, 'muscles': muscles, 'max_pressure': max_pressure}
    if start is not None:
        _write_bundle(out, start, {**given, 'part': part, 'effect': effects}, tendons, name,
                      json_file)
        return
    if tendons:
        raise InputError('--tendons: expected together with --from')
    if ask is None:
        ask = sys.stdin.isatty() and sys.stdout.isatty()
    if ask and part is None and not any(given.values()):
        known = ', '.join(each.name for each in own_muscle.PARTS)
        part = typer.prompt(f'Part ({known}), or Enter for dimensions of your own', default='',
                            show_default=False, err=True).strip() or None
    stock = None if part is None else own_muscle.find_part(part, '--part')
    values = {**(stock.values if stock else {}), 'muscles': '1',
              **{key: value for key, value in given.items() if value is not None}}
    sources = {key: f'{stock.title}, {said}' for key, said in stock.sources.items()
               if given[key] is None} if stock else {}
    if muscles is None:
        sources['muscles'] = 'one, by default'
    if ask:
        for entry in own_muscle.ENTRIES:
            if given[entry.key] is None:
                _ask(entry, values, sources)
    bundle = own_muscle.new_bundle(name or out.stem, values, effects or own_muscle.START_EFFECTS,
                                   lambda entry: entry.option)
    if stock is not None:
        low, high = stock.lengths
        if not low <= bundle.length <= high:
            notes.print(f'note: {stock.title} is sold from {1e3 * low:g} to {1e3 * high:g} mm; '
                        f'--length is {1e3 * bundle.length:g} mm')
    origin = (f'{stock.title}: a catalogue part' if stock else 'A muscle of your own')
    write_whole(out, own_muscle.model_text(bundle, values, sources,
                                           f'{origin}, written by fam_bundle new-model.'))
    console.print(escape(own_muscle.muscle_words(bundle)), soft_wrap=True)
    for key, said in sources.items():
        notes.print(escape(f'{key} {values[key]}: {said}'), style='dim', soft_wrap=True)
    wrote(out)
    console.print(f'next: [bold]fam_bundle diagnose DATA --model {escape(str(out))}[/bold]',
                  soft_wrap=True)
    save_json(json_file, {'out': out, 'name': bundle.name, 'values': values, 'sources': sources,
                          'effects': [effect.name for effect in bundle.effects]})


def _write_bundle(out: Path, start: str, given: dict, tendons: bool, name: str | None,
                  json_file: Path | None) -> None:
    """Write the bundle of a model of one muscle."""
    from fam_bundle_ros.model import own_muscle, Place, save_model
    muscles, pressure = given.pop('muscles'), given.pop('max_pressure')
    for key, value in given.items():
        if value:
            option = key.replace('_thickness', '').replace('_', '-')
            raise InputError(f'--{option}: not with --from, whose muscle has one already; '
                             'expected --muscles, --max-pressure, --tendons and --name only')
    muscle = open_model(start)
    bundle = own_muscle.bundle_of(
        muscle, name or out.stem, own_muscle.counted(muscles or '1', '--muscles'),
        None if pressure is None else quantity(pressure, 'kPa', '--max-pressure'), tendons)
    save_model(bundle, out)
    console.print(escape(own_muscle.muscle_words(bundle)), soft_wrap=True)
    for effect in muscle.effects:
        if effect not in bundle.effects:
            why = ('belongs to the sensors' if effect.place is Place.SENSOR else 'not so between '
                   'rigid ends (--tendons keeps it): the push-back, which was not measured, is '
                   'resistive_plateau with wide intervals; the controller adapts it')
            notes.print(f'{effect.name} is left out: {why}', style='dim', soft_wrap=True)
    wrote(out)
    console.print(f'next: [bold]fam_bundle run --model {escape(str(out))}[/bold]', soft_wrap=True)
    save_json(json_file, {'out': out, 'name': bundle.name, 'from': start,
                          'values': own_muscle.dimensions_of(bundle),
                          'effects': [effect.name for effect in bundle.effects]})


def _list() -> None:
    from fam_bundle_ros.model import own_muscle
    for part in own_muscle.PARTS:
        low, high = part.lengths
        table(('value', '', 'source'),
              [(entry.option, part.values.get(entry.key, 'to be given'),
                part.sources.get(entry.key, '')) for entry in own_muscle.ENTRIES],
              title=f'{part.name}: {part.title}, sold from {1e3 * low:g} to {1e3 * high:g} mm')
        console.print()


def _ask(entry, values: dict[str, str], sources: dict[str, str]) -> None:
    """Ask for one value; Enter accepts the default."""
    before = values.get(entry.key)
    values[entry.key] = typer.prompt(f'{entry.label} ({entry.meaning}), such as {entry.example}',
                                     default=before, err=True).strip()
    if values[entry.key] != before:
        sources.pop(entry.key, None)
