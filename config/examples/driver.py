#!/usr/bin/env python3
# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A driver of a rig as docs/how_to/driver.md asks for: copy it and fill in `Board`."""

import time

from geometry_msgs.msg import WrenchStamped
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool

UNITS = 2
RATE = 200.0  # Hz
COMMAND_TIMEOUT = 0.1  # s
SUPPLY_TIMEOUT = 0.5  # s


class Board:
    """Your hardware. It has to vent by itself when `write` is not called for 0.2 s."""

    def read(self):
        """Return force (N), contraction (m), absolute pressures (Pa), and the stop button."""
        raise NotImplementedError

    def write(self, supply, valves):
        """Open or shut the supply valve; set the valves, -1 exhaust, 0 closed, 1 fill."""
        raise NotImplementedError


class Driver(Node):
    """Readings out, valve commands in; no air without fresh commands."""

    def __init__(self, board, **options):
        super().__init__('driver', namespace='bundle', **options)
        self.board, self.stopped, self.button = board, None, True
        self.commands, self.enabled = [(-1.0, 0.0)] * UNITS, (False, 0.0)
        units = [f'mu{i + 1}' for i in range(UNITS)]
        self.force = self.create_publisher(WrenchStamped, 'force', 10)
        self.strain = self.create_publisher(JointState, 'strain', 10)
        self.pressure = [self.create_publisher(FluidPressure, f'{unit}/pressure', 10)
                         for unit in units]
        self.e_stop = self.create_publisher(
            Bool, 'e_stop', QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        # Both are repeated: behind a lost one a reliable subscription would keep all others back.
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        for i, unit in enumerate(units):
            self.create_subscription(JointState, f'{unit}/valve_command',
                                     lambda message, i=i: self.on_valve(i, message), newest)
        self.create_subscription(Bool, 'supply_enable', self.on_enable, newest)
        # Ages and timer by the steady clock: ROS time may be set back, or stand still.
        self.create_timer(1.0 / RATE, self.tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def on_valve(self, i, message):
        """Take a command, with the time from which it counts."""
        ours = message.name == [f'mu{i + 1}_valve'] and len(message.effort) == 1
        if ours and -1.0 <= message.effort[0] <= 1.0:
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            age = (self.get_clock().now().nanoseconds - stamp) * 1e-9
            # A stamp of the future (another clock) counts from now.
            self.commands[i] = message.effort[0], time.monotonic() - max(age, 0.0)
            # At once: of two commands between two ticks none is skipped.
            self.act()

    def on_enable(self, message):
        """Take leave to open the supply, or its end."""
        self.enabled = message.data, time.monotonic()

    def tick(self):
        """Read, tell the board what it may do, and publish."""
        now = self.get_clock().now()
        force, contraction, pressures, self.button = self.board.read()
        # Before all publishing: that can take long while another process stands still.
        self.act()
        wrench, joint = WrenchStamped(), JointState(name=['contraction'])
        wrench.header.stamp = joint.header.stamp = now.to_msg()
        wrench.header.frame_id, wrench.wrench.force.x = 'load_cell', float(force)
        joint.position = [float(contraction)]
        self.force.publish(wrench)
        self.strain.publish(joint)
        for publisher, value in zip(self.pressure, pressures):
            message = FluidPressure(header=joint.header)
            message.fluid_pressure = float(value)
            publisher.publish(message)
        if self.button != self.stopped:
            self.stopped = self.button
            self.e_stop.publish(Bool(data=bool(self.button)))

    def act(self):
        """Tell the board what it may do."""
        steady, (allowed, heard) = time.monotonic(), self.enabled
        supply = allowed and not self.button and steady - heard <= SUPPLY_TIMEOUT
        self.board.write(supply, [
            command if supply and steady - since <= COMMAND_TIMEOUT else -1.0
            for command, since in self.commands])


def main():
    """Run until Ctrl-C, and vent."""
    rclpy.init()
    board = Board()
    try:
        rclpy.spin(Driver(board))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except RuntimeError:  # rclpy's error where Ctrl-C came before it waits for messages
        if rclpy.ok():
            raise
    finally:
        board.write(False, [-1.0] * UNITS)


if __name__ == '__main__':
    main()
