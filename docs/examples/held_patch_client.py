# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hold the patches that a contact node sends: `python docs/examples/held_patch_client.py`.

Start `box_contact_contact_node` first. The client asks 200 times a second, and its answers come 2
ms late. It holds each answer with the poses that it was asked for. At every physics step the law
then gives the wrench for the pose of that step.

It prints:

    50 ms: -6.99 mm deep, 583.4 mm/s
    100 ms: 0.06 mm deep, 178.7 mm/s
    200 ms: 0.05 mm deep, 1.8 mm/s
    500 ms: 0.05 mm deep, 0.0 mm/s
    2000 ms: 0.05 mm deep, 0.0 mm/s
    force / weight 1.0000, slid 30 mm
"""
import numpy as np
import rclpy
from lockstep_client import LockstepClient

from box_contact_ros import Body, HeldPatch
from box_contact_ros.node.messages import contacts_by_pair

SIZE, MASS = (12.192, 2.438, 2.591), 20_000.0  # a 40 ft container [m], [kg]
STEP_MS, PERIOD_MS, LATENCY_MS = 1, 5, 2
GRAVITY = np.array([0.0, 0.0, -9.81])  # [m/s²]


def main() -> None:
    """Set a container down from 20 mm at 0.3 m/s to the side. Guides keep it from turning."""
    rclpy.init()
    client = LockstepClient()
    client.wait_for_node()
    law = HeldPatch.at_rate(Body.of_box(SIZE, MASS), rate_hz=1e3 / PERIOD_MS,
                             latency=1e-3 * LATENCY_MS, step=1e-3 * STEP_MS)
    stack = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    load = np.array([0.0, 0.0, 2.611, 0.0, 0.0, 0.0, 1.0])
    velocity = np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])  # linear, angular
    for time in range(0, 2001, STEP_MS):
        if time % PERIOD_MS == 0:
            asked, contacts = load.copy(), contacts_by_pair(
                client.ask(time * 1_000_000, load, stack))
        if time % PERIOD_MS == LATENCY_MS:
            law.hold(contacts, asked)  # the load is box_a, so the normal points down
        force = law.wrench(load, velocity)[:3]
        velocity[:3] += 1e-3 * STEP_MS * (force / MASS + GRAVITY)
        load[:3] += 1e-3 * STEP_MS * velocity[:3]
        if time in (50, 100, 200, 500, 2000):
            print(f'{time} ms: {1e3 * (2.591 - load[2]):.2f} mm deep, '
                  f'{1e3 * np.linalg.norm(velocity):.1f} mm/s')
    print(f'force / weight {force[2] / (9.81 * MASS):.4f}, slid {1e3 * load[0]:.0f} mm')
    rclpy.shutdown()


if __name__ == '__main__':
    main()
