# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
ROS 2 nodes: thin shells around plant and control. The only place that imports rclpy.

Executables, with the modules of each:

- `plant_simulator`: `rig_parameters`, `fault_injection`, `hidden_effect`, `dynamometer`
- `pressure_pid`: `pid_parameters`, `pid_readings`
- `recruitment_controller`: `recruitment_parameters`, `oversight`, `reference_intake`,
  `adaptation`, `model_swap`
- `model_monitor`: `live_model`, `diagnosing`
- `reference_generator`
- `serial_rig`, driver of a microcontroller: `board`, `air` and the other `serial_` modules
- `bundle_bringup`: a bundle in one process

Used by several: `base`, `parameters`, `process`, `interface` (names and messages),
`sensing` and `gate` (samples), `references`, `profile`, `models`, `diagnostics`, `loops`,
`e_stop`, `supply_enable`.

For commands: `session` (run, demo), `measuring` and `protocol_run` (measure), `recording`
(record), the other `rig_` modules (check-rig), `live_feed` (workbench), `latency` and `empty`
(bench), `fault_run` and `fault_processes` (benchmark-faults).
"""
