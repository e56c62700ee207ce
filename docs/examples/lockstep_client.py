# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ask a contact node in lockstep: `python docs/examples/lockstep_client.py`.

Start `box_contact_contact_node` first. A simulator that waits for each answer loses none, however
fast or slow it runs. It sends both poses with one stamp, and waits for the contacts of that stamp.
The stamps are the simulator's own time. The service `~/check` needs none: see check_client.py.

It prints:

    5 ms: no contact, 0.0 mm deep
    10 ms: no contact, 0.0 mm deep
    15 ms: contact, 0.5 mm deep
    20 ms: contact, 1.5 mm deep
    25 ms: contact, 2.5 mm deep
"""
from box_contact_ros.extras import require

require('ros')  # what is missing is named in one line
import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_srvs.srv import Trigger

from box_contact_msgs.msg import Contacts
from box_contact_ros import ReadContacts, read_contacts


class LockstepClient(Node):
    """Sends poses `x y z qx qy qz qw` of box_a and box_b, and waits for the answer to them."""

    def __init__(self) -> None:
        super().__init__('lockstep_client')
        self.poses = [self.create_publisher(PoseStamped, f'box_{name}/pose', 10) for name in 'ab']
        self.create_subscription(Contacts, 'contacts', self.receive, 10, raw=True)
        self.node_reset = self.create_client(Trigger, 'contact_node/reset')
        self.answer: ReadContacts | None = None

    def receive(self, data: bytes) -> None:
        """Keep the newest answer."""
        self.answer = read_contacts(data)

    def wait_for_node(self) -> None:
        """Wait for the node, and begin an episode: the node forgets all stamps."""
        self.get_logger().info('waits for a contact node')
        while not (all(pose.get_subscription_count() for pose in self.poses)
                   and self.count_publishers('contacts')):
            rclpy.spin_once(self, timeout_sec=0.05)
        self.reset()

    def reset(self) -> None:
        """Begin an episode, whose times may be those of the last one."""
        self.node_reset.wait_for_service()
        rclpy.spin_until_future_complete(self, self.node_reset.call_async(Trigger.Request()))
        self.answer = None

    def ask(self, time_ns: int, *poses: np.ndarray, patience: float = 0.5) -> ReadContacts:
        """Return the answer to two poses at a time [ns]; lost poses are sent again."""
        stamp = Time(sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        while self.answer is None or self.answer.stamp != time_ns:
            for publisher, pose in zip(self.poses, poses):
                publisher.publish(message(stamp, pose))
            until = self.get_clock().now().nanoseconds + patience * 1e9
            while ((self.answer is None or self.answer.stamp != time_ns)
                   and self.get_clock().now().nanoseconds < until):
                rclpy.spin_once(self, timeout_sec=0.01)
        return self.answer


def message(stamp: Time, pose: np.ndarray) -> PoseStamped:
    """Return the message of a pose; messages want Python's floats, not NumPy's."""
    made = PoseStamped()
    made.header.stamp, made.header.frame_id = stamp, 'world'
    p, q = made.pose.position, made.pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, pose)
    return made


def main() -> None:
    """Lower a container by a millimetre a step until it is 3 mm deep."""
    rclpy.init()
    client = LockstepClient()
    client.wait_for_node()
    stack = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    load = np.array([0.0, 0.0, 2.5925, 0.0, 0.0, 0.0, 1.0])
    for tick in range(1, 6):
        # 5 ms of simulated time per step
        answer = client.ask(tick * 5_000_000, load, stack)
        depth = -1e3 * answer.contacts.separation[0] if answer.names else 0.0
        print(f'{5 * tick} ms: {"contact" if answer.names else "no contact"}, '
              f'{depth:.1f} mm deep')
        load[2] -= 1e-3
    rclpy.shutdown()


if __name__ == '__main__':
    main()
