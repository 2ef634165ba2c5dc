# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""From a CSV file, a ROS 2 bag or a pandas frame to a `Measurement`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fam_bundle_ros.data.bagfile import read_bag
from fam_bundle_ros.data.columns import from_columns
from fam_bundle_ros.data.csvfile import read_csv
from fam_bundle_ros.data.measurement import file_digest, Measurement
from fam_bundle_ros.errors import InputError


def read_measurement(source: Any, *, rest_length: float | None = None,
                     ambient_pressure: float = 101325.0, name: str | None = None,
                     allow_constant_pressure: bool = False) -> Measurement:
    r"""
    Read a measurement from a CSV file, a ROS 2 bag or a pandas frame.

    Parameters
    ----------
    source : path, or pandas.DataFrame
        A CSV file with units in its header, a bag (folder, ``.mcap``, ``.db3``), or a frame with
        the same column names as the CSV.
    rest_length : float, m, optional
        Needed where the data gives the contraction as a length instead of a strain.
    ambient_pressure : float, Pa
        Taken off absolute pressures (bags, units such as ``psia``).
    name : str, optional
        Name for messages and reports; by default the file's.
    allow_constant_pressure : bool
        Accept data whose pressure never changes; effects of pressure are then invisible.

    Raises
    ------
    InputError
        One sentence that names the file, the row and what was expected.

    Examples
    --------
    >>> import io, pathlib, tempfile
    >>> text = 'strain,pressure [psi],force [lbf]\n' + ''.join(
    ...     f'{i / 100},{10 * (i % 3)},{i}\n' for i in range(20))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / 'map.csv'
    ...     _ = path.write_text(text)
    ...     data = read_measurement(path)
    >>> len(data), round(float(data.pressure.max())), round(float(data.force[1]), 3)
    (20, 137895, 4.448)
    """
    if hasattr(source, 'columns'):
        values = {str(key): np.asarray(source[key]) for key in source.columns}
        return from_columns(values, name or 'frame', rest_length=rest_length,
                            ambient_pressure=ambient_pressure,
                            allow_constant_pressure=allow_constant_pressure)
    path = Path(source)
    if not path.exists():
        raise InputError(f'{path}: no such file; expected a CSV or a ROS 2 bag')
    if path.is_dir() or path.suffix in ('.mcap', '.db3'):
        return read_bag(path, rest_length=rest_length, ambient_pressure=ambient_pressure,
                        name=name, allow_constant_pressure=allow_constant_pressure)
    values = read_csv(path)
    measured = from_columns(values, name or path.name, rest_length=rest_length,
                            ambient_pressure=ambient_pressure, first_row=2,
                            allow_constant_pressure=allow_constant_pressure)
    return replace(measured, sha256=file_digest(path))


def as_measurement(source: Any) -> Measurement:
    """Return a `Measurement` as it is, and what `read_measurement` makes of anything else."""
    return source if isinstance(source, Measurement) else read_measurement(source)
