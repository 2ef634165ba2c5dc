# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A measurement from a ROS 2 bag (mcap or sqlite3) and into one, without ROS, by rosbags.

Topics, under any namespace: `force` (WrenchStamped, force.x), `strain` (JointState, joints
`strain` or `contraction`), `mu<i>/pressure` (FluidPressure, absolute). Everything is brought to
the stamps of the force by linear interpolation, within the time that all topics cover. A bag of
other topics is a table of their numbers, read as other tables are.
"""

from collections import Counter
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
import re
import shutil
from typing import Any

import numpy as np

from fam_bundle_ros.bagwriter import BagWriter
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.measurement import build, MAX_ROWS, Measurement
from fam_bundle_ros.data.recipe import Recipe
from fam_bundle_ros.errors import in_short, InputError, system_errors
from fam_bundle_ros.extras import library

#: A silence longer than this many usual periods (and 0.5 s) starts a new trial.
_GAP_PERIODS = 20.0
_GAP = 0.5
#: Arrays with more elements (images, maps) are not read.
_ARRAY = 16


def read_bag(path: Path, recipe: Recipe = Recipe(), name: str | None = None,
             ) -> Measurement | None:
    """
    Return the measurement that a bag of a bundle's topics holds, None where one is missing.

    Pressures are absolute, as FluidPressure defines them, unless the recipe says gauge or one is
    below 60 kPa.

    Parameters
    ----------
    path : path
    recipe : Recipe, optional
        Its rest length is needed where the bag gives the contraction alone.
    name : str, optional
        For messages and reports; by default the name of the file.

    Raises
    ------
    InputError
        Where rosbags is not installed, the bag cannot be read, or topics are of two bundles.
    """
    label = name or path.absolute().name
    with _opened(path, label) as reader:
        topics = _topics(label, reader.connections)
        series, note = _collect(label, reader, topics) if topics else ({}, '')
    if not series or not series['force'][:, 1].any():  # the force is along another axis
        return None
    return _resample(label, series, recipe, note)


@contextmanager
def _opened(path: Path, label: str) -> Iterator[Any]:
    """Open a bag; errors of rosbags inside the block become one sentence."""
    reading, types = (library(f'rosbags.{module}', f'{path.name}: reading a bag')
                      for module in ('highlevel', 'typesys'))
    if path.is_dir() and not (path / 'metadata.yaml').is_file():
        raise InputError(f'{label}: a folder without metadata.yaml; expected a ROS 2 bag or a CSV')
    try:
        with reading.AnyReader([path], default_typestore=types.get_typestore(
                types.Stores.ROS2_JAZZY)) as reader:
            yield reader
    except InputError:
        raise
    except Exception as error:  # rosbags raises its own and sqlite's, zstd's, ...
        raise InputError(f'{label}: cannot be read as a ROS 2 bag ({in_short(error)})'
                         ) from error


def bag_table(path: Path) -> Table:
    """
    Return the numbers of all topics of a bag, a column each, at the times of all messages.

    Columns are called as PlotJuggler does, '/cell/wrench/force/z', '/joints/strain/position'; a
    number that is all of a message as its topic.
    """
    label = path.name
    stamps: dict[str, list[int]] = {}
    readings: dict[str, list[float]] = {}
    with _opened(path, label) as reader:
        wanted = [one for one in reader.connections if not re.search(
            r'/(\w*Image|PointCloud2|OccupancyGrid|Log|ParameterEvent|TFMessage)$', one.msgtype)]
        stamped, note = _stamped(reader, wanted)
        for topic, message, stamp in _messages(label, reader, wanted, stamped):
            for header, value in _numbers(message, topic):
                stamps.setdefault(header, []).append(stamp)
                readings.setdefault(header, []).append(value)
    if not stamps:
        raise InputError(f'{label}: no messages with numbers; expected a log')
    clock = np.unique(np.concatenate([*map(np.array, stamps.values())]))
    columns = {'time': 1e-9 * (clock - clock[0])}
    for header, values in readings.items():
        columns[header] = np.full(len(clock), np.nan)
        columns[header][np.searchsorted(clock, stamps[header])] = values
    return Table(label, 'ROS 2 bag', columns, {'time': 's'}, notes=(note,) if note else ())


def _stamp(message: Any) -> int:
    """Return the stamp of a message's header in ns, 0 for none."""
    stamp = getattr(getattr(message, 'header', None), 'stamp', None)
    return 1_000_000_000 * stamp.sec + stamp.nanosec if stamp is not None else 0


def _stamped(reader: Any, connections: list[Any]) -> tuple[bool, str]:
    """
    Return whether the first message of each topic has a stamp, and a note where some have.

    Stamps of one topic and the times at which another was received may be of two clocks, and
    differ by the delay of the messages.
    """
    with_stamp: list[str] = []
    without: list[str] = []
    for connection in connections:
        for _, _, raw in reader.messages(connections=[connection]):
            message = reader.deserialize(raw, connection.msgtype)
            (with_stamp if _stamp(message) else without).append(connection.topic)
            break
    note = (f"'{with_stamp[0]}' has stamps and '{without[0]}' has none: all are read at the times "
            'at which they were received') if with_stamp and without else ''
    return not without, note


def _messages(label: str, reader: Any, connections: list[Any], stamped: bool,
              ) -> Iterator[tuple[str, Any, int]]:
    """Yield topic, message and its time in ns: its stamp if all have one, else when it came."""
    count: Counter[str] = Counter()
    for connection, received, raw in reader.messages(connections=connections):
        message = reader.deserialize(raw, connection.msgtype)
        yield connection.topic, message, stamped and _stamp(message) or received
        count[connection.topic] += 1
        if count[connection.topic] > MAX_ROWS:
            raise InputError(f'{label}: more than {MAX_ROWS} messages on {connection.topic}')


def _numbers(value: Any, path: str) -> Iterator[tuple[str, float]]:
    """Yield the path and the value of each number in a message; long arrays are left out."""
    if isinstance(value, (bool, int, float, np.number)):
        yield path, float(value)
    for name in getattr(value, '__dataclass_fields__', {}):
        part = getattr(value, name)
        inner = path if name == 'data' else f'{path}/{name}'
        if isinstance(part, (list, np.ndarray)) and len(part) <= _ARRAY:
            joints = getattr(value, 'name', None)
            labels = joints if isinstance(joints, list) and len(joints) == len(part) else None
            for at, each in enumerate(part):
                yield from _numbers(each, f'{path}/{labels[at]}/{name}' if labels else
                                    f'{inner}/{at}')
        elif name not in ('header', 'layout', 'stamp', '__msgtype__'):
            yield from _numbers(part, inner)


def _topics(label: str, connections: Any) -> dict[str, str]:
    found: dict[str, list[str]] = {}
    for connection in connections:
        topic, kind = connection.topic, connection.msgtype.rsplit('/', 1)[-1]
        if topic.endswith('/force') and kind == 'WrenchStamped' and not re.search(
                r'/(reference|model)/force$', topic):
            found.setdefault('force', []).append(topic)
        elif topic.endswith('/strain') and kind == 'JointState' and not topic.endswith(
                '/reference/strain'):
            found.setdefault('strain', []).append(topic)
        elif (match := re.search(r'/(mu\d+)/pressure$', topic)) and kind == 'FluidPressure':
            found.setdefault(f'pressure.{match.group(1)}', []).append(topic)
    pressures = sorted((key for key in found if key.startswith('pressure.')),
                       key=lambda key: int(re.sub(r'\D', '', key)))
    if not {'force', 'strain'} <= found.keys() or not pressures:
        return {}
    for topics in found.values():
        if len(topics) > 1:
            raise InputError(f"{label}: topics {' and '.join(sorted(topics)[:2])}; expected "
                             'the topics of one bundle')
    return {found[key][0]: key for key in ('force', 'strain', *pressures)}


def _collect(label: str, reader: Any, topics: dict[str, str],
             ) -> tuple[dict[str, np.ndarray], str]:
    """Return times in s and readings of each quantity, and a note on the times."""
    rows: dict[str, list[tuple[float, float]]] = {key: [] for key in topics.values()}
    wanted = [connection for connection in reader.connections if connection.topic in topics]
    stamped, note = _stamped(reader, wanted)
    for topic, message, at in _messages(label, reader, wanted, stamped):
        key = topics[topic]
        if key == 'force':
            value = message.wrench.force.x
        elif key == 'strain':
            names = list(message.name)
            key = 'strain' if 'strain' in names else 'contraction'
            if key not in names:
                raise InputError(f"{label}: topic '{topic}' names {names}; expected a joint "
                                 "'strain' or 'contraction'")
            value = message.position[names.index(key)]
        else:
            value = message.fluid_pressure
        seconds, rest = divmod(at, 1_000_000_000)
        rows.setdefault(key, []).append((seconds + 1e-9 * rest, float(value)))
    series = {}
    for key, pairs in rows.items():
        if key == 'strain' and not pairs and rows.get('contraction'):
            continue
        if len(pairs) < 2:
            raise InputError(f'{label}: {len(pairs)} messages of {key}; expected a log')
        table = np.array(pairs)
        table = table[np.argsort(table[:, 0], kind='stable')]
        series[key] = table[np.concatenate([[True], np.diff(table[:, 0]) > 0])]
    return series, note


def _resample(label: str, series: dict[str, np.ndarray], recipe: Recipe, note: str,
              ) -> Measurement:
    """Return the measurement of all topics at the times of the force."""
    begin = max(table[0, 0] for table in series.values())
    end = min(table[-1, 0] for table in series.values())
    clock = series['force'][:, 0]
    inside = (clock >= begin) & (clock <= end)
    clock = clock[inside]
    if len(clock) < 2:
        raise InputError(f'{label}: the topics do not overlap in time; expected one recording')
    values = {key: np.interp(clock, table[:, 0], table[:, 1]) for key, table in series.items()}
    rest_length = recipe.rest_length or recipe.muscle_length
    if 'strain' in values:
        strain = values['strain']
    elif rest_length is None:
        raise InputError(f'{label}: strain gives the contraction in m alone; expected the rest '
                         'length (--rest-length, or a model) to make a strain')
    else:
        strain = values['contraction'] / rest_length
    units = [key for key in values if key.startswith('pressure.')]
    pressure = np.stack([values[key] for key in units], -1)
    notes = [note] if note else []
    if recipe.gauge is None and pressure.min() < 60e3:
        notes.append(f'lowest pressure {pressure.min() / 1e3:.1f} kPa absolute: taken as gauge, '
                     'as FluidPressure should not be')
    elif not recipe.gauge:
        pressure = pressure - recipe.ambient_pressure
    steps = np.diff(clock)
    gap = max(_GAP, _GAP_PERIODS * float(np.median(steps)))
    trial = np.concatenate([[0], np.cumsum(steps > gap)])
    return build(label, strain, pressure, values['force'], trial, clock - clock[0],
                 [key.partition('.')[2] for key in units], notes=notes,
                 max_pressure=recipe.max_pressure, max_strain=recipe.max_strain)


def write_bag(measurement: Measurement, folder: str | Path, *,
              ambient_pressure: float = 101325.0) -> None:
    """
    Write a measurement as a bag (mcap) of the bundle's topics, to be played at a rig's clients.

    The stamps begin at 1 s; trials follow each other with a pause that `read_bag` takes for the
    end of a trial. Motor units are called mu1, mu2, ... in the order of the columns.

    Parameters
    ----------
    folder : path
        Must not exist yet.
    ambient_pressure : float, Pa
        Added to the gauge pressures: FluidPressure is absolute.

    Raises
    ------
    InputError
        Where rosbags is not installed, the measurement has no time, or the folder is there.
    """
    if measurement.time is None:
        raise InputError(f'{measurement.name}: a static map without time cannot be a bag; '
                         "expected a column 'time [s]'")
    folder = Path(folder)
    if folder.exists():
        raise InputError(f'{folder}: is there already; expected the name of a new folder')
    draft = folder.with_name(f'.{folder.name}.part')
    shutil.rmtree(draft, ignore_errors=True)
    try:
        with system_errors(folder, 'cannot be written'):
            with closing(BagWriter(draft, folder.name)) as writer:
                _write(measurement, writer, ambient_pressure)
            draft.rename(folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _write(measurement: Measurement, writer: BagWriter, ambient_pressure: float) -> None:
    from rosbags.typesys import get_typestore, Stores
    store = get_typestore(Stores.ROS2_JAZZY)
    time, header, vector, wrench, force, joints, pressure = (store.types[name] for name in (
        'builtin_interfaces/msg/Time', 'std_msgs/msg/Header', 'geometry_msgs/msg/Vector3',
        'geometry_msgs/msg/Wrench', 'geometry_msgs/msg/WrenchStamped',
        'sensor_msgs/msg/JointState', 'sensor_msgs/msg/FluidPressure'))
    zero, nothing = vector(0.0, 0.0, 0.0), np.zeros(0)
    for stamp, strain, pulls, pressures in zip(_stamps(measurement), measurement.strain,
                                               measurement.force,
                                               measurement.pressure + ambient_pressure):
        head = header(time(*divmod(int(stamp), 1_000_000_000)), '')
        messages = {
            'force': force(head, wrench(vector(float(pulls), 0.0, 0.0), zero)),
            'strain': joints(head, ['strain'], np.array([strain]), nothing, nothing)}
        for unit, value in enumerate(pressures, 1):
            messages[f'mu{unit}/pressure'] = pressure(head, float(value), 0.0)
        for name, message in messages.items():
            writer.write(f'/bundle/{name}', message.__msgtype__, int(stamp),
                         store.serialize_cdr(message, message.__msgtype__))


def _stamps(measurement: Measurement) -> np.ndarray:
    """Return the stamps of the messages in ns, (T,); a pause separates the trials."""
    steps = np.diff(measurement.clock)
    fresh = measurement.start[1:]
    usual = float(np.median(steps[~fresh]))
    steps[fresh] = 2.0 * max(_GAP, _GAP_PERIODS * usual)
    return np.round(1e9 * (1.0 + np.concatenate([[0.0], np.cumsum(steps)]))).astype(np.int64)
