# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stack two containers on a lorry by a crane over ROS: `python docs/examples/crane_lift.py`.

Start a node first, whose scene gets its poses by name:

    box_contact_contact_node --ros-args -p scene:=config/scenes/lift.yaml -p pair_topics:=false

The spreader hangs on a rope and sways. It lands by the contacts that the node sends.

It prints:

    c1: swayed 0.18 m, stands at 5.89 m, 0.6 mm deep
    c2: swayed 0.40 m, stands at 5.88 m, 1.3 mm deep
"""
from box_contact_ros.extras import require

require('ros')  # what is missing is named in one line
import numpy as np
import rclpy
from geometry_msgs.msg import Point, Pose, Quaternion, Transform, Vector3
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import MultiDOFJointState

from box_contact_msgs.msg import Body as BodyMessage
from box_contact_msgs.msg import Box, Contacts
from box_contact_msgs.srv import SetBoxes
from box_contact_ros import Body, PatchForces, ReadContacts, read_contacts

CONTAINER, FRAME = (12.192, 2.438, 2.591), 'spreader_frame'
SIZES = {'ground': (60, 60, 1), 'lorry': (12.5, 2.5, 1.5), 'c1': CONTAINER, 'c2': CONTAINER,
         FRAME: (12.192, 2.438, 0.4)}  # as in the scene file
MASSES = {'c1': 20_000.0, 'c2': 12_000.0, FRAME: 8_000.0}  # [kg]
TOP, STIFFNESS, DAMPING, GRAVITY = 20.0, 1e6, 2e5, 9.81  # of the rope [m], [N/m], [N s/m]
STEP, STEPS = 0.002, 20  # of physics [s]; how many from question to question
WIDE = 1e12  # inertia of a load that guides keep from turning [kg m²]
FIXED = Body.fixed()


class Crane(Node):
    """A spreader on a rope: body 1 of the forces. Body 0 is all that is fixed."""

    def __init__(self) -> None:
        super().__init__('crane')
        self.change = self.create_client(SetBoxes, 'contact_node/set_boxes',
                                         qos_profile=QoSProfile(depth=128))
        self.sender = self.create_publisher(MultiDOFJointState, 'poses', 10)
        self.create_subscription(Contacts, 'contacts', self.receive, 10, raw=True)
        self.answer: ReadContacts | None = None
        self.time = self.get_clock().now().nanoseconds
        self.trolley, self.rope, self.sway = 0.0, 10.0, 0.0
        self.poses = np.array([[0, 0, 0, 0, 0, 0, 1], [0, 0, 10, 0, 0, 0, 1.0]])
        self.velocities = np.zeros((2, 6))
        self.places = {'ground': (0, 0, -0.5), 'lorry': (0, 6, 0.75), 'c1': (0, 0, 1.2955),
                       'c2': (0, -3, 1.2955), FRAME: (0, 0, 0)}  # of parts, in the body's frame
        self.parts = [FRAME]
        self.forces = PatchForces([FIXED, FIXED])
        self.change.wait_for_service()
        self.set_boxes(fixed=[self.box(name, *SIZES[name]) for name in ('c1', 'c2')])

    def receive(self, data: bytes) -> None:
        """Keep the newest answer."""
        self.answer = read_contacts(data)

    def box(self, name: str, *size: float) -> Box:
        """Return a box at its place; one that the node knows has no size in a request."""
        x, y, z = map(float, self.places[name])
        extents = Vector3(**dict(zip('xyz', map(float, size))))
        return Box(name=name, size=extents, pose=Pose(position=Point(x=x, y=y, z=z)))

    def set_boxes(self, **changes: list[Box] | list[BodyMessage]) -> None:
        """Change the boxes of the node, and those of the forces."""
        future = self.change.call_async(SetBoxes.Request(**changes))
        rclpy.spin_until_future_complete(self, future)
        if not future.result().success:
            raise SystemExit(future.result().message)
        self.mass = sum(MASSES[part] for part in self.parts)
        self.forces.set_bodies([FIXED, Body(mass=self.mass, inertia=[WIDE] * 3)])
        body = [int(name in self.parts) for name in SIZES]
        self.forces.set_boxes(list(SIZES.values()), body=body,
                              poses=[(*self.places[name], 0, 0, 0, 1) for name in SIZES])

    def ask(self) -> ReadContacts:
        """Return the answer to the spreader's pose."""
        x, y, z, qx, qy, qz, qw = map(float, self.poses[1])
        state = MultiDOFJointState(joint_names=['spreader'], transforms=[Transform(
            translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=qx, y=qy, z=qz, w=qw))])
        stamp = state.header.stamp
        stamp.sec, stamp.nanosec = divmod(self.time, 10**9)
        while self.answer is None or self.answer.stamp != self.time:
            self.sender.publish(state)
            rclpy.spin_once(self, timeout_sec=0.1)
        return self.answer

    def move(self, trolley: float, height: float, seconds: float, *, lands: bool = False) -> None:
        """Move trolley and rope to a place, or until the load stands."""
        begin, rope, boxes, stood = self.trolley, self.rope, list(SIZES), 0
        end = TOP - height - self.mass * GRAVITY / STIFFNESS
        for step in range(round(seconds / STEP)):
            share = 0.5 - 0.5 * np.cos(np.pi * step * STEP / seconds)
            if not stood:
                self.trolley = begin + share * (trolley - begin)
                self.rope = rope + share * (end - rope)
            if step % STEPS == 0:
                self.time += round(STEPS * STEP * 1e9)
                answer = self.ask()
                pairs = [(boxes.index(a), boxes.index(b)) for _, a, b in answer.names]
                self.forces.hold(np.reshape(pairs, (-1, 2)), answer.contacts, self.poses,
                                 period=STEPS * STEP)
            # A rope keeps its energy by the forces of the poses ahead.
            ahead = self.forces.ahead(STEP, self.poses, self.velocities)
            way = np.array([0, self.trolley, TOP]) - ahead[1, :3]
            length = np.linalg.norm(way)
            pull = STIFFNESS * (length - self.rope) - DAMPING * (
                way @ self.velocities[1, :3] / length)
            outside = np.zeros((2, 6))
            outside[1, :3] = max(0.0, pull) * way / length - [0, 0, GRAVITY * self.mass]
            self.poses, self.velocities, *_ = self.forces.advance(
                STEP, self.poses, self.velocities, outside)
            self.sway = max(self.sway, abs(self.poses[1, 1] - self.trolley))
            stood += lands and self.forces.loads().pressing.sum() > 0.5 * GRAVITY * self.mass
            if stood * STEP > 0.5:
                return

    def carry(self, name: str, y: float, height: float) -> None:
        """Lift a container, and set it down at y, on what is `height` high."""
        place = np.array(self.places[name])
        self.move(place[1], 8.0, 6.0 + 2.0 * abs(place[1] - self.trolley))
        self.move(place[1], place[2], 8.0, lands=True)
        self.parts, self.places[name] = [FRAME, name], place - self.poses[1, :3]
        self.set_boxes(bodies=[BodyMessage(name='spreader', boxes=[self.box(name)])])
        self.move(place[1], 10.0, 5.0)
        self.sway = 0.0
        self.move(y, 10.0, 6.0 + 2.0 * abs(y - self.trolley))
        self.move(y, height, 8.0, lands=True)
        self.places[name] += self.poses[1, :3]
        self.parts = [FRAME]
        self.set_boxes(fixed=[self.box(name)])
        print(f'{name}: swayed {self.sway:.2f} m, stands at {self.places[name][1]:.2f} m, '
              f'{1e3 * (height + 0.5 * CONTAINER[2] - self.places[name][2]):.1f} mm deep')


rclpy.init()
crane = Crane()
crane.carry('c1', 6.0, 1.5)
crane.carry('c2', 6.0, 1.5 + CONTAINER[2])
crane.move(6.0, 10.0, 4.0)
rclpy.shutdown()
