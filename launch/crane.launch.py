"""The crane beside a contact node; on request a soup node and a view of the scene.

    ros2 launch box_contact_ros crane.launch.py model:=exact rate:=500 soup:=true

Ends with the crane. All arguments: ros2 launch box_contact_ros crane.launch.py --show-args
"""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PACKAGE = 'box_contact_ros'
# Name: type, default, description.
ARGUMENTS = {
    'model': (str, 'mlp', 'how the contact node finds the contact point'),
    'rate': (float, '200.0', 'pairs of poses that the crane publishes per second [Hz]'),
    'seed': (int, '0', '0: the standard motion; n > 0: offset and angles drawn at random'),
    'closed_loop': (bool, 'false', 'true: the contacts carry the load, and the crane lands it'),
    'soup': (bool, 'false', 'true: a soup node answers the same poses under soup/'),
    'view': (bool, 'false', 'true: show boxes and contacts in the browser'),
}
PATIENCE = 30.0
"""How long the crane waits for the contact node [s]: a busy machine starts nodes slowly."""


def parameters(*names: str, **fixed: float) -> list[dict]:
    """Launch arguments as parameters of the same names, and of the types that are meant."""
    return [fixed | {name: ParameterValue(LaunchConfiguration(name), value_type=ARGUMENTS[name][0])
                     for name in names}]


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` asks for."""
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=description)
          for name, (_, default, description) in ARGUMENTS.items()),
        Node(package=PACKAGE, executable='contact_node', output='screen',
             parameters=parameters('model')),
        Node(package=PACKAGE, executable='soup_node', output='screen',
             condition=IfCondition(LaunchConfiguration('soup'))),
        Node(package=PACKAGE, executable='view', output='screen', arguments=['--attach'],
             condition=IfCondition(LaunchConfiguration('view'))),
        Node(package=PACKAGE, executable='crane', output='screen', emulate_tty=True,
             parameters=parameters('rate', 'seed', 'closed_loop', wait=PATIENCE),
             on_exit=Shutdown(reason='the crane has ended')),
    ])
