# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Fills in the parameter file of a rig; comments and values that were not measured are kept."""

from collections.abc import Mapping
import re
from typing import Any

from fam_bundle_ros.errors import InputError

_LINE = re.compile(r'^(?P<head>    (?P<name>[a-z][\w.]*): )(?P<value>.*)$')


def fill_in(template: str, values: Mapping[str, Any], head: str) -> str:
    r"""
    Return a ROS parameter file with other values.

    Parameters
    ----------
    template : str
        A parameter file with all parameters below ``/**``, one per line.
    values : mapping
        New values; a parameter that is not in the template is added.
    head : str
        Comment for the top, without ``#``.

    Raises
    ------
    InputError
        When the template has no parameters.

    Examples
    --------
    >>> print(fill_in('/**:\n  ros__parameters:\n    # Hz\n    rate: 200.0\n',
    ...               {'rate': 500.0, 'tube_volume': 4e-6}, 'Measured.'), end='')
    # Measured.
    /**:
      ros__parameters:
        # Hz
        rate: 500.0
        tube_volume: 4.0e-06
    """
    lines, left = [], dict(values)
    for line in template.splitlines():
        match = _LINE.match(line)
        if match and match['name'] in left:
            line = match['head'] + _text(left.pop(match['name']))
        lines.append(line)
    if not any(line.strip() == 'ros__parameters:' for line in lines):
        raise InputError("the template has no line 'ros__parameters:'")
    lines += [f'    {name}: {_text(value)}' for name, value in left.items()]
    return '\n'.join([*(f'# {row}' for row in head.splitlines()), *lines]) + '\n'


def _text(value: Any) -> str:
    """Return a value for rcl's YAML, in which 5e-06 would be a string."""
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, float):
        text = repr(value)
        mantissa, e, exponent = text.partition('e')
        return text if '.' in mantissa else f'{mantissa}.0{e}{exponent}'
    return str(value)
