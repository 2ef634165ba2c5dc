# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""No command writes over one of its inputs, or two results to one file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from typer.core import TyperCommand

from fam_bundle_ros.errors import InputError

#: Parameters of commands that name a file or folder to write.
_WRITTEN = ('out', 'model_out', 'protocol_out', 'save_recipe', 'json_file', 'target')


class CheckedCommand(TyperCommand):
    """A command whose outputs must be other files than its inputs and each other."""

    def invoke(self, ctx: Any) -> Any:
        """
        Run the command.

        Raises
        ------
        InputError
            If an output is an input or another output; nothing is read or written then.
        """
        words = {each.name: each.opts[0] if each.opts[0].startswith('-') else each.metavar
                 for each in self.params}
        files = [(name, file.resolve()) for name, value in ctx.params.items()
                 for file in _files(value)]
        for name, file in files:
            for other, same in files:
                if name in _WRITTEN and other != name and same == file:
                    raise InputError(f'{words[name]} {file.name} is also {words[other]}; expected '
                                     'another name')
        return super().invoke(ctx)


def _files(value: Any) -> Iterator[Path]:
    """Yield the files of a parameter: paths, and texts that are the name of an existing one."""
    for each in value if isinstance(value, (list, tuple)) else [value]:
        if isinstance(each, Path) or (each and isinstance(each, str) and Path(each).exists()):
            yield Path(each)
