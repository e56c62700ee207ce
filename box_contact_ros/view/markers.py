# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Markers for RViz and Foxglove: all boxes of a scene, contacts, and distances.

A contact has its point, normal, patch and depth. Boxes that are near have a dashed line between
their nearest points, with the distance.
Subscribes to the poses of all that moves and to the contact node's contacts. Publishes markers
(visualization_msgs/MarkerArray) 30 times a second while poses come, and fixed boxes once a second
and as they change. RViz with config/contact.rviz
shows them, Foxglove with config/contact.foxglove.json. A patch is the rectangle of its covariance.
"""
from __future__ import annotations

import sys
from collections.abc import Sequence

from ..arguments import parse_command_line, program_main
from ..extras import require
from ..node.parameters import SCENE_PARAMETERS


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    parse_command_line('markers', __doc__, SCENE_PARAMETERS, args)
    require('ros')
    from ..node.runtime import run_node
    from .live.markers import MarkersNode
    return run_node(MarkersNode, args)


if __name__ == '__main__':
    sys.exit(main())
