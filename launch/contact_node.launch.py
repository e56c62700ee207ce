"""A contact node with all of its parameters as arguments, to start or to include.

    ros2 launch box_contact_ros contact_node.launch.py scene:=config/scenes/yard_bay.yaml

All arguments: ros2 launch box_contact_ros contact_node.launch.py --show-args

Made for containers: the log goes to stdout alone, a line a message, and to no file of the node's.
"""
import json

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from box_contact_ros.node.contact_node import PARAMETERS

OTHERS = {
    'name': ('contact_node', 'name of the node'),
    'namespace': ('', 'namespace of the node and of all of its topics'),
    'log_level': ('info', 'least severity that is logged: debug, info, warn, error, fatal'),
}
"""Arguments that are no parameters: default, description."""


def as_text(default: object) -> str:
    """Return a default as it is typed in a shell."""
    return default if isinstance(default, str) else json.dumps(default)


def parameter(name: str) -> ParameterValue:
    """Return the launch argument of a parameter's name, in the parameter's type."""
    default = PARAMETERS[name].default
    kind = list[float] if isinstance(default, tuple) else type(default)
    return ParameterValue(LaunchConfiguration(name), value_type=kind)


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` asks for."""
    arguments = OTHERS | {name: (as_text(setting.default), setting.description)
                          for name, setting in PARAMETERS.items()}
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=description)
          for name, (default, description) in arguments.items()),
        Node(package='box_contact_ros', executable='contact_node', output='screen',
             name=LaunchConfiguration('name'), namespace=LaunchConfiguration('namespace'),
             parameters=[{name: parameter(name) for name in PARAMETERS}],
             ros_arguments=['--log-level', LaunchConfiguration('log_level'),
                            '--disable-external-lib-logs'],
             additional_env={'RCUTILS_LOGGING_USE_STDOUT': '1', 'PYTHONUNBUFFERED': '1'}),
    ])
