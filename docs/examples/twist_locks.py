# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A crane loads a container onto a lorry, which drives off: `python docs/examples/twist_locks.py`.

The spreader hangs on four ropes, whose forces are the program's own. Twist locks that close make
one body of spreader and container. The lorry is moved by its poses. The forces find all pairs.

It prints:

    locked: 0 kN on the hook, 275 kN on ground and lorry
    lifted: 275 kN on the hook, 0 kN on ground and lorry
    landed: 0 kN on the hook, 275 kN on ground and lorry
    opened: 78 kN on the hook, 196 kN on ground and lorry
    the container is 8.00 m away on the lorry
"""
import numpy as np

from box_contact_ros import Body, PatchForces

GROUND, LORRY, SPREADER, CONTAINER = range(4)
SIZES = np.array([(60, 40, 1), (13, 2.5, 1.5), (12.192, 2.438, 0.4), (12.192, 2.438, 2.591)])
MASSES, GRAVITY, STEP = np.array([0, 0, 8e3, 20e3]), 9.81, 1 / 60  # [kg], [m/s²], [s]
TOP, STIFFNESS, DAMPING = 25.0, 2e6, 2e5  # of each rope [m], [N/m], [N s/m]
CORNERS = [(x, y, 0.2) for x in (-5.0, 5.0) for y in (-1.0, 1.0)]  # of the spreader [m]
SEPARATE = [Body.of_box(size, mass) for size, mass in zip(SIZES, MASSES)]
HERE = np.array([0, 0, 0, 0, 0, 0, 1.0])


class Crane:
    """Four boxes: each is a body, but for the container in the locks."""

    def __init__(self) -> None:
        self.poses, self.velocities = np.tile(HERE, (4, 1)), np.zeros((4, 6))
        self.poses[:, 2] = -0.5, 0.75, 5.0, 1.2955
        self.poses[LORRY, 1] = 10.0
        self.height = 5.0  # at which the ropes would hold a spreader without weight [m]
        self.forces = PatchForces(SEPARATE)
        self.open()

    def open(self) -> None:
        """Make the container a body of its own, where it is."""
        self.bodies, self.masses = SEPARATE, MASSES
        self.forces.set_boxes(SIZES, find_pairs=True)
        self.forces.set_bodies(self.bodies)

    def close(self) -> None:
        """Make the container a part of the spreader: its own body has no box, and no weight."""
        places = self.poses[2:] - [*self.poses[SPREADER, :3], 0, 0, 0, 0]
        held = Body.of_boxes(SIZES[2:], places, MASSES[2:])
        self.bodies, self.masses = [*SEPARATE[:2], held.body, SEPARATE[3]], [0, 0, MASSES.sum(), 0]
        self.forces.set_boxes(SIZES, body=[GROUND, LORRY, SPREADER, SPREADER],
                              poses=[HERE, HERE, *held.poses], find_pairs=True)
        self.forces.set_bodies(self.bodies)
        self.place = held.poses[1]

    def ropes(self) -> np.ndarray:
        """Return the wrench of the ropes on the spreader. It hardly turns."""
        at = self.forces.ahead(STEP, self.poses, self.velocities)[SPREADER, :3]  # keeps energy
        wrench = np.zeros(6)
        for corner in np.array(CORNERS):
            arm = corner - self.bodies[SPREADER].centre
            way = [corner[0], corner[1], TOP] - (at + corner)
            speed = self.velocities[SPREADER, :3] + np.cross(self.velocities[SPREADER, 3:], arm)
            length = np.linalg.norm(way)
            stretch = length - (TOP - self.height - corner[2])
            pull = way / length * max(0.0, STIFFNESS * stretch - DAMPING * speed @ way / length)
            wrench += [*pull, *np.cross(arm, pull)]
        return wrench

    def run(self, seconds: float, height: float, lorry: float | None = None) -> None:
        """Hoist to a height, and drive the lorry to a place, smoothly."""
        begin = self.height, self.poses[LORRY, 1]
        for step in range(round(seconds / STEP)):
            share = 0.5 - 0.5 * np.cos(np.pi * step * STEP / seconds)
            self.height = begin[0] + share * (height - begin[0])
            if lorry is not None:
                self.poses[LORRY, 1] = begin[1] + share * (lorry - begin[1])
            wrenches = np.zeros((4, 6))
            wrenches[:, 2] = -GRAVITY * np.array(self.masses)
            self.hook = self.ropes()
            wrenches[SPREADER] += self.hook
            self.poses, self.velocities, *_ = self.forces.advance(
                STEP, self.poses, self.velocities, wrenches)

    def show(self, word: str) -> None:
        """Print what hangs, and what stands."""
        loads = self.forces.loads()
        stands = loads.pressing[(loads.pairs < SPREADER).any(axis=1)].sum()
        print(f'{word}: {self.hook[2] / 1e3:.0f} kN on the hook, '
              f'{stands / 1e3:.0f} kN on ground and lorry')


crane = Crane()
crane.run(6.0, 2.6)
crane.run(1.0, 2.6)
crane.close()
crane.run(1.0, 2.6)
crane.show('locked')
crane.run(6.0, 6.0)
crane.run(2.0, 6.0, lorry=10.0)
crane.show('lifted')
crane.run(8.0, 6.0, lorry=0.0)
crane.run(6.0, 4.1)
crane.run(1.0, 4.1)
crane.show('landed')
crane.poses[CONTAINER] = crane.poses[SPREADER] + [*crane.place[:3], 0, 0, 0, 0]
crane.open()
crane.run(3.0, 6.0)
crane.run(2.0, 6.0)
crane.show('opened')
crane.run(8.0, 6.0, lorry=8.0)
crane.run(1.0, 6.0)
print(f'the container is {crane.poses[CONTAINER, 1]:.2f} m away on the lorry')
