# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Land a container in MuJoCo on pairs that come late: `python docs/examples/mujoco_loop.py`.

MuJoCo integrates the motion. Its own contact is off. Every 20 ms, a `SceneSolver` lists the pairs
that may touch soon, as a contact node does, and its list comes 5 ms late. `PatchForces` solves the
pairs at the poses of each physics step, and gives the wrench. The load lands on a corner, then on
an edge, and lies flat from 0.3 s on.

It prints:

    0.06 s: 0.0 mm deep, 589 mm/s
    0.13 s: 0.0 mm deep, 987 mm/s
    0.26 s: 0.0 mm deep, 109 mm/s
    0.51 s: 0.0 mm deep, 0 mm/s
    1.01 s: 0.0 mm deep, 0 mm/s
    at rest: force / weight 1.0000, tilt below 0.001°: True
"""
from box_contact_ros.extras import require

require('sim')  # what is missing is named in one line
import mujoco
import numpy as np

from box_contact_ros import Body, Box, Pair, PatchForces, Scene, SceneSolver

SIZE, MASS = np.array([12.192, 2.438, 2.591]), 20_000.0  # a 40 ft container [m], [kg]
STEP, STEPS, LATE = 0.001, 20, 5  # physics step [s]; steps from question to question, and to answer
CLOSING = 1.5  # the largest speed at which two boxes approach [m/s]
MARGIN = CLOSING * (STEPS + LATE) * STEP  # pairs apart by this may touch before the next list [m]
DURATION = 3.0  # [s]
STACK = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])  # x y z qx qy qz qw, its top at 1.2955 m

MODEL = f"""
<mujoco>
  <option timestep="{STEP}" integrator="implicitfast"><flag contact="disable"/></option>
  <worldbody>
    <body pos="0.3 0.1 2.76" euler="0.5 1 2"> <!-- degrees -->
      <freejoint/>
      <geom type="box" size="{' '.join(map(str, SIZE / 2))}" mass="{MASS}"/>
    </body>
  </worldbody>
</mujoco>
"""


def pose_of(data: mujoco.MjData) -> np.ndarray:
    """Return the load's pose `x y z qx qy qz qw`; MuJoCo puts w first."""
    w, x, y, z = data.qpos[3:7]
    return np.array([*data.qpos[:3], x, y, z, w])


def velocity_of(data: mujoco.MjData) -> np.ndarray:
    """Return the load's linear and angular velocity (6,) in the world frame."""
    rotation = data.xmat[1].reshape(3, 3)
    return np.concatenate([data.qvel[:3], rotation @ data.qvel[3:]])


def main() -> None:
    """Drop the load, its lowest corner 50 mm above the stack, and print how it rests."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    boxes = {'load': Box(SIZE), 'stack': Box(SIZE, STACK)}
    solver = SceneSolver(Scene(boxes, (Pair.between('load', 'stack'),)), margin=MARGIN)
    fixed = Body.fixed()
    forces = PatchForces([Body.of_box(SIZE, MASS), fixed])  # body 0, the load, and 1, the stack
    forces.set_boxes([SIZE, SIZE])
    velocities, weights = np.zeros((2, 6)), np.zeros((2, 6))
    weights[0, 2] = -9.81 * MASS
    for step in range(round(DURATION / STEP)):
        pose = pose_of(data)
        if step % STEPS == 0:
            answer = solver([pose])  # the pairs that touch, then those within the margin
        if step % STEPS == LATE:
            forces.hold(np.concatenate((answer.pairs, answer.near_pairs)))
        velocities[0] = velocity_of(data)
        poses = np.array([pose, STACK])
        data.xfrc_applied[1] = forces.wrenches(STEP, poses, velocities, weights)[0]
        mujoco.mj_step(model, data)
        if step + 1 in (60, 130, 260, 510, 1010):
            depth = max(0.0, -answer.contacts.separation.min(initial=0.0))
            print(f'{data.time:.2f} s: {1e3 * depth:.1f} mm deep, '
                  f'{1e3 * np.linalg.norm(data.qvel[:3]):.0f} mm/s')
    weight = MASS * 9.81
    tilt = np.degrees(np.arccos(np.clip(data.xmat[1][8], -1.0, 1.0)))
    print(f'at rest: force / weight {data.xfrc_applied[1, 2] / weight:.4f}, '
          f'tilt below 0.001°: {tilt < 0.001}')


if __name__ == '__main__':
    main()
