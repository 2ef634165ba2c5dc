# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""`diagnose --specimens`: several recordings, one table of dimensions."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.markup import escape

from fam_bundle_ros.cli.common import (
    console,
    progress_bar,
    read_data,
    Reading,
    save_json,
    show_muscle,
    table,
    wrote,
)
from fam_bundle_ros.errors import InputError


def diagnose_table(bundle: Any, path: Path, files: list[str], reading: Reading, choices: Any,
                   model_out: Path | None, json_file: Path | None) -> None:
    """
    Diagnose the specimens of a table together, print the result, and write their models.

    Parameters
    ----------
    bundle : Bundle
        With nominal dimensions.
    path : Path
        The table.
    files : list of str
        Recordings of the table to use; empty for all.
    reading : Reading
    choices : Choices
    model_out : Path, optional
        ``better.yaml`` writes ``better_<specimen>.yaml`` for each.
    json_file : Path, optional
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
