# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Land a container in MuJoCo on one contact a tick: `python docs/examples/mujoco_loop.py`.

MuJoCo integrates the motion. Its own contact is off. Every 5 ms the solver answers for the pair,
and the patch law turns the contact into the wrench that acts until the next answer.
"""
import mujoco
import numpy as np

from box_contact_ros import ContactSolver, HeldWrench, PatchLaw

SIZE, MASS = np.array([12.192, 2.438, 2.591]), 20_000.0  # a 40 ft container [m], [kg]
INERTIA = MASS / 12.0 * (np.square(SIZE).sum() - np.square(SIZE))  # about its own axes [kg m²]
RATE, LATENCY, DURATION = 200.0, 0.002, 3.0  # [Hz], [s], [s]
STACK = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])  # x y z qx qy qz qw, its top at 1.2955 m

MODEL = f"""
<mujoco>
  <option timestep="0.001" integrator="implicitfast"><flag contact="disable"/></option>
  <worldbody>
    <body pos="0.3 0.1 2.65" euler="0.5 1 2"> <!-- degrees -->
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
    """Let the load drop 60 mm, and print how it rests."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    solver = ContactSolver(SIZE, SIZE, model='mlp')
    law = PatchLaw.for_loop(MASS, INERTIA, rate_hz=RATE, latency=LATENCY)
    held = HeldWrench()
    steps = round(1.0 / (RATE * model.opt.timestep))
    for tick in range(round(DURATION * RATE)):
        contact = solver(pose_of(data), STACK)  # A is the load, so the normal points down
        held.answer(law.wrench([contact], pose_of(data), velocity_of(data)),
                    asked=data.time, due=data.time + LATENCY)
        for _ in range(steps):
            data.xfrc_applied[1] = held.at(data.time)
            mujoco.mj_step(model, data)
        if tick in (10, 25, 50, 100, 200):
            print(f'{data.time:.2f} s: {1e3 * max(0.0, -contact.separation):.1f} mm deep, '
                  f'{1e3 * np.linalg.norm(data.qvel[:3]):.0f} mm/s')
    weight = MASS * 9.81
    tilt = np.degrees(np.arccos(np.clip(data.xmat[1][8], -1.0, 1.0)))
    print(f'at rest: force / weight {held.current[2] / weight:.4f}, '
          f'tilt below 0.06°: {tilt < 0.06}')


if __name__ == '__main__':
    main()
