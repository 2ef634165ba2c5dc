# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Node reference_generator: samples a trajectory into ``reference/force`` or ``reference/strain``.

The trajectory comes from a file (parameter) or from the topic ``reference/trajectory`` (joint
``force``, ``strain`` or ``contraction``; cubic where the points have velocities, else straight
lines; a start stamp of 0 means now). A file's trajectory starts once the rig sends samples and the
reference has a subscriber. The last value is held. A message without joints and points cancels the
trajectory; an emergency stop cancels one that came by message. With ``give_way`` it is silent
while another node sends ``reference/pressures``, and resumes a second later; its time continues
meanwhile.
"""

from dataclasses import replace
from typing import Any, TYPE_CHECKING

from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode, MODEL
from fam_bundle_ros.nodes.diagnostics import Diagnostics, Meter, Report, WARN
from fam_bundle_ros.nodes.models import bundle_from
from fam_bundle_ros.nodes.parameters import Spec
from fam_bundle_ros.nodes.process import executable
from fam_bundle_ros.nodes.profile import load_profile, Points

if TYPE_CHECKING:
    from fam_bundle_ros.simulation import Trajectory

SPECS = (
    replace(MODEL, text=f'{MODEL.text}: for the rest length'),
    Spec('trajectory', '', 'trajectory file: a path, or the name of one that ships'),
    Spec('repeat', False, 'repeat the trajectory', dynamic=True),
    Spec('prepare', 0.0, 'time for which the first value is held before the start, s', 0.0, 60.0),
    Spec('rate', 200.0, 'largest rate of references, Hz; not above the rate of the samples',
         1.0, 2000.0),
    Spec('give_way', False, 'be silent while another node sends reference/pressures, as '
         '`fam_bundle measure` does', dynamic=True),
)
#: Time without pressure references after which the generator resumes, ns.
_GIVEN_WAY = 1_000_000_000
#: A stamp that goes back by more means that the clock was set; by less, that it is late, ns.
_CLOCK_SET = 1_000_000_000


class ReferenceGenerator(BundleNode):
    """
    The reference generator; further keywords as of `BundleNode`.

    ``profile`` replaces the parameter ``trajectory``.
    """

    def __init__(self, *, profile: 'Points | Trajectory | None' = None, **keywords: Any):
        super().__init__('reference_generator', SPECS, **keywords)
        p = self.p
        if profile is None and p['trajectory']:
            profile = load_profile(p['trajectory'])
        self._length = bundle_from(p['model']).length
        self._profile = profile
        #: Stamp at which the trajectory began, ns; None while it waits for the loop.
        self.start: int | None = None
        self._stamp = 0
        self._heard: dict[str, int] = {}
        self._sent = 0
        #: Stamp at the last pressure references of another node, ns.
        self._pressures: int | None = None
        self._meter = Meter()
        self._sample_meter = Meter()
        self._outputs: dict[str, Any] = {}
        # No publisher without a trajectory: another node may publish references then.
        for kind in ('force', 'strain') if self.lock_step else (profile.kind,) if profile else ():
            self._output(kind)
        self._by_message = False
        self.subscribe(interface.TRAJECTORY, JointTrajectory, self._on_trajectory,
                       interface.RELIABLE, each=True)
        self.subscribe(interface.E_STOP, Bool, self._on_e_stop, interface.E_STOP_HEARD)
        # The rig's samples clock the references, so that both have the same stamps; two sensors,
        # so that one may fail.
        self.subscribe(interface.STRAIN, JointState,
                       lambda m: self._on_sample(interface.STRAIN, m))
        self.subscribe(interface.FORCE, WrenchStamped,
                       lambda m: self._on_sample(interface.FORCE, m))
        self.subscribe(interface.REFERENCE_PRESSURES, JointState, self._on_pressures)
        p.on_change(self)
        self._diagnostics = Diagnostics(self, self._report)

    @property
    def run_time(self) -> float:
        """Time since the trajectory began, s; negative before."""
        if self.start is None:
            return -float('inf')
        return (self._stamp - self.start) * 1e-9 - self.p['prepare']

    @property
    def gives_way(self) -> bool:
        """Whether the generator is silent because another node sends pressures."""
        return bool(self.p['give_way']) and self._pressures is not None and (
            0 <= self._stamp - self._pressures < _GIVEN_WAY)

    def _on_pressures(self, message: JointState) -> None:
        self._pressures = self._stamp

    def _on_sample(self, channel: str, message: JointState | WrenchStamped) -> None:
        stamp = interface.stamp_ns(message.header.stamp)
        repeated = stamp == self._heard.get(channel)
        self._heard[channel] = stamp
        if stamp == self._stamp and not repeated:
            return
        self._sample_meter.tick()
        if not self.lock_step and 0 < self._stamp - stamp < _CLOCK_SET:
            # Stamps of sensors differ a little; stamps of references must not decrease.
            return
        self._stamp = stamp
        # Slightly early is accepted: samples do not arrive at exact multiples of the period.
        if self.lock_step or not 0 <= (stamp - self._sent) * 1e-9 < 1.0 / self.p['rate'] - 2e-4:
            self._sent = stamp
            self._send(stamp)

    def _output(self, kind: str) -> Any:
        """Return publisher and writer of a kind of reference."""
        if kind not in self._outputs:
            self._outputs[kind] = (
                (self.publisher(interface.REFERENCE_FORCE, WrenchStamped),
                 interface.reference_force_writer()) if kind == 'force' else
                (self.publisher(interface.REFERENCE_STRAIN, JointState),
                 interface.reference_strain_writer()))
        return self._outputs[kind]

    def _withdraw_but(self, kind: str) -> None:
        """Free the topics of references for other nodes, but for those of a kind."""
        if not self.lock_step:
            for other in self._outputs.keys() - {kind}:
                self.withdraw(self._outputs.pop(other)[0])

    def _send(self, stamp: int) -> None:
        profile = self._profile
        if profile is None or self.gives_way:
            return
        publisher, write = self._output(profile.kind)
        if self.start is None:
            if not self.lock_step and publisher.get_subscription_count() == 0:
                return
            self.start = stamp
        t = self.run_time
        if self.p['repeat'] and profile.duration > 0.0 and t > 0.0:
            t %= profile.duration
        value = profile.value(max(t, 0.0))
        rate = profile.rate(t) if 0.0 <= t < profile.duration else 0.0
        self._meter.tick()
        publisher.publish(write(stamp, value, rate))

    def _on_trajectory(self, message: JointTrajectory) -> None:
        """Take a new trajectory; after an invalid one the old one is kept."""
        if not message.joint_names and not message.points:
            self._cancel('by a message without points')
            return
        profile = trajectory_profile(message, self._length)
        start = interface.stamp_ns(message.header.stamp) or (self._stamp or None)
        begins = (start - self._stamp) * 1e-9 if start and self._stamp else 0.0
        if begins + profile.duration < 0.0:
            raise InputError(f'by its stamp the trajectory began {-begins:.3g} s ago and is over; '
                             'expected a stamp of now or later, or 0 for now')
        self._profile, self._by_message, self.start = profile, True, start
        self._withdraw_but(profile.kind)
        self._output(profile.kind)
        when = '' if abs(begins) < 1.0 else (
            f'; it begins in {begins:.3g} s' if begins > 0.0 else
            f'; by its stamp it began {-begins:.3g} s ago')
        self.get_logger().info(f'new trajectory of {profile.kind}: {len(profile.times)} points '
                               f'over {profile.duration:g} s{when}')

    def _on_e_stop(self, message: Bool) -> None:
        """Cancel a trajectory that came by message: `enable` alone must not resume it."""
        if message.data and self._by_message:
            self._cancel('by the emergency stop; send a new one')

    def _cancel(self, how: str) -> None:
        if self._profile is not None:
            self.get_logger().warning(f'trajectory of {self._profile.kind} cancelled {how}')
        self._profile, self._by_message, self.start = None, False, None
        self._withdraw_but('')

    def _report(self, report: Report) -> None:
        self._sample_meter.report(report, 'sample')
        self._meter.report(report, 'reference')
        if self._profile is None:
            report.add(WARN, 'WAITING for a trajectory')
            return
        report.value('trajectory', self._profile.name)
        report.value('run time, s', self.run_time)
        report.value('duration, s', self._profile.duration)
        report.value('gives way', self.gives_way)
        if self.start is None:
            report.add(WARN, 'WAITING for the loop')


def trajectory_profile(message: JointTrajectory, length: float) -> Points:
    """Return the trajectory of a message; the rest length (m) is for a joint ``contraction``."""
    names = list(message.joint_names)
    if len(names) != 1 or names[0] not in ('force', 'strain', 'contraction'):
        raise InputError(f"trajectory of the joints {interface.in_words(names)}; expected one "
                         "of 'force', 'strain', 'contraction'")
    scale = 1.0 / length if names[0] == 'contraction' else 1.0
    kind = 'force' if names[0] == 'force' else 'strain'
    if not all(len(point.positions) == 1 for point in message.points):
        raise InputError('a trajectory point has not exactly one position')
    times = tuple(point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec
                  for point in message.points)
    values = tuple(scale * point.positions[0] for point in message.points)
    rates = None
    if message.points and all(len(point.velocities) == 1 for point in message.points):
        rates = tuple(scale * point.velocities[0] for point in message.points)
    return Points('trajectory', kind, times, values, rates)


main = executable(ReferenceGenerator, __doc__, SPECS)
