# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo with elliptic cones and `implicitfast`: a step is one of its own, without sub-steps."""
from __future__ import annotations

from functools import partial

import mujoco
import numpy as np

from ..loops import Boxes, Scene, Theirs
from . import Asked, run


class World:
    """Boxes by `mj_step`."""

    def __init__(self, asked: Asked) -> None:
        """Make the boxes."""
        count = len(asked.mass)
        boxes = Boxes(asked.size, asked.mass, asked.pose, np.zeros((count, 3)),
                      np.zeros((count, 6)))
        self.loop = Theirs(Scene('', boxes), asked.step)
        self.data, option = self.loop.data, self.loop.model.opt
        option.cone, option.integrator = (mujoco.mjtCone.mjCONE_ELLIPTIC,
                                          mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
        if asked.sleep:
            option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
        self.step = partial(mujoco.mj_step, self.loop.model, self.data)

    def awake(self) -> int:
        """Return how many bodies are awake."""
        return int(self.data.ntree_awake)

    def poses(self) -> np.ndarray:
        """Return a pose for each box."""
        boxes = self.loop.boxes
        boxes.pose[self.loop.free] = self.data.qpos[self.loop.places][:, [0, 1, 2, 4, 5, 6, 3]]
        return boxes.pose


if __name__ == '__main__':
    run(World)
