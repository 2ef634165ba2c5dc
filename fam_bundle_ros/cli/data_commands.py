# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands that read measurements: `compare`, `diagnose`, `convert`, `workbench`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from rich.markup import escape
import typer

from fam_bundle_ros.cli.common import (
    AllowPython,
    candidate_table,
    console,
    free_name,
    JsonFile,
    ModelOption,
    muscle_of,
    notes,
    Odds,
    open_model,
    PageFile,
    parameter_table,
    progress_bar,
    read_data,
    Reading,
    reads_data,
    save_json,
    save_page,
    show_muscle,
    table,
    Unexplained,
    wrote,
    yaml_to_write,
)
from fam_bundle_ros.cli.specimens import diagnose_table
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.resources import data_path, model_path


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
    console.print(f'[bold]{result.error_N:.3g} N rms[/bold], {100 * result.relative_error:.2g} % '
                  f'of the force; mean {result.bias_N:+.3g} N, largest {result.largest_N:.3g} N')
    _check_first(result)
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
        save_page(out, comparison_page(result, bundle, _files(recordings, model)))
    save_json(json_file, {**result.to_dict(), 'muscle': muscle_of(bundle),
                          'data': measured.to_dict()})


@reads_data
def diagnose(
    recordings: Annotated[list[str] | None, typer.Argument(
        metavar='DATA', help='Log (CSV or text, .xlsx, .lvm, .tdms, .mat, .parquet), ROS 2 bag, '
        'or the name of shipped data. With --specimens several, or none for all of the table; '
        'with --one-muscle several.'
    )] = None,
    model: ModelOption = ...,  # type: ignore[assignment]
    specimens: Annotated[Path | None, typer.Option('--specimens', metavar='TABLE', help='Several '
                                                   'muscles together: a CSV with a column "file", '
                                                   'dimensions with their units in brackets '
                                                   '(length, diameter, ...), and further numbers, '
                                                   'such as an age.')] = None,
    out: PageFile = None,
    model_out: Annotated[Path | None, typer.Option('--model-out', metavar='FILE', help='Also '
                                                   'write the recommended model (.yaml, with a '
                                                   'table if it has a discrepancy).'
                                                   )] = None,
    one_muscle: Annotated[bool, typer.Option('--one-muscle', help='Diagnose several recordings of '
                                             'the same muscle together.')] = False,
    protocol_out: Annotated[Path | None, typer.Option('--protocol-out', metavar='FILE',
                                                      help='Also write the next experiment as a '
                                                      'protocol (.yaml) for `measure`.')] = None,
    unexplained: Unexplained = 0.01,
    odds: Odds = 20.0,
    json_file: JsonFile = None,
    allow_python: AllowPython = False,
    *,
    reading: Reading,
) -> None:
    """Find the physical effect that a model is missing, if any, and what to measure next."""
    from fam_bundle_ros import discovery
    from fam_bundle_ros.data import save_protocol
    bundle = open_model(model, allow_python)
    choices = discovery.Choices(unexplained=unexplained, odds=odds)
    for what, file in (('model', model_out), ('protocol', protocol_out)):
        if file is not None:
            yaml_to_write(file, what)
    if specimens is not None:
        for option, file in (('--out', out), ('--protocol-out', protocol_out)):
            if file is not None:
                raise InputError(f'{option} {file}: not available for several specimens; expected '
                                 '--json')
        diagnose_table(bundle, specimens, recordings or [], reading, choices, model_out, json_file)
        return
    if not recordings or (len(recordings) > 1 and not one_muscle):
        raise InputError(f'{len(recordings or [])} recordings; expected one, or --specimens with '
                         'a table of their dimensions, or --one-muscle if all are of one muscle')
    measured = read_data(recordings, reading, bundle)
    with progress_bar('diagnose') as tick:
        result = discovery.diagnose(bundle, measured, progress=tick, choices=choices)
    show_muscle(bundle)
    _show_diagnosis(result, recordings, reading, model)
    if out is not None:
        from fam_bundle_ros.report.discovery_pages import diagnosis_page
        save_page(out, diagnosis_page(result, _files(recordings, model)))
    save_json(json_file, {**result.to_dict(), 'muscle': muscle_of(bundle),
                          'data': measured.to_dict()})
    if model_out is not None:
        wrote(*result.recommended.save(model_out))
    if protocol_out is not None and result.next_protocol is not None:
        save_protocol(result.next_protocol, protocol_out)
        wrote(protocol_out)
        console.print(f'measure: [bold]fam_bundle measure {escape(str(protocol_out))} --model '
                      f'{escape(model)} --out next.csv[/bold], then diagnose both recordings '
                      'with --one-muscle', soft_wrap=True)
    elif protocol_out is not None:
        notes.print(f'note: {protocol_out} was not written: the next experiment is not a force '
                    'test')


def _show_diagnosis(result: Any, recordings: list[str], reading: Reading, model: str) -> None:
    _check_first(result.comparison)
    console.print(f'[bold]{result.verdict}[/bold]: {escape(result.summary)}', soft_wrap=True)
    # effects that stand for a mistake in the data must not be added
    if_right = 'if the data are right, ' if result.comparison.slips else ''
    error = result.error_N
    console.print(f"error {error['model']:.3g} N at present, {error['recalibrated']:.3g} N "
                  f"recalibrated, {error['best']:.3g} N at best; noise floor "
                  f'{result.noise.value:.3g} N ({result.noise.basis})')
    if result.shortlist:
        answered = result.verdict != 'unexplained'
        candidate_table(result.shortlist, '' if answered else result.shortlist_title,
                        'probability' if answered else 'among these')
    console.print(if_right + escape(str(result.recommended)), soft_wrap=True)
    words = [*result.shapes, *(f'--replace {old}={new}' for old, new in result.replaced.items()),
             *(f'--remove {name}' for name in result.removed)]
    if words and len(recordings) > 1:
        console.print(f"{if_right}add: the same with [bold]--model-out "
                      f"{free_name('better.yaml')}[/bold] writes the model")
    elif words:
        data = f'{recordings[0]} {reading.words}'.rstrip()
        console.print(f"{if_right}add: [bold]fam_bundle add {' '.join(words)} --data "
                      f'{escape(data)} --model {escape(model)} --out '
                      f"{free_name('better.yaml')}[/bold]", soft_wrap=True)
    for group in result.tied:
        console.print(f'cannot be distinguished in these data: {", ".join(group)}')
    if result.parameters:
        parameter_table(result.parameters)
    if result.verdict in ('unexplained', 'partial'):
        _list('shapes of the remaining error', result.shapes_left)
    if result.verdict != 'adequate':
        _list('where the model fails', result.located)
    console.print(f'[bold]next[/bold]: {escape(result.next_experiment)}', soft_wrap=True)
    for note in result.notes:
        console.print(f'note: {escape(note)}', style='dim', soft_wrap=True)


def _check_first(result: Any) -> None:
    for slip in result.slips:
        console.print(f'[bold]check first[/bold]: {escape(slip)}', soft_wrap=True)


def _list(title: str, items: Sequence[Any]) -> None:
    if items:
        console.print(title, style='bold')
    for item in items:
        console.print(f'  {escape(str(item))}', soft_wrap=True)


def _files(recordings: list[str], model: str) -> list[tuple[str, Path]]:
    return [*(('measurement', data_path(data)) for data in recordings),
            ('model file', model_path(model))]


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
                                              'machine.')] = None,
    show: Annotated[bool, typer.Option(help='Open a browser.')] = True,
) -> None:
    """Open the web page that shows where a model fails, and improves it."""
    from fam_bundle_ros.workbench.main import run
    run(data=None if data is None else data_path(data),
        model=None if model is None else model_path(model), host=host, port=port, token=token,
        show=show)
