# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Warnings about references: not reached for long, refused, or alternating in kind."""

from collections.abc import Mapping

from fam_bundle_ros.control import Reference
from fam_bundle_ros.nodes.diagnostics import Report, WARN

#: Time for which errors last longer than they are absent, beyond that of a transient, s.
_PATIENCE = 2.0
_UNITS = {'force': ' N', 'strain': ''}


class OffTarget:
    """
    Notices a reference that is missed for longer than a transient takes.

    The time on target is subtracted: a reference that moves crosses a wrong reading again and
    again.

    Parameters
    ----------
    limits : mapping
        Largest error of ``force`` (N) and ``strain`` at which the reference counts as reached.

    Examples
    --------
    >>> watch = OffTarget({'force': 5.0, 'strain': 0.02})
    >>> for now in (0.0, 3.0):
    ...     watch.update(now, Reference('force', 60.0), {'force': 23.0, 'strain': 0.1})
    >>> watch.text
    'force is 23, reference is 60 N, for 3.0 s'
    """

    def __init__(self, limits: Mapping[str, float]):
        self._limits = limits
        self.reset()

    def reset(self) -> None:
        """Start again, without a reference."""
        self._seen: float | None = None
        self._missed = self._since = 0.0
        #: Which quantity is off its reference, as text; empty for none.
        self.text = ''

    def update(self, now: float, reference: Reference, measured: Mapping[str, float]) -> None:
        """
        Compare a reference with its reading.

        Parameters
        ----------
        now : float, s
        reference : Reference
        measured : mapping of str to float
            Readings of ``force`` (N) and ``strain``; nan for a missing one.
        """
        kind = reference.kind
        if kind not in self._limits:
            # Pressure errors are watched by the pressure loops.
            self.reset()
            return
        value = measured[kind]
        # nan is not an error here: the sensor watch reports it.
        off = abs(value - reference.value) > self._limits[kind]
        passed = 0.0 if self._seen is None else max(now - self._seen, 0.0)
        self._seen = now
        if self._missed == 0.0:
            self._since = now - passed
        self._missed = min(max(self._missed + (passed if off else -passed), 0.0), _PATIENCE)
        self.text = (f'{kind} is {value:.3g}, reference is {reference.value:.3g}'
                     f'{_UNITS[kind]}, for {now - self._since:.1f} s'
                     ) if off and self._missed >= _PATIENCE else ''


class ReferenceTally:
    """Counts, between two reports, references that were refused and changes of the mode."""

    def __init__(self) -> None:
        self._kind = ''
        self._between: tuple[str, ...] = ()
        self._changes = 0
        self._refused: list[str] = []

    def take(self, kind: str) -> None:
        """Note a reference that was accepted."""
        if kind != self._kind != '':
            self._changes += 1
            self._between = tuple(sorted((kind, self._kind)))
        self._kind = kind

    def refuse(self, reason: str) -> None:
        """Note a reference that was refused."""
        self._refused.append(reason)

    def report(self, report: Report) -> None:
        """Add warnings of both to a report and reset the counters."""
        if self._refused:
            report.add(WARN, f'{len(self._refused)} references refused: {self._refused[-1]}')
        if self._changes > 1:
            report.add(WARN, f'references changed {self._changes} times between '
                       + ' and '.join(self._between))
        self._refused, self._changes = [], 0
