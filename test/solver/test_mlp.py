# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `mlp`: what it promises whatever its network says, and how good its network is."""
from __future__ import annotations

import ctypes
import ctypes.util
import json
import platform
import re
from pathlib import Path
from typing import Any

import numpy as np
import poses
import pytest
from safetensors.numpy import save_file

pytest.importorskip('benchmarks.pose_sets')

from benchmarks.accuracy import limit_of
from benchmarks.errors import contact_errors
from benchmarks.pose_sets import LOADS, SETS, Pairs, flush_stacks
from benchmarks.steps import drawn_paths, largest_steps
from benchmarks.worst_case import climb, worst_start
from box_contact_ros import ContactSolver
from box_contact_ros.core import (
    BRACKET_LIMIT,
    DEPTH_FLOOR,
    FEATURES,
    NETWORK_FORMAT,
    SPREAD_LIMIT,
    native,
    stages,
)
from box_contact_ros.scene.pose import rotation_matrix
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.solver.mlp import ACTIVATION, NETWORK, UNITS_MAX, core_numbers, load_mlp
from box_contact_ros.solver.weights_file import WeightsError

N = 4000
LANES = native.lanes
"""Rows of a batch that are solved side by side."""
UNIT = (1.0, 1.0, 1.0)
EXACT = ContactSolver(UNIT, UNIT, model='exact')
ALL_SETS = {**SETS, **LOADS}
INSIDE = 2.0**-44
"""How far outside a box the point may be, of the size (5.7e-14); for a contact that is pressed in,
DEPTH_FLOOR more. Far from the origin, ulps of the coordinates are added (none here)."""
ROUNDING = 3000 * 2.0**-24
"""Of float32, as the model's header bounds it [of volume and covariance]."""


def aligned(rng: np.random.Generator, n: int) -> tuple[np.ndarray, ...]:
    """Containers exactly above each other, tilted about a level axis of the box or not at all."""
    axes = np.eye(3)[rng.integers(0, 3, n)]
    tilt = rng.choice([0.0, 1e-12, 2e-9, 1e-6, 1e-4, 1e-3], n)
    height = poses.CONTAINER[2] - rng.choice([0.0, 1e-9, 1e-4, 1e-2], n)
    b = np.column_stack([np.zeros((n, 2)), height, poses.small_rotations(axes, tilt)])
    turn, shift = poses.unit_quaternions(rng, n), rng.uniform(-20, 20, (n, 3))
    size = np.tile(poses.CONTAINER, (n, 1))
    return (poses.moved(np.tile(poses.IDENTITY, (n, 1)), shift, turn), poses.moved(b, shift, turn),
            size, size)


FAMILIES = {
    'random': poses.random_pairs, 'near-parallel': poses.near_parallel_pairs,
    'flush': poses.flush_pairs, 'equal thickness': poses.equal_thickness, 'ridges': poses.ridges,
    'cards': poses.cards, 'aligned': aligned, **ALL_SETS}


def drawn(name: str, n: int = N) -> Pairs:
    return Pairs(*FAMILIES[name](np.random.default_rng([771, list(FAMILIES).index(name)]), n))


@pytest.fixture(scope='module')
def mlp() -> ContactSolver:
    return ContactSolver(UNIT, UNIT)


@pytest.fixture(params=FAMILIES)
def pairs(request: pytest.FixtureRequest) -> Pairs:
    return drawn(request.param)


@pytest.fixture(params=ALL_SETS)
def named_set(request: pytest.FixtureRequest) -> tuple[str, Pairs]:
    return request.param, drawn(request.param)


def with_numbers(pairs: Pairs, numbers: np.ndarray) -> Contacts:
    """Return the contacts by a network as the core reads it."""
    return Contacts(*native.PairSolver('mlp', UNIT, UNIT, numbers).solve(*pairs, 1)[0])


def fallbacks(pairs: Pairs) -> np.ndarray:
    """Return which rows (n,) are left to `exact`, by asking for one after the other."""
    solver = native.PairSolver('mlp', UNIT, UNIT, SHIPPED)
    counts = [0]
    for row in range(len(pairs.pose_a)):
        solver.solve(*(part[row:row + 1] for part in pairs), 1)
        counts.append(solver.fallbacks)
    return np.diff(counts) > 0


def assert_same_bits(one: Contacts, other: Contacts, where: object = None) -> None:
    for name, mine, theirs in zip(Contacts._fields, one, other, strict=True):
        assert np.array_equal(mine, theirs, equal_nan=True), (name, where)


def rows_of(found: Contacts, rows: np.ndarray) -> Contacts:
    return Contacts(*(field[rows] for field in found))


def trace(covariance: np.ndarray) -> np.ndarray:
    return np.trace(covariance, axis1=1, axis2=2)


def assert_sound(pairs: Pairs, found: Contacts) -> None:
    """Points are in both boxes, volumes positive, covariances symmetric and positive definite.

    Definite are those of the columns: clipping may lose the least eigenvalue of a card.
    """
    reach = np.maximum(np.abs(pairs.pose_a[:, :3]), np.abs(pairs.pose_b[:, :3])).max(axis=1)
    slack = (INSIDE * np.maximum(pairs.size, reach)
             + np.maximum(0.0, DEPTH_FLOOR * pairs.size + found.separation))
    rows = found.colliding
    assert rows.any() and np.isfinite(found.point[rows]).all()
    assert np.all((pairs.beyond(found.point) <= slack)[rows])
    volume, covariance = found.volume[rows], found.covariance[rows]
    assert np.all(np.isfinite(volume) & (volume > 0.0))
    assert np.array_equal(covariance, np.swapaxes(covariance, 1, 2))
    covariance = covariance[volume != pairs.contacts().volume[rows]]
    # The covariance is turned in float64, which may lose the least eigenvalue of a sliver.
    assert np.all(np.linalg.eigvalsh(covariance)[:, 0] >= -1e-15 * trace(covariance))


# --- what SAT gives -------------------------------------------------------------------------------


def test_verdict_separation_normal_and_axis_are_those_of_exact(
        mlp: ContactSolver, pairs: Pairs) -> None:
    """Bit for bit; the network has no say in them."""
    one, other = pairs.contacts(mlp), pairs.contacts()
    for name in ('colliding', 'separation', 'normal', 'axis'):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name
    for name in ('point', 'volume', 'covariance'):
        assert np.array_equal(np.isnan(getattr(one, name)), np.isnan(getattr(other, name)))


# --- what holds whatever the network says ---------------------------------------------------------

SHIPPED = core_numbers(load_mlp().networks[NETWORK])
LEAST, MOST = np.array([-4.0], np.float32), np.array([4.0], np.float32)
"""Networks of no unit, which always choose the one bracket or the other."""


def garbage(kind: str) -> np.ndarray:
    """Return the numbers of a network that was not trained."""
    rng = np.random.default_rng(4)
    numbers = rng.normal(size=1 + 32 * (FEATURES + 2))
    factor = {'random': 1.0, 'large': 100.0, 'tiny': 1e-40}.get(kind)  # tiny: denormals
    if factor is None:  # as large as a loader believes
        return (1e4 * np.sign(numbers)).astype(np.float32)
    return (factor * numbers).astype(np.float32)


GARBAGE = {'least': LEAST, 'most': MOST,
           **{kind: garbage(kind) for kind in ('random', 'large', 'tiny', 'largest')}}
FE_UNDERFLOW = 0x10 if platform.machine() == 'x86_64' else 0x8
WORST = {'point': 3.0, 'volume': 100.0 * (BRACKET_LIMIT / (1.0 - BRACKET_LIMIT) + ROUNDING),
         'covariance': 45.0}
"""Largest errors of garbage [%]. That of the volume is proven, as the brackets hold the truth."""


@pytest.mark.parametrize('kind', GARBAGE)
def test_garbage_for_weights_stays_within_the_brackets(kind: str) -> None:
    """Volumes err by what the brackets allow; points are in both boxes, covariances definite."""
    for name in FAMILIES:
        pairs = drawn(name, N // 2)
        found, truth = with_numbers(pairs, GARBAGE[kind]), pairs.contacts()
        assert_sound(pairs, found)
        rows = truth.colliding
        with np.errstate(invalid='ignore', divide='ignore'):  # slivers have no width in the plane
            errors = contact_errors(rows_of(found, rows), rows_of(truth, rows), pairs.edge[rows])
        for quantity, most in WORST.items():
            assert getattr(errors, quantity).max() <= most, (name, quantity)


@pytest.mark.parametrize('name', FAMILIES)
def test_the_network_has_no_more_influence_than_the_brackets_leave_it(name: str) -> None:
    """None where the brackets meet: equal bits. Else, by Cauchy and Schwarz from the limits.

    |Δpoint|² ≤ BRACKET_LIMIT · SPREAD_LIMIT · trace, |Δvolume| as the brackets are apart.
    """
    pairs = drawn(name)
    least, most = with_numbers(pairs, LEAST), with_numbers(pairs, MOST)
    found = stages(*pairs, names=('colliding', 'volume', 'true_volume', 'upper_volume',
                                  'upper_least', 'upper_most'))
    rows = found.colliding
    scale = found.volume[rows] / found.true_volume[rows]
    apart = (found.upper_volume * (found.upper_most - found.upper_least)).sum(axis=1)[rows] * scale
    least, most = rows_of(least, rows), rows_of(most, rows)
    meet = apart == 0.0
    assert_same_bits(rows_of(least, meet), rows_of(most, meet))
    change = least.volume - most.volume
    assert np.all(change >= -ROUNDING * least.volume)
    assert np.all(change <= apart + ROUNDING * least.volume)
    point = np.linalg.norm(least.point - most.point, axis=1)
    bound = np.sqrt(BRACKET_LIMIT * SPREAD_LIMIT * trace(most.covariance))
    assert np.all(point <= bound * (1.0 + 2.0 * SPREAD_LIMIT))
    print(f'{name}: brackets meet {meet.mean():.3f}, point {(point / bound).max():.3f}')


def test_the_network_is_really_asked() -> None:
    """The tests above would prove nothing of a network whose answer is not used."""
    pairs = drawn('crossed bars')
    least, most = with_numbers(pairs, LEAST), with_numbers(pairs, MOST)
    assert (least.volume > (1.0 + 1e-4) * most.volume).mean() > 0.01


def test_weights_that_are_no_numbers_are_refused() -> None:
    """Behind the loader, which refuses them too."""
    numbers = SHIPPED.copy()
    numbers[0] = np.nan
    with pytest.raises(ValueError, match='weight that is not within'):
        with_numbers(drawn('containers', 8), numbers)


def test_contacts_are_sound(mlp: ContactSolver, pairs: Pairs) -> None:
    assert_sound(pairs, pairs.contacts(mlp))


@pytest.mark.parametrize('size_a, size_b', [((1e-9,) * 3, (1e-9,) * 3), ((1e9,) * 3, (1e9,) * 3),
                                            (UNIT, (1e-6,) * 3), ((1e-50,) * 3, (1e-50,) * 3),
                                            ((1e50,) * 3, (1e50,) * 3)])
def test_extreme_sizes(mlp: ContactSolver, size_a: tuple, size_b: tuple) -> None:
    """From the smallest to the largest that is accepted: nothing over- or underflows."""
    n = 64
    b = np.tile(poses.IDENTITY, (n, 1))
    b[:, 2] = (0.5 * (size_a[2] + size_b[2])
               - min(size_a[2], size_b[2]) * np.linspace(0.0, 0.2, n))
    b[:, :2] = 0.1 * size_b[0]
    pairs = Pairs(np.tile(poses.IDENTITY, (n, 1)), b, np.tile(size_a, (n, 1)),
                  np.tile(size_b, (n, 1)))
    found = pairs.contacts(mlp)
    assert found.colliding.all()
    covariance = found.covariance
    found = found._replace(covariance=covariance / trace(covariance)[:, None, None])
    assert_sound(pairs, found)


def test_boxes_that_stand_squarely_do_not_underflow(mlp: ContactSolver) -> None:
    """Where numbers of float32 underflow, the machine takes a hundred times as long for them."""
    libm = ctypes.CDLL(ctypes.util.find_library('m'))
    pairs = flush_stacks(np.random.default_rng(3), N)
    libm.feclearexcept(FE_UNDERFLOW)
    pairs.contacts(mlp)
    assert not libm.fetestexcept(FE_UNDERFLOW)
    assert np.multiply(np.float32(1e-30), np.float32(1e-12)) < 1e-40
    assert libm.fetestexcept(FE_UNDERFLOW)  # it would have been seen


# --- left to exact --------------------------------------------------------------------------------

SHARES = {'random cubes': 0.002, 'touching': 0.001, 'random sizes': 0.012, 'stacks': 0.012,
          'tilted stacks': 0.012, 'containers': 0.004, 'parcels': 0.001, 'crossed bars': 0.1,
          'overhang': 0.02, 'near flush': 0.001, 'landings': 0.001}
"""Largest share of a set that may be left to `exact`: about twice what was measured."""


def test_what_is_left_to_exact_is_exact_and_counted(pairs: Pairs) -> None:
    """Those rows have its bits. A batch counts what its single calls count, in any order."""
    left, exact = fallbacks(pairs), pairs.contacts()
    for order in (np.arange(len(left)), np.random.default_rng(1).permutation(len(left))):
        solver = ContactSolver(UNIT, UNIT)
        found = pairs.rows(order).contacts(solver)
        assert solver.fallbacks == left.sum()
        at = left[order]
        assert_same_bits(rows_of(found, at), rows_of(exact, order[at]))
    assert not left[~exact.colliding].any()


@pytest.mark.parametrize('name', ALL_SETS)
def test_few_are_left_to_exact(name: str) -> None:
    """A model that hands the hard half to `exact` has not been built."""
    solver = ContactSolver(UNIT, UNIT)
    pairs = drawn(name, 5 * N)
    pairs.contacts(solver)
    assert solver.fallbacks <= SHARES[name] * len(pairs.pose_a)


@pytest.mark.parametrize('b', [poses.IDENTITY, poses.IDENTITY + (0.1, 0, 0, 0, 0, 0, 0)])
def test_a_box_through_its_like_is_left_to_exact(b: np.ndarray) -> None:
    """Deeper than any contact; single calls count, too."""
    solver = ContactSolver(UNIT, (0.5, 0.5, 3.0))
    assert solver(poses.IDENTITY, b).colliding and solver.fallbacks == 1
    solver.batch([poses.IDENTITY] * 3, [b] * 3)
    assert solver.fallbacks == 4


# --- laws -----------------------------------------------------------------------------------------


def test_swap(mlp: ContactSolver, pairs: Pairs) -> None:
    """B against A: equal bits of all but the normal, by either model.

    Clipping and pressing depend on the face that wins a tie, A's or B's: there `exact` may differ.
    """
    other = Pairs(pairs.pose_b, pairs.pose_a, pairs.size_b, pairs.size_a)
    found = stages(*pairs, names=('certain', 'separation', 'size'))
    certain = found.certain & (found.separation < -DEPTH_FLOOR * found.size)
    left = fallbacks(pairs)
    assert np.array_equal(left, fallbacks(other))
    for solver, asked in ((mlp, ~left | certain), (None, certain)):
        one, two = (rows_of(found, asked)
                    for found in (pairs.contacts(solver), other.contacts(solver)))
        for name in ('colliding', 'separation', 'point', 'volume', 'covariance'):
            assert np.array_equal(getattr(one, name), getattr(two, name), equal_nan=True), name


def test_a_batch_is_its_single_calls(mlp: ContactSolver, pairs: Pairs) -> None:
    """Row i of a batch is the single call of row i, to the bit."""
    many = pairs.contacts(mlp)
    for i in range(0, len(pairs.pose_a), 7):
        one = native.PairSolver('mlp', tuple(pairs.size_a[i]), tuple(pairs.size_b[i]), SHIPPED)(
            pairs.pose_a[i], pairs.pose_b[i])
        assert_same_bits(one, Contacts(*(field[i] for field in many)), i)


@pytest.mark.parametrize('count', [1, 2, LANES - 1, LANES, LANES + 1, 2 * LANES, 4 * LANES + 2])
@pytest.mark.parametrize('first', [0, 5])
def test_a_row_does_not_know_its_neighbours(mlp: ContactSolver, count: int, first: int) -> None:
    """Vectors that are not full, and rows in other lanes: the same bits."""
    pairs = drawn('crossed bars', 200)  # of which some are left to `exact`
    some = slice(first, first + count)
    assert_same_bits(pairs.rows(some).contacts(mlp),
                     Contacts(*(field[some] for field in pairs.contacts(mlp))))


def test_rows_apart_refused_or_left_do_not_disturb_neighbours(mlp: ContactSolver) -> None:
    """Side by side, contacts between rows of all other kinds keep their bits.

    A refused row raises, and the next call is right again.
    """
    pairs = drawn('random sizes', 32)
    clean = pairs.contacts(mlp)
    mixed = Pairs(*(part.copy() for part in pairs))
    mixed.pose_b[1::4, :3] += 1e3                       # far apart
    mixed.size_a[2::4] = (1.0, 1e-3, 1.0)               # a card
    mixed.pose_b[3::8] = mixed.pose_a[3::8]             # one in the other
    found = mixed.contacts(mlp)
    assert_same_bits(*(Contacts(*(field[::4] for field in each)) for each in (found, clean)))
    assert not found.colliding[1::4].any() and np.isnan(found.point[1::4]).all()
    for bad in ((np.nan, 0, 0, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 0)):
        refused = Pairs(*(part.copy() for part in pairs))
        refused.pose_b[17] = bad
        with pytest.raises(ValueError, match=r'poses_b\[17\]'):
            refused.contacts(mlp)
        assert_same_bits(pairs.contacts(mlp), clean)


@pytest.mark.parametrize('power', [-30, 1, 30])
def test_scale_by_powers_of_two_is_exact(mlp: ContactSolver, pairs: Pairs, power: int) -> None:
    """Everything scaled by 2^k: point, volume and covariance scale to the bit."""
    factor = 2.0**power
    scaling = np.array([factor] * 3 + [1.0] * 4)
    scaled = Pairs(pairs.pose_a * scaling, pairs.pose_b * scaling, pairs.size_a * factor,
                   pairs.size_b * factor)
    one, two = pairs.contacts(mlp), scaled.contacts(mlp)
    assert np.array_equal(one.point * factor, two.point, equal_nan=True)
    assert np.array_equal(one.volume * factor**3, two.volume)
    assert np.array_equal(one.covariance * factor**2, two.covariance, equal_nan=True)


def test_minus_q_is_q(mlp: ContactSolver, pairs: Pairs) -> None:
    """To the bit."""
    minus = np.array([1, 1, 1, -1, -1, -1, -1.0])
    other = pairs._replace(pose_a=pairs.pose_a * minus, pose_b=pairs.pose_b * minus)
    assert_same_bits(pairs.contacts(mlp), other.contacts(mlp))


MOVED = {'point': (1e-4, 0.1), 'volume': (5e-3, WORST['volume']), 'covariance': (5e-3, 3.0)}
"""Differences after a motion [%], as poses and float32 round: of 99 rows in 100, and of a row that
changes over to `exact` or back."""


def assert_close(found: Contacts, wanted: Contacts, pairs: Pairs) -> None:
    """Check that all rows have the same contacts, up to MOVED."""
    errors = contact_errors(found, wanted, pairs.edge)
    for quantity, (usual, most) in MOVED.items():
        error = getattr(errors, quantity)
        assert np.percentile(error, 99) <= usual and error.max() <= most, quantity


def test_rigid_motion(mlp: ContactSolver, named_set: tuple[str, Pairs]) -> None:
    """Moved together, point and covariance move along, and the volume stays."""
    _, pairs = named_set
    rng = np.random.default_rng(3)
    n = len(pairs.pose_a)
    turn, shift = poses.unit_quaternions(rng, n), rng.uniform(-5, 5, (n, 3))
    moved = pairs._replace(pose_a=poses.moved(pairs.pose_a, shift, turn),
                           pose_b=poses.moved(pairs.pose_b, shift, turn))
    found, axes = pairs.contacts(mlp), rotation_matrix(turn)
    assert_close(moved.contacts(mlp), found._replace(
        point=poses.rotate(turn, found.point) + shift,
        covariance=axes @ found.covariance @ np.swapaxes(axes, 1, 2)), pairs)


def test_box_symmetries(mlp: ContactSolver, named_set: tuple[str, Pairs]) -> None:
    """A box's axes relabelled: a quarter turn about each of its axes, extents along."""
    _, pairs = named_set
    one = pairs.contacts(mlp)
    half = np.sqrt(0.5)
    for axis, order in (((half, 0, 0, half), (0, 2, 1)), ((0, half, 0, half), (2, 1, 0)),
                        ((0, 0, half, half), (1, 0, 2))):
        for pose, size in (('pose_a', 'size_a'), ('pose_b', 'size_b')):
            turned = getattr(pairs, pose).copy()
            turned[:, 3:] = poses.multiply(turned[:, 3:], np.tile(axis, (len(turned), 1)))
            other = pairs._replace(**{pose: turned, size: getattr(pairs, size)[:, order]})
            assert_close(other.contacts(mlp), one, pairs)


# --- errors and steps -----------------------------------------------------------------------------


@pytest.mark.parametrize('name', ALL_SETS)
def test_errors_are_within_the_limits(mlp: ContactSolver, name: str) -> None:
    """The 99th percentile, on pairs that nobody has trained on."""
    pairs = ALL_SETS[name](np.random.default_rng([20270101, list(ALL_SETS).index(name)]), 5 * N)
    errors = contact_errors(pairs.contacts(mlp), pairs.contacts(), pairs.edge)
    for quantity, found in errors._asdict().items():
        assert np.percentile(found, 99) <= limit_of(quantity, name), quantity


WORST_STEP = {'point': 0.1, 'volume': 1.0}
"""Largest steps at a vanishing change of pose [%]; that of the volume is proven."""


@pytest.mark.parametrize('name', ALL_SETS)
def test_steps_at_a_vanishing_change_of_pose(mlp: ContactSolver, name: str) -> None:
    """Where frame, winner, range or limits change over; from pairs that a climb finds steepest."""
    rng = np.random.default_rng(7)

    def error(pairs: Pairs) -> np.ndarray:
        found, truth = pairs.contacts(mlp), pairs.contacts()
        with np.errstate(invalid='ignore', divide='ignore'):
            return np.nan_to_num(np.where(truth.colliding, contact_errors(
                found, truth, pairs.edge).point, -1.0), nan=-1.0)

    start = worst_start(drawn(name), error, 60)
    pairs, _ = climb(rng, start, error, generations=20)
    for flat in (False, True):
        steps = largest_steps(mlp, drawn_paths(rng, pairs.rows(slice(30)), 0.02, flat))
        print(name, [f'{step.max():.2g}' for step in steps])
        for step, most in zip(steps, WORST_STEP.values()):
            assert step.max() <= most


# --- the network ----------------------------------------------------------------------------------


def test_the_compiled_network_is_the_shipped_file() -> None:
    """core/src/mlp/shipped_network.hpp has the numbers of weights/mlp.safetensors, to the bit."""
    header = Path(__file__).parents[2] / 'box_contact_ros/core/src/mlp/shipped_network.hpp'
    body = header.read_text('utf-8').partition('{\n')[2].partition('};')[0]
    numbers = np.array([float(text) for text in re.findall(r'([-\d.e]+)F', body)], np.float32)
    assert np.array_equal(numbers, SHIPPED)
    pairs = drawn('crossed bars', 200)
    assert_same_bits(pairs.contacts(ContactSolver(UNIT, UNIT)), with_numbers(pairs, SHIPPED))


def written(path: Path, widths: tuple[int, ...] = (FEATURES, 4, 1), name: str = NETWORK,
            **changes: Any) -> str:
    """Return a weights file with a network of zeros and a card that fits it, but for `changes`."""
    tensors = {f'{name}.{layer}.{part}': np.zeros(shape, np.float32)
               for layer, (inputs, outputs) in enumerate(zip(widths, widths[1:]))
               for part, shape in (('weight', (outputs, inputs)), ('bias', outputs))}
    card = {'format': NETWORK_FORMAT, 'activation': ACTIVATION, 'architecture': list(widths)}
    save_file(tensors, path, metadata={'card': json.dumps(card | changes)})
    return str(path)


def test_a_network_of_zeros_is_taken(tmp_path: Path) -> None:
    """It chooses the middle between the brackets."""
    pairs = drawn('crossed bars')
    found = pairs.contacts(ContactSolver(UNIT, UNIT, weights=written(tmp_path / 'zeros')))
    assert_same_bits(found, with_numbers(pairs, np.zeros(1, np.float32)))
    least, most = with_numbers(pairs, LEAST), with_numbers(pairs, MOST)
    both = found.volume != pairs.contacts().volume  # not left to `exact` by any
    np.testing.assert_allclose(found.volume[both], 0.5 * (least.volume + most.volume)[both],
                               rtol=1e-6)


@pytest.mark.parametrize('hidden', [(), (8, 8), (UNITS_MAX + 1,)])
def test_layers_that_the_core_does_not_have_are_refused(tmp_path: Path, hidden: tuple) -> None:
    """None or two hidden layers, or too many units."""
    weights = written(tmp_path / 'other', (FEATURES, *hidden, 1))
    with pytest.raises(WeightsError, match=f'one hidden layer, of at most {UNITS_MAX} units'):
        ContactSolver(UNIT, UNIT, weights=weights)


@pytest.mark.parametrize('change, words', [
    ({'format': NETWORK_FORMAT - 1}, f'has format 2; this version reads {NETWORK_FORMAT}'),
    ({'format': '3'}, "has format '3'"), ({'format': True}, 'has format True'),
    ({'format': None}, 'has format None'),
    ({'activation': 'softsign'}, "units are 'relu', not 'softsign'"),
    ({'activation': None}, "units are 'relu', not None"),
    ({'name': 'point'}, f"no network 'share' with {FEATURES} inputs and 1 outputs"),
    ({'widths': (FEATURES + 1, 4, 1)}, f'with {FEATURES} inputs and 1 outputs'),
    ({'widths': (FEATURES, 4, 2)}, f'with {FEATURES} inputs and 1 outputs')])
def test_weights_with_another_meaning_are_refused(
        tmp_path: Path, change: dict[str, Any], words: str) -> None:
    """They would be taken without complaint, and answer nonsense."""
    with pytest.raises(WeightsError, match=words):
        ContactSolver(UNIT, UNIT, weights=written(tmp_path / 'other', **change))
