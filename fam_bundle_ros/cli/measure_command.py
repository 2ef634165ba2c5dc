# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The command `measure`: runs and records an experiment."""

from itertools import accumulate
from pathlib import Path
from typing import Annotated, Any

from rich.markup import escape
import typer

from fam_bundle_ros.cli.common import (
    AllowPython,
    chosen_model,
    confirm,
    console,
    ControllerModel,
    JsonFile,
    Namespace,
    notes,
    open_model,
    PlantModel,
    progress_bar,
    save_json,
    table,
    wrote,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.told import counted

#: Largest number of segments that are listed; of more, the first ones and the last.
_LISTED = 20


def measure(
    protocol: Annotated[str, typer.Argument(metavar='PROTOCOL', help='Protocol file, or the name '
                                            'of a shipped one, such as spie2021.')],
    out: Annotated[Path, typer.Option('--out', '-o', metavar='FILE', help='New CSV for the '
                                      'recording.')] = Path('measured.csv'),
    model: ControllerModel = None,
    plant_model: PlantModel = None,
    rig: Annotated[bool, typer.Option('--rig', help='Use a running bundle (a rig and its '
                                      'controller) instead of a simulated one.')] = False,
    resume: Annotated[bool, typer.Option('--resume', help='Continue an unfinished experiment; '
                                         'complete segments are kept.')] = False,
    dry_run: Annotated[bool, typer.Option('--dry-run', help='Only print the segments and their '
                                          'duration.')] = False,
    namespace: Namespace = 'bundle',
    seed: Annotated[int, typer.Option(help='Seed of the noise of the simulated rig.', min=0)] = 0,
    yes: Annotated[bool, typer.Option('--yes', help='With --rig: do not ask.')] = False,
    json_file: JsonFile = None,
    allow_python: AllowPython = False,
) -> None:
    """
    Run an experiment on a simulated or a real rig, and record it as a CSV.

    Isobars, holds, minor loops, pressure steps and sweeps, as listed in a protocol. Complete
    segments are kept: after Ctrl-C or a stop --resume continues. `compare` and `diagnose` read the
    CSV.
    """
    from fam_bundle_ros.data.protocol import read_protocol
    from fam_bundle_ros.data.segment_store import SegmentStore
    from fam_bundle_ros.nodes.measuring import fits, Stopped, with_room
    from fam_bundle_ros.nodes.measuring import measure as drive
    if rig and (model is None or plant_model is not None):
        raise InputError('--rig without --model; expected the model file of the muscles on the '
                         'rig' if model is None else '--rig and --plant-model exclude each other')
    plan = read_protocol(protocol)
    bundle = chosen_model(model, allow_python)
    plant = None if plant_model is None else open_model(plant_model, allow_python)
    if not rig:
        allowed, bundle = bundle, with_room(plan, bundle)
        plant = None if plant is None else with_room(plan, plant)
        if any(bundle.max_pressure > allowed.max_pressure):
            notes.print(f'note: the simulated rig may go beyond the max_pressure of '
                        f'{escape(allowed.name)}, as the protocol asks; a rig may not')
    fits(plan, bundle)
    store = SegmentStore(out, plan, bundle.names, resume)
    result = _announce(plan, store.done, rig)
    if dry_run:
        save_json(json_file, result)
        return
    if rig:
        confirm(f'The muscles will be filled up to {max(plan.highest) / 1e3:.0f} kPa and will '
                  'move: is everybody away from them and the stop button within reach?', yes)
    try:
        with progress_bar('measure') as tick:
            drive(plan, out, bundle, plant_model=plant, rig=rig, resume=resume,
                  namespace=namespace.strip('/'), seed=seed, progress=tick)
    except (Stopped, KeyboardInterrupt) as end:
        if isinstance(end, Stopped):
            notes.print(f'[bold red]stopped and vented[/bold red]: {escape(str(end))}',
                        soft_wrap=True)
        notes.print(f"{len(store.done)} of {result['segments']} segments are kept in "
                    f'{store.folder}; --resume continues' if store.done else
                    'no segment was complete: nothing is kept', soft_wrap=True)
        if isinstance(end, Stopped):
            raise typer.Exit(1) from None
        raise
    wrote(out, out.with_suffix('.protocol.yaml'))
    save_json(json_file, {**result, 'file': out})


def _announce(plan: Any, done: frozenset[int], rig: bool) -> dict[str, Any]:
    """Print the segments and their duration; return a summary."""
    from fam_bundle_ros.data.protocol import minutes, segments
    planned = segments(plan)
    todo = [segment for segment in planned if segment.number not in done]
    left = sum(segment.duration for segment in todo)
    begins = accumulate((segment.duration for segment in todo), initial=0.0)
    rows: list[tuple[Any, str, str]] = [
        (segment.number, minutes(begin), segment.course.words)
        for segment, begin in zip(todo, begins)]
    if len(rows) > _LISTED:
        rows = [*rows[:_LISTED - 1], ('...', '', ''), rows[-1]]
    console.print(f'[bold]{escape(plan.name)}[/bold]: {counted(len(planned), "segment")}'
                  + (f', {len(done)} of them done' if done else '') + f', {minutes(left)}'
                  + ('' if rig else ' (a simulated rig takes less)'), soft_wrap=True)
    table(('segment', 'from', 'what'), rows)
    return {'protocol': plan.name, 'segments': len(planned), 'done': len(done), 'seconds': left}
