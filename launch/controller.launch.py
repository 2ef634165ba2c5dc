# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The controller on a rig: recruitment and pressure loops in one process, the monitor in another.

What the monitor computes would hold up the loops of its process for some 50 ms.
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def start(context):
    use_sim_time = ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)
    parameters = [LaunchConfiguration('params_file'), {'use_sim_time': use_sim_time}]
    model = LaunchConfiguration('model').perform(context)
    if model:
        parameters.append({'model': model})

    def process(executable, *more):
        return Node(
            package='fam_bundle_ros',
            executable=executable,
            # Without a name: it would be given to every node of the process.
            namespace=LaunchConfiguration('namespace'),
            parameters=[*parameters, *more],
            arguments=['--ros-args', '--log-level', LaunchConfiguration('log_level')],
            output='screen',
        )
    nodes = [process('bundle_bringup', {'simulate': False, 'monitor': False})]
    if LaunchConfiguration('monitor').perform(context).lower() == 'true':
        nodes.append(process('model_monitor'))
    return nodes


def generate_launch_description():
    config = PathJoinSubstitution([FindPackageShare('fam_bundle_ros'), 'config'])
    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value='bundle'),
        DeclareLaunchArgument(
            'params_file', default_value=PathJoinSubstitution([config, 'rig.yaml'])),
        DeclareLaunchArgument('use_sim_time', default_value='false'),
        DeclareLaunchArgument('log_level', default_value='info'),
        DeclareLaunchArgument(
            'model', default_value='', description='model file; else that of params_file'),
        DeclareLaunchArgument('monitor', default_value='true', description='start model_monitor'),
        OpaqueFunction(function=start),
    ])
