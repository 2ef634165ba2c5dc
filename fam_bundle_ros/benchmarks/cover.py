# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pairwise testing: few cases that cover every pair of values of several factors."""

from collections.abc import Sequence
from itertools import combinations
import random
from typing import Any


def pairwise(factors: Sequence[Sequence[Any]]) -> list[tuple[Any, ...]]:
    """
    Return cases, with one value of each factor, that cover every pair of values.

    Greedy: of several random candidates, the one with most pairs not covered yet. The two longest
    factors determine the smallest number of cases.

    Examples
    --------
    >>> len(pairwise([['a', 'b', 'c'], [1, 2, 3], ['x', 'y']]))
    9
    """
    chance = random.Random(0)
    missing = {((i, a), (j, b)) for i, j in combinations(range(len(factors)), 2)
               for a in factors[i] for b in factors[j]}
    cases = []
    while missing:
        begun = min(missing, key=repr)
        tries = []
        for _ in range(12):
            case: list[Any] = [None] * len(factors)
            for i, value in begun:
                case[i] = value
            order = [i for i in range(len(factors)) if case[i] is None]
            chance.shuffle(order)
            for i in order:
                values = list(factors[i])
                chance.shuffle(values)
                case[i] = max(values, key=lambda value: len(
                    missing & _pairs([*case[:i], value, *case[i + 1:]])))
            tries.append(tuple(case))
        best = max(tries, key=lambda case: len(missing & _pairs(case)))
        missing -= _pairs(best)
        cases.append(best)
    return cases


def _pairs(case: Sequence[Any]) -> set[tuple[tuple[int, Any], ...]]:
    """Return the pairs of (factor, value) that a case covers; None is no value."""
    return set(combinations([(i, value) for i, value in enumerate(case) if value is not None], 2))
