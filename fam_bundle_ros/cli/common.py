# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Shared by the commands: options, finding files, tables, results as JSON."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
import functools
import inspect
import os
from pathlib import Path
import shlex
import sys
import time
from typing import Annotated, Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text
import typer

from fam_bundle_ros import palette
from fam_bundle_ros.atomic import refuse_unwritable
from fam_bundle_ros.errors import about, InputError
from fam_bundle_ros.resources import data_path, model_path
from fam_bundle_ros.told import shown

#: Width for a pipe or a file, large enough that no row of a table is wrapped.
_PIPE_WIDTH = 160
#: Period of progress lines when stderr is not a terminal, s.
SAY = 10.0
#: Default model: the bundle of the paper. Commands say when they use it.
PAPER = 'spie2021'


class PatientConsole(Console):
    """A console whose reader may leave early (``| head``): the command still writes its files."""

    def on_broken_pipe(self) -> None:
        """Write no more, and carry on."""
        self.quiet = True
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


#: Console of the results; progress and notes go to `notes`, so that a pipe gets only results.
console = PatientConsole(highlight=False, width=None if sys.stdout.isatty() else _PIPE_WIDTH)
notes = Console(stderr=True, highlight=False)

def page_to_write(path: Path | None) -> Path | None:
    """Return the page to write; InputError for another suffix or where none can be written."""
    if path is not None and path.suffix not in ('', '.html', '.htm'):
        raise InputError(f'--out {path}: expected the name of a page (.html) to write')
    return _to_write(path)


def _to_write(path: Path | None) -> Path | None:
    if path is not None:
        refuse_unwritable(path)
    return path


JsonFile = Annotated[Path | None, typer.Option(
    '--json', metavar='FILE', callback=_to_write, help='Also write the result as JSON.')]
AllowPython = Annotated[bool, typer.Option('--allow-python', help='Run Python files of effects '
                                           'that a model names. Only for models you trust.')]
WorkersOption = Annotated[int | None, typer.Option('--workers', min=1, help='Processes; all cores '
                                                   'by default.')]
SchedulerOption = Annotated[str | None, typer.Option(
    '--scheduler', metavar='ADDRESS', help='Run on the Dask cluster of this scheduler, '
    'tcp://HOST:8786, instead of on this machine (extra cluster).')]
Unexplained = Annotated[float, typer.Option(
    '--unexplained', metavar='SHARE', min=1e-4, max=1.0, help='Normal amount of structure beyond '
    "all laws, as a share of the force's standard deviation.")]
Odds = Annotated[float, typer.Option('--odds', min=1.0, help='Sets of effects count as ties if at '
                                     'most this many times less probable than the best.')]
PageFile = Annotated[Path | None, typer.Option(
    '--out', '-o', metavar='FILE', callback=page_to_write, help='Also write the page (HTML).')]
Namespace = Annotated[str, typer.Option('--namespace', '-n', metavar='NAME', help='Namespace of '
                                        'the bundle.')]
ControllerModel = Annotated[str | None, typer.Option(
    '--model', '-m', metavar='MODEL', help='Model of the controller, and of the simulated rig.')]
PlantModel = Annotated[str | None, typer.Option(
    '--plant-model', metavar='MODEL', help='Model of the simulated rig, for a hidden effect.')]
Names = Annotated[str, typer.Option(help='Names separated by commas, or all.')]
ModelOption = Annotated[str, typer.Option('--model', '-m', metavar='MODEL', help='Model file, or '
                                          'name of a shipped model.')]


_PANEL = 'How the data are read'


@dataclass(frozen=True)
class Reading:
    """Options of all commands on data: how a measurement is read."""

    columns: Annotated[list[str] | None, typer.Option(
        '--columns', metavar='QUANTITY=COLUMN', rich_help_panel=_PANEL, help='What a column is: '
        '"length=L \\[mm]", "force=-F \\[N]" to invert the sign, "force=AI1 * 50 N - 2 N" with a '
        'calibration, "pressure=300 kPa" for a constant, "time=100 Hz", "trial=none" for no '
        'column. May be given several times.')] = None
    rest_length: Annotated[str | None, typer.Option(
        '--rest-length', metavar='LENGTH', rich_help_panel=_PANEL, help='Rest length, "127 mm", '
        'for data with lengths; by default that of the file, else of the model.')] = None
    gauge: Annotated[bool | None, typer.Option(
        '--gauge/--absolute', rich_help_panel=_PANEL, show_default=False, help='Whether pressures '
        'are gauge or absolute, if the header does not say it.')] = None
    max_pressure: Annotated[str | None, typer.Option(
        '--max-pressure', metavar='PRESSURE', rich_help_panel=_PANEL, help='Highest pressure of '
        'the muscle, "20 MPa", if it is above 1 MPa.')] = None
    max_strain: Annotated[float | None, typer.Option(
        '--max-strain', rich_help_panel=_PANEL, help='Highest strain of the muscle, if it is '
        'above 0.5.')] = None
    sheet: Annotated[str | None, typer.Option(
        '--sheet', metavar='NAME', rich_help_panel=_PANEL, help='Sheet of a workbook, group of a '
        '.tdms file, variable of a .mat file.')] = None
    drop_bad: Annotated[bool | None, typer.Option(
        '--drop-bad', rich_help_panel=_PANEL, show_default=False, help='Leave out, and count, '
        'rows with a word instead of a number.')] = None
    recipe: Annotated[Path | None, typer.Option(
        '--recipe', metavar='FILE', rich_help_panel=_PANEL, help='Read these options from a file.'
    )] = None
    save_recipe: Annotated[Path | None, typer.Option(
        '--save-recipe', metavar='FILE', rich_help_panel=_PANEL, help='Write these options and '
        'the recognised columns to a file, for further recordings.')] = None

    @property
    def words(self) -> str:
        """The options as on a command line, for another command that reads the same file."""
        words = [f'--columns {shlex.quote(text)}' for text in self.columns or ()]
        words += [f'--{key.replace("_", "-")} {shlex.quote(str(value))}' for key, value in (
            ('rest_length', self.rest_length), ('max_pressure', self.max_pressure),
            ('max_strain', self.max_strain), ('sheet', self.sheet), ('recipe', self.recipe))
            if value is not None]
        if self.gauge is not None:
            words.append('--gauge' if self.gauge else '--absolute')
        return ' '.join([*words, *(['--drop-bad'] if self.drop_bad else [])])


def reads_data(command: Callable[..., None]) -> Callable[..., None]:
    """
    Add the options of `Reading` to a command, which gets them as its argument ``reading``.

    Typer reads options from the signature, so the command's signature is extended.
    """
    signature = inspect.signature(command)
    own = [entry.replace(kind=inspect.Parameter.KEYWORD_ONLY)
           for name, entry in signature.parameters.items() if name != 'reading']
    more = [inspect.Parameter(each.name, inspect.Parameter.KEYWORD_ONLY, default=None,
                              annotation=each.type) for each in fields(Reading)]

    @functools.wraps(command)
    def extended(**given: Any) -> None:
        reading = Reading(**{each.name: given.pop(each.name) for each in fields(Reading)})
        command(**given, reading=reading)

    extended.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=own + more)
    extended.__annotations__ = {entry.name: entry.annotation for entry in [*own, *more]}
    return extended


def read_data(files: Sequence[str], reading: Reading, model: Any = None) -> Any:
    """
    Return the Measurement of one or more files, and print how their columns were recognised.

    A model provides defaults of rest length and limits of pressure and strain.
    """
    from fam_bundle_ros.data import (
        join,
        load_recipe,
        read_recordings,
        Recipe,
        recipe_of,
        save_recipe,
        taken_words,
    )
    from fam_bundle_ros.discovery.reading import length_of, recipe_for
    recipe = Recipe() if reading.recipe is None else load_recipe(reading.recipe)
    columns = {}
    for entry in reading.columns or ():
        key, found, column = entry.partition('=')
        if not found or not column.strip():
            raise InputError(f"--columns '{entry}'; expected QUANTITY=COLUMN, for example "
                             '"length=L [mm]"')
        columns[key.strip()] = column.strip()
    told = {option: quantity(text, like, f'--{option.replace("_", "-")}')
            for option, text, like in (('rest_length', reading.rest_length, 'm'),
                                       ('max_pressure', reading.max_pressure, 'Pa')) if text}
    recipe = recipe.merged(columns=columns, gauge=reading.gauge, max_strain=reading.max_strain,
                           sheet=reading.sheet, drop_bad=reading.drop_bad, **told)
    length = length_of(model) if model else None
    if length is not None and recipe.rest_length is not None and abs(
            recipe.rest_length / length - 1.0) > 0.02:
        notes.print(f'note: --rest-length is {1e3 * recipe.rest_length:.4g} mm, the length of '
                    f'{model.name} {1e3 * length:.4g} mm')
    used = recipe if model is None else recipe_for(model, recipe)
    recordings = read_recordings(files, recipe=used)
    for measured in recordings:
        dropped = measured.dropped_words if measured.dropped else ''
        for line in filter(None, (taken_words(measured), dropped, *measured.notes)):
            notes.print(escape(f'{measured.name}: {line}'), style='dim', soft_wrap=True)
    if reading.save_recipe is not None:
        save_recipe(recipe_of(measured, recipe), reading.save_recipe)
        wrote(reading.save_recipe)
    return join(recordings)


def open_model(name: str, allow_python: bool = False):
    """Return the Bundle of a model file, or of a shipped model by its name."""
    from fam_bundle_ros.model import load_model
    return load_model(model_path(name), allow_python=allow_python)


def chosen_model(name: str | None, allow_python: bool = False):
    """Return the chosen model, by default the bundle of the paper, and print its muscle."""
    bundle = open_model(name or PAPER, allow_python)
    show_muscle(bundle)
    if name is None:
        console.print('no model was chosen: this is the bundle of the paper; for another give its '
                      'model file (fam_bundle new-model writes one)', style='dim', soft_wrap=True)
    return bundle


def show_muscle(bundle: Any) -> None:
    """Print the muscle of a result: the model's name and geometry."""
    from fam_bundle_ros.model.own_muscle import muscle_words
    console.print(escape(muscle_words(bundle)), style='dim', soft_wrap=True)


def muscle_of(bundle: Any) -> dict[str, Any]:
    """Return a model's name and dimensions, for JSON."""
    from fam_bundle_ros.model.own_muscle import dimensions_of
    return {'name': bundle.name, **dimensions_of(bundle)}


def quantity(text: str, like: str, option: str) -> float:
    """Return an option's value with its unit in SI; the error names the option."""
    from fam_bundle_ros.units import parse, spaced
    with about(option):
        return parse(spaced(text), like)


def yaml_to_write(path: Path, what: str = 'model') -> None:
    """Raise InputError for a path without a YAML suffix or where no file can be written."""
    if path.suffix not in ('.yaml', '.yml'):
        raise InputError(f'{path}: expected the name of a {what} file (.yaml) to write')
    refuse_unwritable(path)


def free_name(name: str) -> str:
    """Return the name of a new file, with a number if the file exists already."""
    path, number = Path(name), 2
    while path.exists():
        path, number = Path(name).with_stem(f'{Path(name).stem}_{number}'), number + 1
    return str(path)


def confirm(question: str, yes: bool) -> None:
    """Ask for confirmation unless ``yes``; InputError if the answer is no."""
    if not (yes or typer.confirm(question)):
        raise InputError('not confirmed: nothing was done')


def save_json(path: Path | None, result: Any) -> None:
    """Write the result to the file of ``--json``, if any."""
    if path is not None:
        from fam_bundle_ros.jsonfile import write_json
        write_json(path, result)
        wrote(path)


def save_page(path: Path, page: Any) -> None:
    """Write a page to the file of ``--out``."""
    from fam_bundle_ros.report.page import write_page
    write_page(path, page)
    wrote(path)


def wrote(*paths: Path | str) -> None:
    """Print on stderr which files were written."""
    for path in paths:
        notes.print(f'wrote {path}', style='dim', soft_wrap=True)


def page_files(recordings: Sequence[str], models: Sequence[str]) -> list[tuple[str, Path]]:
    """Return the files of a result for the provenance of its page."""
    return [*(('measurement', data_path(data)) for data in recordings),
            *(('model file', model_path(model)) for model in models)]


def check_first(result: Any) -> None:
    """Print mistakes in the data that a comparison suspects."""
    for slip in result.slips:
        console.print(f'[bold]check first[/bold]: {escape(slip)}', soft_wrap=True)


def table(columns: Sequence[str], rows: Iterable[Sequence[Any]], title: str = '',
          numeric: Sequence[int] = ()) -> None:
    """
    Print a table without borders; the columns ``numeric`` are aligned right.

    Cells are text, rich text, numbers (three significant digits) or None.
    """
    if title:
        console.print(title, style='bold')
    grid = Table(box=None, header_style='dim', pad_edge=False, padding=(0, 2, 0, 0))
    for index, name in enumerate(columns):
        right = index in numeric
        grid.add_column(name, justify='right' if right else 'left', overflow='fold')
    for row in rows:
        grid.add_row(*(cell if isinstance(cell, Text) else shown(cell) for cell in row))
    console.print(grid)


def parameter_table(parameters: Iterable[Any]) -> None:
    """Print estimates with their 95 % intervals."""
    table(('parameter', 'value', 'unit', '95 % interval', 'note'),
          [(e.key, f'{e.value:.4g}', e.unit, f'{e.interval[0]:.4g} to {e.interval[1]:.4g}', e.flag)
           for e in parameters], numeric=(1,))


@contextmanager
def progress_bar(words: str) -> Iterator[Callable[..., None]]:
    """
    Show the progress of long work on stderr: a bar, or lines if it is not a terminal.

    Yields a function of the share done (0 to 1) and a description of the present step.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    with Progress(TextColumn('{task.description}'), BarColumn(bar_width=30),
                  TimeElapsedColumn(), console=notes, transient=True,
                  disable=not notes.is_terminal) as bar:
        task, said = bar.add_task(words, total=1.0), time.monotonic()

        def tick(share: float, what: str = '') -> None:
            nonlocal said
            if not notes.is_terminal and time.monotonic() - said > SAY:
                said = time.monotonic()
                notes.print(f'{words}: {100.0 * share:.0f} %{f", {what}" if what else ""}',
                            soft_wrap=True)
            bar.update(task, completed=share, description=f'{words}: {what}' if what else words)

        yield tick


@contextmanager
def counter(words: str) -> Iterator[Callable[..., None]]:
    """Show a `progress_bar`; yields a function of number done, total, and description."""
    with progress_bar(words) as tick:
        yield lambda done, every, what='': tick(
            done / every, f'{done} of {every}{f", {what}" if what else ""}')


def candidate_table(entries: Iterable[Any], title: str, probability: str) -> None:
    """Print the candidates of a diagnosis, each under its label."""
    table(('candidate', probability, 'error (N)', 'why'),
          [(effect_name(c.effect, c.label), f'{c.probability:.2f}', c.error_N, c.why)
           for c in entries], title, numeric=(1, 2))


def effect_name(name: str, shown: str = '') -> Text:
    """Return an effect's name, or ``shown`` instead, in the effect's colour."""
    return Text(shown or name, style=palette.effect(name).dark)


def state_name(state: int) -> Text:
    """Return a recruitment state's name in its colour."""
    return Text(f'RS{state}', style=palette.recruitment_state(state).dark)
