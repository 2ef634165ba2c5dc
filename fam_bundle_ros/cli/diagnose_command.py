# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The command `diagnose`: one recording, several of one muscle, or several specimens."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from rich.markup import escape
import typer

from fam_bundle_ros.cli.common import (
    AllowPython,
    candidate_table,
    check_first,
    console,
    free_name,
    JsonFile,
    ModelOption,
    muscle_of,
    notes,
    Odds,
    open_model,
    page_files,
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
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.told import number


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
                                                   'write the recommended model (.yaml, and '
                                                   'the table of a model that has one).'
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
        _diagnose_specimens(bundle, specimens, recordings or [], reading, choices, model_out,
                            json_file)
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
        save_page(out, diagnosis_page(result, page_files(recordings, [model])))
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
    check_first(result.comparison)
    console.print(f'[bold]{result.verdict}[/bold]: {escape(result.summary)}', soft_wrap=True)
    # effects that stand for a mistake in the data must not be added
    if_right = 'if the data are right, ' if result.comparison.slips else ''
    error = result.error_N
    console.print(f"error {number(error['model'])} N at present, {number(error['recalibrated'])} "
                  f"N recalibrated, {number(error['best'])} N at best; noise floor "
                  f'{number(result.noise.value)} N ({result.noise.basis})')
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
    from fam_bundle_ros.discovery.templates import SHARE
    _list(f'shapes of the remaining error (% {SHARE})', result.shapes_left)
    if result.verdict != 'adequate':
        _list('where the model fails', result.located)
    console.print(f'[bold]next[/bold]: {escape(result.next_experiment)}', soft_wrap=True)
    for note in result.notes:
        console.print(f'note: {escape(note)}', style='dim', soft_wrap=True)


def _list(title: str, items: Sequence[Any]) -> None:
    if items:
        console.print(title, style='bold')
    for item in items:
        console.print(f'  {escape(str(item))}', soft_wrap=True)


def _diagnose_specimens(bundle: Any, path: Path, files: list[str], reading: Reading,
                        choices: Any, model_out: Path | None, json_file: Path | None) -> None:
    """
    Diagnose the specimens of a table (or only those of ``files``) together.

    The model of each is ``better_<specimen>.yaml`` for the option ``better.yaml``.
    """
    from fam_bundle_ros import discovery
    from fam_bundle_ros.model import save_model
    told = {specimen.data.resolve(): specimen for specimen in discovery.read_specimens(path)}
    strange = [file for file in files if Path(file).resolve() not in told]
    if strange:
        raise InputError(f"{strange[0]}: not in column 'file' of {path}, which has "
                         f"{', '.join(str(s.data) for s in told.values())}")
    chosen = [told[Path(file).resolve()] for file in files] or list(told.values())
    specimens = [replace(s, data=read_data([str(s.data)], reading, s.model(bundle)))
                 for s in chosen]
    with progress_bar('diagnose') as tick:
        result = discovery.diagnose_specimens(bundle, specimens, progress=tick, choices=choices)
    show_muscle(bundle)
    for title, text in result.headlines:
        console.print(f'[bold]{escape(title)}:[/bold] {escape(text)}', soft_wrap=True)
    table(('specimen', 'verdict', 'error (N)', 'recalibrated (N)', 'best (N)', 'held out (N)',
           'tolerances moved'),
          [(each.name, each.finding.verdict, *(each.error_N[key] for key in (
              'model', 'recalibrated', 'best', 'held_out')), each.moved_words)
           for each in result.verdicts], numeric=(2, 3, 4, 5))
    for each in result.verdicts:
        for note in each.notes:
            console.print(escape(f'{each.name}: {note}'), soft_wrap=True)
    table(('effect', 'probability'), [(name, f'{p:.2f}') for name, p in list(
        result.probability.items())[:6]], numeric=(1,))
    for constant in result.constants:
        console.print(escape(str(constant)), soft_wrap=True)
    if model_out is not None:
        for each in result.verdicts:
            out = model_out.with_name(f'{model_out.stem}_{each.name}{model_out.suffix}')
            save_model(each.model, out)
            wrote(out)
    save_json(json_file, result.to_dict())
