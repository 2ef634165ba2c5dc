# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Range checks of configuration values, shared by all parts of the plant."""

import math

from fam_bundle_ros.errors import InputError


def require(owner: object, *names: str, above: float = -math.inf, least: float = -math.inf,
            most: float = math.inf) -> None:
    """
    Raise InputError for attributes of ``owner`` that are not finite numbers within bounds.

    Parameters
    ----------
    names : str
        Attributes to check.
    above, least, most : float
        Exclusive and inclusive lower bound, inclusive upper bound.

    Raises
    ------
    InputError
        With the class, the attribute, its value and the expected range.
    """
    for name in names:
        value = getattr(owner, name)
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if number and math.isfinite(value) and value > above and least <= value <= most:
            continue
        wanted = ['a finite number']
        if above > -math.inf:
            wanted.append(f'above {above:g}')
        if least > -math.inf:
            wanted.append(f'at least {least:g}')
        if most < math.inf:
            wanted.append(f'at most {most:g}')
        raise InputError(f'{type(owner).__name__}.{name} is {value!r}; '
                         f"expected {', '.join(wanted)}")
