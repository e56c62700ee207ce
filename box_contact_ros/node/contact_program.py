# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contact node: box poses in, contact points and normals out.

Subscribes box_a/pose and box_b/pose (geometry_msgs/PoseStamped). Publishes contact/point
(PointStamped) and contact/normal (Vector3Stamped, from A to B) while the boxes touch. On every
evaluation it publishes contacts (box_contact_msgs/Contacts), and once a second /diagnostics. Where
box_contact_msgs is not installed, contacts_cloud (sensor_msgs/PointCloud2) replaces contacts.

With a scene file: <box>/pose of every moving box, and <pair>/contact/point, <pair>/contact/normal.
With wrench: contact/wrench (WrenchStamped), or <pair>/wrench, the force law's answer.
It is a lifecycle node that configures and activates itself, unless autostart is false.
`contact_node --check FILE` tells what a scene file means, without ROS.
"""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..core import LENGTH_MAX
from ..scene.scene_solver import CONTAINER
from ..scene.stamp_pairing import PAIRINGS
from ..solver.models import find_model, model_names
from .named_files import FIXED_PARAMETERS, SCENE
from .parameters import Limits, Setting, answer_help, flag, number, one_of, size, text
from .wrench_output import WRENCH_PARAMETERS


def model(name: str, value: Any) -> str:
    """Check the name of a model."""
    find_model(name, text(name, value))
    return str(value)


LONGEST = 1e6  # s, about twelve days
PARAMETERS = {
    'size_a': Setting(CONTAINER, 'full extents of box A, three numbers > 0 [m]', size),
    'size_b': Setting(CONTAINER, 'full extents of box B, three numbers > 0 [m]', size),
    'scene': SCENE,
    'model': Setting('mlp', f'how the contact point is found: {model_names()}',
                     Limits(model, f'one of: {model_names()}')),
    'weights': Setting('', 'weights file to use instead of the shipped one', text),
    'pairing': Setting('stamp', 'stamp: answer once, when poses of equal stamp are in; latest: '
                                "answer every pose with the other boxes' last", one_of(PAIRINGS)),
    'tolerance': Setting(0.0, 'with pairing stamp: stamps this far apart still belong together [s]',
                         number(0.0, LONGEST)),
    'max_age': Setting(1.0, 'a pose that is older than this at its tick, by the stamps, is '
                            'stale: its pairs get no contact; longer than the slowest '
                            'period; 0: never [s]', number(0.0, LONGEST)),
    'deadline': Setting(0.0, 'quality of service that pose publishers must offer: longest time '
                             'between poses; 0: none [s]', number(0.0, LONGEST)),
    'margin': Setting(0.0, 'pairs apart are listed in contacts too, up to this separation [m]; '
                           'their depth is negative', number(0.0, LENGTH_MAX)),
    'pair_topics': Setting(True, 'whether pairs have topics of their own next to contacts', flag),
    'contacts_cloud': Setting(False, 'whether contacts are published as a point cloud as well; '
                                     'always where box_contact_msgs is not installed', flag),
    **WRENCH_PARAMETERS,
    'serialization': Setting('raw', 'raw: read and write the bytes of messages; typed: message '
                                    'objects, slower, the reference', one_of(('raw', 'typed'))),
    'autostart': Setting(True, 'whether the node configures and activates itself', flag,
                         fixed=True),
    **FIXED_PARAMETERS,
}


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    answer_help('contact_node', __doc__, PARAMETERS, args)
    from .contact_node import ContactNode  # `--help` needs no ROS
    from .runtime import run_node

    return run_node(ContactNode, args)
