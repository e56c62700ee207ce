# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the public API refuses: one table, of a call, and the field and the value that it names."""
from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from box_contact_ros import (
    Body,
    Box,
    Contact,
    Contacts,
    ContactSolver,
    Frame,
    Pair,
    PatchForces,
    Scene,
    SceneSolver,
    contacts_of,
    face_patches,
    make_model,
    read_scene,
)

UNIT, NORMAL = (1.0, 1.0, 1.0), (0.0, 0.0, 1.0)
POSE = np.array([0.0, 0, 0, 0, 0, 0, 1])
POSES, STILL = np.tile(POSE, (2, 1)), np.zeros((2, 6))
SOLVER = ContactSolver(UNIT, UNIT)
BODY = Body.of_box(UNIT, 1.0)
FORCES = PatchForces([BODY, BODY])
CONTACTS = SOLVER.batch(POSES[:1], POSES[1:])
BOXED = PatchForces([BODY, BODY])
BOXED.set_boxes([UNIT, UNIT])
FINDING = PatchForces([BODY, BODY])
FINDING.set_boxes([UNIT, UNIT], find_pairs=True)
BOXES = {name: Box(UNIT) for name in 'ab'}
FIXED = {name: Box(UNIT, POSE) for name in 'ab'}
PAIR = Pair.between('a', 'b')
SCENE = SceneSolver(Scene(BOXES, (PAIR,)))
UP = np.array([0.0, 0, 0.9, 0, 0, 0, 0])
NAN, INF = math.nan, math.inf


def body(mass: Any = 1.0, inertia: Any = UNIT, **more: Any) -> Body:
    return Body(mass=mass, inertia=inertia, **more)


def hold(pairs: Any = ((0, 1),), contacts: Any = CONTACTS, poses: Any = POSES, *,
         field: str = '', value: Any = None, **more: Any) -> None:
    given = replace(contacts, **{field: np.array([value], float)}) if field else contacts
    FORCES.hold(pairs, given, poses, **more)


def scene(boxes: Any = BOXES, pairs: Any = (PAIR,), **more: Any) -> Scene:
    return Scene(boxes, pairs, **more)


TABLE: list[tuple[Callable[[], object], str, str]] = [
    (lambda: ContactSolver((1, 2, -1), UNIT), 'size_a', '(1, 2, -1)'),
    (lambda: ContactSolver(UNIT, (1, 2)), 'size_b', '(2,)'),
    (lambda: ContactSolver(UNIT, UNIT, model='mpl'), 'model', "'mpl'"),
    (lambda: ContactSolver(UNIT, UNIT, margin='far'), 'margin', "'far'"),
    (lambda: ContactSolver(UNIT, UNIT, margin=NAN), 'margin', 'nan'),
    (lambda: make_model('mlp', weights=5), 'weights', '5'),
    (lambda: SOLVER(POSE, 'pose'), 'pose_b', "'pose'"),
    (lambda: SOLVER(POSE[:6], POSE), 'pose_a', '(6,)'),
    (lambda: SOLVER.batch(POSES, POSES * NAN), 'poses_b[0]', 'nan'),
    (lambda: SOLVER.batch(POSES, POSES[:1]), 'poses_a and poses_b', '2 and 1'),
    (lambda: SOLVER.batch(POSES, POSES, size_a=(1, '2', 3)), 'size_a', "(1, '2', 3)"),
    (lambda: SOLVER.batch(POSES, pairs=[(0, 2)]), 'pairs[0]', '(0, 2)'),
    (lambda: SOLVER.batch(POSES, pairs=[(0.0, 1.0)]), 'pairs', '(0.0, 1.0)'),
    (lambda: SOLVER.batch(POSES, POSES, threads=1025), 'threads', '1025'),
    (lambda: SOLVER.batch(POSES, POSES, threads=10**30), 'threads', '1' + 20 * '0'),
    (lambda: SOLVER.batch(POSES, POSES, patch='no'), 'patch', "'no'"),
    (lambda: Contact(True, 'deep', UNIT, UNIT, 1.0, np.eye(3)), 'separation', "'deep'"),
    (lambda: Contact(True, -1.0, ('x', 0, 0), UNIT, 1.0, np.eye(3)), 'normal', "('x', 0, 0)"),
    (lambda: Contacts.of([None]), 'contacts[0]', 'None'),

    (lambda: body(mass='1'), 'mass', "'1'"),
    (lambda: body(mass=1e-300), 'mass', '1e-300'),
    (lambda: body(mass=2e50), 'mass', '2e+50'),
    (lambda: body(mass=-1), 'mass', '-1'),
    (lambda: body(mass=NAN), 'mass', 'nan'),
    (lambda: body(inertia=(1, 1)), 'inertia', '(2,)'),
    (lambda: body(inertia=(1, 1, 100)), 'inertia', '(1, 1, 100)'),
    (lambda: body(inertia=(1, 0, 1)), 'inertia', '(1, 0, 1)'),
    (lambda: body(inertia=(1, 1, '1')), 'inertia', "(1, 1, '1')"),
    (lambda: body(centre=(0, 0, INF)), 'centre', '(0, 0, inf)'),
    (lambda: Body.of_box((1, 2, -1), 1), 'size', '(1, 2, -1)'),
    (lambda: Body.of_box(UNIT, '1'), 'mass', "'1'"),
    (lambda: Body.of_boxes([UNIT], [POSE], [1.0, 1.0]), 'masses', '1, 1 and 2'),
    (lambda: Body.of_boxes([(1, 2, -1)], [POSE], [1.0]), 'sizes[0]', '(1, 2, -1)'),
    (lambda: Body.of_boxes([UNIT], [POSE * 0], [1.0]), 'poses[0]', 'w=0'),
    (lambda: Body.of_boxes([UNIT], [POSE], [0.0]), 'masses', '0.'),
    (lambda: PatchForces(None), 'bodies', 'None'),
    (lambda: PatchForces([BODY, 1]), 'bodies[1]', '1'),
    (lambda: PatchForces([], friction=-0.5), 'friction', '-0.5'),
    (lambda: PatchForces([], friction='ice'), 'friction', "'ice'"),
    (lambda: FORCES.set_bodies([None]), 'bodies[0]', 'None'),
    (lambda: PatchForces([], substeps=0), 'substeps', '0'),
    (lambda: PatchForces([], substeps=1001), 'substeps', '1001'),
    (lambda: PatchForces([], substeps=2**40), 'substeps', str(2**40)),
    (lambda: PatchForces([], substeps=1.5), 'substeps', '1.5'),
    (lambda: PatchForces([], threads=1025), 'threads', '1025'),
    (lambda: PatchForces([], most_depth=0.0), 'most_depth', '0'),
    (lambda: PatchForces([], most_depth=NAN), 'most_depth', 'nan'),
    (lambda: FORCES.forget([2]), 'bodies[0]', '2'),
    (lambda: FORCES.forget(['a']), 'bodies', "['a']"),
    (lambda: FORCES.forget(1), 'bodies', '1'),

    (lambda: hold([(0.0, 1.0)]), 'pairs', '(0.0, 1.0)'),
    (lambda: hold([(0, 2)]), 'pairs[0]', 'no box 2'),
    (lambda: hold([(1, 1)]), 'pairs[0]', 'body 1'),
    (lambda: hold([(0, 1), (1, 0)], Contacts.of([*CONTACTS, *CONTACTS])), 'pairs', 'twice'),
    (lambda: hold(contacts=None), 'contacts', 'None'),
    (lambda: FORCES.hold([(0, 1)]), 'contacts', 'set_boxes'),
    (lambda: FORCES.hold([(0, 1)], period=0.1), 'contacts', 'None'),
    (lambda: hold(contacts=5), 'contacts', '5'),
    (lambda: hold(poses=None), 'poses', 'None'),
    (lambda: FORCES.set_boxes([UNIT], body=[2]), 'body[0]', '2'),
    (lambda: FORCES.set_boxes([UNIT], body=['a']), 'body', "['a']"),
    (lambda: FORCES.set_boxes([UNIT], body=[0, 1]), 'body', '(2,)'),
    (lambda: FORCES.set_boxes([(1, 2, -1)]), 'sizes[0]', '(1, 2, -1)'),
    (lambda: FORCES.set_boxes([UNIT], poses=[(0,) * 7]), 'poses[0]', '(0, 0, 0, 0)'),
    (lambda: FORCES.set_boxes([UNIT] * 3), 'body[2]', '2'),
    (lambda: BOXED.set_bodies([BODY]), 'bodies', 'body 1'),
    (lambda: BOXED.hold([(0, 2)]), 'pairs[0]', '2'),
    (lambda: BOXED.hold([(0, 1), (1, 0)]), 'pairs', 'twice'),
    (lambda: BOXED.hold([(0, 1)], friction=[-1.0]), 'friction[0]', '-1'),
    (lambda: BOXED.hold([(0, 1)], friction=[1.0, 1.0]), 'friction', '(2,)'),
    (lambda: FINDING.hold([(0, 1)]), 'hold', 'find their pairs themselves'),
    (lambda: FINDING.set_surface(2, (1, 0, 0)), 'box', 'no box 2'),
    (lambda: FINDING.set_surface(0.5, (1, 0, 0)), 'box', '0.5'),
    (lambda: FINDING.set_surface(0, (1, 0)), 'velocity', '(2,)'),
    (lambda: FINDING.set_surface(0, (1, NAN, 0)), 'velocity', 'nan'),
    (lambda: FINDING.set_surface(0, friction=-1.0), 'friction', '-1'),
    (lambda: FINDING.set_surface(0, friction=(0.5,)), 'friction', '(0.5,)'),
    (lambda: hold(poses=POSES[:1]), 'poses', '(1, 7)'),
    (lambda: hold(poses=POSES * [1, 1, 1, 0, 0, 0, 0]), 'poses[0]', '(0, 0, 0, 0)'),
    (lambda: hold(field='normal', value=(0, 0, 2)), 'normal[0]', '(0, 0, 2)'),
    (lambda: hold(field='normal', value=(0, 0, 1 + 2e-6)), 'normal[0]', '(0, 0, 1)'),
    (lambda: hold(field='covariance', value=-np.eye(3)), 'covariance[0]', '(-1, '),
    (lambda: hold(field='covariance', value=np.diag([1, 1, -1e-8])), 'covariance[0]', '-1e-08'),
    (lambda: hold(field='covariance', value=np.eye(3) + [[0, 1e-3, 0], [0] * 3, [0] * 3]),
     'covariance[0]', '0.001'),
    (lambda: hold(field='covariance', value=np.zeros((3, 3))), 'covariance[0]', '(0, 0, 0'),
    (lambda: hold(field='volume', value=-1), 'volume', '-1'),
    (lambda: hold(field='point', value=(0, 0, NAN)), 'point[0]', 'nan'),
    (lambda: hold(friction=['1']), 'friction', "['1']"),
    (lambda: hold(friction=[-1.0]), 'friction[0]', '-1'),
    (lambda: hold(surface_velocity=[(0, 0, NAN)]), 'surface_velocity[0]', 'nan'),
    (lambda: hold(surface_velocity=[(0, 0)]), 'surface_velocity', '(1, 2)'),
    (lambda: hold(age='1'), 'age', "'1'"),
    (lambda: hold(period=-0.1), 'period', '-0.1'),
    (lambda: FORCES.advance(1.0, POSES, STILL), 'dt', '1'),
    (lambda: FORCES.advance(0.0, POSES, STILL), 'dt', '0'),
    (lambda: FORCES.wrenches(0.0, POSES, STILL), 'dt', '0'),
    (lambda: FORCES.wrenches(0.1, POSES[:1], STILL), 'poses', '(1, 7)'),
    (lambda: FORCES.advance('1', POSES, STILL), 'dt', "'1'"),
    (lambda: FORCES.advance(0.1, POSES[:1], STILL), 'poses', '(1, 7)'),
    (lambda: FORCES.advance(0.1, POSES, STILL + INF), 'velocities[0]', 'inf'),
    (lambda: FORCES.advance(0.1, POSES, STILL + 1e200), 'velocities[0]', '1e+200'),
    (lambda: FORCES.advance(0.1, POSES, STILL, STILL + NAN), 'wrenches[0]', 'nan'),
    (lambda: FORCES.advance(0.1, POSES, STILL[:, :5]), 'velocities', '(2, 5)'),

    (lambda: Box((1, 2, -1)), 'size', '(1, 2, -1)'),
    (lambda: Box(('1', '2', '3')), 'size', "('1', '2', '3')"),
    (lambda: Box(UNIT, (0,) * 7), 'pose', 'w=0'),
    (lambda: Box(UNIT, pose_topic=5), 'pose_topic', '5'),
    (lambda: Box(UNIT, body=5), 'body', '5'),
    (lambda: Box(UNIT, pose_topic='/b', body='hook'), 'pose_topic', "'hook'"),
    (lambda: Frame((0,) * 7), 'pose', 'w=0'),
    (lambda: Frame(POSE, '/hook'), 'pose_topic', "'/hook'"),
    (lambda: scene(bodies=[Frame()]), 'bodies', 'Frame('),
    (lambda: scene(bodies={'hook': None}), 'bodies.hook', 'None'),
    (lambda: scene(bodies={'hook': Frame()}), 'bodies.hook', "no box is a part of 'hook'"),
    (lambda: scene(bodies={'a': Frame()}), 'bodies.a', 'name of a box'),
    (lambda: scene(boxes={**BOXES, 'c': Box(UNIT, body='hook')}), 'boxes.c.body', "'hook'"),
    (lambda: scene(boxes={**BOXES, 'c': Box(UNIT, body='hook')}, bodies={'hook': Frame()},
                   pairs=(Pair('p', 'a', 'hook'),)), 'pairs[0].b', "'hook' is a body"),
    (lambda: scene(boxes=[BOXES['a']]), 'boxes', 'size='),
    (lambda: scene(boxes={'a': None}), 'boxes.a', 'None'),
    (lambda: scene(pairs=None), 'pairs', 'None'),
    (lambda: scene(pairs=()), 'pairs', 'a scene needs at least one pair'),
    (lambda: scene(pairs=(PAIR, PAIR)), 'pairs[1].name', "the same name as that of 'a' and 'b'"),
    (lambda: scene(pairs=(('a', 'b'),)), 'pairs[0]', "('a', 'b')"),
    (lambda: scene(pairs=(Pair('p', 'a', 'c'),)), 'pairs[0].b', "'c'"),
    (lambda: scene(patterns=('*',)), 'patterns[0]', "'*'"),
    (lambda: scene(patterns=('a*', 'b*')), 'patterns[0]', "'a*'"),
    (lambda: scene(patterns=(5,)), 'patterns[0]', '5'),
    (lambda: scene(FIXED), 'pairs[0]', 'leave `pose` out of a box that moves, and give its'),
    (lambda: scene(FIXED, (), patterns=(('*', '*'),)), 'patterns[0]', 'ask contacts_of'),
    (lambda: scene(frame_id=5), 'frame_id', '5'),
    (lambda: scene(poses='no'), 'poses', "'no'"),
    (lambda: SceneSolver(None), 'scene', 'None'),
    (lambda: SceneSolver(scene(), margin='x'), 'margin', "'x'"),
    (lambda: SceneSolver(scene(), most_near=1.5), 'most_near', '1.5'),
    (lambda: SCENE(None), 'poses', 'None'),
    (lambda: SCENE([POSE]), 'poses', "1 poses, but 2 boxes and bodies move: ['a', 'b']"),
    (lambda: SCENE([POSE] * 3), 'poses', '3 poses, but 2 boxes and bodies move'),
    (lambda: SCENE([POSE, 'x']), 'pose of b', "'x'"),
    (lambda: SCENE(POSES * 0), 'pose of a', 'w=0'),
    (lambda: contacts_of(UNIT, POSE), 'poses', '(7,)'),
    (lambda: contacts_of(UNIT, POSES * 0), 'poses[0]', 'w=0'),
    (lambda: contacts_of((1, 2, -1), POSES), 'sizes', '(1, 2, -1)'),
    (lambda: contacts_of([UNIT, (1, 2, -1)], POSES), 'sizes[1]', '(1, 2, -1)'),
    (lambda: contacts_of([UNIT], POSES), 'sizes', '1 size, but 2 poses'),
    (lambda: contacts_of(UNIT, POSES, [(0, 2)]), 'pairs[0]', '(0, 2)'),
    (lambda: contacts_of(UNIT, POSES, [(0, 1), (1, 1)]), 'pairs[1]', 'box 1'),
    (lambda: contacts_of(UNIT, POSES, fixed=[0, 1]), 'fixed', '[0, 1]'),
    (lambda: contacts_of(UNIT, POSES, fixed=[[True], []]), 'fixed', '[[True], []]'),
    (lambda: contacts_of(UNIT, POSES, margin=-1), 'margin', '-1'),
    (lambda: contacts_of(UNIT, POSES, margin=np.nan), 'margin', 'nan'),
    (lambda: contacts_of(UNIT, POSES, margin='1'), 'margin', "'1'"),
    (lambda: contacts_of(UNIT, POSES, threads=0), 'threads', '0'),
    (lambda: face_patches(UNIT, POSES * 0, [(0, 1)], [NORMAL]), 'poses[0]', 'w=0'),
    (lambda: face_patches((1, INF, 1), POSES, [(0, 1)], [NORMAL]), 'sizes', '(1, inf, 1)'),
    (lambda: face_patches(UNIT, POSES, [(0, 2)], [NORMAL]), 'pairs[0]', '(0, 2)'),
    (lambda: face_patches(UNIT, POSES, [(0, 1)], NORMAL), 'normal', '(3,)'),
    (lambda: face_patches(UNIT, POSES, [(0, 1)], [UNIT]), 'normal[0]', '[1.0, 1.0, 1.0]'),
    (lambda: face_patches(UNIT, POSES, [(0, 1)], [(0, 0, NAN)]), 'normal[0]', 'nan'),
    (lambda: face_patches(UNIT, POSES, [(0, 1)], [NORMAL], tolerance=-1), 'tolerance', '-1'),
    (lambda: face_patches(UNIT, POSES, [(0, 1)], [NORMAL], tolerance=NAN), 'tolerance', 'nan'),
    (lambda: read_scene(5), 'path', '5'),
    (lambda: read_scene('no.yaml'), 'scene', "'no.yaml'"),
    (lambda: read_scene('a\0b'), 'path', "'a\\x00b'"),
]


def test_a_refusal_names_field_and_value() -> None:
    """Whatever is refused is a ValueError of one line; and the forces are as they were."""
    FORCES.hold([(0, 1)], CONTACTS, POSES)
    FORCES.advance(0.01, POSES, STILL)
    before, missing = copy.copy(FORCES), []
    for call, field, value in TABLE:
        with pytest.raises(ValueError) as refusal:
            call()
        text = str(refusal.value)
        if not (field in text and value in text and '\n' not in text):
            missing.append((field, value, text))
    assert not missing
    for one, other in zip(FORCES.advance(0.01, POSES, STILL), before.advance(0.01, POSES, STILL)):
        assert one.tobytes() == other.tobytes()


class Traitor:
    """Rows of numbers that change the bodies when NumPy reads them."""

    def __init__(self, forces: PatchForces, rows: np.ndarray) -> None:
        self.forces, self.rows = forces, rows

    def __array__(self, *_: Any, **__: Any) -> np.ndarray:
        self.forces.set_bodies([BODY] * (4000 if self.rows.shape[1] == 7 else 1))
        return self.rows


def test_bodies_that_change_while_arrays_are_read() -> None:
    """Rows are counted after all is converted: more bodies would read and write past the arrays."""
    for call in (lambda forces: forces.advance(0.1, Traitor(forces, POSES), STILL),
                 lambda forces: forces.advance(0.1, POSES, Traitor(forces, STILL)),
                 lambda forces: forces.advance(0.1, POSES, STILL, Traitor(forces, STILL)),
                 lambda forces: forces.hold([(0, 1)], CONTACTS, Traitor(forces, POSES))):
        with pytest.raises(ValueError, match='poses must be an array of shape'):
            call(PatchForces([BODY, BODY]))


def test_the_limits_themselves_are_accepted() -> None:
    """Bodies of 1e-50 and 1e50 kg, moments of a rod, a normal and a covariance that are rounded."""
    light, heavy = (Body(mass=mass, inertia=(mass, mass, mass)) for mass in (1e-50, 1e50))
    rod = body(inertia=(1.0, 1.0, 2.0 * (1.0 + 4e-10)))
    thin = replace(CONTACTS, normal=np.array([(0, 0, 1.0 + 5e-7)]),
                   covariance=np.array([np.diag([1.0, 1.0, -1e-9])]))
    for bodies in ([light, heavy], [light, light], [heavy, heavy], [rod, rod]):
        forces = PatchForces(bodies)
        forces.hold([(0, 1)], thin, POSES)
        for dt in (1e-50, np.nextafter(1.0, 0.0), np.float32(0.1)):
            assert all(np.isfinite(rows).all() for rows in forces.advance(dt, POSES, STILL))
            assert all(np.isfinite(columns).all() for columns in forces.loads())
    SOLVER.batch(POSES, POSES, threads=1024)
