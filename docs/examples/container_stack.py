# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Five containers fall onto each other and rest: `python docs/examples/container_stack.py`.

All of them move. MuJoCo integrates, and its own contact is off. A solver answers for the pairs 200
times a second, and each answer comes 2 ms late. `PatchForces` takes the answers, and gives the
wrench on every container at every physics step.

It prints:

    2 s: slower than 1 mm/s: True, less than 1 mm deep: True
    4 s: slower than 1 mm/s: True, less than 1 mm deep: True
    6 s: slower than 1 mm/s: True, less than 1 mm deep: True
    8 s: slower than 1 mm/s: True, less than 1 mm deep: True
    corners on the ground: 25 25 25 25 % of the weight
"""
from itertools import combinations

from box_contact_ros.extras import require

require('sim')  # what is missing is named in one line
import mujoco
import numpy as np

from box_contact_ros import Body, ContactSolver, PatchForces

SIZE, MASS, COUNT = (12.192, 2.438, 2.591), 20_000.0, 5  # [m], [kg]
RATE, LATENCY, STEP, DURATION = 200.0, 0.002, 0.001, 8.0  # [Hz], [s], [s], [s]
GAP = 0.01  # between the containers at the start [m]

# Box 0 is the ground.
SIZES = np.array([(40.0, 40.0, 1.0), *[SIZE] * COUNT])
GROUND = np.array([0.0, 0.0, -0.5, 0.0, 0.0, 0.0, 1.0])
PAIRS = np.array(list(combinations(range(COUNT + 1), 2)))
MODEL = '\n'.join([
    f'<mujoco><option timestep="{STEP}"><flag contact="disable"/></option><worldbody>',
    *(f'<body pos="{0.1 * (-1)**i} 0 {(i + 0.5) * SIZE[2] + (i + 1) * GAP}" euler="0.05 0 {i}">'
      f'<freejoint/><geom type="box" size="{" ".join(str(x / 2) for x in SIZE)}" mass="{MASS}"/>'
      '</body>' for i in range(COUNT)), '</worldbody></mujoco>'])


def poses_of(data: mujoco.MjData) -> np.ndarray:
    """Return all poses (n, 7) `x y z qx qy qz qw`; MuJoCo puts w first."""
    return np.vstack([GROUND, data.qpos.reshape(COUNT, 7)[:, [0, 1, 2, 4, 5, 6, 3]]])


def velocities_of(data: mujoco.MjData) -> np.ndarray:
    """Return all velocities (n, 6) in the world frame; MuJoCo's spins are in the bodies' own."""
    velocities = data.qvel.reshape(COUNT, 6).copy()
    velocities[:, 3:] = np.einsum('nij,nj->ni', data.xmat[1:].reshape(COUNT, 3, 3),
                                  velocities[:, 3:])
    return np.vstack([np.zeros(6), velocities])


def main() -> None:
    """Let the containers fall, push the lowest, and print how the stack moves."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    solver = ContactSolver(SIZE, SIZE, model='exact')
    bodies = [Body.fixed(), *[Body.of_box(SIZE, MASS)] * COUNT]
    forces = PatchForces(bodies)
    forces.set_boxes(SIZES)  # then corners of loads are those of the faces
    weights = np.zeros((COUNT + 1, 6))
    weights[1:, 2] = -9.81 * MASS
    ticks, late = round(1 / (RATE * STEP)), round(LATENCY / STEP)
    for step in range(round(DURATION / STEP)):
        poses = poses_of(data)
        if step % ticks == 0:
            asked, contacts = poses, solver.batch(poses, sizes=SIZES, pairs=PAIRS)
        if step % ticks == late:
            forces.hold(PAIRS, contacts, asked, age=LATENCY)
        data.xfrc_applied[1:] = forces.wrenches(STEP, poses, velocities_of(data), weights)[1:]
        mujoco.mj_step(model, data)
        if step % 2000 == 1999:
            fastest = np.abs(data.qvel.reshape(COUNT, 6)[:, :3]).max()
            deepest = -contacts.separation.min()
            print(f'{data.time:.0f} s: slower than 1 mm/s: {fastest < 1e-3}, '
                  f'less than 1 mm deep: {deepest < 1e-3}')
    shares = forces.loads().corner_loads[0] / (9.81 * MASS * COUNT)
    print('corners on the ground:', *(f'{100.0 * share:.0f}' for share in shares),
          '% of the weight')


if __name__ == '__main__':
    main()
