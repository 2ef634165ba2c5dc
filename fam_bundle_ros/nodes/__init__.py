# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""ROS 2 nodes: thin shells around plant and control. The only place that imports rclpy."""
