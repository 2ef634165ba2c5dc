# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A recording as a function of time, for tests of its clocks."""

import numpy as np

from fam_bundle_ros.data import read_measurement

TIME = 0.05 * np.arange(400)


def strain(time):
    """Return a sweep of the strain."""
    return 0.1 - 0.1 * np.cos(2 * np.pi * time / 10.0)


def pressure(time):
    """Return a pressure that rises, kPa."""
    return 100.0 + 15.0 * time


def force(time, muscle):
    """Return the force of the muscle at these times, N."""
    return muscle(strain(time), 1e3 * pressure(time))


def padded(values):
    """Return values with blanks to the length of the table."""
    return np.concatenate([values, np.full(len(TIME) - len(values), np.nan)])


def of_clock(header, clock, muscle):
    """Return a log of one trial with this clock."""
    return read_measurement({header: clock, 'strain': strain(TIME), 'p [kPa]': pressure(TIME),
                             'F [N]': force(TIME, muscle)})


def table(path, header, *columns):
    """Write a CSV file with these columns."""
    rows = [','.join(f'{cell:.4f}' if isinstance(cell, float) else str(cell) for cell in row)
            for row in zip(*columns)]
    path.write_text('\n'.join([*([header] if header else []), *rows]))
    return path
