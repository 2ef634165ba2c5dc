# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The command `demo`: closed loop on simulated hardware, a better model, and a report."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import shutil
import tempfile
import time
from typing import Annotated, Any

import typer

from fam_bundle_ros.cli.common import (
    console,
    effect_name,
    JsonFile,
    notes,
    open_model,
    save_json,
    table,
    wrote,
)
from fam_bundle_ros.errors import InputError, system_errors
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.told import number

#: Contents of a report folder; a folder with other files is never replaced.
_OURS = {'index.html', 'metrics.json', 'bag'}
MODEL = 'models/spie2021.yaml'
DATA = 'data/dmsp20_static_map.csv'
START = 'data/dmsp20_static_map.model.yaml'


def demo(
    out: Annotated[Path, typer.Option('--out', '-o', metavar='FOLDER', help='Folder of the report.'
                                      )] = Path('report'),
    seed: Annotated[int, typer.Option(help="Seed of the sensors' noise.", min=0)] = 0,
    json_file: JsonFile = None,
) -> None:
    """
    Run control and discovery on simulated hardware and real ROS 2, and write a report.

    A force and a strain trajectory that recruit and release the second motor unit, then a model
    of a measured muscle that is improved step by step.
    """
    # keep the nodes of the demo invisible to other machines
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    begin = time.perf_counter()
    with _fresh_folder(out) as folder, _steps() as step:
        bundle = open_model('spie2021')
        runs = _run_trajectories(bundle, folder, seed, step)
        diagnosis = _improve(step)
        with step('writing the report', 1.0):
            found = _write(folder, runs, diagnosis, bundle, seed, begin)
    _summary(found)
    wrote(out / 'index.html', out / 'metrics.json', out / 'bag')
    save_json(json_file, found)


Step = Callable[[str, float], Any]


def stories(bundle: Any) -> tuple[tuple[str, Any, str], ...]:
    """Return name, trajectory and description of the runs that recruit and release a unit."""
    from fam_bundle_ros.benchmarks.control_trajectories import make_trajectory, STRAIN
    from fam_bundle_ros.nodes.profile import load_profile
    from fam_bundle_ros.plant import MassSpring
    from fam_bundle_ros.simulation import Trajectory
    lift = load_profile('strain_steps')
    return (
        ('force', make_trajectory('ramp_20', bundle),
         'a force that rises through the overlap of the two recruitment states and falls back, '
         f'on a dynamometer that holds the strain at {100 * STRAIN:.0f} %.'),
        ('strain', Trajectory(lift.name, lift.kind, lift.duration, lift.value, lift.rate,
                              MassSpring(mass=5.0, damping=40.0), prepare=2.0),
         'a mass of 5 kg that is lifted to 16 % strain, held, and lowered again.'),
    )


def _run_trajectories(bundle: Any, folder: Path, seed: int, step: Step) -> list[Any]:
    from fam_bundle_ros.nodes.session import run_trajectory
    from fam_bundle_ros.report.demo_page import DemoRun
    runs = []
    for name, trajectory, words in stories(bundle):
        logs = {}
        for scheme, label in (('orderly', f'{name} trajectory on ROS 2'),
                              ('all_on', f'{name} trajectory, all units on')):
            with step(label, 12.0) as tick:
                logs[scheme] = run_trajectory(
                    bundle, trajectory, seed=seed, overrides={'scheme': scheme},
                    bag=folder / 'bag' / name if scheme == 'orderly' else None,
                    progress=tick, log_level='warn')
        runs.append(DemoRun(name, words, logs['orderly'], logs['all_on']))
    return runs


def _improve(step: Step) -> Any:
    from fam_bundle_ros import discovery
    from fam_bundle_ros.model import load_model
    with step('model of a measured muscle', 1.0) as tick:
        return discovery.diagnose(load_model(config_path(START)),
                                  discovery.read_measurement(config_path(DATA)), progress=tick)


def _write(folder: Path, runs: list[Any], diagnosis: Any, bundle: Any, seed: int,
           begin: float) -> dict[str, Any]:
    from fam_bundle_ros.jsonfile import write_json
    from fam_bundle_ros.plant import RigConfig
    from fam_bundle_ros.report.demo_page import demo_metrics, demo_page
    from fam_bundle_ros.report.page import write_page
    from fam_bundle_ros.report.paper import paper_figures
    found = demo_metrics(runs, diagnosis, bundle, RigConfig(), time.perf_counter() - begin, seed)
    files = [('model of the bundle', config_path(MODEL)), ('measured map', config_path(DATA)),
             ('initial model', config_path(START)),
             *((f'bag of the {run.name} trajectory', folder / 'bag' / run.name)
               for run in runs)]
    write_page(folder / 'index.html', demo_page(runs, diagnosis, found, bundle,
                                                paper_figures(bundle), files))
    write_json(folder / 'metrics.json', found)
    return found


def _summary(found: dict[str, Any]) -> None:
    rows = []
    for name, run in found['runs'].items():
        scale, unit = (1.0, 'N') if run['kind'] == 'force' else (100.0, '%')
        own = run['orderly']
        saving = 100.0 * run['air_saving']
        rows.append((name, ' → '.join(run['states']),
                     f'{number(scale * own["tracking_rms"])} {unit}',
                     f'{number(scale * own["largest_error"])} {unit}', own['switches'],
                     f'{1e6 * own["air_mass"]:.0f} mg',
                     f'{abs(saving):.1f} % {"less" if saving >= 0 else "more"}'))
    table(('trajectory', 'states', 'rms error', 'largest', 'switches', 'air',
           'than all on'), rows, title='Closed loop on ROS 2, simulated rig',
          numeric=(2, 3, 4, 5))
    model = found['model']
    console.print()
    table(('step', 'error (N)', 'held out (N)'),
          [(_step_name(row['step']), row['error_N'], row.get('held_out_N'))
           for row in model['steps']], numeric=(1, 2),
          title=f'Model against the measured DMSP-20 ({model["verdict"].replace("_", " ")}; noise '
                f'floor {number(model["noise_floor_N"], 2)} N)')
    held = model['recommended']
    console.print(f'held out: effects alone {number(held["held_out_physics_N"])} N, six-parameter '
                  f'empirical form {number(held["rivals_N"]["empirical"])} N, recommended model '
                  f'{number(held["held_out_N"])} N', soft_wrap=True)
    console.print(f'[dim]finished in {found["seconds"]:.0f} s[/dim]')


def _step_name(name: str) -> Any:
    if name.startswith('+ '):
        text = effect_name(name[2:])
        return type(text)('+ ') + text
    return name


@contextmanager
def _steps() -> Iterator[Step]:
    """Show a progress bar per step; yields a context manager of description and total."""
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
    with Progress(SpinnerColumn(finished_text='✓'), TextColumn('{task.description}'),
                  BarColumn(bar_width=24), TimeElapsedColumn(), console=notes) as bar:
        @contextmanager
        def step(words: str, total: float) -> Iterator[Callable[..., None]]:
            if not notes.is_terminal:
                notes.print(words)
            task = bar.add_task(words, total=total, visible=notes.is_terminal)

            def tick(done: float, what: str = '') -> None:
                bar.update(task, completed=done)

            yield tick
            tick(total)
        yield step


@contextmanager
def _fresh_folder(out: Path) -> Iterator[Path]:
    """Yield a new folder that replaces an older report when the block ends without error."""
    if out.exists():
        strange = sorted({p.name for p in out.iterdir()} - _OURS) if out.is_dir() else [out.name]
        if strange:
            raise InputError(f'{out}: contains {strange[0]}, which is not part of a report; '
                             'expected a new folder or that of an older report')
    with system_errors(out, 'cannot be written'):
        draft = Path(tempfile.mkdtemp(prefix=f'.{out.name}-', dir=out.parent))
    try:
        draft.chmod(0o755)
        (draft / 'bag').mkdir()
        yield draft
        if out.exists():
            shutil.rmtree(out)
        draft.rename(out)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
