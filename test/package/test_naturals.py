# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What people type from memory: it works, or ends in a line that says how."""
from __future__ import annotations

import dataclasses
import pickle
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any

import numpy as np
import pytest

import box_contact_ros as bc
from box_contact_ros import (
    Body,
    Box,
    ContactSolver,
    Pair,
    Plan,
    Scene,
    SceneSolver,
    Sweep,
    contacts_of,
    inspect_plan,
    read_plan,
)
from box_contact_ros.solver.pose import rotation_matrix
from box_contact_ros.solver.poses import as_pose, as_poses

C = (12.192, 2.438, 2.591)
I, A, FAR = ((0, 0, z, 0, 0, 0, 1) for z in (0, 2.581, 99))  # noqa: E741  of a stack, and loads
SOLVER = ContactSolver(C, C)
ROWS = 'name,x,y,z,length,width,height\na,0,0,0,600,400,200\nb,0,0,500,600,400,200\n'
LEAST, SIZES = np.array([(0, 0, 0), (0, 0, 0.5)]), np.array([(0.6, 0.4, 0.2)] * 2)
QUARTER = np.sqrt(0.5)
FORMS = 'other forms of a pose are a 4×4 matrix, '
NO_HELP = 'the words are those of Python'


class Column:
    """A column of a data frame: not a sequence, and NumPy reads it."""

    def __init__(self, values: np.ndarray) -> None:
        self.values = values

    def __array__(self, *_: object, **__: object) -> np.ndarray:
        return self.values


class Rotation:
    """As SciPy's: a quarter about z."""

    def as_quat(self) -> np.ndarray:
        """Return x y z w."""
        return np.array([0.0, 0.0, QUARTER, QUARTER])


def message(**vectors: tuple[float, ...]) -> Message:
    """Return a message with vectors and quaternions."""
    return Message(**{name: Message(**dict(zip('xyzw', numbers)))
                      for name, numbers in vectors.items()})


POSE = message(position=A[:3], orientation=A[3:])


@pytest.fixture
def file(tmp_path: Path) -> str:
    """Return the path of a plan."""
    (tmp_path / 'plan.csv').write_text(ROWS)
    return str(tmp_path / 'plan.csv')


def found(file: str) -> bc.Inspection:
    """Return what is wrong with a plan, of which one box hangs."""
    return inspect_plan(read_plan(file, unit='mm', origin='corner'))


NATURALS: dict[str, tuple[Callable[[str], Any], Any]] = {
    '1 if contact': (lambda _: bool(SOLVER(FAR, I)), 'Contact has no truth value: ask .coll'),
    '2 a matrix': (lambda _: SOLVER(np.eye(4), np.eye(4)).colliding, True),
    '3 (xyz, Rotation)': (lambda _: SOLVER((A[:3], Rotation()), (I[:3], Rotation())).separation,
                          -0.01),
    '4 numbers': (lambda _: SOLVER(np.r_[A[:3], 0, 0, 0, 1], I).separation, -0.01),
    '5 a message': (lambda _: SOLVER(POSE, message(translation=I[:3], rotation=I[3:])).separation,
                    -0.01),
    '6 position alone': (lambda _: SOLVER(A[:3], I[:3]), FORMS),
    '7 one against many': (lambda _: len(SOLVER.batch(A, np.array([I] * 3))), 3),
    '8 depth': (lambda _: [SOLVER(A, I).depth, SOLVER(FAR, I).depth,
                           *SOLVER.batch([A, FAR], I).depth], [0.01, 0.0, 0.01, 0.0]),
    '9 collide, as in C++': (lambda _: bc.collide(Box(C, A), Box(C, I)), 'ContactSolver(size_a, '),
    '10 contacts_of': (lambda _: contacts_of([C, C], [A, I])[0].tolist(), [[0, 1]]),
    '11 a path': (lambda file: inspect_plan(file), 'add --unit mm --origin corner'),
    '12 Plan(table)': (lambda _: Plan(ROWS), 'Plan.from_corners(least, sizes)'),
    '13 columns': (lambda _: inspect_plan(Plan.from_corners(
        Column(LEAST), Column(SIZES), floor=0.0)).stands.tolist(), [True, False, True]),
    '14 if found': (lambda file: bool(found(file)), 'ask .sound or .verdict'),
    '15 rows': (lambda file: [row.kind for row in found(file).rows()], ['hangs']),
    '16 JSON': (lambda file: found(file).to_json()[:24], '{"verdict": "not sound", '[:24]),
    '17 plot(file)': (lambda file: [found(file).plot(f'{file}.png'), Path(f'{file}.png').exists()
                                    ][1], True),
    '18 plot()': (lambda file: hasattr(found(file).plot(), '_repr_html_'), True),
    '19 found[name]': (lambda file: found(file)['b'], NO_HELP),
    '20 Body.fixed': (lambda _: Body.fixed().mass, 0.0),
    '21 version': (lambda _: re.sub(r'\d+\.\d+\.\d+', 'three', bc.__version__), 'three'),
    '22 pickle': (lambda _: pickle.loads(pickle.dumps(SOLVER(A, I))).colliding, True),
    '23 asdict': (lambda _: dataclasses.asdict(SOLVER(A, I)), NO_HELP),
    '24 wxyz': (lambda _: SOLVER((*A[:3], 0, 0, 0, 0), I), 'x y z qx qy qz qw, not wxyz'),
    '25 half extents': (lambda _: ContactSolver(np.divide(C, 2), np.divide(C, 2))(A, I).colliding,
                        False),
    '26 four poses': (lambda _: SOLVER.time_of_impact(start_a=FAR, end_a=A, start_b=I, end_b=I),
                      'two sweeps, Sweep(start_a, end_a), Sweep(start_b, end_b); not four poses'),
    '27 no sizes': (lambda _: ContactSolver()(A, I), 'size_a is missing: give it to ContactSol'),
    '28 print': (lambda file: str(found(file)).splitlines()[-1][-10:], ': not sound'[-10:]),
    '29 a scene of lists': (lambda _: SceneSolver([C, C]), 'scene must be a Scene, not '),
    '30 len(plan)': (lambda file: len(found(file).plan), 3)}
"""What is typed, and what comes of it: a result, or words of the refusal."""


@pytest.mark.parametrize('name', NATURALS)
def test_what_is_typed_from_memory(name: str, file: str) -> None:
    typed, result = NATURALS[name]
    try:
        got = typed(file)
    except (TypeError, ValueError, AttributeError) as refusal:
        assert result == NO_HELP or result in str(refusal)
    else:
        assert got == (pytest.approx(result) if isinstance(result, float | list)
                       and name[0] in '34578' else result)


def test_most_work_or_say_how() -> None:
    """Of 25 and 24 nothing can be seen, where half extents and wxyz are sizes and rotations."""
    silent = {'24 wxyz', '25 half extents'}
    assert sum(result != NO_HELP and name not in silent
               for name, (_, result) in NATURALS.items()) >= 24


# --- poses ----------------------------------------------------------------------------------------


def test_poses_of_other_forms_are_the_same_poses() -> None:
    """One, and rows of them; also stamped ones, those of float32, and turns by half a circle."""
    rng = np.random.default_rng(1)
    quaternions = rng.normal(size=(200, 4))
    quaternions[:3], quaternions[3] = np.eye(4)[:3], (1, 1, 1, 1e-9)
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    rows = np.hstack((rng.normal(size=(200, 3)), quaternions))
    matrices = np.tile(np.eye(4), (200, 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = rotation_matrix(quaternions), rows[:, :3]
    messages = [Message(pose=message(position=row[:3], orientation=row[3:])) for row in rows]
    moves = [Message(transform=message(translation=row[:3], rotation=row[3:])) for row in rows]
    for poses in (matrices, list(matrices), messages, moves, (rows[:, :3], rows[:, 3:]),
                  (rows[:, :3], matrices[:, :3, :3]), [(row[:3], row[3:]) for row in rows.tolist()],
                  [Message(pose=one) for one in messages], rows.tolist()):
        same = as_poses(poses, 'poses')
        signs = np.sign(np.einsum('ni,ni->n', same[:, 3:], quaternions))
        assert np.allclose(same[:, :3], rows[:, :3], rtol=0, atol=0)
        assert np.allclose(same[:, 3:] * signs[:, None], quaternions, rtol=0, atol=1e-15)
        assert np.array_equal(as_pose(poses[7], 'pose') if not isinstance(poses, tuple)
                              else same[7], same[7])
    assert as_poses(matrices.astype(np.float32), 'poses') == pytest.approx(
        as_poses(matrices, 'poses'), abs=1e-6)


@pytest.mark.parametrize('pose, words', [
    (np.diag([1.0, 1, 1, 2]), 'a must be matrices whose last row is 0 0 0 1, not '),
    (np.diag([1.0, 1, -1, 1]), 'a must have a rotation matrix: '),
    (np.diag([2.0, 1, 1, 1]), 'a must have a rotation matrix: '),
    (np.full((4, 4), np.nan), 'a must be matrices whose last row is'),
    (((0, 0, 0), (0, 0, 1)), f'a must be a pose (x y z qx qy qz qw), not an array of shape (2, 3); '
                             f'{FORMS}'),
    ((POSE.position, Message(x=0.0)), 'a must be a pose (x y z qx qy qz qw) of numbers, not '),
    (np.ma.array(np.eye(4)), 'a must be a pose (x y z qx qy qz qw) of numbers, not masked'),
    ('pose', "a must be a pose (x y z qx qy qz qw) of numbers, not 'pose'"),
    (Message(pose=POSE.position), 'a must be a pose'), ([POSE], 'a must be a pose'),
    (None, 'a must be a pose (x y z qx qy qz qw) of numbers, not None')])
def test_what_is_no_pose(pose: Any, words: str) -> None:
    with pytest.raises(ValueError, match=f'^{re.escape(words)}'):
        as_pose(pose, 'a')


def test_one_pose_stands_for_many() -> None:
    """The rows are those of equal poses; two single poses are no batch."""
    many = np.array([I, (0, 0, 1, 0, 0, 0, 1)])
    for one, rows in ((SOLVER.batch(A, many), SOLVER.batch([A, A], many)),
                      (SOLVER.distance_batch(many, FAR), SOLVER.distance_batch(many, [FAR] * 2))):
        for field in dataclasses.fields(one):
            assert np.array_equal(getattr(one, field.name), getattr(rows, field.name), True)
    times = SOLVER.time_of_impact_batch(Sweep(FAR, many), Sweep(I, I)).time
    assert times == pytest.approx([(99 - 2.591) / 99, (99 - 2.591) / 98], abs=1e-6)
    with pytest.raises(ValueError, match='^poses_a and poses_b are single poses: a batch has rows'):
        SOLVER.batch(A, I)


def test_other_calls_take_other_forms() -> None:
    """Forces, scenes and plans do as a solver does."""
    matrix = np.eye(4)
    matrix[2, 3] = A[2]
    assert Box(C, POSE).pose == A
    scene = SceneSolver(Scene({'a': Box(C), 'b': Box(C, np.eye(4))}, [Pair('', 'a', 'b')]))
    assert scene([POSE]).contacts.separation == pytest.approx([-0.01])
    assert Plan(C, [np.eye(4), matrix]).poses.tolist() == [list(I), list(A)]
    forces = bc.PatchForces([Body.fixed(), Body.of_box(C, 1e4)])
    forces.set_boxes([C, C], find_pairs=True)
    still = np.zeros((2, 6))
    assert np.array_equal(forces.advance(0.001, [message(position=I[:3], orientation=I[3:]), POSE],
                                         still).poses, forces.advance(0.001, [I, A], still).poses)


# --- truth ----------------------------------------------------------------------------------------


def test_answers_have_no_truth_value() -> None:
    """`if answer:` would be True for boxes that are apart and for a plan that is not sound."""
    boxes = {'a': Box(C), 'b': Box(C, I)}
    scene = SceneSolver(Scene(boxes, [Pair('', 'a', 'b')]))
    down, still = Sweep([FAR], [A]), Sweep([I], [I])
    for answer, words in (
            (SOLVER(FAR, I), 'ask .colliding'), (SOLVER.distance(FAR, I), 'ask .colliding'),
            (SOLVER.batch([FAR], [I]), 'ask .colliding, .colliding.any'),
            (SOLVER.distance_batch([FAR], [I]), 'ask .colliding, .colliding.any'),
            (SOLVER.time_of_impact_batch(down, still), 'ask .time'),
            (SOLVER.time_of_impact_batch(down, still)[0], 'ask whether .time is NaN'),
            (inspect_plan(Plan([C] * 2, [I, A])), 'ask .sound or .verdict'),
            (scene.check_path([[FAR], [A]]), 'ask .is_free')):
        with pytest.raises(TypeError, match=f'{type(answer).__name__} has no truth value: {words}'):
            bool(answer)


def test_a_solver_shows_its_sizes_and_model() -> None:
    assert repr(ContactSolver(C, (1, 2, 3), model='mlp')) == (
        f"ContactSolver(size_a={C}, size_b=(1.0, 2.0, 3.0), model='mlp')")
    assert repr(ContactSolver(margin=0.5)) == "ContactSolver(model='exact', margin=0.5)"
