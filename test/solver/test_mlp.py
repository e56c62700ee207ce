# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `mlp`: what it promises whatever its network says, and how good its network is."""
from __future__ import annotations

from typing import Any

import numpy as np
import poses
import pytest

from box_contact_ros import ContactSolver
from box_contact_ros.core import (
    ASPECT_MAX,
    DEPTH_FLOOR,
    DEPTH_MAX,
    FEATURES,
    OUTPUTS,
    SIZE_RATIO_MAX,
    native,
    stages,
)
from box_contact_ros.reports.accuracy import limit_of, statistics
from box_contact_ros.resources import resource_path
from box_contact_ros.scene.pose import rotation_matrix
from box_contact_ros.scene.pose_sets import (
    SETS,
    Pairs,
    contact_errors,
    log_uniform,
    quaternion_multiply,
    turns,
)
from box_contact_ros.solver.mlp import ACTIVATION, DESCRIPTION, FORMAT, UNITS_MAX, core_numbers
from box_contact_ros.solver.weights_file import WeightsError, load_weights, save_weights

N = 10_000
LANES = native.lanes
"""Rows of a batch that are solved side by side."""
UNIT = (1.0, 1.0, 1.0)
EXACT = ContactSolver(UNIT, UNIT, model='exact')

INSIDE = 2.0**-44
"""How far outside a box the point may be, of the size (5.7e-14); for a contact that is pressed in,
DEPTH_FLOOR more. Far from the origin, ulps of the coordinates are added (none here)."""

FAMILIES = {
    'random': poses.random_pairs,
    'near-parallel': poses.near_parallel_pairs,
    'aligned': lambda rng, n: aligned(rng, n),
    **SETS}


def aligned(rng, n):
    """Containers exactly above each other, tilted about a level axis of the box or not at all."""
    axes = np.eye(3)[rng.integers(0, 3, n)]
    tilt = rng.choice([0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3], n)
    height = poses.CONTAINER[2] - rng.choice([0.0, 1e-9, 1e-4, 1e-2], n)
    b = np.column_stack([np.zeros((n, 2)), height, poses.small_rotations(axes, tilt)])
    turn, shift = poses.unit_quaternions(rng, n), rng.uniform(-20, 20, (n, 3))
    size = np.tile(poses.CONTAINER, (n, 1))
    return (poses.moved(np.tile(poses.IDENTITY, (n, 1)), shift, turn), poses.moved(b, shift, turn),
            size, size)


@pytest.fixture(scope='module')
def mlp():
    return ContactSolver(UNIT, UNIT, model='mlp')


@pytest.fixture(params=FAMILIES)
def pairs(request):
    return Pairs(*FAMILIES[request.param](np.random.default_rng(771), N))


@pytest.fixture(params=SETS)
def named_set(request):
    return request.param, SETS[request.param](np.random.default_rng(772), N)


def solve(solver, pairs):
    return solver.batch(pairs.pose_a, pairs.pose_b, size_a=pairs.size_a, size_b=pairs.size_b)


def largest(pairs):
    return np.maximum(pairs.size_a.max(axis=1), pairs.size_b.max(axis=1))


def edge(pairs):
    """Return the smaller box's longest edge [m]: what errors are given in."""
    return np.minimum(pairs.size_a.max(axis=1), pairs.size_b.max(axis=1))


def percent(one, other, pairs):
    """Distance between points, in % of `edge`; rows with a contact in both."""
    distance = 100.0 * np.linalg.norm(one - other, axis=1) / edge(pairs)
    return distance[np.isfinite(distance)]


def in_range(pairs, found):
    """Rows that the MLP must answer itself, worked out the plain way."""
    aspect = np.maximum(pairs.size_a.max(axis=1) / pairs.size_a.min(axis=1),
                        pairs.size_b.max(axis=1) / pairs.size_b.min(axis=1))
    ratio = largest(pairs) / edge(pairs)
    shortest = np.minimum(pairs.size_a.min(axis=1), pairs.size_b.min(axis=1))
    return ((aspect <= ASPECT_MAX * (1 + 1e-9)) & (ratio <= SIZE_RATIO_MAX * (1 + 1e-9))
            & (-found.separation <= DEPTH_MAX * (1 + 1e-9) * shortest))


def outside(pairs, found):
    """(n,) by how much the point is outside either box [m]; negative inside."""
    worst = np.full(len(pairs.pose_a), -np.inf)
    for pose, size in ((pairs.pose_a, pairs.size_a), (pairs.pose_b, pairs.size_b)):
        local = poses.rotate(pose[:, 3:] * (-1, -1, -1, 1), found.point - pose[:, :3])
        worst = np.maximum(worst, (np.abs(local) - size / 2).max(axis=1))
    return worst


def is_inside(pairs, found):
    """Every contact's point lies in both boxes, up to INSIDE and how far B is pressed in."""
    rows = found.colliding
    size = largest(pairs)
    coordinates = np.maximum(np.abs(pairs.pose_a[:, :3]), np.abs(pairs.pose_b[:, :3])).max(axis=1)
    slack = (INSIDE * np.maximum(size, coordinates)
             + np.maximum(0.0, DEPTH_FLOOR * size + found.separation))
    return np.isfinite(found.point[rows]).all() and np.all((outside(pairs, found) <= slack)[rows])


def trace(covariance):
    return np.trace(covariance, axis1=1, axis2=2)


def is_a_patch(found):
    """Every contact has a finite, positive volume and a covariance of no negative eigenvalue."""
    volume, covariance = found.volume[found.colliding], found.covariance[found.colliding]
    # The covariance is summed and turned in float64.
    least = np.linalg.eigvalsh(covariance)[:, 0]
    return (np.all(np.isfinite(volume) & (volume > 0.0))
            and np.array_equal(covariance, np.swapaxes(covariance, 1, 2))
            and np.all(least >= -1e-14 * trace(covariance)))


# --- what SAT gives -------------------------------------------------------------------------------


def test_verdict_separation_and_normal_are_those_of_exact(mlp, pairs):
    """Bit for bit; the network has no say in them."""
    one, other = solve(mlp, pairs), solve(EXACT, pairs)
    for name in ('colliding', 'separation', 'normal'):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name
    for name in ('point', 'volume', 'covariance'):
        assert np.array_equal(np.isnan(getattr(one, name)), np.isnan(getattr(other, name)))


# --- what holds whatever the network says ---------------------------------------------------------


def garbage(rng, kind):
    """(weight, bias) of two layers that were not trained."""
    widths = (FEATURES, 32, OUTPUTS)
    layers = []
    for number, (inputs, outputs) in enumerate(zip(widths, widths[1:])):
        weight, bias = rng.normal(size=(outputs, inputs)), rng.normal(size=outputs)
        if kind == 'as large as a loader believes':
            weight, bias = 1e4 * np.sign(weight), 1e4 * np.sign(bias)
        elif kind == 'tiny':  # float32 denormals
            weight, bias = 1e-40 * weight, 1e-40 * bias
        elif kind == 'zero':
            weight, bias = 0.0 * weight, 0.0 * bias
        elif kind == 'one direction':
            weight, bias = 0.0 * weight, np.full(outputs, -1e4 if number % 2 else 1e4)
        layers.append((weight, bias))
    return layers


def card_of(widths: tuple[int, ...]) -> dict[str, Any]:
    """Return a model card that the MLP takes."""
    return {'name': 'other', 'model': 'mlp', 'format': FORMAT,
            'inputs': {'description': DESCRIPTION}, 'activation': ACTIVATION, 'outputs': [],
            'sizes': [], 'architecture': list(widths), 'data': {},
            'seed': 0, 'commit': '', 'metrics': {}}


def written(path, layers):
    """Return the weights file of these layers."""
    save_weights(path, {'point': layers}, card_of((FEATURES, 32, OUTPUTS)))
    return str(path)


@pytest.mark.parametrize('kind', ['random', 'as large as a loader believes', 'tiny', 'zero',
                                  'one direction'])
def test_contacts_are_sound_even_with_garbage_for_weights(tmp_path, kind):
    """Weights that nobody trained: points are wrong, finite, and inside; volumes are positive.

    Covariances are positive semidefinite.
    """
    file = written(tmp_path / 'garbage.safetensors', garbage(np.random.default_rng(4), kind))
    solver = ContactSolver(UNIT, UNIT, model='mlp', weights=file)
    for name, make in FAMILIES.items():
        pairs = Pairs(*make(np.random.default_rng(31), N))
        found = solve(solver, pairs)
        assert is_inside(pairs, found) and is_a_patch(found), name


@pytest.mark.parametrize('size', [1.0, 30.0, 1e4])
def test_patches_fit_the_bounds_even_with_garbage_for_weights(size):
    """In the bounds: volumes above zero and at most one, variances above zero and at most 1/3.

    The core is asked itself, as the solver would replace what is not sound.
    """
    rng = np.random.default_rng(9)
    numbers = (size * rng.normal(size=OUTPUTS + 20 * 32)).astype(np.float32)
    for name, make in SETS.items():
        pairs = make(np.random.default_rng(31), N)
        found = stages(*pairs, names=('answer_volume', 'answer_covariance'), network=numbers)
        variances = np.linalg.eigvalsh(found.answer_covariance)
        assert np.all((found.answer_volume > 0.0) & (found.answer_volume <= 1.0)), name
        assert np.all((variances > 0.0) & (variances < 1.0 / 3.0 + INVERSE_ROUNDING)), name
        assert np.ptp(variances) > 0.3  # not all alike


@pytest.mark.parametrize('output', range(OUTPUTS))
def test_weights_that_are_no_numbers_are_answered_exactly(output):
    """A loader refuses them; if one gets through, point, volume and covariance are exact ones."""
    numbers = core_numbers(load_weights(resource_path('weights', 'mlp.safetensors'))
                           .networks['point'])
    numbers[output] = np.nan
    pairs = SETS['stacks'](np.random.default_rng(31), 1000)
    solver = native.PairSolver('mlp', UNIT, UNIT, numbers)
    found, _ = solver.solve(*pairs, 1)
    assert solver.answered_exactly == len(pairs.pose_a)
    for mine, theirs in zip(found, solve(EXACT, pairs)):
        assert np.array_equal(mine, theirs, equal_nan=True)


def test_garbage_for_weights_is_really_asked(tmp_path):
    """The test above would prove nothing of a network whose answer is not used."""
    file = written(tmp_path / 'garbage.safetensors',
                   garbage(np.random.default_rng(4), 'one direction'))
    pairs = SETS['stacks'](np.random.default_rng(31), N)
    found = solve(ContactSolver(UNIT, UNIT, model='mlp', weights=file), pairs)
    assert np.median(percent(found.point, solve(EXACT, pairs).point, pairs)) > 10.0


def test_the_point_is_in_both_boxes(mlp, pairs):
    """With the shipped weights; volume and covariance are sound, too."""
    found = solve(mlp, pairs)
    assert is_inside(pairs, found) and is_a_patch(found)


def test_points_of_an_aligned_stack_are_inside(mlp):
    """Two containers exactly above each other, turned anywhere.

    All their sides lie in pairs of one plane, and rounding put the edges of each outside the other:
    no bounds, and a point 6 m off.
    """
    rng = np.random.default_rng(8)
    n = 5000
    b = np.tile((0, 0, poses.CONTAINER[2] - 1e-3, 0, 0, 0, 1.0), (n, 1))
    turn, shift = poses.unit_quaternions(rng, n), rng.uniform(-20, 20, (n, 3))
    size = np.tile(poses.CONTAINER, (n, 1))
    pairs = Pairs(poses.moved(np.tile(poses.IDENTITY, (n, 1)), shift, turn),
                  poses.moved(b, shift, turn), size, size)
    found = solve(mlp, pairs)
    assert is_inside(pairs, found)
    assert percent(found.point, solve(EXACT, pairs).point, pairs).max() < 3.0


@pytest.mark.parametrize('size_a, size_b', [((1e-9,) * 3, (1e-9,) * 3), ((1e9,) * 3, (1e9,) * 3),
                                            (UNIT, (1e-6,) * 3), ((1e-50,) * 3, (1e-50,) * 3),
                                            ((1e50,) * 3, (1e50,) * 3)])
def test_extreme_sizes_are_finite_and_inside(mlp, size_a, size_b):
    """From the smallest to the largest that is accepted: nothing over- or underflows."""
    n = 64
    reach = 0.5 * (size_a[2] + size_b[2])
    b = np.tile((0, 0, 0, 0, 0, 0, 1.0), (n, 1))
    b[:, 2] = reach - min(size_a[2], size_b[2]) * np.linspace(0.0, 0.2, n)
    b[:, :2] = 0.1 * size_b[0]
    pairs = Pairs(np.tile(poses.IDENTITY, (n, 1)), b, np.tile(size_a, (n, 1)),
                  np.tile(size_b, (n, 1)))
    found = solve(mlp, pairs)
    assert found.colliding.all() and is_inside(pairs, found) and is_a_patch(found)


# --- the range ------------------------------------------------------------------------------------


def test_outside_the_range_the_answer_is_the_exact_one_and_counted(pairs):
    """To the bit; inside the range the network answers, and nothing is counted."""
    solver = ContactSolver(UNIT, UNIT, model='mlp')
    assert solver.exact_answers == 0
    found, exact = solve(solver, pairs), solve(EXACT, pairs)
    out = found.colliding & ~in_range(pairs, found)
    assert solver.exact_answers == out.sum()
    for name, one, other in zip(found._fields, found, exact):
        assert np.array_equal(one[out], other[out]), name


@pytest.mark.parametrize('name', SETS)
def test_the_sets_are_inside_the_range(name):
    """An MLP that hands the hard half to `exact` has not been built."""
    solver = ContactSolver(UNIT, UNIT, model='mlp')
    solve(solver, SETS[name](np.random.default_rng(5), N))
    assert solver.exact_answers == 0


@pytest.mark.parametrize('what, size_a, size_b, depth', [
    ('aspect', (ASPECT_MAX, 1, 1), (ASPECT_MAX, 1, 1), 0.01),
    ('ratio', (SIZE_RATIO_MAX,) * 3, UNIT, 0.01),
    ('depth', UNIT, UNIT, DEPTH_MAX)])
def test_the_limits_belong_to_the_range(what, size_a, size_b, depth):
    """At the limit itself the network answers; a little beyond, `exact`. Single calls count too."""
    for factor, counted in ((1.0, 0), (1.001, 1)):
        mine = np.array(size_a, dtype=float)
        if what != 'depth':
            mine[0 if what == 'aspect' else slice(None)] *= factor
        deep = depth * (factor if what == 'depth' else 1.0)
        b = (0.2, 0.1, 0.5 * (mine[2] + size_b[2]) - deep, 0, 0, 0, 1)
        for call in ('single', 'batch'):
            solver = ContactSolver(mine, size_b, model='mlp')
            one = (solver(poses.IDENTITY, b) if call == 'single'
                   else solver.batch([poses.IDENTITY], [b]))
            assert np.all(one.colliding) and solver.exact_answers == counted, (what, factor, call)


# --- laws -----------------------------------------------------------------------------------------


def test_batch_equals_single_calls(mlp, pairs):
    """Row i of a batch is the single call of row i, to the bit."""
    many = solve(mlp, pairs)
    solver, sizes = None, None
    for i in range(0, len(pairs.pose_a), 29):
        if sizes != (tuple(pairs.size_a[i]), tuple(pairs.size_b[i])):
            sizes = (tuple(pairs.size_a[i]), tuple(pairs.size_b[i]))
            solver = ContactSolver(*sizes, model='mlp')
        one = solver(pairs.pose_a[i], pairs.pose_b[i])
        for name, single, row in zip(one._fields, one, (field[i] for field in many)):
            assert np.array_equal(single, row, equal_nan=True), (name, i)


@pytest.mark.parametrize('count', [1, 2, LANES - 1, LANES, LANES + 1, 2 * LANES + 2])
@pytest.mark.parametrize('first', [0, 5])
def test_a_row_does_not_know_its_neighbours(mlp, count, first):
    """Vectors that are not full, and rows in other lanes: the same bits."""
    pairs = Pairs(*poses.near_parallel_pairs(np.random.default_rng(6), 200))
    all_rows = solve(mlp, pairs)
    some = solve(mlp, Pairs(*(part[first:first + count] for part in pairs)))
    for name, one, many in zip(some._fields, some, all_rows):
        assert np.array_equal(one, many[first:first + count], equal_nan=True), name


def test_rows_apart_refused_or_out_of_range_do_not_disturb_neighbours(mlp):
    """Side by side, contacts between rows of all other kinds keep their bits.

    A refused row raises, and the next call is right again.
    """
    rng = np.random.default_rng(7)
    pairs = SETS['random sizes'](rng, 32)
    clean = solve(mlp, pairs)
    mixed = Pairs(*(part.copy() for part in pairs))
    mixed.pose_b[1::4, :3] += 1e3                       # far apart
    mixed.size_a[2::4] = (1.0, 1e-3, 1.0)               # out of range
    mixed.pose_b[3::8] = mixed.pose_a[3::8]             # one in the other
    found = solve(mlp, mixed)
    assert np.array_equal(found.point[::4], clean.point[::4])
    assert not found.colliding[1::4].any() and np.isnan(found.point[1::4]).all()
    for bad in ((np.nan, 0, 0, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 0)):
        refused = Pairs(*(part.copy() for part in pairs))
        refused.pose_b[17] = bad
        with pytest.raises(ValueError, match=r'poses_b\[17\]'):
            solve(mlp, refused)
        again = solve(mlp, pairs)
        assert np.array_equal(again.point, clean.point)


def test_same_input_same_bits(pairs):
    """Two solvers, one of them after other work, rows in another order."""
    one = ContactSolver(UNIT, UNIT, model='mlp')
    two = ContactSolver(UNIT, UNIT, model='mlp')
    solve(two, Pairs(*poses.random_pairs(np.random.default_rng(0), 300)))
    order = np.random.default_rng(1).permutation(len(pairs.pose_a))
    shuffled = solve(two, Pairs(*(part[order] for part in pairs)))
    for name, left, right in zip(shuffled._fields, solve(one, pairs), shuffled):
        assert np.array_equal(left[order], right, equal_nan=True), name


@pytest.mark.parametrize('power', [-30, 1, 30])
def test_scale_by_powers_of_two_is_exact(mlp, pairs, power):
    """Everything scaled by 2^k: point, volume and covariance scale to the bit."""
    factor = 2.0**power
    scaling = np.array([factor] * 3 + [1.0] * 4)
    scaled = Pairs(pairs.pose_a * scaling, pairs.pose_b * scaling, pairs.size_a * factor,
                   pairs.size_b * factor)
    one, two = solve(mlp, pairs), solve(mlp, scaled)
    assert np.array_equal(one.point * factor, two.point, equal_nan=True)
    assert np.array_equal(one.volume * factor**3, two.volume)
    assert np.array_equal(one.covariance * factor**2, two.covariance, equal_nan=True)


def test_minus_q_is_q(mlp, pairs):
    """To the bit."""
    minus = np.array([1, 1, 1, -1, -1, -1, -1.0])
    other = pairs._replace(pose_a=pairs.pose_a * minus, pose_b=pairs.pose_b * minus)
    for name, left, right in zip(Pairs._fields, solve(mlp, pairs), solve(mlp, other)):
        assert np.array_equal(left, right, equal_nan=True), name


def assert_close(found, wanted, pairs):
    """Check that all rows have the same contacts, up to roundings of the network's float32 [%].

    Measured: 9e-6, 4e-4 and 4e-4 at worst. A rounding could choose another of the two frames only
    where the bounding boxes tie, which none of these pairs does.
    """
    errors = contact_errors(found, wanted, pairs.edge)
    assert len(errors.point) > N / 4
    assert errors.point.max() < 1e-4
    assert errors.volume.max() < PATCH_ROUNDING and errors.covariance.max() < PATCH_ROUNDING


def test_swap(mlp, named_set):
    """B against A: another frame, and so another answer within the stated error."""
    name, pairs = named_set
    other = Pairs(pairs.pose_b, pairs.pose_a, pairs.size_b, pairs.size_a)
    errors = contact_errors(solve(mlp, other), solve(mlp, pairs), pairs.edge)
    for quantity, found in errors._asdict().items():
        for value, most in zip(statistics(found), limit_of(quantity, name)):
            assert value <= 2.0 * most, quantity


def test_rigid_motion(mlp, named_set):
    """Moved together, point and covariance move along, and the volume stays."""
    _, pairs = named_set
    rng = np.random.default_rng(3)
    n = len(pairs.pose_a)
    turn, shift = poses.unit_quaternions(rng, n), rng.uniform(-5, 5, (n, 3))
    moved = pairs._replace(pose_a=poses.moved(pairs.pose_a, shift, turn),
                           pose_b=poses.moved(pairs.pose_b, shift, turn))
    found, axes = solve(mlp, pairs), rotation_matrix(turn)
    assert_close(solve(mlp, moved), found._replace(
        point=poses.rotate(turn, found.point) + shift,
        covariance=axes @ found.covariance @ np.swapaxes(axes, 1, 2)), pairs)


def test_box_symmetries(mlp, named_set):
    """A box's axes relabelled: a quarter turn about each of its axes, extents along."""
    _, pairs = named_set
    one = solve(mlp, pairs)
    half = np.sqrt(0.5)
    for axis, order in (((half, 0, 0, half), (0, 2, 1)), ((0, half, 0, half), (2, 1, 0)),
                        ((0, 0, half, half), (1, 0, 2))):
        for pose, size in (('pose_a', 'size_a'), ('pose_b', 'size_b')):
            turned = getattr(pairs, pose).copy()
            turned[:, 3:] = poses.multiply(turned[:, 3:], np.tile(axis, (len(turned), 1)))
            other = pairs._replace(**{pose: turned, size: getattr(pairs, size)[:, order]})
            assert_close(solve(mlp, other), one, pairs)


# --- continuity -----------------------------------------------------------------------------------

INVERSE_ROUNDING = 1e-3
"""Of variances [half extents²]: float32 and couplings as large as they may be; measured: 2e-4."""
PATCH_ROUNDING = 1e-3
"""Largest differences of volume and covariance by roundings of float32 [%]; see `assert_close`."""
PATHS, FRAMES = 100, 400
JUMP = 4.0
"""Bound of a step of the point beyond the exact point's [% of the edge]. Measured: 2.3, where the
frame changes, or the exact point itself moves by much of the box."""
JUMP_999 = 1.3
"""999 steps of 1,000 [%]; measured: 0.7 on the worst path."""


def swaying(rng, size, *, tilt, heading, yaw, lateral, depth):
    """Frames of paths of a box over another, the lowest corner `depth` deep: (PATHS, FRAMES)."""
    n = PATHS * FRAMES
    shape = (PATHS, FRAMES)
    tilt, heading, yaw, depth = (np.broadcast_to(x, shape).ravel()
                                 for x in (tilt, heading, yaw, depth))
    level = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(n)])
    turn = quaternion_multiply(turns(level, tilt), turns((0.0, 0.0, 1.0), yaw))
    low = np.full(n, np.inf)
    for signs in np.ndindex(2, 2, 2):
        corner = np.tile((np.array(signs) - 0.5) * size, (n, 1))
        low = np.minimum(low, poses.rotate(turn, corner)[:, 2])
    place = np.broadcast_to(lateral, (*shape, 2)).reshape(n, 2) * np.array(size)[:2]
    b = np.column_stack([place, 0.5 * size[2] - low - depth, turn])
    sizes = np.tile(size, (n, 1))
    return Pairs(np.tile(poses.IDENTITY, (n, 1)), b, sizes, sizes)


def path(name, rng, size):
    """Paths of one kind; angles in rad."""
    def each(low, high, *more):
        return rng.uniform(low, high, (PATHS, 1, *more))

    time = np.linspace(0.0, 1.0, FRAMES)[None]
    motion = {'tilt': each(1e-4, 0.01), 'heading': each(-np.pi, np.pi), 'yaw': each(-0.3, 0.3),
              'lateral': each(-0.2, 0.2, 2), 'depth': 0.004 * size[2]}
    motion |= {
        'landing': {'tilt': each(0.005, 0.05) * (1 - time), 'depth': 1e-3 * size[2]},
        'through zero tilt': {'tilt': each(5e-4, 5e-3) * (1 - 2 * time)},
        'aligned, through zero tilt': {
            'tilt': each(5e-4, 5e-3) * (1 - 2 * time), 'lateral': 0.0, 'yaw': 0.0,
            'heading': 0.5 * np.pi * rng.integers(0, 4, (PATHS, 1))},
        'yaw': {'yaw': np.pi * time * each(0.1, 1.0), 'depth': 0.01 * size[2]},
        'sliding': {'lateral': each(-0.4, 0.4, 2) + each(-0.8, 0.8, 2) * time[..., None] / 2},
        'deepening': {'depth': 0.1 * min(size) * 10.0**(-5.0 * (1 - time))},
        'rolling': {'heading': each(-np.pi, np.pi) + 2 * np.pi * time}}[name]
    return swaying(rng, size, **motion)


@pytest.mark.parametrize('size', [poses.CONTAINER, poses.CUBE], ids=['containers', 'cubes'])
@pytest.mark.parametrize('name', ['landing', 'through zero tilt', 'aligned, through zero tilt',
                                  'yaw', 'sliding', 'deepening', 'rolling'])
def test_continuity_along_smooth_paths(mlp, name, size):
    """Per frame the point moves at most as far as the exact one plus a jump."""
    pairs = path(name, np.random.default_rng(12), size)
    steps = []
    for model in (mlp, EXACT):
        point = solve(model, pairs).point.reshape(PATHS, FRAMES, 3)
        steps.append(100.0 * np.linalg.norm(np.diff(point, axis=1), axis=2) / max(size))
    beyond = steps[0] - steps[1]
    beyond = beyond[np.isfinite(beyond)]
    assert len(beyond) > 0.4 * PATHS * FRAMES
    assert np.quantile(beyond, 0.999) <= JUMP_999
    assert beyond.max() <= JUMP


def test_a_face_that_comes_in_comes_in_smoothly(mlp):
    """A cube's corner nears the border of a face, where the overlap begins to be cut off.

    There is no step there.
    """
    n = 3601
    turn = poses.small_rotations(np.array([[1.0, -0.7, 0.2]]), np.array([0.6]))
    b = np.tile(np.concatenate([(0, 0, 0), turn[0]]), (n, 1))
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    turned = poses.rotate(np.tile(turn, (8, 1)), corners)
    lowest = turned[np.argmin(turned[:, 2])]
    b[:, :3] = np.array([0.3, 0.0, 0.99]) - lowest
    b[:, 1] += np.linspace(0.9, 0.99, n)
    size = np.full((n, 3), 2.0)
    pairs = Pairs(np.tile(poses.IDENTITY, (n, 1)), b, size, size)
    steps = [np.linalg.norm(np.diff(solve(model, pairs).point, axis=0), axis=1)
             for model in (mlp, EXACT)]
    # In the exact steps the face comes in with a kink, so the path did reach it.
    assert np.ptp(steps[1][:3000]) < 1e-9 < np.ptp(steps[1][3000:])
    assert steps[0].max() <= 5e-4 * 2.0  # of the edge


# --- accuracy -------------------------------------------------------------------------------------


@pytest.mark.parametrize('name', SETS)
def test_errors_are_within_the_limits(mlp, name):
    """Mean, 99th percentile and worst error, on 20,000 pairs that nobody has trained on."""
    pairs = SETS[name](np.random.default_rng([20270101, list(SETS).index(name)]), 20_000)
    errors = contact_errors(solve(mlp, pairs), solve(EXACT, pairs), pairs.edge)
    for quantity, found in errors._asdict().items():
        assert len(found) == len(pairs.pose_a)
        for value, most in zip(statistics(found), limit_of(quantity, name)):
            assert value <= most, quantity


# --- network --------------------------------------------------------------------------------------


def test_missing_weights_name_the_model_that_needs_none(monkeypatch):
    """`exact` is what a user without weights can go on with."""
    def nowhere(*parts):
        raise FileNotFoundError(parts)

    monkeypatch.setattr('box_contact_ros.solver.weights_file.resource_path', nowhere)
    with pytest.raises(WeightsError, match="'exact'"):
        ContactSolver(UNIT, UNIT, model='mlp')


@pytest.mark.parametrize('hidden', [(), (8, 8), (UNITS_MAX + 1,)])
def test_layers_that_the_core_does_not_have_are_refused(tmp_path, hidden):
    """None or two hidden layers, or too many units."""
    widths = (FEATURES, *hidden, OUTPUTS)
    layers = [(np.zeros((b, a)), np.zeros(b)) for a, b in zip(widths, widths[1:])]
    path = tmp_path / 'other.safetensors'
    save_weights(path, {'point': layers}, card_of(widths))
    with pytest.raises(WeightsError, match=f'one hidden layer, of at most {UNITS_MAX} units'):
        ContactSolver(UNIT, UNIT, model='mlp', weights=str(path))


@pytest.mark.parametrize('change, words', [
    ({'format': 3}, 'has format 3; this version reads 2 and 1'),
    ({'format': '2'}, "has format '2'"), ({'format': True}, 'has format True'),
    ({'format': None}, 'has format None'),
    ({'activation': 'softsign'}, "units are 'relu', not 'softsign'"),
    ({'activation': None}, "units are 'relu', not None")])
def test_weights_with_another_meaning_are_refused(tmp_path, change, words):
    """They would be taken without complaint, and answer nonsense."""
    widths = (FEATURES, 4, OUTPUTS)
    layers = [(np.zeros((b, a)), np.zeros(b)) for a, b in zip(widths, widths[1:])]
    path = tmp_path / 'other.safetensors'
    save_weights(path, {'point': layers}, card_of(widths))
    ContactSolver(UNIT, UNIT, model='mlp', weights=str(path))
    save_weights(path, {'point': layers}, card_of(widths) | change)
    with pytest.raises(WeightsError, match=words):
        ContactSolver(UNIT, UNIT, model='mlp', weights=str(path))


def test_weights_of_another_model_are_refused(tmp_path):
    """A network that is none of the MLP's."""
    path = tmp_path / 'other.safetensors'
    rng = np.random.default_rng(1)
    card = {'name': 'other', 'model': 'other', 'inputs': {}, 'outputs': [], 'sizes': [],
            'architecture': [6, 4], 'data': {}, 'seed': 0, 'commit': '', 'metrics': {}}
    save_weights(path, {'point': [(rng.normal(size=(4, 6)), rng.normal(size=4))]}, card)
    with pytest.raises(WeightsError, match=f'{FEATURES} inputs and {OUTPUTS}'):
        ContactSolver(UNIT, UNIT, model='mlp', weights=str(path))


def listing(path, sizes):
    """Return a copy of the shipped network whose card lists pairs of sizes."""
    shipped = load_weights(resource_path('weights', 'mlp.safetensors'))
    save_weights(path, {'point': shipped.networks['point'].layers},
                 shipped.card | {'sizes': sizes})
    return str(path)


def test_sizes_that_the_card_lists_are_for_the_network(mlp, tmp_path):
    """In one batch, too, in either order of the boxes and of the axes; the rest is exact."""
    weights = listing(tmp_path / 'some', [[poses.CUBE, poses.CONTAINER]])
    some = ContactSolver(poses.CONTAINER[::-1], poses.CUBE, model='mlp', weights=weights)
    pairs = SETS['random cubes'](np.random.default_rng(8), 60)
    sizes_b = np.tile(poses.CUBE, (len(pairs.pose_b), 1))
    sizes_b[::2] = poses.CONTAINER
    a, b = pairs.pose_a, pairs.pose_b
    found, network, exact = (one.batch(a, b, size_a=poses.CUBE, size_b=sizes_b)
                             for one in (some, mlp, EXACT))
    assert np.array_equal(found.point[::2], network.point[::2], equal_nan=True)
    assert np.array_equal(found.point[1::2], exact.point[1::2], equal_nan=True)
    assert some.exact_answers >= np.count_nonzero(exact.colliding[1::2]) > 0
    one = ContactSolver(poses.CUBE, poses.CUBE, model='mlp', weights=weights)
    assert np.array_equal(one(a[0], b[0]).point, EXACT.batch(
        a[:1], b[:1], size_a=poses.CUBE, size_b=poses.CUBE).point[0])
    with pytest.raises(ValueError, match='zero length'):
        one.batch(np.zeros((1, 7)), b[:1])


@pytest.mark.parametrize('sizes', [5, 'abc', [[2, 2]], [poses.CUBE], [[poses.CUBE, (1, -1, 1)]]])
def test_sizes_in_a_card_that_are_none(tmp_path, sizes):
    with pytest.raises(WeightsError, match='no pairs of three extents'):
        ContactSolver(UNIT, UNIT, model='mlp', weights=listing(tmp_path / 'bad', sizes))


def test_depths_in_the_sets_are_what_they_say():
    """The accuracy above is of contacts that are as deep as they should be."""
    pairs = SETS['random cubes'](np.random.default_rng(3), N)
    depth = -solve(EXACT, pairs).separation
    assert depth.min() == pytest.approx(2e-3, rel=0.05) and depth.max() <= 0.2 * (1 + 1e-9)
    assert log_uniform(np.random.default_rng(0), 1.0, 2.0, 5).min() >= 1.0
    assert np.abs(solve(EXACT, SETS['touching'](np.random.default_rng(3), N)).separation
                  ).max() < 1e-14
