# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane beside a contact node; on request a soup node and a view of the scene.

    ros2 launch box_contact_ros crane.launch.py model:=exact rate:=500 soup:=true

Takes the arguments of contact_node.launch.py too, which starts the contact node. Ends with the
crane. Without MuJoCo it starts nothing, and prints how to install it.
"""
from pathlib import Path

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    Shutdown,
)
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from box_contact_ros.extras import require

ARGUMENTS = {
    'rate': ('200.0', 'pairs of poses published per second [Hz]'),
    'lockstep': ('false', 'no real time: every tick waits for its answer'),
    'judge_force': ('false', 'the force must equal the weight, as by model exact'),
    'soup': ('false', 'whether a soup node answers the same poses under soup/'),
    'view': ('false', 'whether boxes and contacts are shown in the browser'),
    'namespace': ('', 'namespace of all nodes and topics'),
}


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` asks for."""
    def node(program: str, **options: object) -> Node:
        return Node(package='box_contact_ros', executable=program, output='screen',
                    namespace=LaunchConfiguration('namespace'), **options)

    values = {name: ParameterValue(LaunchConfiguration(name), value_type=kind)
              for name, kind in (('rate', float), ('lockstep', bool), ('judge_force', bool))}
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=description)
          for name, (default, description) in ARGUMENTS.items()),
        OpaqueFunction(function=lambda _: require('sim')),
        node('crane', parameters=[values], emulate_tty=True,
             on_exit=Shutdown(reason='the crane has ended')),
        node('soup_node', condition=IfCondition(LaunchConfiguration('soup'))),
        node('view', condition=IfCondition(LaunchConfiguration('view'))),
        IncludeLaunchDescription(str(Path(__file__).with_name('contact_node.launch.py'))),
    ])
