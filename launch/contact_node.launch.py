# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A contact node, to start or to include.

    ros2 launch box_contact_ros contact_node.launch.py scene:=/path/to/yard.yaml model:=exact

Each parameter of the node is an argument. params_file has the values of those that are not given.
"""
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from box_contact_ros.node.parameters import CONTACT_PARAMETERS, Setting, flag

ARGUMENTS = {
    'namespace': ('', 'namespace of the node'),
    'use_respawn': ('false', 'whether a node that has ended is started anew'),
    'log_level': ('info', 'lowest level that is logged'),
}
SETTINGS = {**CONTACT_PARAMETERS,
            'use_sim_time': Setting(False, 'whether /clock tells the time', flag)}


def type_of(setting: Setting) -> type | None:
    """Return the type of a parameter; None for a list, whose numbers YAML tells apart."""
    return None if isinstance(setting.default, tuple) else type(setting.default)


def contact_node(context: LaunchContext) -> list[Node]:
    """Return the node with what was given."""
    given = {name: LaunchConfiguration(name) for name in (*ARGUMENTS, *SETTINGS, 'params_file')}
    values = {name: ParameterValue(given[name], value_type=type_of(setting))
              for name, setting in SETTINGS.items() if given[name].perform(context)}
    return [Node(
        package='box_contact_ros', executable='contact_node', output='screen',
        namespace=given['namespace'], ros_arguments=['--log-level', given['log_level']],
        parameters=[given['params_file'], values],
        respawn=given['use_respawn'], respawn_delay=2.0)]


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` asks for."""
    return LaunchDescription([
        DeclareLaunchArgument('params_file', description='file of all parameters', default_value=[
            FindPackageShare('box_contact_ros'), '/config/contact_node.yaml']),
        *(DeclareLaunchArgument(name, default_value=default, description=description)
          for name, (default, description) in ARGUMENTS.items()),
        *(DeclareLaunchArgument(name, default_value='', description=setting.description)
          for name, setting in SETTINGS.items()),
        OpaqueFunction(function=contact_node),
    ])
