# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane beside a contact node; on request a soup node and a view of the scene.

    ros2 launch box_contact_ros crane.launch.py model:=exact rate:=500 soup:=true

Takes the arguments of contact_node.launch.py too, which starts the contact node. Ends with the
crane. All arguments: ros2 launch box_contact_ros crane.launch.py --show-args
"""
from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    Shutdown,
)
from launch_ros.actions import Node

from box_contact_ros.demo.crane_parameters import PARAMETERS
from box_contact_ros.node.launch_arguments import CONTACT_NODE, descriptions, given_values
from box_contact_ros.node.parameters import Setting, flag
from box_contact_ros.resources import resource_path

OF_CRANE = {name: PARAMETERS[name] for name in ('rate', 'seed', 'closed_loop')}
ARGUMENTS = OF_CRANE | {
    'soup': Setting(False, 'whether a soup node answers the same poses under soup/', flag),
    'view': Setting(False, 'whether boxes and contacts are shown in the browser', flag),
}
PATIENCE = 30.0
"""How long the crane waits for the contact node [s]: a busy machine starts nodes slowly."""


def programs(context: LaunchContext) -> list[Node]:
    """Return what runs beside the contact node."""
    given = given_values(context, CONTACT_NODE | ARGUMENTS)

    def node(program: str, *names: str, before: tuple[str, ...] = (),
             argument: str = '--shared-parameters', **options: object) -> Node:
        values = {name: given[name] for name in ('use_sim_time', *names) if name in given}
        level = ['--log-level', given['log_level']] if 'log_level' in given else []
        return Node(package='box_contact_ros', executable=program, output='screen',
                    namespace=given.get('namespace'), arguments=[argument],
                    parameters=[values] if values else [], ros_arguments=[*before, *level],
                    **options)

    return [
        node('crane', *OF_CRANE, before=('-p', f'wait:={PATIENCE}'), emulate_tty=True,
             on_exit=Shutdown(reason='the crane has ended')),
        *([node('soup_node')] if given.get('soup') else []),
        *([node('view', argument='--attach')] if given.get('view') else []),
    ]


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` asks for."""
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value='', description=description)
          for name, description in descriptions(ARGUMENTS).items()),
        OpaqueFunction(function=programs),  # first: it refuses what the include would ignore
        IncludeLaunchDescription(str(resource_path('launch', 'contact_node.launch.py'))),
    ])
