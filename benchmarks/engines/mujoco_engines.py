# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo: signed distance and collision, by each of its colliders of convex shapes.

`mj_collision` takes two boxes by a collider of their own, whatever the flags say. Boxes as meshes
of eight corners are what it takes by CCD.
"""
from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product
from typing import Any

import mujoco
import numpy as np

from ..contestant import APART, Contestant, Manifold, manifold, wxyz

Shape = Callable[[str, np.ndarray], tuple[str, str]]  # (name, size) -> asset, geom
_CCD_ENDS = 'The search for the depth ends at 0, on boxes of very unequal sizes.'
FARTHEST = 1.0  # distance up to which mj_geomDistance looks [m]


def distance(name: str, flags: str) -> Contestant:
    """Return `mj_geomDistance`: signed distance and two nearest points; their middle."""
    ends = np.zeros(6)
    measure, kinematics = mujoco.mj_geomDistance, mujoco.mj_kinematics

    def boxes(p: np.ndarray, q: np.ndarray) -> Callable[..., Any]:
        model, data = _model(box_geoms, flags, p, q)
        places = data.qpos

        def ask(poses: np.ndarray) -> float:
            places[:] = poses
            kinematics(model, data)
            return measure(model, data, 0, 1, FARTHEST, ends)
        return ask

    def read(result: float) -> Manifold:
        if result > 0.0:
            return APART
        start, end = ends[:3], ends[3:]
        length = np.linalg.norm(start - end)
        normal = (start - end) / length if length else np.full(3, np.nan)
        return manifold([(0.5 * (start + end), normal, -result)])

    return Contestant(name=f'MuJoCo mj_geomDistance{name}',
                      call='mj_geomDistance(model, data, 0, 1, 1.0, fromto)'
                      f'{flags and f", {flags}"}', returns='distance, two nearest points',
                      package='mujoco', choices=('its point',), boxes=boxes, at=as_qpos, read=read,
                      causes={'normal': _CCD_ENDS + ' The two nearest points coincide, and give no '
                              'direction.'})


def collision(name: str, shape: Shape, flags: str, normal: str = '', **about: Any) -> Contestant:
    """Return `mj_collision`, after `mj_kinematics`: up to eight contacts."""
    kinematics, collide = mujoco.mj_kinematics, mujoco.mj_collision

    def boxes(p: np.ndarray, q: np.ndarray) -> Callable[..., Any]:
        model, data = _model(shape, flags, p, q)
        places = data.qpos

        def ask(poses: np.ndarray) -> Any:
            places[:] = poses
            kinematics(model, data)
            collide(model, data)
            return data
        return ask

    def read(data: Any) -> Manifold:
        found = data.contact
        # A frame's first row is the normal, from the geom of lower number to the other.
        return Manifold(np.array(found.pos), np.array(found.frame)[:, :3], -np.array(found.dist))

    return Contestant(name=f'MuJoCo mj_collision{name}',
                      call=f'mj_collision(model, data){flags and f", {flags}"}',
                      returns='up to 8 points with depths, normals',
                      package='mujoco', boxes=boxes, at=as_qpos, read=read, **about,
                      causes={'missed': _CCD_ENDS, 'normal': normal})


def as_qpos(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray]:
    """Return both poses (7,) as MuJoCo's `qpos` of two free bodies, (14,)."""
    place_a, place_b, quat_a, quat_b = wxyz(a, b)
    return (np.concatenate([place_a, quat_a, place_b, quat_b]),)


def box_geoms(name: str, size: np.ndarray) -> tuple[str, str]:
    """Return the shape of a box: its assets, none, and its geom."""
    return '', f'<geom type="box" size="{_text(0.5 * size)}"/>'


def _meshes(name: str, size: np.ndarray) -> tuple[str, str]:
    corners = np.array(list(product((-0.5, 0.5), repeat=3))) * size
    return f'<mesh name="{name}" vertex="{_text(corners)}"/>', f'<geom type="mesh" mesh="{name}"/>'


def _text(numbers: np.ndarray) -> str:
    return ' '.join(map(repr, numbers.ravel().tolist()))


def _model(shape: Shape, flags: str, p: np.ndarray, q: np.ndarray) -> tuple[Any, Any]:
    assets, geoms = zip(shape('a', p), shape('b', q))
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'  # else small boxes are refused
    bodies = ''.join(f'<body><freejoint/>{inertia}{geom}</body>' for geom in geoms)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option><flag {flags}/></option><asset>{"".join(assets)}</asset>'
        f'<worldbody>{bodies}</worldbody></mujoco>')
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


LIBCCD = 'nativeccd="disable"'
ENGINES = [
    partial(distance, '', ''), partial(distance, ', libccd', LIBCCD),
    partial(collision, '', box_geoms, ''),
    partial(collision, ', meshes', _meshes, 'multiccd="enable"', normal='multiccd takes the normal '
            'of a face near the direction of least depth; with one point the normal is right.'),
    partial(collision, ', meshes, one point', _meshes, 'multiccd="disable"',
            choices=('its point',)),
    partial(collision, ', meshes, libccd', _meshes, f'{LIBCCD} multiccd="enable"',
            normal='libccd ends its search for the depth early, too deep and off in direction.'),
]
