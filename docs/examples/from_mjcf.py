# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What touches in a model of MuJoCo? `python docs/examples/from_mjcf.py [MODEL]`.

MuJoCo reads the MJCF file, so includes, defaults and frames work. As in MuJoCo, geoms of one body,
or of a body and its parent, are no pair, nor are those that `contype` and `conaffinity` keep apart.
Only boxes are read, and no `<exclude>`.

It prints:

    table and block: 0.1 mm deep, 24.0 cm2
    block and left finger: 0.1 mm deep, 7.5 cm2
    block and right finger: 0.1 mm deep, 7.5 cm2
"""
import sys
from pathlib import Path

import mujoco
import numpy as np

from box_contact_ros import contacts_of, patch_area

MODEL = Path(__file__).with_name('files') / 'gripper.xml'


def read_model(path: str | Path) -> tuple[list[str], np.ndarray, np.ndarray, np.ndarray]:
    """Return names, full extents (n, 3), poses (n, 7), and the pairs (m, 2) that may collide."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)  # in the pose that the file has
    geoms = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
    turn = np.zeros((len(geoms), 4))
    for row, matrix in zip(turn, data.geom_xmat[geoms]):
        mujoco.mju_mat2Quat(row, matrix)
    pose = np.hstack((data.geom_xpos[geoms], turn[:, [1, 2, 3, 0]]))  # MuJoCo puts w first
    body = model.body_weldid[model.geom_bodyid[geoms]]
    parent = np.where(body, model.body_weldid[model.body_parentid[body]], -1)
    parent[parent == 0] = -1  # the world collides with its children
    a, b = np.triu_indices(len(geoms), 1)
    apart = (body[a] != body[b]) & (parent[a] != body[b]) & (body[a] != parent[b])
    kind, others = model.geom_contype[geoms], model.geom_conaffinity[geoms]
    apart &= (kind[a] & others[b] | kind[b] & others[a]) != 0
    names = [model.geom(geom).name or f'geom {geom}' for geom in geoms]
    return names, 2.0 * model.geom_size[geoms], pose, np.stack((a, b), axis=1)[apart]


def main() -> None:
    """Read a model, and tell what touches in it."""
    names, size, pose, allowed = read_model(sys.argv[1] if len(sys.argv) > 1 else MODEL)
    for (a, b), contact in zip(*contacts_of(size, pose, allowed)):
        print(f'{names[a]} and {names[b]}: {max(0.0, -1e3 * contact.separation):.1f} mm deep, '
              f'{1e4 * patch_area(contact):.1f} cm2')


if __name__ == '__main__':
    main()
