# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What every command shares: arguments, finding files, tables, results as JSON."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
import re
import sys
from typing import Annotated, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text
import typer

from fam_bundle_ros import palette
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.resources import config_names, config_path

#: A pipe or a file has no width: wide enough that no row of a table is folded for it.
_PIPE_WIDTH = 160
#: Results go here; progress and notes to `notes`, so that a pipe gets the results only.
console = Console(highlight=False, width=None if sys.stdout.isatty() else _PIPE_WIDTH)
notes = Console(stderr=True, highlight=False)

JsonFile = Annotated[Path | None, typer.Option('--json', metavar='FILE', help='Also write the '
                                               'result as JSON.')]
AllowPython = Annotated[bool, typer.Option('--allow-python', help='Run Python files of effects '
                                           'that a model names. Only for models you trust.')]
ModelArgument = Annotated[str, typer.Argument(metavar='MODEL', help='Model file, or a name that '
                                              'ships.')]
ModelOption = Annotated[str, typer.Option('--model', '-m', metavar='MODEL', help='Model file, or '
                                          'a name that ships.')]


def open_model(name: str, allow_python: bool = False):
    """Return the Bundle of a model file, or of a shipped model by its name."""
    from fam_bundle_ros.model import load_model
    return load_model(model_path(name), allow_python=allow_python)


def model_path(name: str) -> Path:
    """Return the path of a model file, or of a shipped model by its name."""
    path = Path(name)
    shipped = {Path(file).name.removesuffix('.yaml').removesuffix('.model'): f'{folder}/{file}'
               for folder in ('data', 'models') for file in config_names(folder)
               if file.endswith('.model.yaml') or (folder == 'models' and
                                                   file.endswith('.yaml'))}
    if path.exists() or name not in shipped:
        if not path.exists():
            raise InputError(f'{name}: no such model file; models that ship: '
                             f'{", ".join(sorted(shipped))}')
        return path
    return config_path(shipped[name])


def data_path(name: str) -> Path:
    """Return the path of a measurement, or of one that ships by its name."""
    path = Path(name)
    if path.exists():
        return path
    shipped = [file for file in config_names('data') if file.endswith('.csv')]
    if f'{name}.csv' in shipped:
        return config_path(f'data/{name}.csv')
    known = ', '.join(file.removesuffix('.csv') for file in shipped)
    raise InputError(f'{name}: no such file or bag; measurements that ship: {known or "none"}')


def spaced(text: str) -> str:
    """Return a quantity with a space before its unit: on a command line people write 5ms."""
    return re.sub(r'^([-+]?[\d.]+(?:e[-+]?\d+)?)(?=[^\d.\s])', r'\1 ', text.strip(), flags=re.I)


def quantity(text: str, like: str, option: str) -> float:
    """Return an option's value with its unit in SI; the error names the option."""
    from fam_bundle_ros.units import parse
    try:
        return parse(spaced(text), like)
    except InputError as error:
        raise InputError(f'{option}: {error}') from error


def save_json(path: Path | None, result: Any) -> None:
    """Write the result where ``--json`` asks for it."""
    if path is not None:
        from fam_bundle_ros.report.files import write_json
        write_json(path, result)
        wrote(path)


def wrote(*paths: Path | str) -> None:
    """Say what was written, on stderr."""
    for path in paths:
        notes.print(f'wrote {path}', style='dim', soft_wrap=True)


def table(columns: Sequence[str], rows: Iterable[Sequence[Any]], title: str = '',
          numeric: Sequence[int] = ()) -> None:
    """
    Print a table without lines but the one under its head.

    Parameters
    ----------
    columns : sequence of str
    rows : sequence of sequence
        Cells: text, rich text, numbers (three significant digits) or None.
    title : str
    numeric : sequence of int
        Columns that are set right.
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


def shown(value: Any) -> str:
    """Return a cell's text."""
    if value is None or (isinstance(value, float) and value != value):
        return '–'
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    if isinstance(value, float):
        from fam_bundle_ros.report.numbers import number
        return number(value)
    return str(value)


@contextmanager
def progress_bar(words: str) -> Iterator[Callable[..., None]]:
    """
    Show how far long work is, on stderr.

    Yields a function of the share done (0 to 1) and a word about what is being done.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    with Progress(TextColumn('{task.description}'), BarColumn(bar_width=30),
                  TimeElapsedColumn(), console=notes, transient=True,
                  disable=not notes.is_terminal) as bar:
        task = bar.add_task(words, total=1.0)

        def tick(share: float, what: str = '') -> None:
            bar.update(task, completed=share, description=f'{words}: {what}' if what else words)

        yield tick


def effect_name(name: str) -> Text:
    """Return an effect's name in its colour."""
    return Text(name, style=palette.effect(name).dark)


def state_name(state: int) -> Text:
    """Return a recruitment state's name in its colour."""
    return Text(f'RS{state}', style=palette.recruitment_state(state).dark)
