# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the pages draw with viser: a light, cubes, and where the camera is. No ROS."""
from __future__ import annotations

import math
from typing import Any

import numpy as np

SKYLIGHT = 2.6  # intensity
FROM_BELOW = (120, 120, 120)  # colour of what the ground reflects
VIEWPOINT = np.array([-0.55, -0.78, 0.42])
"""Direction from the boxes to the camera at first."""
NARROW = 0.85  # width divided by height of the view that all boxes are in, however they lie
CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CUBE_FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                       [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
_ENDS = np.array([(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit])
CUBE_EDGES = np.concatenate([CUBE[_ENDS], 1.0001 * CUBE[_ENDS[:, :1]]], axis=1)
"""Corners (12, 3, 3) of a triangle an edge, so thin that its wireframe is the edge."""
GAMMA = 2.2  # of the colours of screens


def add_light(scene: Any) -> None:
    """Add a light from above to a scene of viser."""
    # viser's lights, among them a picture of a hall, take seconds of rendering in software.
    scene.configure_environment_map(hdri=None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere('/sky', ground_color=FROM_BELOW, intensity=SKYLIGHT,
                               position=(0.0, 0.0, 1.0))


def add_cubes(scene: Any, colours: np.ndarray, opacity: float, path: str = '') -> tuple[Any, Any]:
    """Return the faces and the edges of boxes, for a tick to move; colours (n, 3) from 0 to 255.

    Boxes are instances of one cube, which move together. path: of both, where there are others.
    """
    count = len(colours)
    no_turn, nothing = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), np.zeros((count, 3))

    def add(name: str, corners: np.ndarray, triangles: np.ndarray, shades: np.ndarray,
            **look: Any) -> Any:
        # viser takes the colours of single instances as light.
        light = (255.0 * (shades / 255.0) ** GAMMA).astype(np.uint8)
        return scene.add_batched_meshes_simple(
            path + name, corners, triangles, no_turn, nothing, batched_scales=nothing,
            batched_colors=light, lod='off', cast_shadow=False, receive_shadow=False, **look)

    # The steps of toons would cross a face, dark on one side.
    faces = add('/boxes', CUBE, CUBE_FACES, colours, opacity=opacity, flat_shading=True)
    return faces, add('/edges', CUBE_EDGES.reshape(-1, 3), np.arange(36).reshape(12, 3),
                      colours // 2, wireframe=True)


def camera_position(radius: float, fov: float, aspect: float) -> np.ndarray:
    """Return where a camera (3,) towards the origin has a sphere about it in view, from VIEWPOINT.

    radius: [m]; fov: vertical angle of view [rad]; aspect: width of the view divided by its height.
    """
    half_angle = math.atan(min(1.0, aspect) * math.tan(0.5 * fov))
    return radius / math.sin(half_angle) * VIEWPOINT / np.linalg.norm(VIEWPOINT)
