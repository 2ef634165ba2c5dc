# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands on measurements: `compare`, `convert`, `workbench`."""

from pathlib import Path
from typing import Annotated

from rich.markup import escape
import typer

from fam_bundle_ros.cli.common import (
    AllowPython,
    check_first,
    console,
    JsonFile,
    ModelOption,
    muscle_of,
    open_model,
    page_files,
    PageFile,
    read_data,
    Reading,
    reads_data,
    save_json,
    save_page,
    show_muscle,
    table,
    wrote,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.resources import data_path, model_path
from fam_bundle_ros.told import number


@reads_data
def compare(
    recordings: Annotated[list[str], typer.Argument(
        metavar='DATA', help='Log (CSV or text, .xlsx, .lvm, .tdms, .mat, .parquet), ROS 2 bag, '
        'or the name of shipped data; several files of one muscle are joined, as trials or as one '
        'file for each sensor.')],
    model: ModelOption,
    out: PageFile = None,
    json_file: JsonFile = None,
    allow_python: AllowPython = False,
    *,
    reading: Reading,
) -> None:
    """Compare a model with a measurement: how large the error is, and where."""
    from fam_bundle_ros import discovery
    bundle = open_model(model, allow_python)
    measured = read_data(recordings, reading, bundle)
    result = discovery.compare(bundle, measured)
    show_muscle(bundle)
    console.print(f'[bold]{number(result.error_N)} N rms[/bold], '
                  f'{number(100 * result.relative_error, 2)} % of the force; mean '
                  f'{number(result.bias_N, sign=True)} N, largest {number(result.largest_N)} N')
    check_first(result)
    if result.history:
        console.print(escape(result.history), soft_wrap=True)
    console.print(escape(str(result.noise)))
    for name in ('pressure', 'strain', 'direction', 'region', 'motor_unit'):
        rows = result.tables.get(name, [])
        if len(rows) > 1:
            table((name.replace('_', ' '), 'rows', 'error (N)', 'mean (N)', ''),
                  [(row['label'], row['samples'], row['error_N'], row['bias_N'],
                    '' if row['beyond_noise'] else 'noise') for row in rows], numeric=(1, 2, 3))
    console.print('where it fails' if result.located
                  else 'in no region is the error above the noise', style='bold')
    for region in result.located:
        console.print(f'  {escape(str(region))}')
    if out is not None:
        from fam_bundle_ros.report.discovery_pages import comparison_page
        save_page(out, comparison_page(result, bundle, page_files(recordings, [model])))
    save_json(json_file, {**result.to_dict(), 'muscle': muscle_of(bundle),
                          'data': measured.to_dict()})


@reads_data
def convert(
    source: Annotated[str, typer.Argument(metavar='DATA', help='ROS 2 bag (folder, .mcap, .db3) '
                                          'or a log of any format.')],
    target: Annotated[Path, typer.Argument(metavar='OUT', help='CSV file (.csv) to write, or '
                                           'a name without suffix for a bag.')],
    model: Annotated[str | None, typer.Option('--model', '-m', metavar='MODEL', help='Add the '
                                              'force of this model and the residual.')] = None,
    json_file: JsonFile = None,
    allow_python: AllowPython = False,
    *,
    reading: Reading,
) -> None:
    """Convert a bag or log to a CSV of strain, pressure (kPa), force (N), or a log to a bag."""
    from fam_bundle_ros.discovery import compare as compare_with
    from fam_bundle_ros.discovery import write_bag, write_csv
    if target.suffix not in ('.csv', ''):
        raise InputError(f'{target}: expected the name of a CSV file (.csv) to write, or a name '
                         'without suffix for the folder of a bag')
    if model is not None and not target.suffix:
        raise InputError(f'{target}: --model adds columns to a CSV; expected a name that ends in '
                         '.csv')
    bundle = None if model is None else open_model(model, allow_python)
    measured = read_data([source], reading, bundle)
    extra = {}
    if bundle is not None:
        show_muscle(bundle)
        result = compare_with(bundle, measured)
        extra = {'model force [N]': result.prediction, 'residual [N]': result.residual}
    if target.suffix:
        write_csv(measured, target, extra)
    else:
        write_bag(measured, target)
    console.print(escape(str(measured)), soft_wrap=True)
    wrote(target)
    save_json(json_file, {'source': source, **measured.to_dict()})


def workbench(
    data: Annotated[str | None, typer.Argument(metavar='[DATA]', help='Measurement to open with.'
                                               )] = None,
    model: Annotated[str | None, typer.Option('--model', '-m', metavar='MODEL', help='Model file, '
                                              'or name of a shipped model.')] = None,
    host: Annotated[str, typer.Option(help='Address to listen at.')] = '127.0.0.1',
    port: Annotated[int, typer.Option(help='Port to listen at.', min=1, max=65535)] = 8080,
    token: Annotated[str | None, typer.Option(help='Needed for an address other than this '
                                              'machine: 8 letters and digits or more.')] = None,
    show: Annotated[bool, typer.Option(help='Open a browser.')] = True,
) -> None:
    """Open the web page that shows where a model fails, and improves it."""
    from fam_bundle_ros.workbench.main import run
    run(data=None if data is None else data_path(data),
        model=None if model is None else model_path(model), host=host, port=port, token=token,
        show=show)
