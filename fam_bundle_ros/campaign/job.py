# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Import, compare and diagnose one recording of a campaign; results and errors are plain dicts."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
import hashlib
import json
from pathlib import Path
import socket
from typing import Any

from fam_bundle_ros.campaign.recordings import Recording
from fam_bundle_ros.campaign.version import code_version
from fam_bundle_ros.data import read_measurement, Recipe
from fam_bundle_ros.data.measurement import file_digest
from fam_bundle_ros.discovery import Choices, diagnose
from fam_bundle_ros.discovery.reading import recipe_for
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.jsonfile import plain
from fam_bundle_ros.model import Bundle, loads_model

#: Format of a result; if it changes, all results are computed again.
FORMAT = 'fam-bundle-campaign-result/2'


@dataclass(frozen=True)
class Model:
    """The text of a model file, with its name and the folder of relative paths in it."""

    text: str
    where: str
    folder: str
    allow_python: bool = False

    @classmethod
    def of(cls, path: Path, allow_python: bool = False) -> 'Model':
        """Return the model of a file; InputError if it cannot be read."""
        try:
            text = path.read_text(encoding='utf-8')
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f'{path}: cannot be read ({error}); expected a model file') from error
        return cls(text, path.name, str(path.parent.resolve()), allow_python)

    def bundle(self) -> Bundle:
        """Return the model as a `Bundle`."""
        return _bundle(self)

    @cached_property
    def digest(self) -> str:
        """Hash of the text and of the content of every table and Python file that it names."""
        whole = hashlib.sha256(self.text.encode())
        for effect in self.bundle().effects:
            named = (effect.python_file, effect.options().get('table'))
            for file in named:
                if file:
                    whole.update(file_digest(Path(self.folder, file)).encode())
        return whole.hexdigest()


@lru_cache(maxsize=4)
def _bundle(model: Model) -> Bundle:
    return loads_model(model.text, model.where, Path(model.folder), model.allow_python)


@dataclass(frozen=True)
class Job:
    """All data for the diagnosis of one recording by a worker process; picklable."""

    #: With the known dimensions of its specimen.
    recording: Recording
    #: With nominal dimensions.
    model: Model
    recipe: Recipe
    choices: Choices

    @cached_property
    def address(self) -> str:
        """
        Hash of everything on which the result depends.

        This is the data, the model, the specimen's dimensions, the recipe, the choices and the
        code, but not the name or folder of the file.
        """
        parts = {'format': FORMAT, 'data': self.recording.sha256, 'model': self.model.digest,
                 'dimensions': sorted(self.recording.dimensions.items()),
                 'recipe': plain(self.recipe), 'choices': plain(self.choices),
                 'code': code_version()}
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:32]


def run(job: Job) -> dict[str, Any]:
    """
    Return the result of a recording as plain values.

    They are ``error`` (empty if it succeeded), ``passing`` (True if the error is due to the
    machine, not to the data: the next run tries again), ``data``, ``compare`` and ``diagnose``
    (the JSON of the commands of these names).
    """
    try:
        return _done(job)
    except InputError as error:
        return _failed(str(error), passing=False)
    except OSError as error:
        return _failed(str(error), passing=True)
    except Exception as error:  # one bad recording must not stop the campaign
        return _failed(f'unexpected {type(error).__name__}: {error}', passing=True)


def lost(job: Job) -> dict[str, Any]:
    """Return the result of a recording whose worker process died at every attempt."""
    return _failed('the process that worked on it died each time: out of memory, or '
                   'a crash', passing=True)


def _done(job: Job) -> dict[str, Any]:
    path, dimensions = job.recording.path, job.recording.dimensions
    if not path.exists():
        raise FileNotFoundError(f'{path} is not there on {socket.gethostname()}; expected every '
                                'worker to see the folder under the same path')
    model = job.model.bundle()
    if dimensions:
        model = model.with_parameters({f'geometry.{k}': value
                                       for k, value in dimensions.items()})
    # a result must not be stored under the hash of other data
    if file_digest(path) != job.recording.sha256:
        raise OSError('it was changed while the campaign ran')
    told = job.recipe.merged(rest_length=dimensions.get('length'))
    measured = read_measurement(path, recipe=recipe_for(model, told))
    result = diagnose(model, measured, choices=job.choices)
    compared, diagnosed = result.comparison.to_dict(), result.to_dict()
    # large parts are omitted from stored results
    for tree, heavy in ((compared, ('tables', 'noise')), (diagnosed, ('confounding',))):
        for key in heavy:
            del tree[key]
    compared['slips'] = list(result.comparison.slips)
    return {'format': FORMAT, 'error': '', 'passing': False, 'code': code_version(),
            **plain({'data': measured.to_dict(), 'compare': compared, 'diagnose': diagnosed})}


def _failed(error: str, passing: bool) -> dict[str, Any]:
    return {'format': FORMAT, 'error': ' '.join(error.split()), 'passing': passing,
            'code': code_version()}
