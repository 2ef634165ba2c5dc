# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Several recordings of one muscle as one measurement."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.errors import InputError

#: s assumed between two recordings, whose distance in time is not known.
_BETWEEN = 60.0


def join(recordings: Sequence[Measurement]) -> Measurement:
    """
    Return recordings one after the other, each trial a trial of its own.

    Raises
    ------
    InputError
        Where they have not the same motor units, or only some have time.
    """
    first = recordings[0]
    if len(recordings) == 1:
        return first
    for other in recordings[1:]:
        if other.pressure.shape[1] != first.pressure.shape[1]:
            raise InputError(f'{other.name}: {other.pressure.shape[1]} motor units; expected '
                             f'{first.pressure.shape[1]} as in {first.name}')
        if other.is_static != first.is_static:
            raise InputError(f'{other.name} and {first.name}: one has time, the other is a static '
                             'map; expected two of a kind')
    before = np.cumsum([0, *(len(each.trial_names) for each in recordings[:-1])])
    parts: dict[str, Any] = {
        name: np.concatenate([getattr(each, name) for each in recordings]) for name in (
            'strain', 'pressure', 'force', 'strain_rate', 'direction', 'direction_basis')}
    for name in ('trial', 'recording'):  # no more recordings than trials
        parts[name] = np.concatenate([getattr(each, name) + k
                                      for each, k in zip(recordings, before)])
    dropped: Counter[str] = Counter()
    for each in recordings:
        dropped.update(each.dropped)
    return replace(
        first, name=' + '.join(each.name for each in recordings), sha256='', **parts,
        trial_names=tuple(f'{each.name} {name}' for each in recordings
                          for name in each.trial_names),
        time=None if first.is_static else _one_clock(recordings),
        dropped=dict(dropped), first_dropped={},
        notes=tuple(dict.fromkeys(f'{each.name}: {note}' for each in recordings
                                  for note in each.notes)))


def _one_clock(recordings: Sequence[Measurement]) -> np.ndarray:
    times, end = [], 0.0
    for each in recordings:
        clock = each.clock - each.clock.min() + end
        times.append(clock)
        end = float(clock.max()) + _BETWEEN
    return np.concatenate(times)
