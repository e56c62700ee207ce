# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contact node: box poses in, contact points and normals out.

Subscribes box_a/pose and box_b/pose (geometry_msgs/PoseStamped). Publishes contact/point
(PointStamped) and contact/normal (Vector3Stamped, from A to B) while the boxes touch. On every
evaluation it publishes contacts (box_contact_msgs/Contacts), and once a second /diagnostics.

With a scene file: <name>/pose of every box and body that moves, and of every pair
<pair>/contact/point, <pair>/contact/normal.
The services ~/check and ~/check_path answer about the boxes of a request, without stamps.
~/set_boxes changes boxes of the scene, ~/get_boxes tells them, and the topic ~/boxes each change.
The service ~/reset (std_srvs/Trigger) forgets all poses and stamps.
It is a lifecycle node that configures and activates itself, unless autostart is false. Its
parameters are read when it is configured; model, tolerance and max_age may be set while it runs.
"""
from __future__ import annotations

import sys
from collections.abc import Sequence

from ..arguments import parse_command_line, program_main
from ..extras import require
from .parameters import CONTACT_PARAMETERS


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    parse_command_line('contact_node', __doc__, CONTACT_PARAMETERS, args)
    require('ros')
    from .contact_node import ContactNode, run
    return run(ContactNode, args)


if __name__ == '__main__':
    sys.exit(main())
