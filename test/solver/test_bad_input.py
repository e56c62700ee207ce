# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bad input at the doors without ROS: the Python API and weights files.

The policy: docs/reference/conventions.md, "Bad input". test_faults.py has the node's.
"""
from __future__ import annotations

import itertools
import math
from decimal import Decimal
from fractions import Fraction
from functools import partial

import numpy as np
import poses
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from box_contact_ros import ContactSolver, make_model
from box_contact_ros.core import LENGTH_MAX, LENGTH_MIN, QUATERNION_MAX, QUATERNION_MIN
from box_contact_ros.solver.checks import (
    absent_poses,
    are_poses,
    as_floats,
    as_wholes,
    pose_fault,
    size_fault,
)

MODELS = ('exact', 'mlp')  # input is checked before a model sees it; answers are each model's
SOLVERS = {model: ContactSolver(poses.CUBE, poses.CUBE, model=model) for model in MODELS}
ABOVE = np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])
TURN = np.array([0.1, -0.2, 0.3, 0.9]) / np.linalg.norm([0.1, -0.2, 0.3, 0.9])
TILTED = np.r_[0.3, 0.2, 2.0, TURN]

few = settings(max_examples=200, derandomize=True)
every_model = pytest.mark.parametrize('model', MODELS)


def both_ways(model, pose_a, pose_b, size_a=poses.CUBE, size_b=poses.CUBE):
    """Return the contact of a pair; single call and batch agree to the bit."""
    one = ContactSolver(size_a, size_b, model=model)(pose_a, pose_b)
    many = SOLVERS[model].batch([pose_a] * 2, [pose_b] * 2, size_a=[size_a] * 2, size_b=size_b)
    for row in many:
        poses.assert_same_bits(one, row)
    return one


def assert_sound(contact):
    """Check what every answer is, whatever was asked."""
    assert type(contact.colliding) is bool and type(contact.separation) is float
    assert math.isfinite(contact.separation)
    if contact.colliding:
        assert abs(np.linalg.norm(contact.normal) - 1.0) < 1e-12
        assert np.isfinite(contact.point).all()
    else:
        assert contact.separation > 0.0
        assert np.isnan(contact.normal).all() and np.isnan(contact.point).all()


@settings(max_examples=300)
@given(st.lists(st.tuples(*[st.floats(width=64) | st.sampled_from(
    [LENGTH_MAX, -2 * LENGTH_MAX, QUATERNION_MIN, QUATERNION_MAX, 0.0])] * 7),
                min_size=1, max_size=5))
def test_poses_are_checked_by_rows_as_alone(rows):
    """One rule, for a pose and for an array of them; NaN alone is no bad pose but an absent one."""
    array = np.array([*rows, (math.nan,) * 7])
    assert are_poses(array).tolist() == [pose_fault(row) is None for row in array]
    assert absent_poses(array).tolist() == [all(map(math.isnan, row)) for row in array]


# --- quaternions ----------------------------------------------------------------------------------


@every_model
@pytest.mark.parametrize('norm', [1e-99, 1e-8, 0.5, 0.999, 1 - 1e-9, 1 + 1e-15, 2.0, 1e8, 1e99])
def test_a_quaternion_is_normalised(model, norm):
    """Norms off by drift (1e-15 to 1e-3) or by far.

    Verdict, separation and normal are those of the unit one to rounding; so is the point of
    `exact`.
    """
    wanted = both_ways(model, poses.IDENTITY, TILTED)
    scaled = np.r_[TILTED[:3], norm * TURN]
    found = both_ways(model, poses.IDENTITY * norm, scaled)  # A's position is 0
    assert found.colliding is wanted.colliding is True
    assert found.separation == pytest.approx(wanted.separation, abs=4e-15)
    assert found.normal == pytest.approx(wanted.normal, abs=4e-15)
    # The network of `mlp` runs in float32.
    assert found.point == pytest.approx(wanted.point, abs=1e-13 if model == 'exact' else 1e-5)


@pytest.mark.parametrize('norm', [QUATERNION_MIN, QUATERNION_MAX])
def test_the_limits_of_a_quaternion_are_one(norm):
    """The checks in Python and the core draw the line at the same bit.

    If they did not, a quaternion within a few ulp of it was refused without a reason.
    """
    rng = np.random.default_rng(5)
    verdicts = set()
    for _ in range(300):
        turn = rng.normal(size=4)
        turn *= norm / np.linalg.norm(turn) * (1.0 + rng.integers(-3, 4) * 2.0**-52)
        pose = np.r_[ABOVE[:3], turn]
        fault = pose_fault(pose)
        verdicts.add(fault is None)
        for ask, name in ((lambda p: SOLVERS['exact'](poses.IDENTITY, p), 'pose_b'),
                          (lambda p: SOLVERS['exact'].batch([poses.IDENTITY], [p]), 'poses_b[0]')):
            if fault is None:
                ask(pose)
            else:
                with pytest.raises(ValueError) as refusal:
                    ask(pose)
                assert str(refusal.value) == (
                    f'{name} {fault}; a pose is x y z qx qy qz qw, not wxyz')
    assert verdicts == {True, False}


# --- values ---------------------------------------------------------------------------------------

BAD_NUMBERS = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize('value', [math.nan, math.inf, -1e308])
@pytest.mark.parametrize('place', range(7))
def test_a_bad_number_in_a_pose(place, value):
    """NaN, infinity and what would overflow, in every place of a pose: the field and the value."""
    solver, bad = SOLVERS['exact'], TILTED.copy()
    bad[place] = value
    words = f'{value:g}'.replace('+', r'\+')
    for kind, call in itertools.product((np.array, list), (solver, solver.distance)):
        with pytest.raises(ValueError, match=f'^pose_a (position|quaternion) .*{words}'):
            call(kind(bad), kind(ABOVE))
        with pytest.raises(ValueError, match=f'^pose_b (position|quaternion) .*{words}'):
            call(kind(ABOVE), kind(bad))
    rows = np.tile(ABOVE, (11, 1))
    rows[9] = bad
    for call in (solver.batch, solver.distance_batch):
        with pytest.raises(ValueError, match=rf'^poses_b\[9\] (position|quaternion) .*{words}'):
            call(np.tile(ABOVE, (11, 1)), rows)


@pytest.mark.parametrize('axis', range(3))
@pytest.mark.parametrize('value', [math.nan, math.inf, 0.0, -2.0, 5e-324, 1e-51, 1e51])
def test_a_bad_extent(axis, value):
    """No plates, rods or points, nothing negative, not finite, or beyond the limits, on any axis.

    They are refused in the solver and in a row of a batch. (A NaN on y or z got through a batch,
    into the answer.)
    """
    bad = np.array(poses.CUBE)
    bad[axis] = value
    words = f'{value:g}'.replace('+', r'\+')
    for name, sizes in (('size_a', (bad, poses.CUBE)), ('size_b', (poses.CUBE, bad))):
        with pytest.raises(ValueError, match=rf'^{name} \(.*{words}.*\) is '):
            ContactSolver(*sizes)
        rows = np.tile(poses.CUBE, (11, 1))
        rows[9] = bad
        good = np.tile(ABOVE, (11, 1))
        for call in (SOLVERS['exact'].batch, SOLVERS['exact'].distance_batch):
            with pytest.raises(ValueError, match=rf'^{name}\[9\] \(.*{words}.*\) is '):
                call(good, good, **{name: rows})
            with pytest.raises(ValueError, match=rf'^{name} \(.*{words}.*\) is '):
                call(good, good, **{name: bad})


any_float = st.one_of(st.floats(), st.floats(-3, 3), st.sampled_from(
    [0.0, -0.0, 5e-324, 1e-310, 1e-160, 1e-50, 1e50, 1e160, -1e308, *BAD_NUMBERS]))


def numbers(kind, count):
    return st.lists(kind, min_size=count, max_size=count)


@every_model
@settings(few, max_examples=400)
@given(numbers(st.floats(-2, 2), 14), numbers(st.floats(0.5, 4), 6),
       st.dictionaries(st.integers(0, 19), any_float))
@example([0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1], [1, 1, 1, 1, 1, 1], {15: math.nan})
def test_whatever_comes_in(model, two_poses, two_sizes, changes):
    """Good poses and sizes with none, some or all of the twenty numbers replaced by any float.

    Refused where the checks say so, else a sound answer; and no warning, which is an error here.
    (Of 400, some 200 are answered.)
    """
    values = [changes.get(place, value) for place, value in enumerate(two_poses + two_sizes)]
    pose_a, pose_b, size_a, size_b = values[:7], values[7:14], values[14:17], values[17:]
    bad = any(map(pose_fault, (pose_a, pose_b))) or any(map(size_fault, (size_a, size_b)))
    if not bad:
        assert_sound(both_ways(model, pose_a, pose_b, size_a, size_b))
        return
    with pytest.raises(ValueError, match='^(pose_a|pose_b|size_a|size_b) .* (is|has|exceeds) '):
        ContactSolver(size_a, size_b, model=model)(pose_a, pose_b)
    with pytest.raises(ValueError, match=r'^(poses_a\[0\]|poses_b\[0\]|size_a|size_b) '):
        SOLVERS[model].batch([pose_a], [pose_b], size_a=[size_a], size_b=[size_b])


exponent = math.log10(LENGTH_MAX)
any_good_extent = st.floats(-exponent, exponent).map(
    lambda x: min(max(10.0**x, LENGTH_MIN), LENGTH_MAX))


@every_model
@few
@given(numbers(any_good_extent, 3), numbers(any_good_extent, 3),
       numbers(st.floats(-1, 1), 3), numbers(any_float, 8))
def test_every_accepted_size_is_answered(model, size_a, size_b, offset, turns):
    """A hundred orders of magnitude between two extents, boxes near each other: a sound answer."""
    turns = [turn if not pose_fault([0, 0, 0, *turn]) else TURN for turn in (turns[:4], turns[4:])]
    position = np.clip(np.multiply(offset, np.minimum(size_a, size_b)), -LENGTH_MAX, LENGTH_MAX)
    assert_sound(both_ways(model, [0, 0, 0, *turns[0]], [*position, *turns[1]], size_a, size_b))


# --- kinds ----------------------------------------------------------------------------------------


def read_only(array):
    array = array.copy()
    array.flags.writeable = False
    return array


def off_by_a_byte(array):
    memory = np.zeros(array.nbytes + 1, dtype=np.uint8)[1:]
    memory[:] = np.frombuffer(array.tobytes(), dtype=np.uint8)
    return memory.view(float)


def field(array):
    rows = np.zeros(len(array), dtype=[('byte', 'i1'), ('number', 'f8')])
    rows['number'] = array
    return rows['number']


GOOD_KINDS = {
    'list': list, 'tuple': tuple, 'read-only': read_only, 'field': field,
    'unaligned': off_by_a_byte, 'broadcast': lambda v: np.broadcast_to(v, v.shape),
    'reversed view': lambda v: v[::-1].copy()[::-1],
    'column': lambda v: np.tile(v[:, None], 3)[:, 1],
    'every other': lambda v: np.repeat(v, 2)[::2],
    'float16': lambda v: v.astype(np.float16), 'float32': lambda v: v.astype(np.float32),
    'longdouble': lambda v: v.astype(np.longdouble), 'big-endian': lambda v: v.astype('>f8'),
    'objects': lambda v: v.astype(object), 'fractions': lambda v: [Fraction(x) for x in v],
    'scalars': lambda v: [np.float32(x) for x in v], '0-d arrays': lambda v: list(map(np.array, v)),
    'buffer': memoryview,
}


@pytest.mark.parametrize('kind', GOOD_KINDS.values(), ids=GOOD_KINDS)
def test_numbers_of_any_kind(kind):
    """Whatever holds real numbers is taken as float64, in single calls and batches alike."""
    wanted = SOLVERS['exact'](poses.IDENTITY, ABOVE)
    size = kind(np.array(poses.CUBE))
    for solver in (SOLVERS['exact'], ContactSolver(size, size)):
        found = solver(kind(poses.IDENTITY), kind(ABOVE))
        many = solver.batch([kind(poses.IDENTITY)], [kind(ABOVE)], size_a=size, size_b=[size])
        poses.assert_same_bits(found, wanted)
        poses.assert_same_bits(many[0], wanted)


class Marked(np.ndarray):
    """A subclass of arrays."""


@pytest.mark.parametrize('layout', [
    np.asfortranarray, lambda v: v[:, ::-1].copy()[:, ::-1],
    lambda v: np.repeat(v, 2, axis=1)[:, ::2], lambda v: v.view(Marked),
    lambda v: v.astype('>f8')])
def test_rows_of_any_layout(layout):
    """Sizes of rows too; what is returned are plain arrays."""
    solver = SOLVERS['exact']
    a, b, sizes = (np.tile(row, (9, 1)) for row in (poses.IDENTITY, ABOVE, np.array(poses.CUBE)))
    wanted = solver.batch(a, b)
    found = solver.batch(layout(a), layout(b), size_a=layout(sizes), size_b=layout(sizes))
    poses.assert_same_bits(found, wanted)
    assert {type(field) for field in poses.fields(found)} == {np.ndarray}


def test_plain_arrays_are_taken_as_they_are():
    numbers, rows = np.zeros((2, 7)), np.zeros((2, 2), np.int64)
    assert as_floats(numbers, 'numbers', '', (None, 7)) is numbers
    assert as_wholes(rows, 'rows', 2) is rows
    with pytest.raises(ValueError, match='rows must be whole numbers'):
        as_wholes(rows, 'rows', 3)


@every_model
def test_integers_are_numbers(model):
    for kind in (int, np.int8, np.uint64):
        pose = np.array([0, 0, 1, 0, 0, 0, 1]).astype(kind)
        assert both_ways(model, poses.IDENTITY, pose).separation == -1.0
        assert both_ways(model, poses.IDENTITY, list(pose)).separation == -1.0
    assert not both_ways(model, poses.IDENTITY, [2**70, 0, 0, 0, 0, 0, 1]).colliding


@pytest.mark.parametrize('strange', [
    None, 'pose', '0000001', b'1234567', 1.0, True, [], {}, set(), {1: 2}, 1 + 2j, object(),
    ['0'] * 6 + ['1'], [0.0] * 6 + [None], [0.0] * 6 + ['1'], [0.0] * 6 + [1j],
    [0.0] * 6 + [Decimal(1)], [True] * 7, np.ones(7, bool), np.ones(7, complex),
    np.ones(7, 'U1'), np.ones(7, 'm8[s]'), np.ones(7, 'M8[s]'), np.array([None] * 7),
    np.zeros(7, [('x', float)]), [[1], [1, 2]], [10**400] + [1] * 6, [10**5000] + [1] * 6,
    np.ones((7, 1)), np.ones((1, 1, 7)), np.ones(6), np.ones(8), np.array(1.0), np.array('pose'),
    (x for x in ABOVE), iter([1.0] * 7), range(6)], ids=lambda value: type(value).__name__)
def test_what_is_no_pose(strange):
    """Other kinds and shapes: one line with the field, from single calls, batches and sizes.

    NumPy alone would read '1' as 1, None as NaN and a date as a number, and drop imaginary parts.
    """
    solver = SOLVERS['exact']
    asked = [(lambda: ContactSolver([strange], poses.CUBE), 'size_a')]
    for one, many in ((solver, solver.batch), (solver.distance, solver.distance_batch)):
        asked += [(partial(one, strange, ABOVE), 'pose_a'),
                  (partial(one, ABOVE, strange), 'pose_b'),
                  (partial(many, [strange], [ABOVE]), 'poses_a'),
                  (partial(many, [ABOVE], [strange]), 'poses_b'),
                  (partial(many, [ABOVE], [ABOVE], size_b=[strange]), 'size_b')]
    if not (isinstance(strange, list) and not strange):  # an empty list has no rows
        asked.append((lambda: solver.batch(strange, [ABOVE]), 'poses_a'))
    for ask, field in asked:
        with pytest.raises(ValueError) as refusal:
            ask()
        text = str(refusal.value)
        assert text.startswith(f'{field} must be ') and '\n' not in text and len(text) < 1000


def test_no_rows_beside_a_row():
    for call in (SOLVERS['exact'].batch, SOLVERS['exact'].distance_batch):
        with pytest.raises(ValueError, match='^poses_a and poses_b must be equally many'):
            call([], [ABOVE])


def test_a_long_double_beyond_float64():
    """It becomes infinite and is refused as such, without NumPy's RuntimeWarning."""
    if np.finfo(np.longdouble).max == np.finfo(float).max:
        pytest.skip('long double is double here')
    bad = np.r_[np.longdouble('1e4000'), ABOVE[1:].astype(np.longdouble)]
    with pytest.raises(ValueError, match=r'^pose_b position \(inf, .*is not finite'):
        SOLVERS['exact'](poses.IDENTITY, bad)


def test_a_refusal_leaves_no_trace():
    """Good, bad, good: the second good answer is the first."""
    solver = ContactSolver(poses.CUBE, poses.CUBE)
    wanted = solver(poses.IDENTITY, ABOVE)
    for bad in (np.full(7, math.nan), np.zeros(7), None, []):
        with pytest.raises(ValueError):
            solver(bad, ABOVE)
        with pytest.raises(ValueError):
            solver.batch([ABOVE, ABOVE], [ABOVE, np.full(7, math.inf)])
        poses.assert_same_bits(solver(poses.IDENTITY, ABOVE), wanted)


# --- names and files ------------------------------------------------------------------------------


def test_weights_that_are_no_file(tmp_path):
    """A folder, a device, a name too long."""
    for path in (tmp_path, '/dev/null', 'x' * 5000, 'a\0b', tmp_path / 'nothing'):
        with pytest.raises(ValueError, match='weights file .* (cannot be read|does not exist)'):
            make_model('mlp', weights=str(path))
    with pytest.raises(ValueError, match="^weights have no effect on model 'exact'"):
        make_model('exact', weights='mlp.safetensors')
