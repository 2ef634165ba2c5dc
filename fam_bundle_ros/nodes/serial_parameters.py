# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of serial_rig, and the conversion of a board's numbers to SI units."""

from dataclasses import replace
import math
from typing import Any

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes.parameters import Spec
from fam_bundle_ros.nodes.serial_protocol import BoardSample

#: Largest number of motor units of the protocol, limited by the length of a line.
MOST_UNITS = 16

UNITS = Spec('units', 2, 'motor units of the rig', 1, MOST_UNITS)
SPECS = (
    UNITS,
    Spec('url', '/dev/ttyACM0', 'serial port, or socket://host:port'),
    Spec('baud', 115200, 'baud rate of a serial port; ignored by USB CDC', 300, 12_000_000),
    Spec('reconnect_interval', 0.5, 'time between two attempts to open the port, s', 0.05, 60.0),
    Spec('board_timeout', 0.5, 'silence after which a board is lost and the rig stopped until '
         'e_stop_reset, s', 0.05, 10.0),
    Spec('command_timeout', 0.1, 'a motor unit without a fresh command is vented, s',
         0.01, 10.0),
    Spec('supply_timeout', 0.5, 'silence of supply_enable after which the supply is shut and '
         'dumped, s', 0.15, 1.0),
    Spec('start_stopped', True, 'start with the emergency stop on, as rigs do'),
    Spec('trip_pressure', 450e3, 'a motor unit above it stops the rig, Pa gauge', 1e3, 1.5e6),
    Spec('board_sends_gauge', True, 'the pressures of the board after scale and offset are gauge, '
         'else absolute; the topics are always absolute'),
)
_CHANNELS = {'force': ('N', 1.0), 'contraction': ('m', 1e-3), 'supply': ('Pa', 1e3)}


def scale_specs(units: int) -> tuple[Spec, ...]:
    """Return scale and offset of every channel; by default a board sends N, mm and kPa."""
    channels = {**_CHANNELS, **{f'mu{i + 1}': ('Pa', 1e3) for i in range(units)}}
    return tuple(spec for name, (unit, scale) in channels.items() for spec in (
        Spec(f'{name}.scale', scale, f'{unit} per unit of the board; negative to invert the sign',
             -1e9, 1e9),
        Spec(f'{name}.offset', 0.0, f'{unit} at a value of 0 from the board', -1e7, 1e7)))


class Scales:
    """Converts a board's numbers to SI units: ``scale * number + offset`` of the parameters."""

    def __init__(self, values: dict[str, Any], units: int):
        names = [*_CHANNELS, *(f'mu{i + 1}' for i in range(units))]
        self._lines = {name: (values[f'{name}.scale'], values[f'{name}.offset'])
                       for name in names}
        for name, (scale, _) in self._lines.items():
            if scale == 0.0 or not math.isfinite(scale):
                raise InputError(f'parameter {name}.scale is {scale:g}; expected a number other '
                                 'than 0')
        self._above = 0.0 if values['board_sends_gauge'] else values['ambient_pressure']

    def in_si(self, sample: BoardSample) -> BoardSample:
        """Return a sample with its readings in N, m and Pa (gauge)."""
        supply = sample.supply
        return replace(
            sample, force=self._read('force', sample.force),
            contraction=self._read('contraction', sample.contraction),
            supply=None if supply is None else self._read('supply', supply) - self._above,
            pressure=tuple(self._read(f'mu{i + 1}', value) - self._above
                           for i, value in enumerate(sample.pressure)))

    def _read(self, name: str, number: float) -> float:
        scale, offset = self._lines[name]
        return float(scale * number + offset)
