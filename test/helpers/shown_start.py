# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stand before a node's command line, as `launch-prefix`, and print what the node would start with.

One line of JSON: program, full name, log levels, parameters as rclpy reads them.
"""
import json
import signal
import sys
from pathlib import Path

signal.signal(signal.SIGINT, signal.SIG_IGN)  # launch ends all programs with the first

import rclpy  # noqa: E402
from rclpy.node import Node  # noqa: E402

command = sys.argv[1:]
rclpy.init(args=command)
program = Path(command[0]).name
node = Node(program)
print(json.dumps({
    'program': program, 'name': node.get_fully_qualified_name(),
    'levels': [level for flag, level in zip(command, command[1:]) if flag == '--log-level'],
    'arguments': rclpy.utilities.remove_ros_args(command)[1:],
    'parameters': {name: list(p.value) if p.type_.name.endswith('ARRAY') else p.value
                   for name, p in node._parameter_overrides.items()}}), flush=True)
node.destroy_node()
