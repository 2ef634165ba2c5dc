# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Import, compare and diagnose all recordings of a folder; results are stored and reused.

    found = run_campaign('recordings', 'model.yaml', 'results', specimens='specimens.csv')
    print(found)
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
import json
from pathlib import Path
from typing import Any

from fam_bundle_ros.atomic import write_whole
from fam_bundle_ros.campaign import job, tables
from fam_bundle_ros.campaign.pool import as_done
from fam_bundle_ros.campaign.recordings import find, MARK, Recording
from fam_bundle_ros.campaign.trends import Contrast, contrasts, Share, shares, Trend, trends
from fam_bundle_ros.campaign.version import code_version
from fam_bundle_ros.data import load_recipe, Recipe
from fam_bundle_ros.discovery import Choices
from fam_bundle_ros.errors import InputError, system_errors
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.resources import model_path
from fam_bundle_ros.told import counted, Told

FORMAT = 'fam-bundle-campaign/1'
#: Trends whose corrected probability is above this are not reported.
CLEAR = 0.05

Row = dict[str, Any]


@dataclass(frozen=True, repr=False)
class Campaign(Told):
    """
    Result of a campaign: many recordings compared with one model.

    Attributes
    ----------
    model : Bundle
        Nominal.
    recordings, effects, parameters : list of dict
        The rows of the tables; see `campaign.tables`.
    facts : dict of str to dict
        Numbers of the table of specimens for each muscle: the mean over its recordings.
    shares : list of Share
    contrasts : list of Contrast
    trends : list of Trend
        Contrasts and trends are in the order of their p values, also those not significant.
    computed : int
        Recordings computed in this run; the others were found in the folder of results.
    """

    model: Bundle
    recordings: list[Row]
    effects: list[Row]
    parameters: list[Row]
    facts: dict[str, dict[str, float]]
    shares: list[Share]
    contrasts: list[Contrast]
    trends: list[Trend]
    computed: int

    @property
    def failed(self) -> list[Row]:
        """Rows of recordings with an error."""
        return [row for row in self.recordings if row['status'] == 'failed']

    @property
    def counted(self) -> list[Row]:
        """Rows used for shares and trends: no errors, duplicates, or slips to check first."""
        return [row for row in self.recordings if row['counted']]

    @property
    def doubtful(self) -> list[Row]:
        """Rows of recordings that look as if a unit or sign were wrong."""
        return [row for row in self.recordings if row['check_first'] and not row['duplicate_of']]

    @property
    def muscles(self) -> dict[str, int]:
        """Number of recordings that count, for each muscle."""
        return dict(Counter(row['muscle'] for row in self.counted))

    @property
    def verdicts(self) -> dict[str, int]:
        """Number of recordings with each verdict, the most frequent first."""
        return dict(Counter(row['verdict'] for row in self.counted).most_common())

    @property
    def clear_trends(self) -> list[Trend]:
        """Trends that are significant (5 % probability of any false one)."""
        return [trend for trend in self.trends if trend.p < CLEAR]

    @property
    def clear_contrasts(self) -> list[Contrast]:
        """Contrasts that are significant (5 % probability of any false one)."""
        return [contrast for contrast in self.contrasts if contrast.p < CLEAR]

    @property
    def summary(self) -> str:
        """Numbers of recordings that failed, that count, and that have each verdict."""
        twice = sum(bool(row['duplicate_of']) for row in self.recordings)
        said = [counted(len(self.recordings), 'recording'), f'{len(self.failed)} failed',
                counted(twice, 'duplicate'),
                *([f'{len(self.doubtful)} to check first'] if self.doubtful else [])]
        return (f"{', '.join(said)}; {len(self.counted)} counted, of "
                f"{counted(len(self.muscles), 'muscle')}: "
                + ', '.join(f'{count} {name}' for name, count in self.verdicts.items()))

    def __str__(self) -> str:
        missing = [f'{share.effect} is missing in {share.muscles} of {share.of} muscles '
                   f'({100 * share.low:.0f} to {100 * share.high:.0f} %)'
                   for share in self.shares if share.muscles]
        return '\n'.join([self.summary, *missing, *map(str, self.clear_contrasts),
                          *map(str, self.clear_trends)])


@dataclass(frozen=True)
class Store:
    """Results by address (`job.Job.address`); the folder is made if it does not exist."""

    folder: Path

    def __post_init__(self) -> None:
        with system_errors(self.folder, 'cannot be made', '; expected a folder for results'):
            self.folder.mkdir(parents=True, exist_ok=True)

    def path(self, address: str) -> Path:
        """Return the file of a result."""
        return self.folder / f'{address}.json'

    def read(self, address: str) -> dict[str, Any] | None:
        """Return a result; None if there is no valid one."""
        try:
            result = json.loads(self.path(address).read_text(encoding='utf-8'))
        except (OSError, ValueError):
            return None
        return result if isinstance(result, dict) and 'passing' in result else None

    def is_done(self, address: str) -> bool:
        """Return whether there is a final result: not an error of the machine."""
        result = self.read(address)
        return result is not None and not result['passing']

    def write(self, address: str, result: dict[str, Any]) -> None:
        """Write a result atomically."""
        write_whole(self.path(address), json.dumps(result, indent=1, allow_nan=False))


def run_campaign(folder: str | Path, model: str | Path, out: str | Path, *,
                 recipe: Recipe | str | Path | None = None,
                 specimens: str | Path | None = None, choices: Choices | None = None,
                 pattern: str = '*', as_read: bool = False, allow_python: bool = False,
                 workers: int | None = None, scheduler: str | None = None,
                 progress: Callable[[int, int, str], None] | None = None) -> Campaign:
    """
    Diagnose all recordings of a folder, and write the tables.

    Parameters
    ----------
    folder : path
    model : path
        Model file, or the name of a model of this package.
    out : path
        Folder of results; existing results are not computed again. It gets
        ``recordings.parquet``, ``effects.parquet``, ``parameters.parquet`` and one JSON for each
        recording.
    recipe : Recipe or path, optional
        How to read the recordings.
    specimens : path, optional
        Table of dimensions and further numbers; see `read_specimens`. Recordings with the same
        text in a column ``muscle`` are of one muscle.
    choices : Choices, optional
    pattern : str
        Pattern of the file names, such as ``'*.csv'``.
    as_read : bool
        Whether recordings count that look as if a unit or sign were wrong.
    allow_python : bool
        Whether Python files of effects that the model names may be run.
    workers, scheduler
        See `campaign.pool.each`.
    progress : callable, optional
        Called with the number of finished recordings, the number of all, and the file.

    Raises
    ------
    InputError
        For a folder without recordings, a bad model, recipe or table, or a scheduler that does
        not answer. Errors of single recordings are in their rows.
    """
    import pandas  # noqa: F401  # imported here to fail before hours of work
    import pyarrow  # noqa: F401
    folder, out = Path(folder), Path(out)
    if folder.resolve().is_relative_to(out.resolve()):
        raise InputError(f'{out}: holds the recordings; expected another folder for the results')
    path = model_path(model)
    wanted = job.Model.of(path, allow_python)
    bundle = wanted.bundle()
    table = None if specimens is None else Path(specimens)
    skip = [] if recipe is None or isinstance(recipe, Recipe) else [Path(recipe)]
    how = recipe if isinstance(recipe, Recipe) else (
        Recipe() if recipe is None else load_recipe(recipe))
    chosen = choices or Choices()
    jobs = [job.Job(recording, wanted, how, chosen)
            for recording in find(folder, table, pattern, tuple(skip))]
    store = Store(out / 'recordings')
    write_whole(out / MARK, json.dumps({
        'format': FORMAT, 'folder': str(folder.resolve()), 'model': str(path.resolve()),
        'model_sha256': wanted.digest, 'recipe': asdict(how), 'choices': asdict(chosen),
        'specimens': None if table is None else str(table.resolve()),
        'code': code_version()}, indent=1))
    # recordings with the same address have the same result
    left = list({each.address: each for each in jobs if not each.recording.problem
                 and not store.is_done(each.address)}.values())
    for done, (place, result) in enumerate(as_done(
            job.run, left, workers, scheduler, job.lost), 1):
        store.write(left[place].address, result)
        if progress:
            progress(done, len(left), left[place].recording.file)
    found = _together(bundle, jobs, store, len(left), as_read)
    for name in ('recordings', 'effects', 'parameters'):
        tables.write_parquet(name, getattr(found, name), out / f'{name}.parquet')
    return found


def _together(bundle: Bundle, jobs: list[job.Job], store: Store, computed: int, as_read: bool,
              ) -> Campaign:
    """Return the campaign: tables of all results, and their statistics."""
    rows: list[Row] = []
    effects: list[Row] = []
    parameters: list[Row] = []
    # of files with equal content, one in the table of specimens is the original
    first: dict[str, str] = {}
    recordings = [each.recording for each in jobs]
    for recording in sorted(recordings, key=lambda each: each.specimen is None):
        first.setdefault(recording.sha256, recording.file)
    for each, recording in zip(jobs, recordings):
        # one at a time, to save memory
        result = {'error': recording.problem} if recording.problem else store.read(each.address)
        assert result is not None
        original = '' if recording.problem else first[recording.sha256]
        rows.append(tables.recording_row(recording, result, each.address,
                                         '' if original == recording.file else original, as_read))
        effects += tables.effect_rows(recording, result)
        parameters += tables.parameter_rows(recording, result)
    used = {row['file'] for row in rows if row['counted']}
    muscles = Counter(row['muscle'] for row in rows if row['file'] in used)
    facts = _facts([each for each in recordings if each.file in used])
    ranked = [row for row in effects if row['file'] in used]
    fitted = [row for row in parameters if row['file'] in used]
    return Campaign(bundle, rows, effects, parameters, facts, shares(ranked, muscles),
                    contrasts(ranked, muscles, facts), trends(fitted, facts), computed)


def _facts(recordings: list[Recording]) -> dict[str, dict[str, float]]:
    """Return for each muscle the mean of each number of the table over its recordings."""
    found: dict[str, dict[str, list[float]]] = {}
    for recording in recordings:
        for name, value in tables.facts_of(recording.specimen).items():
            if isinstance(value, float) and name != 'muscle':
                found.setdefault(recording.muscle, {}).setdefault(name, []).append(value)
    return {muscle: {name: sum(values) / len(values) for name, values in each.items()}
            for muscle, each in found.items()}
