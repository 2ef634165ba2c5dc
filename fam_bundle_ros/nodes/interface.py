# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The ROS interface: names, types, QoS and the conversion of every message, both ways.

The only module that knows the messages. Elsewhere, stamps are integers in nanoseconds and
pressures are gauge; FluidPressure is absolute. Every scalar is cast, as Jazzy's Python messages
write a value of the wrong type as garbage without an error. Motor units are numbered from 1 here,
as in the topic names.

Making a message takes longer than sending it. A message that is sent for every sample is therefore
made once: a *writer* is a function that rewrites one message and returns it, to be published
before the next call. ``..._message`` returns a new message.
"""

from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
import math
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool, String, UInt8
from trajectory_msgs.msg import JointTrajectory

from fam_bundle_ros.errors import InputError

NAMESPACE = 'bundle'
#: Largest number of motor units of a bundle.
MOST_UNITS = 64

FORCE = 'force'
STRAIN = 'strain'
SUPPLY = 'supply/pressure'
REFERENCE_FORCE = 'reference/force'
REFERENCE_STRAIN = 'reference/strain'
REFERENCE_PRESSURES = 'reference/pressures'
#: Strain setpoint of the dynamometer.
REFERENCE_DYNAMOMETER = 'reference/dynamometer'
TRAJECTORY = 'reference/trajectory'
RECRUITMENT_STATE = 'recruitment_state'
RECRUITMENT = 'recruitment'
ADAPTATION = 'adaptation'
MODEL_FORCE = 'model/force'
MODEL_RESIDUAL = 'model/residual'
MODEL_STATE = 'model/state'
MODEL_DIAGNOSIS = 'model/diagnosis'
MODEL_APPLIED = 'model/applied'
E_STOP = 'e_stop'
#: Permission to open the supply; see docs/how_to/driver.md.
SUPPLY_ENABLE = 'supply_enable'
# Global by convention (REP-107 and use_sim_time); all other names are relative.
DIAGNOSTICS = '/diagnostics'
CLOCK = '/clock'

ENABLE = 'enable'
E_STOP_TRIGGER = 'e_stop_trigger'
E_STOP_RESET = 'e_stop_reset'
RESET = 'reset'
TARE = 'tare'
ADAPTATION_RESET = 'adaptation/reset'
ADAPTATION_SAVE = 'adaptation/save'
FAULT_CLEAR = 'fault/clear'
DIAGNOSE = 'diagnose'
APPLY_MODEL = 'apply_model'
RESTORE_MODEL = 'restore_model'

LOAD_CELL_FRAME = 'load_cell'


def unit_names(units: int) -> list[str]:
    """Return mu1, mu2, ..., as in the messages that have a joint for each motor unit."""
    return [f'mu{unit}' for unit in range(1, units + 1)]


def in_words(names: Iterable[str]) -> str:
    """
    Return the names of a message for an error; an empty one can be seen.

    Examples
    --------
    >>> in_words(['strain', '']), in_words([])
    ("strain, ''", 'none')
    """
    return ', '.join(name or "''" for name in names) or 'none'


def pressure_topic(unit: int) -> str:
    """Return the name of a motor unit's pressure topic."""
    return f'mu{unit}/pressure'


def setpoint_topic(unit: int) -> str:
    """Return the name of a motor unit's pressure setpoint topic."""
    return f'mu{unit}/pressure_setpoint'


def valve_topic(unit: int) -> str:
    """Return the name of a motor unit's valve command topic."""
    return f'mu{unit}/valve_command'


def pid_state_topic(unit: int) -> str:
    """Return the name of the topic with the state of a motor unit's pressure loop."""
    return f'mu{unit}/pid_state'


def pressure_channels(units: int) -> list[tuple[str, str]]:
    """Return topic and frame of every measured pressure, the supply's first."""
    return [(SUPPLY, 'supply'), *((pressure_topic(k), f'mu{k}') for k in range(1, units + 1))]


@dataclass(frozen=True)
class Topic:
    """A topic of the interface: name, message type, and whether it is latched."""

    name: str
    type: Any
    latched: bool = False

    @property
    def type_name(self) -> str:
        """Return the name as ROS tools print it, for example ``std_msgs/msg/Bool``."""
        package = self.type.__module__.split('.')[0]
        return f'{package}/msg/{self.type.__name__}'


def topics(units: int) -> tuple[Topic, ...]:
    """Return every topic of a bundle with ``units`` motor units, except ``/clock``."""
    per_unit = [Topic(name(unit), kind) for unit in range(1, units + 1) for name, kind in (
        (pressure_topic, FluidPressure), (setpoint_topic, FluidPressure),
        (valve_topic, JointState))]
    states = [Topic(pid_state_topic(unit), String, latched=True) for unit in range(1, units + 1)]
    return (Topic(FORCE, WrenchStamped), Topic(STRAIN, JointState), Topic(SUPPLY, FluidPressure),
            *per_unit, *states, Topic(SUPPLY_ENABLE, Bool),
            Topic(REFERENCE_FORCE, WrenchStamped), Topic(REFERENCE_STRAIN, JointState),
            Topic(REFERENCE_PRESSURES, JointState), Topic(REFERENCE_DYNAMOMETER, JointState),
            Topic(TRAJECTORY, JointTrajectory),
            Topic(RECRUITMENT_STATE, UInt8, latched=True), Topic(RECRUITMENT, JointState),
            Topic(ADAPTATION, String, latched=True),
            Topic(MODEL_FORCE, WrenchStamped), Topic(MODEL_RESIDUAL, WrenchStamped),
            *(Topic(name, String, latched=True)
              for name in (MODEL_STATE, MODEL_DIAGNOSIS, MODEL_APPLIED)),
            Topic(E_STOP, Bool, latched=True), Topic(DIAGNOSTICS, DiagnosticArray))


# --- QoS --------------------------------------------------------------------------------------

#: Publishers are reliable, so that any subscriber matches.
PUBLISH = QoSProfile(depth=10)
#: For events that must not be lost.
RELIABLE = QoSProfile(depth=10)
#: In lock-step no message may be lost, however long a subscriber is delayed.
LOCK_STEP = QoSProfile(depth=200)
#: Matches every driver, and never queues old readings.
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
#: For what is said again and again: behind a lost message a reliable subscription keeps all later
#: ones back, until the publisher's history has passed.
REPEATED = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: For the subscribers of the emergency stop: a stop that is released before the subscriber comes
#: to look must not be replaced by its release.
E_STOP_HEARD = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def stream_qos(lock_step: bool) -> QoSProfile:
    """Return the QoS with which samples and commands are subscribed to."""
    return LOCK_STEP if lock_step else NEWEST


def repeated_qos(lock_step: bool) -> QoSProfile:
    """Return the QoS with which states that are repeated in wall time are subscribed to."""
    return LOCK_STEP if lock_step else REPEATED


# --- time -------------------------------------------------------------------------------------

def stamp_ns(stamp: Time) -> int:
    """Return a stamp in nanoseconds."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def to_stamp(nanoseconds: int) -> Time:
    """Return nanoseconds as a stamp."""
    stamp = Time()
    write_stamp(stamp, nanoseconds)
    return stamp


def write_stamp(stamp: Time, nanoseconds: int) -> None:
    """Set a stamp to nanoseconds."""
    stamp.sec, stamp.nanosec = divmod(int(nanoseconds), 1_000_000_000)


# --- rig --------------------------------------------------------------------------------------

def force_writer() -> Callable[[int, float], WrenchStamped]:
    """Return the writer (stamp, force) of a force in N, tension positive, as a wrench."""
    message = WrenchStamped()
    message.header.frame_id = LOAD_CELL_FRAME
    stamp_now, vector = message.header.stamp, message.wrench.force

    def write(stamp: int, force: float) -> WrenchStamped:
        write_stamp(stamp_now, stamp)
        vector.x = float(force)
        return message
    return write


def force_message(stamp: int, force: float) -> WrenchStamped:
    """Return a force in N, tension positive, as a wrench."""
    return force_writer()(stamp, force)


def read_force(message: WrenchStamped) -> float:
    """Return the force of a wrench, N."""
    return message.wrench.force.x


def joint_writer(names: Sequence[str], *fields: str) -> Callable[..., JointState]:
    """Return the writer (stamp, values of each field) of joints; the values are cast."""
    message = JointState()
    message.name = list(names)
    for field in fields:
        setattr(message, field, array('d', bytes(8 * len(names))))
    stamp_now, arrays = message.header.stamp, [getattr(message, field) for field in fields]

    def write(stamp: int, *values: Iterable[float]) -> JointState:
        write_stamp(stamp_now, stamp)
        for room, given in zip(arrays, values):
            for k, value in enumerate(given):
                room[k] = value
        return message
    return write


def strain_writer(length: float) -> Callable[[int, float, float], JointState]:
    """
    Return the writer (stamp, strain, rate in 1/s) of the joints strain and contraction.

    Positive when shorter; ``length`` is the rest length of the bundle, m.
    """
    joints = joint_writer(('contraction', 'strain'), 'position', 'velocity')
    return lambda stamp, strain, rate: joints(stamp, (strain * length, strain),
                                              (rate * length, rate))


def contraction_writer() -> Callable[[int, float], JointState]:
    """
    Return the writer (stamp, contraction in m) of a rig that does not know the rest length.

    The receiver computes the strain with the rest length of its model.
    """
    joints = joint_writer(('contraction',), 'position')
    return lambda stamp, contraction: joints(stamp, (contraction,))


def strain_message(stamp: int, strain: float, rate: float, length: float) -> JointState:
    """Return a message of `strain_writer`."""
    return strain_writer(length)(stamp, strain, rate)


def read_strain(message: JointState, length: float) -> tuple[float, float]:
    """
    Return strain and strain rate (1/s; nan where the message gives no velocity).

    InputError if there is neither a joint ``strain`` nor a joint ``contraction``, or if the number
    of positions or velocities is not that of the joints.
    """
    joints, rates = len(message.name), len(message.velocity)
    if len(message.position) != joints or rates not in (0, joints):
        raise InputError(f'a strain message names the joints {in_words(message.name)} '
                         f'with {len(message.position)} positions and {rates} velocities; '
                         'expected one position each, and one velocity each or none')
    for joint, scale in (('strain', 1.0), ('contraction', 1.0 / length)):
        if joint in message.name:
            k = message.name.index(joint)
            return message.position[k] * scale, message.velocity[k] * scale if rates else math.nan
    raise InputError(f"a strain message names the joints {in_words(message.name)}; "
                     "expected 'strain' or 'contraction'")


def pressure_writer(ambient: float, frame: str = '') -> Callable[[int, float], FluidPressure]:
    """
    Return the writer (stamp, gauge pressure in Pa) of a pressure.

    The message carries absolute pressure by definition: gauge + ``ambient`` (Pa).
    """
    message = FluidPressure()
    message.header.frame_id = frame
    stamp_now = message.header.stamp

    def write(stamp: int, gauge: float) -> FluidPressure:
        write_stamp(stamp_now, stamp)
        message.fluid_pressure = float(gauge + ambient)
        return message
    return write


def pressure_message(stamp: int, gauge: float, ambient: float, frame: str = '') -> FluidPressure:
    """Return a message of `pressure_writer`."""
    return pressure_writer(ambient, frame)(stamp, gauge)


def read_pressure(message: FluidPressure, ambient: float, is_gauge: bool = False) -> float:
    """Return the gauge pressure, Pa; ``is_gauge`` for a driver that sends gauge already."""
    return message.fluid_pressure if is_gauge else message.fluid_pressure - ambient


def valve_writer(unit: int) -> Callable[[int, float], JointState]:
    """
    Return the writer (stamp, command) of a valve command, -1 exhaust, 0 closed, 1 fill.

    The stamp is that of the reading on which the command is based.
    """
    joints = joint_writer((f'mu{unit}_valve',), 'effort')
    return lambda stamp, command: joints(stamp, (command,))


def valve_message(stamp: int, unit: int, command: float) -> JointState:
    """Return a message of `valve_writer`."""
    return valve_writer(unit)(stamp, command)


def read_valve(message: JointState, unit: int) -> float:
    """Return the command for a motor unit's valve; InputError if for another or not -1 to 1."""
    name = f'mu{unit}_valve'
    if list(message.name) != [name] or len(message.effort) != 1:
        raise InputError(f"a valve command names {in_words(message.name)} with "
                         f"{len(message.effort)} efforts; expected '{name}' with one")
    command = message.effort[0]
    if not -1.0 <= command <= 1.0:
        raise InputError(f'valve command of mu{unit} is {command}; expected -1 to 1')
    return command


# --- references -------------------------------------------------------------------------------

def reference_force_writer() -> Callable[[int, float, float], WrenchStamped]:
    """Return the writer (stamp, force, rate) of a force reference, N; a wrench has no rate."""
    wrench = force_writer()
    return lambda stamp, force, rate: wrench(stamp, force)


def reference_strain_writer() -> Callable[[int, float, float], JointState]:
    """Return the writer (stamp, strain, rate in 1/s) of a strain reference."""
    joints = joint_writer(('strain',), 'position', 'velocity')
    return lambda stamp, strain, rate: joints(stamp, (strain,), (rate,))


def reference_pressures_writer(units: int) -> Callable[[int, Iterable[float]], JointState]:
    """Return the writer (stamp, gauge pressures in Pa) of pressure references."""
    return joint_writer(unit_names(units), 'effort')


def read_pressures(message: JointState, units: int) -> tuple[float, ...]:
    """
    Return the pressure references of mu1 ... mu<n>, Pa (gauge); the joints may have any order.

    InputError if not every motor unit has exactly one.
    """
    names = unit_names(units)
    if sorted(message.name) != sorted(names) or len(message.effort) != units:
        raise InputError(f"pressures name {in_words(message.name)} with "
                         f"{len(message.effort)} efforts; expected {', '.join(names)} with one "
                         'each')
    found = dict(zip(message.name, message.effort))
    return tuple(found[name] for name in names)


# --- recruitment ------------------------------------------------------------------------------

def state_message(state: int) -> UInt8:
    """Return a recruitment state: 0 off, k = RSk."""
    return UInt8(data=int(state))


def recruitment_writer(units: int) -> Callable[[int, Iterable[bool], Iterable[float]], JointState]:
    """Return the writer of 0 or 1 (position) and share of the force (effort) per motor unit."""
    joints = joint_writer(unit_names(units), 'position', 'effort')
    return lambda stamp, active, share: joints(stamp, map(bool, active), share)


def text_message(text: str) -> String:
    """Return a text."""
    return String(data=text)


def bool_message(value: bool) -> Bool:
    """Return a Bool; a numpy bool would be sent as False."""
    return Bool(data=bool(value))
