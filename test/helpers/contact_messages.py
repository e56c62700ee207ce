# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A contact node in this process, and its Contacts, made from the solver's contacts."""
from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from geometry_msgs.msg import Point, Vector3
from rclpy.context import Context
from rclpy.parameter import Parameter

from box_contact_msgs.msg import Contact, Contacts
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import make_header
from box_contact_ros.solver import contact as solver


def contacts_message(touching: Mapping[str, solver.Contact], stale: Sequence[str] = (), *,
                     stamp: int, frame_id: str = 'yard') -> Contacts:
    """Return the message of contacts by the names of their pairs, and of stale pairs."""
    message = Contacts(header=make_header(stamp, frame_id), stale=list(stale))
    for pair, c in touching.items():
        x, y, z, nx, ny, nz = map(float, (*c.point, *c.normal))
        message.contacts.append(Contact(
            pair=pair, point=Point(x=x, y=y, z=z), normal=Vector3(x=nx, y=ny, z=nz),
            depth=-float(c.separation), volume=float(c.volume), area=solver.patch_area(c),
            covariance=c.covariance[np.triu_indices(3)]))
    return message


def answering_node(context: Context, **parameters: object) -> ContactNode:
    """Return a contact node of these parameters that is configured and active."""
    node = ContactNode(context, parameter_overrides=[
        Parameter(name, value=value) for name, value in parameters.items()])
    node.start()
    return node
