# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Commands for supply and valves that a driver may apply, given the age of what it received. No ROS.

A motor unit whose valve command is old is vented. The supply is open only while `supply_enable`
is true and fresh and the rig is not stopped; while it is shut, every valve exhausts.
"""

from dataclasses import dataclass

VENT = -1.0


@dataclass(frozen=True)
class Order:
    """Commands for supply and valves."""

    #: Whether the supply is open.
    supply: bool
    #: -1 exhaust, 0 closed, 1 fill.
    valves: tuple[float, ...]
    #: Stamp of the oldest reading on which a valve command in use is based, s; None without
    #: one.
    answers: float | None
    #: Why the supply is shut; empty while it is open.
    why: str


class Air:
    """
    Keeps valve commands and `supply_enable`, and returns what is still valid.

    Times are of one steady clock, s. The age of a valve command counts from the stamp of the
    reading on which it is based, that of ``supply_enable`` from its arrival.

    Examples
    --------
    >>> air = Air(1, command_timeout=0.1, supply_timeout=0.5)
    >>> air.enable(True, 0.0)
    >>> air.command(0, 0.3, 0.0, 0.01)
    True
    >>> air.order(0.05).valves, air.order(0.2).valves, air.order(0.6).why
    ((0.3,), (-1.0,), 'nothing on supply_enable for 0.5 s')
    """

    def __init__(self, units: int, command_timeout: float, supply_timeout: float):
        self._command_timeout = command_timeout
        self._supply_timeout = supply_timeout
        #: Command and the time from which it counts.
        self._commands: list[tuple[float, float] | None] = [None] * units
        self._enable: tuple[bool, float] | None = None
        self._forbidden = -supply_timeout

    def command(self, unit: int, value: float, answers: float, now: float) -> bool:
        """
        Take the command of a valve, -1 exhaust, 0 closed, 1 fill; return whether it is fresh.

        ``answers`` is the time of the reading on which the command is based, s. If it lies in the
        future (clocks differ), the age counts from the arrival, ``now``. Motor units are numbered
        from 0.
        """
        if now - answers > self._command_timeout:
            return False
        self._commands[unit] = value, min(answers, now)
        return True

    def enable(self, value: bool, now: float, publishers: int = 1) -> None:
        """
        Take ``supply_enable``.

        With several publishers, true is accepted only without a false within ``supply_timeout``.
        """
        if not value:
            self._forbidden = now
        elif publishers > 1 and now - self._forbidden < self._supply_timeout:
            return
        self._enable = value, now

    def age(self, unit: int, now: float) -> float | None:
        """Return the age of a motor unit's command, s; None before the first."""
        command = self._commands[unit]
        return None if command is None else now - command[1]

    def stale(self, now: float) -> tuple[int, ...]:
        """Return the motor units (from 0) without a fresh command."""
        return tuple(unit for unit in range(len(self._commands)) if not self._fresh(unit, now))

    def order(self, now: float, stopped: str = '') -> Order:
        """Return the commands; ``stopped`` is any other reason why the rig is stopped."""
        why = stopped or self._shut(now)
        if why:
            return Order(False, (VENT,) * len(self._commands), None, why)
        used = [command if self._fresh(unit, now) else None
                for unit, command in enumerate(self._commands)]
        return Order(True, tuple(command[0] if command else VENT for command in used),
                     min((command[1] for command in used if command), default=None), '')

    def _fresh(self, unit: int, now: float) -> bool:
        age = self.age(unit, now)
        return age is not None and age <= self._command_timeout

    def _shut(self, now: float) -> str:
        if self._enable is None:
            return 'nothing on supply_enable yet'
        value, since = self._enable
        if now - since > self._supply_timeout:
            return f'nothing on supply_enable for {self._supply_timeout:g} s'
        return '' if value else 'supply_enable is false'
