# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drake: point pairs, and the surface of its hydroelastic contact."""
from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from pydrake import geometry
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform

from ..contestant import APART, Contestant, Manifold, manifold

MODULUS = 1e5  # hydroelastic modulus [Pa]; equal on both boxes, so that it shifts nothing


class _DrakeScene:
    """Two boxes in a scene graph."""

    def __init__(self, surfaces: bool, p: np.ndarray, q: np.ndarray) -> None:
        self._graph = geometry.SceneGraph()
        source = self._graph.RegisterSource('boxes')
        self._frames, shapes = [], []
        for name, size in (('a', p), ('b', q)):
            frame = self._graph.RegisterFrame(source, geometry.GeometryFrame(name))
            shape = self._graph.RegisterGeometry(source, frame, geometry.GeometryInstance(
                RigidTransform(), geometry.Box(*size), name))
            properties = geometry.ProximityProperties()
            geometry.AddCompliantHydroelasticProperties(float(size.max()), MODULUS, properties)
            self._graph.AssignRole(source, shape, properties)
            self._frames.append(frame)
            shapes.append(shape)
        self._context = self._graph.CreateDefaultContext()
        self._port, self._poses = (self._graph.get_source_pose_port(source),
                                   geometry.FramePoseVector())
        self._surfaces = surfaces
        self.first = shapes[0]

    def __call__(self, at_a: Any, at_b: Any) -> tuple[Any, list[Any]]:
        self._poses.set_value(self._frames[0], at_a)
        self._poses.set_value(self._frames[1], at_b)
        self._port.FixValue(self._context, self._poses)
        query = self._graph.get_query_output_port().Eval(self._context)
        if self._surfaces:
            return self.first, query.ComputeContactSurfaces(
                geometry.HydroelasticContactRepresentation.kPolygon)
        return self.first, query.ComputePointPairPenetration()


def _engine(surfaces: bool, read: Callable[[Any], Manifold], **about: Any) -> Contestant:
    def place(pose: np.ndarray) -> Any:
        x, y, z, w = pose[3:] / np.linalg.norm(pose[3:])
        return RigidTransform(Quaternion(w, x, y, z), pose[:3])

    return Contestant(package='drake', read=read, boxes=partial(_DrakeScene, surfaces),
                      at=lambda a, b: (place(a), place(b)), **about)


def point_pair() -> Contestant:
    """Return Drake's `ComputePointPairPenetration`: two points; their middle."""
    def read(found: Any) -> Manifold:
        first, pairs = found
        if not pairs:
            return APART
        pair = pairs[0]
        towards = -1.0 if pair.id_A == first else 1.0  # the normal points from B to A
        return manifold([(0.5 * (np.array(pair.p_WCa) + pair.p_WCb),
                          towards * np.array(pair.nhat_BA_W), pair.depth)])

    return _engine(False, read, name='Drake point pair', returns='two points, depth, normal',
                   call='QueryObject.ComputePointPairPenetration', choices=('its point',))


def centre_of_pressure(surface: Any) -> np.ndarray:
    """Return the mean of the surface's points (3,), weighted by area and pressure.

    A face is a fan of triangles, on which the pressure p is linear:
    ∫ p x = area / 12 · Σ p_i (x_i + s), x_i the corners and s their sum.
    """
    mesh, field = surface.poly_mesh_W(), surface.poly_e_MN()
    total, moment = 0.0, np.zeros(3)
    for k in range(mesh.num_elements()):
        face = mesh.element(k)
        places = [face.vertex(i) for i in range(face.num_vertices())]
        corners = np.array([mesh.vertex(place) for place in places])
        pressures = np.array([field.EvaluateAtVertex(place) for place in places])
        for i in range(1, len(places) - 1):
            x, p = corners[[0, i, i + 1]], pressures[[0, i, i + 1]]
            area = 0.5 * np.linalg.norm(np.cross(x[1] - x[0], x[2] - x[0]))
            total += area * p.sum() / 3.0
            moment += area / 12.0 * (p @ (x + x.sum(axis=0)))
    return moment / total if total > 0.0 else np.array(surface.centroid())


def surface() -> Contestant:
    """Return Drake's `ComputeContactSurfaces`: the surface of equal pressure.

    Its points are the surface's centroid and its centre of pressure.
    """
    def read(found: Any) -> Manifold:
        first, surfaces = found
        if not surfaces:
            return APART
        one = surfaces[0]
        normal = sum(one.area(k) * np.array(one.face_normal(k)) for k in range(one.num_faces()))
        towards = -1.0 if one.id_M() == first else 1.0  # face normals point from N to M
        normal *= towards / np.linalg.norm(normal)
        return manifold([(point, normal, float('nan'))
                         for point in (one.centroid(), centre_of_pressure(one))])

    return _engine(True, read, name='Drake hydroelastic', returns='polygons with pressure, normals',
                   call='QueryObject.ComputeContactSurfaces, kPolygon', patch='area, pressure',
                   choices=('its point', 'centre of pressure'),
                   causes={'normal': 'The surface of equal pressure bends round edges and corners: '
                           'its normal is not that of the least depth.'})


ENGINES = [point_pair, surface]
