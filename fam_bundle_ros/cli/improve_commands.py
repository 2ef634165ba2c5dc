# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands that improve models: `add`, `ladder`."""

from pathlib import Path
from typing import Annotated, Any

from rich.markup import escape
import typer

from fam_bundle_ros.cli.common import (
    AllowPython,
    console,
    JsonFile,
    ModelOption,
    muscle_of,
    notes,
    open_model,
    page_files,
    PageFile,
    parameter_table,
    read_data,
    Reading,
    reads_data,
    save_json,
    save_page,
    show_muscle,
    table,
    wrote,
    yaml_to_write,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.told import number

#: Largest number of effects whose orders are shown.
_MOST_ORDERED = 3


@reads_data
def add(
    data: Annotated[list[str], typer.Option('--data', '-d', metavar='DATA', help='Measurement to '
                                            'refit on.')],
    model: ModelOption,
    out: Annotated[Path, typer.Option('--out', '-o', metavar='FILE', help='Model file to write.')],
    effects: Annotated[list[str] | None, typer.Argument(
        metavar='[EFFECT]...', help="Effects to add; none: refit the model's own parameters."
    )] = None,
    source: Annotated[str | None, typer.Option('--from', metavar='MODEL', help='Take the effects '
                                               'from this model file: your own expressions.'
                                               )] = None,
    replacing: Annotated[list[str] | None, typer.Option('--replace', metavar='OLD=NEW',
                                                        help='Replace an effect of the model by '
                                                        'another.')] = None,
    removing: Annotated[list[str] | None, typer.Option('--remove', metavar='NAME', help='Remove '
                                                       'an effect from the model.')] = None,
    discrepancy: Annotated[bool, typer.Option('--discrepancy', help='Also add a table, of the '
                                              'remaining error or to an empirical form, if this '
                                              'predicts unseen rows better.')] = False,
    name: Annotated[str | None, typer.Option(help='Name of the new model.')] = None,
    json_file: JsonFile = None,
    allow_python: AllowPython = False,
    *,
    reading: Reading,
) -> None:
    """Add effects to a model, refit everything on data, and write the new model file."""
    from fam_bundle_ros.discovery import add_effect
    from fam_bundle_ros.model import save_model
    if len(data) > 1:
        raise InputError(f'--data was given {len(data)} times; expected one measurement')
    bundle = open_model(model, allow_python)
    wanted: list[Any] = list(effects or [])
    if source is not None:
        if not wanted:
            raise InputError(f'--from {source} without an effect; expected the names of the '
                             'effects to take from it')
        library = open_model(source, allow_python)
        wanted = [library.effect(effect) for effect in wanted]
    yaml_to_write(out)
    swaps = {}
    for text in replacing or []:
        old, sign, new = text.partition('=')
        if not (old and sign and new):
            raise InputError(f'--replace {text}: expected OLD=NEW, two names of effects')
        swaps[old] = new
    if not (wanted or swaps or removing) and name is None:
        name = f'{bundle.name}_recalibrated'
    measured = read_data(data, reading, bundle)
    with notes.status('refitting'):
        result = add_effect(bundle, wanted, measured, name,
                            replacing=swaps, removing=removing or ())
    files: tuple[Path, ...] = (out,)
    if discrepancy:
        files = result.recommended.save(out)
    else:
        save_model(result.model, out)
    show_muscle(result.model)
    console.print(f'added {result.what}: [bold]{number(result.error_before_N)} N -> '
                  f'{number(result.error_N)} N[/bold], {number(result.held_out_N)} N on held-out '
                  f'data; noise floor {number(result.noise.value)} N', soft_wrap=True)
    for words in filter(None, (result.doubt, result.past)):
        console.print(words, soft_wrap=True)
    if discrepancy:
        console.print(str(result.recommended), soft_wrap=True)
    parameter_table(result.parameters)
    wrote(*files)
    save_json(json_file, {**result.to_dict(), 'out': out, 'muscle': muscle_of(result.model),
                          'data': measured.to_dict()})


@reads_data
def ladder(
    data: Annotated[str, typer.Argument(metavar='DATA', help='Log of any format, ROS 2 bag, or '
                                        'the name of shipped data.')],
    models: Annotated[list[str], typer.Argument(metavar='MODEL...', help='Model files, in the '
                                                'order of the steps.')],
    word: Annotated[bool, typer.Option('--models', help='May stand before the models.')] = False,
    out: PageFile = None,
    json_file: JsonFile = None,
    allow_python: AllowPython = False,
    *,
    reading: Reading,
) -> None:
    """Show the error of one model after the other on the same data, against the noise floor."""
    from fam_bundle_ros import discovery
    bundles = [open_model(model, allow_python) for model in models]
    measured = read_data([data], reading, bundles[0])
    with notes.status('refitting without held-out blocks'):
        result = discovery.ladder(measured, bundles)
        orders = _orders(bundles, measured)
    show_muscle(bundles[0])
    table(('model', 'error (N)', 'refitted (N)', 'held out (N)'),
          [(step['step'], step['error_N'], step['refitted_N'], step['held_out_N'])
           for step in result.steps], numeric=(1, 2, 3))
    console.print('on the same held-out rows: ' + ', '.join(
        f'{words} {number(result.rivals_N[name])} N' for name, words in (
            ('mean', 'mean force'), ('plane', 'plane'),
            ('empirical', 'six-parameter empirical form'))))
    if result.doubt:
        console.print(result.doubt, soft_wrap=True)
    console.print(escape(str(result.noise)), soft_wrap=True)
    if len(orders) > 1:
        table(('in this order', 'error after each step (N)'),
              [(order, '  '.join(number(error) for error in errors))
               for order, errors in orders.items()])
    if out is not None:
        from fam_bundle_ros.report.discovery_pages import ladder_page
        save_page(out, ladder_page(result, orders, page_files([data], models)))
    save_json(json_file, {**result.to_dict(), 'orders': orders, 'muscle': muscle_of(bundles[0]),
                          'data': measured.to_dict()})


def _orders(bundles: list[Any], measured: Any) -> dict[str, list[float]]:
    """Return the errors for every order of adding the effects that only the last model has."""
    from fam_bundle_ros.discovery import orders
    first, last = bundles[0], bundles[-1]
    had = {effect.name for effect in first.effects}
    added = [effect.name for effect in last.effects if effect.name not in had]
    kept = had <= {effect.name for effect in last.effects}
    if not kept or not 2 <= len(added) <= _MOST_ORDERED:
        return {}
    try:
        return orders(first, added, measured)
    except InputError:
        return {}  # an effect of the user's own, which is not in the catalogue
