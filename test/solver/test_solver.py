# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ContactSolver at the door: what is accepted, what is refused and in which words."""
from __future__ import annotations

import math
import pickle
import warnings

import numpy as np
import poses
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from box_contact_ros import Contact, ContactSolver
from box_contact_ros.solver.checks import pose_fault
from box_contact_ros.solver.contact import patch_area

SOLVER = ContactSolver(poses.CUBE, poses.CUBE, model='exact')
ABOVE = [0.5, 0.25, 1.875, 0, 0, 0, 1]


def test_result_is_plain():
    """A contact is a bool, a float and two arrays; without contact, point and normal are NaN."""
    contact = SOLVER(poses.IDENTITY, ABOVE)
    assert isinstance(contact, Contact)
    assert contact.colliding is True
    assert type(contact.separation) is float and contact.separation == -0.125
    assert contact.normal.shape == contact.point.shape == (3,)
    apart = SOLVER(poses.IDENTITY, [0, 0, 2.5, 0, 0, 0, 1])
    assert apart.colliding is False and apart.separation == 0.5
    assert np.isnan(apart.normal).all() and np.isnan(apart.point).all()


def test_area_of_a_patch():
    """Closed form: the rectangle that two faces share, turned and shifted; NaN without a patch."""
    rng = np.random.default_rng(3)
    pair = np.array([poses.IDENTITY, [1.2, -1.6, 0.995, 0, 0, 0, 1]])
    wanted = (1.0 + 0.5 - 1.2) * (1.5 + 1.0 - 1.6)  # half extents less the distance, by axis
    solver = ContactSolver((2, 3, 1), (1, 2, 1), model='exact')
    for _ in range(20):
        contact = solver(*poses.moved(pair, rng.uniform(-5, 5, 3),
                                      poses.unit_quaternions(rng, 1)))
        assert patch_area(contact) == pytest.approx(wanted, rel=1e-9)
    nothing = contact._replace(covariance=np.full((3, 3), np.nan))
    assert math.isnan(patch_area(nothing))


def test_results_are_not_shared():
    """A result stays as it was when the solver is called again."""
    one = SOLVER(poses.IDENTITY, ABOVE)
    kept = one.point.copy()
    SOLVER(poses.IDENTITY, [0, 0, 1.5, 0, 0, 0, 1])
    assert np.array_equal(one.point, kept)


@pytest.mark.parametrize('model', ['mlp', 'exact', 'paper', 'soup-2'])
def test_a_solver_goes_to_other_processes(model):
    """Pickled and back, for a pool of processes, it answers the same."""
    if model == 'soup-2':
        pytest.importorskip('fcl')
    solver = ContactSolver((1, 2, 3) if model != 'paper' else poses.CUBE, poses.CUBE, model=model)
    other = pickle.loads(pickle.dumps(solver))
    assert other.model == model
    above = [0.1, 0.05, 1.9, 0.02, 0.01, 0, 1]
    for one, two in zip(solver(poses.IDENTITY, above), other(poses.IDENTITY, above)):
        assert np.array_equal(one, two, equal_nan=True)


@pytest.mark.parametrize('gap, colliding', [
    (0.0, True), (1e-15, True), (1e-14, False), (1e-12, False), (-1e-15, True)])
def test_exact_touch_is_contact(gap, colliding):
    """Contact up to 8 ulp of the largest coordinate or size: 8 · 4.4e-16 = 3.6e-15 m here."""
    assert SOLVER(poses.IDENTITY, [0, 0, 2.0 + gap, 0, 0, 0, 1]).colliding is colliding


def test_touch_tolerance_follows_the_coordinates():
    """In UTM coordinates, where one ulp is 9.3e-10 m, a gap of 8 of them is still touch."""
    origin = np.array([5e5, 5.8e6, 20.0])
    a = np.r_[origin, 0, 0, 0, 1]
    for gap, colliding in ((8 * 2.0**-30, True), (9 * 2.0**-30, False)):
        b = np.r_[origin + (0, 2 + gap, 0), 0, 0, 0, 1]
        assert SOLVER(a, b).colliding is colliding


@pytest.mark.parametrize('length', [1e-8, 0.5, 0.999, 2.0, 1e8, 1e-99, 1e99])
def test_quaternion_of_any_length_is_normalised(length):
    turn = np.array([0.1, -0.2, 0.3, 0.9])
    one = SOLVER(poses.IDENTITY, np.r_[0, 0, 2, turn / np.linalg.norm(turn)])
    two = SOLVER(poses.IDENTITY, np.r_[0, 0, 2, length * turn])
    assert two.separation == pytest.approx(one.separation, abs=1e-15)
    assert two.point == pytest.approx(one.point, abs=1e-14)


BAD_POSES = {
    'position': [([math.nan, 0, 0, 0, 0, 0, 1], r'position \(nan, 0, 0\) is not finite'),
                 ([0, math.inf, 0, 0, 0, 0, 1], r'position \(0, inf, 0\) is not finite'),
                 ([0, 0, 1e308, 0, 0, 0, 1], r'position \(0, 0, 1e\+308\) exceeds')],
    'quaternion': [([0, 0, 0, 0, 0, 0, 0], r'quaternion \(x=0, y=0, z=0, w=0\) has zero length; a '
                    'pose is x y z qx qy qz qw$'),
                   ([0, 0, 0, 0, 0, 0, 5e-324], 'zero length'),
                   ([0, 0, 0, 0, math.nan, 0, 1], r'y=nan.* is not finite'),
                   ([0, 0, 0, 0, 0, -math.inf, 1], 'is not finite'),
                   ([0, 0, 0, 1e200, 0, 0, 1e200], 'longer than')]}


@pytest.mark.parametrize('bad, words', [case for cases in BAD_POSES.values() for case in cases])
def test_bad_poses_are_refused(bad, words):
    """Single and batch, either box: ValueError with the field, the row and the value."""
    with pytest.raises(ValueError, match='^pose_a .*' + words):
        SOLVER(bad, ABOVE)
    with pytest.raises(ValueError, match='^pose_b .*' + words):
        SOLVER(poses.IDENTITY, bad)
    good = np.tile(np.array(ABOVE, dtype=float), (3, 1))
    rows = good.copy()
    rows[1] = bad
    with pytest.raises(ValueError, match=r'^poses_b\[1\] .*' + words):
        SOLVER.batch(good, rows)
    assert pose_fault(bad) is not None


@pytest.mark.parametrize('bad, words', [
    ((0, 2, 2), r'\(0, 2, 2\) is not positive'), ((2, -1, 2), 'is not positive'),
    ((2, 2, -0.0), 'is not positive'), ((math.nan, 2, 2), 'is not finite'),
    ((2, math.inf, 2), 'is not finite'), ((5e-324, 2, 2), 'is outside'),
    ((2, 1e200, 2), 'is outside'),
    ((2, 2), 'three full extents'), ('box', 'three full extents'), (2.0, 'three full extents'),
    (None, 'three full extents')])
def test_bad_sizes_are_refused(bad, words):
    for name, sizes in (('size_a', (bad, poses.CUBE)), ('size_b', (poses.CUBE, bad))):
        with pytest.raises(ValueError, match=f'^{name} .*{words}'):
            ContactSolver(*sizes)
    if np.shape(bad) == (3,):
        rows = np.tile(np.array(poses.CUBE), (2, 1))
        rows[1] = bad
        two = np.tile(poses.IDENTITY, (2, 1))
        with pytest.raises(ValueError, match=r'^size_b\[1\] .*' + words):
            SOLVER.batch(two, two, size_b=rows)


@pytest.mark.parametrize('bad', [[1, 2, 3], np.zeros((2, 7)), 'pose', None, [[0] * 7], 1.0,
                                 [0, 0, 0, 0, 0, 0, 'w'], [0, 0, 0, 0, 0, 0, None]])
def test_bad_shapes_are_refused(bad):
    with pytest.raises(ValueError, match=r'^pose_a .*'):
        SOLVER(bad, ABOVE)
    with pytest.raises(ValueError, match='^poses_b '):
        SOLVER.batch(np.zeros((1, 7)), np.zeros((1, 6)) if bad is None else 'poses')


def test_unequal_batches_are_refused():
    with pytest.raises(ValueError, match='equally many, not 2 and 3'):
        SOLVER.batch(np.tile(poses.IDENTITY, (2, 1)), np.tile(poses.IDENTITY, (3, 1)))


@pytest.mark.parametrize('threads', [0, -1, True, 1.0, '2', None])
def test_threads_are_a_whole_number(threads):
    with pytest.raises(ValueError, match='threads must be a whole number from 1 on'):
        SOLVER.batch([poses.IDENTITY], [ABOVE], threads=threads)


@pytest.mark.parametrize(('name', 'value'), [('model', None), ('model', 3), ('weights', 3)])
def test_names_that_are_none(name, value):
    with pytest.raises(ValueError, match=name):
        ContactSolver(poses.CUBE, poses.CUBE, **{name: value})


def test_empty_batch():
    found = SOLVER.batch(np.zeros((0, 7)), np.zeros((0, 7)))
    assert found.colliding.shape == found.separation.shape == (0,)
    assert found.normal.shape == found.point.shape == (0, 3)


def test_no_pairs_are_no_rows():
    """As a broad phase gives them that found nothing."""
    assert SOLVER.batch([poses.IDENTITY, ABOVE], pairs=[]).point.shape == (0, 3)


@pytest.mark.parametrize('mask', [False, True])
def test_a_masked_array_is_refused(mask):
    """A mask would be dropped, and what it hides would count."""
    pose = np.ma.array(np.array(poses.IDENTITY, dtype=float), mask=mask)
    with pytest.raises(ValueError, match='^pose_a must be a pose .* of numbers, not masked'):
        SOLVER(pose, ABOVE)
    with pytest.raises(ValueError, match='^poses_a must be poses .* of numbers, not masked'):
        SOLVER.batch(pose[None], [ABOVE])
    with pytest.raises(ValueError, match='^pairs must be whole numbers'):
        SOLVER.batch([poses.IDENTITY, ABOVE], pairs=np.ma.array([[0, 1]], mask=mask))


def test_unknown_model():
    with pytest.raises(ValueError, match="model 'exakt' is not one of: .*exact"):
        ContactSolver(poses.CUBE, poses.CUBE, model='exakt')


def test_inputs_of_any_kind():
    """Lists, float32, integers, strided views: all the same to the solver."""
    wanted = SOLVER(poses.IDENTITY, ABOVE)
    wide = np.zeros((7, 3))
    wide[:, 1] = ABOVE
    for given_as in (tuple(ABOVE), np.array(ABOVE, dtype=np.float32), wide[:, 1]):
        assert np.array_equal(SOLVER([0, 0, 0, 0, 0, 0, 1], given_as).point, wanted.point)


numbers = st.floats(allow_nan=True, allow_infinity=True, width=64)


@settings(max_examples=500, deadline=None)
@given(st.lists(numbers, min_size=7, max_size=7), st.lists(numbers, min_size=7, max_size=7))
def test_any_fourteen_doubles(pose_a, pose_b):
    """Whatever comes in: a finite answer, or a ValueError; never NaN in a contact."""
    try:
        contact = SOLVER(pose_a, pose_b)
    except ValueError:
        assert pose_fault(pose_a) or pose_fault(pose_b)
        return
    assert not pose_fault(pose_a) and not pose_fault(pose_b)
    assert math.isfinite(contact.separation)
    if contact.colliding:
        assert np.isfinite(contact.point).all()
        assert abs(np.linalg.norm(contact.normal) - 1) < 1e-12


def test_warnings_are_errors_here():
    """The suite runs with warnings as errors, so none hides."""
    with pytest.raises(UserWarning):
        warnings.warn('seen', UserWarning, stacklevel=1)
