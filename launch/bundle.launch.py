# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The simulated bundle: all nodes in one process."""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def start(context):
    use_sim_time = ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)
    parameters = [LaunchConfiguration('params_file'),
                  {'use_sim_time': use_sim_time, 'lock_step': use_sim_time,
                  'wait_for_reference': use_sim_time}]
    model = LaunchConfiguration('model').perform(context)
    if model:
        parameters.append({'model': model})
    return [Node(
        package='fam_bundle_ros',
        executable='bundle_bringup',
        # Without a name: it would be given to every node of the process.
        namespace=LaunchConfiguration('namespace'),
        parameters=parameters,
        arguments=['--ros-args', '--log-level', LaunchConfiguration('log_level')],
        output='screen',
    )]


def generate_launch_description():
    config = PathJoinSubstitution([FindPackageShare('fam_bundle_ros'), 'config'])
    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value='bundle'),
        DeclareLaunchArgument(
            'params_file', default_value=PathJoinSubstitution([config, 'simulation.yaml'])),
        DeclareLaunchArgument(
            'use_sim_time', default_value='false',
            description='lock-step: the simulator is the clock, as fast as the machine can'),
        DeclareLaunchArgument('log_level', default_value='info'),
        DeclareLaunchArgument(
            'model', default_value='', description='model file; else that of params_file'),
        OpaqueFunction(function=start),
    ])
