# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A plan from MuJoCo's model of MJCF or URDF: `python docs/examples/mujoco_plan.py [MODEL]`.

What a free joint carries is one body, all else is fixed, planes are slabs. Other shapes and what is
near them, equalities and odd gravity are named, so that not all is judged. It prints:

    overlap: 3
    overlap               block  left finger  0.1 mm deep
    overlap               block  right finger  0.1 mm deep
    overlap               table  block  0.1 mm deep
    1 box, 0.2 kg, centre of mass 0.100 0.000 0.020 m, friction 0.5 to 1: not sound
"""
import sys
from pathlib import Path

from box_contact_ros.extras import require

require('sim', 'plans')  # what is missing is named in one line
import mujoco
import numpy as np

from box_contact_ros import Fault, Plan, inspect_plan


def plan_of(model: mujoco.MjModel) -> Plan:
    """Return the plan of a model's boxes and planes, at qpos0."""
    data, box, plane = mujoco.MjData(model), mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_PLANE
    mujoco.mj_fwdPosition(model, data)
    top = np.arange(model.nbody)  # of each body, the one with the free joint; 0: it is fixed
    for n in np.setdiff1d(top, model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]):
        top[n] = top[model.body_parentid[n]]  # parents come first
    is_box, is_plane = model.geom_type == box, model.geom_type == plane
    names = np.array([model.geom(n).name or f'geom {n}' for n in range(model.ngeom)])
    pull, body, axes = model.opt.gravity, top[model.geom_bodyid], data.geom_xmat.reshape(-1, 3, 3)
    size, place, pose = 2.0 * model.geom_size, data.geom_xpos, np.zeros((model.ngeom, 7))
    size[is_plane] = *[4.0 * (1.0 + np.abs(place).max() + size[is_box].max(initial=0.0))] * 2, 1.0
    pose[:, :3] = place - np.where(is_plane, 0.5, 0.0)[:, None] * axes[:, :, 2]
    for n, matrix in enumerate(data.geom_xmat):
        mujoco.mju_mat2Quat(pose[n, 3:], matrix)
    pose[:, 3:], is_free = np.roll(pose[:, 3:], -1, axis=1), body > 0  # MuJoCo puts w first
    volume = is_box * size.prod(axis=1) + 1e-12
    mass = is_free * model.body_subtreemass[body] * volume / np.bincount(body, volume)[body]
    centre = np.einsum('nij,ni->nj', axes, data.subtree_com[body] - place) * is_free[:, None]
    other, half = ~is_box & ~is_plane, np.linalg.norm(size, axis=1)[:, None] / 2.0
    near = np.linalg.norm(place[:, None] - place[other], axis=2) < model.geom_rbound[other] + half
    held = np.isin(body, [0, *body[near.any(axis=1)]])
    faults = [Fault('shape', (name,), 'not judged') for name in names[other | held & is_free]]
    odd = ('equalities', model.neq), ('odd gravity', pull[:2].any() or pull[2] >= 0.0)
    faults += [Fault('shape', (), f'it has {what}') for what, there in odd if there]
    bits = np.bitwise_and.outer(model.geom_contype, model.geom_conaffinity)
    pairs = (model.geom_bodyid[:, None] << 16) + model.geom_bodyid
    is_out = np.isin([pairs, pairs.T], model.exclude_signature).any(0) | ((bits | bits.T) == 0)
    kept = np.flatnonzero(~other)
    return Plan(size[kept], pose[kept], mass[kept], centres=centre[kept], body=body[kept],
                names=names[kept].tolist(), ground=np.flatnonzero(held[kept]), faults=faults,
                apart=np.argwhere(np.triu(is_out[np.ix_(kept, kept)], 1)),
                friction=model.geom_friction[kept, 0])


if __name__ == '__main__':
    given = (*sys.argv[1:], str(Path(__file__).with_name('gripper.xml')))[0]
    print(inspect_plan(plan_of(mujoco.MjModel.from_xml_path(given))))
