# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The folder of results: one small JSON file for each recording, named by its address."""

from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any

from fam_bundle_ros.atomic import write_whole
from fam_bundle_ros.errors import InputError


@dataclass(frozen=True)
class Store:
    """Results by address (`job.Job.address`); the folder is made if it does not exist."""

    folder: Path

    def __post_init__(self) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f'{self.folder}: cannot be made ({error.strerror}); expected a '
                             'folder for results') from error

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
