# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The command `campaign`: import, compare and diagnose over a folder of recordings."""

from pathlib import Path
from typing import Annotated

from rich.markup import escape
import typer

from fam_bundle_ros.cli.common import (
    AllowPython,
    console,
    counter,
    JsonFile,
    ModelOption,
    muscle_of,
    Odds,
    save_json,
    SchedulerOption,
    show_muscle,
    table,
    Unexplained,
    WorkersOption,
    wrote,
)
from fam_bundle_ros.resources import model_path

#: Largest number of doubtful and of failed recordings that are printed; the page lists all.
_MOST = 10


def campaign(
    folder: Annotated[Path, typer.Argument(metavar='FOLDER', help='Recordings, also in '
                                           'subfolders: logs and ROS 2 bags.')],
    model: ModelOption,
    out: Annotated[Path, typer.Option('--out', '-o', metavar='FOLDER', help='Results: tables '
                                      '(Parquet), the page (index.html), a JSON for each '
                                      'recording. Existing results are not computed again.')],
    recipe: Annotated[Path | None, typer.Option('--recipe', metavar='FILE', help='How the '
                                                'recordings are read; diagnose --save-recipe '
                                                'writes one.')] = None,
    specimens: Annotated[Path | None, typer.Option(
        '--specimens', metavar='TABLE', help='A CSV with a column "file" (paths from the folder '
        'of the table), dimensions with their units in brackets, further numbers such as an '
        'age, and a column "muscle" if several recordings are of one muscle.')] = None,
    pattern: Annotated[str, typer.Option(help='Pattern of the file names, "*.csv".')] = '*',
    as_read: Annotated[bool, typer.Option('--as-read', help='Also count recordings that look as '
                                          'if a unit or sign were wrong.')] = False,
    unexplained: Unexplained = 0.01,
    odds: Odds = 20.0,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    json_file: JsonFile = None,
    allow_python: AllowPython = False,
) -> None:
    """
    Diagnose hundreds of recordings: which effects are missing, and what this correlates with.

    Started again after it was stopped or killed, it continues. A recording that fails is in the
    tables with its error, and the exit status is still 0. The JSON has `recordings`, `verdicts`,
    `shares`, `contrasts` and `trends`.
    """
    from fam_bundle_ros.campaign import run_campaign
    from fam_bundle_ros.discovery import Choices
    from fam_bundle_ros.report.campaign_page import campaign_page
    from fam_bundle_ros.report.page import write_page
    with counter('campaign') as tick:
        result = run_campaign(
            folder, model, out, recipe=recipe, specimens=specimens, pattern=pattern,
            as_read=as_read, choices=Choices(unexplained=unexplained, odds=odds),
            allow_python=allow_python,
            workers=workers, scheduler=scheduler, progress=tick)
    show_muscle(result.model)
    known = len(result.recordings) - result.computed
    console.print(escape(result.summary)
                  + (f'; {known} were already computed' if known else ''), soft_wrap=True)
    table(('effect', 'muscles that lack it', 'of', 'tied'),
          [(share.effect, share.muscles, share.of, share.tied) for share in result.shares],
          numeric=(1, 2, 3))
    for found in (*result.clear_contrasts, *result.clear_trends):
        console.print(escape(str(found)), soft_wrap=True)
    for row in result.doubtful[:_MOST]:
        console.print(f"[bold]check first[/bold]: {escape(row['file'])}: "
                      f"{escape(row['check_first'])}", soft_wrap=True)
    if len(result.doubtful) > _MOST:
        console.print(f'... and {len(result.doubtful) - _MOST} more to check first')
    for row in result.failed[:_MOST]:
        console.print(f"failed: {escape(row['file'])}: {escape(row['error'])}", soft_wrap=True)
    if len(result.failed) > _MOST:
        console.print(f'... and {len(result.failed) - _MOST} more that failed')
    files = [('model file', model_path(model)),
             *([('recipe', recipe)] if recipe else []),
             *([('table of specimens', specimens)] if specimens else [])]
    page = write_page(out / 'index.html', campaign_page(result, files, [
        ('recordings in', str(folder.resolve())), ('structure that is normal', f'{unexplained:g}'),
        ('odds of a tie', f'{odds:g}')]))
    wrote(*(out / f'{name}.parquet' for name in ('recordings', 'effects', 'parameters')), page)
    save_json(json_file, {'muscle': muscle_of(result.model), 'recordings': result.recordings,
                          'verdicts': result.verdicts, 'shares': result.shares,
                          'contrasts': result.contrasts, 'trends': result.trends})
