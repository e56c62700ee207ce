# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A contact node with all of its parameters as arguments, to start or to include.

    ros2 launch box_contact_ros contact_node.launch.py scene:=config/scenes/yard_bay.yaml

All arguments: ros2 launch box_contact_ros contact_node.launch.py --show-args

Made for containers: the log goes to stdout alone, a line a message, and to no file of the node's.
"""
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from box_contact_ros.node.contact_program import PARAMETERS
from box_contact_ros.node.launch_arguments import CONTACT_NODE, descriptions, given_values
from box_contact_ros.resources import resource_path

RESPAWN_SECONDS = 2.0
SHIPPED = str(resource_path('config', 'contact_node.yaml'))


def contact_node(context: LaunchContext) -> list[Node]:
    """Return the node with what was given, and nothing else."""
    given = given_values(context, CONTACT_NODE)
    values = {name: given[name] for name in ('use_sim_time', *PARAMETERS) if name in given}
    if given.get('use_lifecycle_manager'):
        if given.get('autostart'):
            raise ValueError('use_lifecycle_manager: the manager starts the node, so leave '
                             'autostart out')
        values['autostart'] = False
    # The order of precedence, lowest first: the shipped file, SetParameter of a launch file that
    # includes this one, params_file, arguments.
    shipped = [] if 'params_file' in given else ['--params-file', SHIPPED]
    level = ['--log-level', given['log_level']] if 'log_level' in given else []
    files = [given['params_file']] if 'params_file' in given else []
    return [Node(
        package='box_contact_ros', executable='contact_node', output='screen',
        arguments=['--shared-parameters'],  # SetParameter is for all nodes
        name=given.get('name'), namespace=given.get('namespace'),
        ros_arguments=[*shipped, *level, '--disable-external-lib-logs'],
        parameters=[*files, *([{name: ParameterValue(value, value_type=str)
                                if isinstance(value, str) else value
                                for name, value in values.items()}] if values else [])],
        respawn=given.get('respawn', False), respawn_delay=RESPAWN_SECONDS,
        additional_env={'RCUTILS_LOGGING_USE_STDOUT': '1', 'PYTHONUNBUFFERED': '1'})]


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` asks for."""
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value='', description=description)
          for name, description in descriptions(CONTACT_NODE).items()),
        OpaqueFunction(function=contact_node),
    ])
