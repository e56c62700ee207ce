# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Make forces of what a contact node sends: `python docs/examples/forces_client.py`.

Start `box_contact_contact_node` first. The client asks 200 times a second, and its answers come 2
ms late. `PatchForces` takes each answer with the poses that it was asked for. At every physics step
it then moves the load.

It prints:

    50 ms: -7.00 mm deep, 583.4 mm/s
    100 ms: 0.14 mm deep, 0.0 mm/s
    200 ms: 0.03 mm deep, 0.0 mm/s
    500 ms: 0.03 mm deep, 0.0 mm/s
    2000 ms: 0.03 mm deep, 0.0 mm/s
    force / weight 1.0000, slid 20 mm
    corner loads 49.1 49.1 49.0 49.0 kN
"""
from box_contact_ros.extras import require

require('ros')  # what is missing is named in one line
import numpy as np
import rclpy
from lockstep_client import LockstepClient

from box_contact_ros import Body, PatchForces

SIZE, MASS = (12.192, 2.438, 2.591), 20_000.0  # a 40 ft container [m], [kg]
STEP_MS, PERIOD_MS, LATENCY_MS = 1, 5, 2
GRAVITY = 9.81  # [m/s²]
WIDE = 1e12  # inertia of a load that guides keep from turning [kg m²]


def main() -> None:
    """Set a container down from 20 mm at 0.3 m/s to the side. Guides keep it from turning."""
    rclpy.init()
    client = LockstepClient()
    client.wait_for_node()
    places = {'box_a': 0, 'box_b': 1}  # of the bodies, by the names of their boxes
    forces = PatchForces([Body(mass=MASS, inertia=[WIDE] * 3),
                          Body.fixed()])
    forces.set_boxes([SIZE, SIZE])  # then corners of loads are those of the faces
    poses = np.array([[0.0, 0.0, 2.611, 0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    velocities, weights = np.zeros((2, 6)), np.zeros((2, 6))
    velocities[0, 0], weights[0, 2] = 0.3, -GRAVITY * MASS
    for time in range(0, 2001, STEP_MS):
        if time % PERIOD_MS == 0:
            asked, answer = poses.copy(), client.ask(time * 1_000_000, *poses)
        if time % PERIOD_MS == LATENCY_MS:
            pairs = [(places[a], places[b]) for _, a, b in answer.names]
            forces.hold(np.reshape(pairs, (-1, 2)), answer.contacts, asked,
                        age=1e-3 * LATENCY_MS, period=1e-3 * PERIOD_MS)
        poses, velocities, wrenches, _ = forces.advance(1e-3 * STEP_MS, poses, velocities, weights)
        if time in (50, 100, 200, 500, 2000):
            print(f'{time} ms: {1e3 * (2.591 - poses[0, 2]):.2f} mm deep, '
                  f'{1e3 * np.linalg.norm(velocities):.1f} mm/s')
    print(f'force / weight {wrenches[0, 2] / (GRAVITY * MASS):.4f}, '
          f'slid {1e3 * poses[0, 0]:.0f} mm')
    print('corner loads', *(f'{1e-3 * load:.1f}' for load in forces.loads().corner_loads[0]), 'kN')
    rclpy.shutdown()


if __name__ == '__main__':
    main()
