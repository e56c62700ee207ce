# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Apply the wrench that a contact node sends: `python docs/examples/wrench_client.py`.

For a simulator that knows nothing of contacts. Start the node first, with the mass and the rate:
`box_contact_contact_node --ros-args -p wrench:=true -p rate:=200 -p mass_a:=20000`.

It prints:

    50 ms: -4.89 mm deep, 539.5 mm/s
    100 ms: 0.12 mm deep, 57.2 mm/s
    200 ms: 1.19 mm deep, 0.8 mm/s
    500 ms: 1.21 mm deep, 0.0 mm/s
    2000 ms: 1.21 mm deep, 0.0 mm/s
    force / weight 1.0000
"""
import numpy as np
import rclpy
from geometry_msgs.msg import WrenchStamped
from lockstep_client import LockstepClient

MASS = 20_000.0  # [kg]


def main() -> None:
    """Set a container down from 20 mm in steps of 5 ms. It can only move up and down."""
    rclpy.init()
    client = LockstepClient(WrenchStamped, 'contact/wrench')
    client.wait_for_node()
    stack = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    load = np.array([0.0, 0.0, 2.611, 0.0, 0.0, 0.0, 1.0])
    speed = 0.0
    for time in range(0, 2001, 5):
        force = client.ask(time * 1_000_000, load, stack).wrench.force.z
        for _ in range(5):  # physics steps of 1 ms under one wrench
            speed += 1e-3 * (force / MASS - 9.81)
            load[2] += 1e-3 * speed
        if time in (50, 100, 200, 500, 2000):
            print(f'{time} ms: {1e3 * (2.591 - load[2]):.2f} mm deep, {1e3 * abs(speed):.1f} mm/s')
    print(f'force / weight {force / (9.81 * MASS):.4f}')
    rclpy.shutdown()


if __name__ == '__main__':
    main()
