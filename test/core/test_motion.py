# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Time of impact and least distance: closed forms, samples of the way, laws, refusals, bits."""
from __future__ import annotations

import itertools
import math
import os
import subprocess
import sys

import numpy as np
import poses
import pytest

from box_contact_ros import Approach, Approaches, ContactSolver, Sweep
from box_contact_ros.core import instruction_sets

motions = pytest.importorskip('benchmarks.motions')

TOLERANCE = 1e-6
LEAST_SHARE = 64 * 2.0**-52
"""Of the largest coordinate: the least tolerance."""
IDENTITY = (0.0, 0.0, 0.0, 1.0)
UNIT = (1.0, 1.0, 1.0)
FIELDS = ('colliding', 'distance', 'normal', 'point_a', 'point_b')
every_kind = pytest.mark.parametrize('kind', motions.KINDS)


def at(*place, turn=IDENTITY):
    return np.array([*place, *turn], float)


def about(axis, angle):
    return (*(math.sin(angle / 2) * np.array(axis, float)), math.cos(angle / 2))


def ask(found, name='time_of_impact', rows=slice(None), **options):
    """Return the approaches of motions with one clearance, 0 unless it is given."""
    found = found.rows(rows)
    return getattr(ContactSolver(), f'{name}_batch')(
        *found.sweeps(), size_a=found.size_a, size_b=found.size_b, **options)


def nearest_at(found, s):
    """Return the distances at times s (n,)."""
    return ContactSolver().distance_batch(
        poses.on_the_way(found.start_a, found.end_a, found.centre_a, s),
        poses.on_the_way(found.start_b, found.end_b, found.centre_b, s), size_a=found.size_a,
        size_b=found.size_b)


def least_tolerance(found):
    """Return a tolerance that all motions accept, and the report's."""
    reach = max(np.abs(part[:, :3]).max() for part in found[:4])
    return max(TOLERANCE, 16 * LEAST_SHARE * reach)


# --- closed forms ---------------------------------------------------------------------------------


def test_a_box_falls_onto_a_floor():
    """From 10 m to −10 m, a cube of 1 m above a plate whose top is at 0: at (10 − .5) / 20."""
    solver = ContactSolver(UNIT, (4, 4, 2))
    hit = solver.time_of_impact(Sweep(at(0, 0, 10), at(0, 0, -10)),
                                Sweep(at(0, 0, -1), at(0, 0, -1)))
    assert isinstance(hit, Approach) and hit.time <= 0.475
    assert hit.time == pytest.approx(0.475, abs=TOLERANCE / 20)
    assert hit.closing_speed == pytest.approx(20.0)
    assert 0.0 <= hit.nearest.distance <= TOLERANCE
    assert hit.nearest.normal == pytest.approx([0, 0, -1])
    assert hit.nearest.point_b == pytest.approx([0, 0, 0])


def test_a_bullet_is_not_through_a_plate():
    """Both poses are free; a cube of .04 m meets a plate of .04 m before half of the way."""
    solver = ContactSolver((0.04,) * 3, (4, 4, 0.04))
    bullet = Sweep(at(2, 2, 5), at(2, 2, -5))
    hit = solver.time_of_impact(bullet, Sweep(at(2, 2, 0), at(2, 2, 0)))
    assert hit.time == pytest.approx(0.496, abs=1e-7) and hit.time <= 0.496
    upper = solver.time_of_impact(bullet, Sweep(at(2, 2, 0.02 - 0.03), at(2, 2, -0.01)))
    assert upper.time == pytest.approx(0.497, abs=1e-7) and upper.time <= 0.497


def test_a_bar_turns_onto_an_edge():
    """A bar of half length 2 turns down about its middle, onto the upper edge of a wall behind."""
    solver = ContactSolver((4.0, 0.2, 0.2), (0.2, 1.0, 1.0))
    edge, wall = np.array([1.7, -1.0]), at(1.6, 0, -1.5)
    turning = Sweep(at(0, 0, 0), at(0, 0, 0, turn=about((0, 1, 0), 1.0)))
    hit = solver.time_of_impact(turning, Sweep(wall, wall))
    # The lower face is 0.1 below the axis of the turn.
    angle = math.atan2(-edge[1], edge[0]) - math.asin(0.1 / np.hypot(*edge))
    assert hit.time <= angle and hit.time == pytest.approx(angle, abs=1e-6)
    assert hit.nearest.point_b[[0, 2]] == pytest.approx(edge, abs=1e-6)


@pytest.mark.parametrize('gap', [1e-9, 1e-3])
def test_a_corner_that_turns_by_touches_or_not(gap):
    """A square turns over a floor: its corner comes to √½ of its edge, half way."""
    solver = ContactSolver(UNIT, (4, 4, 1))
    turning = Sweep(at(0, 0, 0), at(0, 0, 0, turn=about((0, 1, 0), math.pi / 2)))
    touch = math.sqrt(0.5) + 0.5
    floor = at(0, 0, -touch - gap)
    low = solver.least_distance(turning, Sweep(floor, floor), tolerance=1e-10)
    assert low.time == pytest.approx(0.5, abs=1e-4)
    assert low.nearest.distance == pytest.approx(gap, abs=1e-10)
    assert math.isnan(solver.time_of_impact(turning, Sweep(floor, floor), tolerance=1e-10).time)
    floor = at(0, 0, -touch + gap)
    first = solver.time_of_impact(turning, Sweep(floor, floor), tolerance=1e-10)
    # √½ cos(θ) = √½ − gap, θ before half of the turn.
    assert first.time == pytest.approx(0.5 - math.acos(1 - gap / math.sqrt(0.5)) / (math.pi / 2),
                                       abs=1e-5)


def test_a_box_of_a_body_goes_on_an_arc():
    """Its centre of turning stays, and its own centre circles it: it meets a wall at an angle."""
    solver = ContactSolver((0.2, 0.2, 0.2), (0.2, 10, 10))
    centre = np.array([-3.0, 0.0, 0.0])
    end = np.r_[-3.0 + 3.0 * math.cos(1.0), 3.0 * math.sin(1.0), 0.0, about((0, 0, 1), 1.0)]
    arc = Sweep(at(0, 0, 0), end, centre)
    wall = at(0.5, 0, 0)
    free = solver.least_distance(arc, Sweep(wall, wall))
    assert free.nearest.distance <= 0.3 + TOLERANCE
    # The chord is straight without a centre.
    straight = solver.time_of_impact(
        Sweep(at(0, 0, 0), end), Sweep(at(-0.8, 1.9, 0), at(-0.8, 1.9, 0)))
    assert not math.isnan(straight.time)
    behind = at(-3.2, 0, 0)  # the wall cuts the circle of 3 m only beyond the half turn
    assert math.isnan(solver.time_of_impact(arc, Sweep(behind, behind)).time)


def test_a_clearance_and_the_start():
    """Within the clearance at the start is time 0; NaN is never."""
    solver = ContactSolver(UNIT, UNIT)
    ways = Sweep(at(0, 0, 3), at(0, 0, 1.5)), Sweep(at(0, 0, 0), at(0, 0, 0))
    assert math.isnan(solver.time_of_impact(*ways).time)
    hit = solver.time_of_impact(*ways, clearance=1.0)
    assert hit.time == pytest.approx(2 / 3, abs=1e-6) and hit.time <= 2 / 3
    assert solver.time_of_impact(*ways, clearance=2.0).time == 0.0
    never = solver.time_of_impact(*ways, clearance=0.5 - 2e-6)
    assert math.isnan(never.closing_speed) and math.isnan(never.nearest.distance)
    assert not never.nearest.colliding
    away = solver.time_of_impact(Sweep(at(0, 0, 1), at(0, 0, 2)), Sweep(at(0, 0, 0), at(0, 0, 0)))
    assert away.time == 0.0 and away.closing_speed == pytest.approx(-1.0)
    low = solver.least_distance(*ways)
    assert low.time == 1.0 and low.nearest.distance == pytest.approx(0.5)
    still = solver.least_distance(Sweep(at(0, 0, 3), at(0, 0, 3)), ways[1])
    assert still.nearest.distance == 2.0 and still.closing_speed == 0.0


# --- samples of the way ---------------------------------------------------------------------------


@every_kind
def test_it_is_neither_late_nor_early(kind):
    """Against 1,000 poses of the way, and the pose at the time itself."""
    drawn = motions.draw(kind, 3, 40)
    tolerance = least_tolerance(drawn)
    for row in range(40):
        one = drawn.rows(slice(row, row + 1))
        hit = ask(one, clearance=float(one.clearance[0]), tolerance=tolerance)
        low = ask(one, 'least_distance', tolerance=tolerance)
        end = 1.0 if math.isnan(hit.time[0]) else hit.time[0]
        times = np.linspace(0.0, 1.0, 1001)
        near = nearest_at(motions.Motions(*(np.repeat(part, 1001, axis=0) for part in one)), times)
        before = times < end - 1e-12
        assert not near.colliding[before].any()
        assert (near.distance[before] > one.clearance[0]).all()
        if not math.isnan(hit.time[0]):
            there = nearest_at(one, hit.time)[0]
            rounding = LEAST_SHARE * 1e-1 * max(1.0, np.abs(one.start_a[0, :3]).max())
            assert there.distance <= one.clearance[0] + tolerance + rounding
            assert hit.nearest.distance[0] <= one.clearance[0] + tolerance
        assert (low.nearest.distance[0] <= near.distance + tolerance).all()


@every_kind
def test_no_answer_is_late(kind):
    """Of 300 motions, 200 poses before the time that is answered, half of them close to it."""
    drawn = motions.draw(kind, 0, 300)
    tolerance = least_tolerance(drawn)
    ends = np.array([ask(drawn, rows=slice(row, row + 1), tolerance=tolerance,
                         clearance=float(drawn.clearance[row])).time[0] for row in range(300)])
    ends = np.where(np.isnan(ends), 1.0, ends)
    shares = np.concatenate((1.0 - np.geomspace(1e-9, 1.0, 100, endpoint=False),
                             np.linspace(0.0, 1.0, 100, endpoint=False)))
    times = np.outer(ends, shares)
    every = motions.Motions(*(np.repeat(part, 200, axis=0) for part in drawn))
    near = nearest_at(every, times.ravel()).distance.reshape(300, 200)
    before = times < ends[:, None] - 1e-12
    assert before.sum() > 20_000 or kind in ('no motion', 'equal motions')
    assert (near > drawn.clearance[:, None])[before].all()


@every_kind
def test_the_least_distance_is_that_of_its_time(kind):
    drawn = motions.draw(kind, 4, 200)
    low = ask(drawn, 'least_distance', tolerance=least_tolerance(drawn))
    there = nearest_at(drawn, low.time)
    scale = np.abs(drawn.start_a[:, :3]).max(axis=1) + 1e3
    assert np.allclose(there.distance, low.nearest.distance, rtol=0, atol=1e-14 * scale.max())
    inner = (low.time > 0.0) & (low.time < 1.0) & (low.nearest.distance > 1e-3)
    assert (np.abs(low.closing_speed[inner]) < 50.0).all()


# --- laws -----------------------------------------------------------------------------------------


def agree(found, one, other, tolerance, clearance=None):
    """Assert that verdicts agree, unless the least distance is two tolerances from a clearance."""
    least = ask(found, 'least_distance', tolerance=tolerance).nearest.distance
    clear = np.abs(least - (found.clearance if clearance is None else clearance)) > 2.5 * tolerance
    assert np.array_equal(np.isnan(one)[clear], np.isnan(other)[clear])
    assert clear.mean() > 0.3


def times(found, tolerance):
    """Return the times of impact (n,), each with its own clearance."""
    return np.array([ask(found, rows=slice(row, row + 1), clearance=float(found.clearance[row]),
                         tolerance=tolerance).time[0] for row in range(len(found.clearance))])


LAWFUL = ['both turning', 'plates and bullets', 'containers that swing', 'boxes of bodies',
          'grazing the clearance', 'sizes 1:1,000']
lawful = pytest.mark.parametrize('kind', LAWFUL)


@lawful
def test_a_swap_changes_nothing_but_sides(kind):
    drawn = motions.draw(kind, 5, 300)
    other = motions.Motions(drawn.start_b, drawn.end_b, drawn.start_a, drawn.end_a, drawn.size_b,
                            drawn.size_a, drawn.centre_b, drawn.centre_a, drawn.clearance)
    agree(drawn, times(drawn, TOLERANCE), times(other, TOLERANCE), TOLERANCE)
    low, swapped = (ask(one, 'least_distance') for one in (drawn, other))
    assert np.allclose(low.nearest.distance, swapped.nearest.distance, rtol=0, atol=2e-6)


@lawful
def test_a_common_rigid_motion_changes_nothing(kind):
    rng = np.random.default_rng(6)
    drawn = motions.draw(kind, 6, 300)
    shift, turn = rng.normal(size=3), np.tile(poses.unit_quaternions(rng, 1), (300, 1))
    other = drawn._replace(**{name: poses.moved(getattr(drawn, name), shift, turn)
                              for name in motions.Motions._fields[:4]})
    agree(drawn, times(drawn, TOLERANCE), times(other, TOLERANCE), TOLERANCE)
    low, moved = (ask(one, 'least_distance') for one in (drawn, other))
    assert np.allclose(low.nearest.distance, moved.nearest.distance, rtol=0, atol=2e-6)


@lawful
def test_a_way_that_is_cut_in_two_is_the_same_way(kind):
    """Wherever it is cut: the first time is that of the first part, or else of the second."""
    rng = np.random.default_rng(7)
    drawn = motions.draw(kind, 7, 300)
    cut = rng.uniform(0.0, 1.0, 300)
    middle_a = poses.on_the_way(drawn.start_a, drawn.end_a, drawn.centre_a, cut)
    middle_b = poses.on_the_way(drawn.start_b, drawn.end_b, drawn.centre_b, cut)
    parts = (drawn._replace(end_a=middle_a, end_b=middle_b),
             drawn._replace(start_a=middle_a, start_b=middle_b))
    whole = times(drawn, TOLERANCE)
    first, second = (times(part, TOLERANCE) for part in parts)
    joined = np.where(np.isnan(first), cut + (1.0 - cut) * second, cut * first)
    agree(drawn, whole, joined, TOLERANCE)
    least = [ask(part, 'least_distance').nearest.distance for part in parts]
    assert np.allclose(np.minimum(*least), ask(drawn, 'least_distance').nearest.distance,
                       rtol=0, atol=2e-6)


@lawful
def test_the_way_back_has_the_same_least_distance(kind):
    drawn = motions.draw(kind, 8, 300)
    back = drawn._replace(start_a=drawn.end_a, end_a=drawn.start_a, start_b=drawn.end_b,
                          end_b=drawn.start_b)
    low, other = (ask(one, 'least_distance').nearest.distance for one in (drawn, back))
    assert np.allclose(low, other, rtol=0, atol=2e-6)


def test_a_quaternion_and_its_negative_are_one_orientation():
    drawn = motions.draw('both turning', 9, 100)
    signs = np.where(np.random.default_rng(9).random((100, 4)) < 0.5, -1.0, 1.0)
    turned = {name: getattr(drawn, name).copy() for name in motions.Motions._fields[:4]}
    for k, part in enumerate(turned.values()):
        part[:, 3:] *= 3.0**k * signs[:, k, None]
    assert np.allclose(ask(drawn).time, ask(drawn._replace(**turned)).time, rtol=0, atol=1e-6,
                       equal_nan=True)


# --- tolerances -----------------------------------------------------------------------------------


@pytest.mark.parametrize('kind', ['grazing', 'grazing the clearance', 'edges nearly parallel',
                                  'slides at the clearance', 'grazing, UTM', 'no motion'])
def test_the_least_tolerance_is_kept(kind):
    """What the refusal names is accepted, and found to."""
    drawn = motions.draw(kind, 10, 60)
    for row in range(60):
        one = drawn.rows(slice(row, row + 1))
        with pytest.raises(ValueError, match=r'^row 0: tolerance 1e-20 is below \S+ m') as refusal:
            ask(one, tolerance=1e-20)
        least = float(str(refusal.value).split('below ')[1].split(' m')[0])
        scale = max(np.abs(part[:, :3]).max() for part in one[:4]) + one.size_a.max()
        assert 0.3 * LEAST_SHARE * scale < least < 20 * LEAST_SHARE * scale
        with pytest.raises(ValueError, match='tolerance'):
            ask(one, tolerance=least * 0.98)
        hit = ask(one, clearance=float(one.clearance[0]), tolerance=least)
        low = ask(one, 'least_distance', tolerance=least)
        assert math.isnan(hit.time[0]) or hit.nearest.distance[0] <= one.clearance[0] + least
        coarse = ask(one, 'least_distance', tolerance=TOLERANCE)
        assert low.nearest.distance[0] <= coarse.nearest.distance[0] + least


# --- refusals -------------------------------------------------------------------------------------

WAYS = (at(0, 0, 3), at(0, 0, 1), at(0, 0, 0), at(0, 0, 0))
NAMES = ('start_a', 'end_a', 'start_b', 'end_b', 'centre_a', 'centre_b')
REFUSED = {
    'a turn by 180 degrees': ({'end_a': at(0, 0, 1, turn=(0, 0, 1, 0))},
                              'the turn from start_a to end_a by 180 degrees has two ways: give a '
                              'pose between'),
    'nearly': ({'end_b': at(0, 0, 0, turn=(1, 0, 0, 5e-10))}, 'the turn from start_b to end_b by'),
    'clearance below 0': ({'clearance': -1e-9}, 'clearance must be within 0 and 1e50 m, not -1e-'),
    'clearance NaN': ({'clearance': math.nan}, 'clearance must be within 0 and 1e50 m, not nan'),
    'tolerance 0': ({'tolerance': 0}, 'tolerance must be above 0, and at most 1e50 m, not 0'),
    'a fine tolerance': ({'tolerance': 1e-16}, 'tolerance 1e-16 is below'),
    'a word': ({'tolerance': 'fine'}, "tolerance must be a number, not 'fine'"),
    'a bad start': ({'start_b': at(0, math.inf, 0)}, 'start_b position .0, inf, 0. is not finite'),
    'a bad end': ({'end_a': at(0, 0, 0, turn=(0, 0, 0, 0))}, 'end_a quaternion .0, 0, 0, 0. has'),
    'no pose': ({'end_b': (0, 0, 0)}, 'end_b must be'),
    'a bad centre': ({'centre_b': (0, math.nan, 0)}, 'centre_b .0, nan, 0. is not finite'),
    'no centre': ({'centre_a': (0, 0)}, r'centre_a must be centres \(3,\)')}
BY_ROW = ('a turn by 180 degrees', 'nearly', 'a fine tolerance', 'a bad start', 'a bad end',
          'a bad centre')


def sweeps(parts):
    """Return the sweeps of A and B, by the names of their parts."""
    return [Sweep(*(parts[f'{part}_{side}'] for part in ('start', 'end', 'centre')))
            for side in 'ab']


@pytest.mark.parametrize('name', REFUSED)
def test_what_is_refused(name):
    """The same words for one pair and, with the row, for a batch of two."""
    changed, words = REFUSED[name]
    usual = dict(zip(NAMES, (*WAYS, (0, 0, 0), (0, 0, 0))))
    parts = {name: changed.get(name, part) for name, part in usual.items()}
    rest = {name: value for name, value in changed.items() if name not in NAMES}
    solver = ContactSolver(UNIT, UNIT)
    calls = [solver.time_of_impact, *(() if 'clearance' in changed else (solver.least_distance,))]
    for call in calls:
        with pytest.raises(ValueError, match=f'^{words}'):
            call(*sweeps(parts), **rest)
    if name in BY_ROW:
        rows = {name: [part, parts[name]] for name, part in usual.items()}
        with pytest.raises(ValueError, match=f'^row {int(name != "a fine tolerance")}: {words}'):
            solver.time_of_impact_batch(*sweeps(rows), **rest)


def test_arguments_that_do_not_go_together():
    solver, rows = ContactSolver(), np.tile(at(0, 0, 0), (3, 1))
    still, cut = Sweep(rows, rows), Sweep(rows, rows[:2])
    pairs, one = [(0, 1)], 'one Sweep.*not'
    two = r'motions are two sweeps, Sweep\(start_a, end_a\), '
    for arguments, options, words in (
            ((still,), {'size_a': UNIT, 'size_b': UNIT}, f'{two}.*not Sweep.*, None'),
            ((rows, rows, rows, rows), {'size_a': UNIT, 'size_b': UNIT}, f'{two}.*not four poses'),
            ((still, still), {'sizes': UNIT, 'pairs': pairs}, one),
            ((rows, rows), {'sizes': UNIT, 'pairs': pairs}, one),
            ((still,), {'sizes': UNIT, 'pairs': pairs, 'size_a': UNIT}, 'pairs are places'),
            ((cut, still), {'size_a': UNIT, 'size_b': UNIT}, 'ends_a and starts_b and ends_b must'),
            ((cut,), {'sizes': UNIT, 'pairs': pairs}, 'starts and ends must be equally many'),
            ((still,), {'sizes': UNIT, 'pairs': [(0, 3)]}, r'pairs\[0\] is \(0, 3\)'),
            ((still,), {'sizes': UNIT, 'pairs': pairs, 'threads': 0}, 'threads must be')):
        with pytest.raises(ValueError, match=words):
            solver.time_of_impact_batch(*arguments, **options)
    with pytest.raises(ValueError, match='size_a is missing'):
        solver.least_distance(Sweep(*WAYS[:2]), Sweep(*WAYS[2:]))
    for call in (solver.time_of_impact, solver.least_distance):
        with pytest.raises(ValueError, match=two):
            call(*WAYS)
        with pytest.raises(ValueError, match=two):
            call(**dict(zip(NAMES, WAYS)))


# --- bits -----------------------------------------------------------------------------------------


def assert_same_approaches(one, other, rows=slice(None)):
    for name in ('time', 'closing_speed'):
        assert getattr(one, name)[rows].tobytes() == getattr(other, name).tobytes(), name
    for name in FIELDS:
        assert getattr(one.nearest, name)[rows].tobytes() == getattr(other.nearest, name).tobytes()


def of_all_kinds(n):
    parts = [motions.draw(kind, 11, n) for kind in motions.KINDS if 'UTM' not in kind]
    return motions.Motions(*(np.concatenate(column) for column in zip(*parts)))


@pytest.mark.parametrize('name', ['time_of_impact', 'least_distance'])
def test_a_batch_is_its_single_calls(name):
    """In arrays and lists, by rows and by places, and with threads."""
    drawn = of_all_kinds(40)
    many = ask(drawn, name)
    assert isinstance(many, Approaches) and len(many) == len(drawn.clearance)
    for row in range(0, len(many), 7):
        solver = ContactSolver(drawn.size_a[row], drawn.size_b[row])
        parts = {part: getattr(drawn, part)[row] for part in NAMES}
        plain = getattr(solver, name)(*sweeps(parts))
        listed = getattr(solver, name)(*sweeps({
            part: list(map(np.longdouble, value)) for part, value in parts.items()}))
        for one, other in itertools.product((plain, listed), (many[row],)):
            assert np.array_equal([one.time, one.closing_speed], [other.time, other.closing_speed],
                                  equal_nan=True)
            for field in FIELDS:
                assert np.array_equal(getattr(one.nearest, field), getattr(other.nearest, field),
                                      equal_nan=True)
    n = len(many)
    joined = [np.concatenate(parts) for parts in (
        (drawn.start_a, drawn.start_b), (drawn.end_a, drawn.end_b), (drawn.size_a, drawn.size_b),
        (drawn.centre_a, drawn.centre_b))]
    order = np.random.default_rng(0).permutation(n)
    by_place = getattr(ContactSolver(), f'{name}_batch')(
        Sweep(joined[0], joined[1], joined[3]), sizes=joined[2], threads=3,
        pairs=np.column_stack([order, order + n]))
    assert_same_approaches(many, by_place, order)


SHOW = """
import numpy as np
from test_motion import ask, of_all_kinds
from box_contact_ros.core import native
drawn = of_all_kinds(15)
print(native.kernel)
for name in ('time_of_impact', 'least_distance'):
    found = ask(drawn, name)
    print(found.time.tobytes().hex(), found.closing_speed.tobytes().hex())
"""


@pytest.mark.skipif(len(instruction_sets()) < 2, reason='one instruction set')
def test_bits_are_those_of_every_instruction_set():
    answers = {}
    for name in instruction_sets():
        done = subprocess.run([sys.executable, '-c', SHOW], capture_output=True, text=True,
                              check=True, env={**os.environ, 'BOX_CONTACT_INSTRUCTION_SET': name,
                                               'PYTHONPATH': os.pathsep.join(sys.path)})
        shown, *answers[name] = done.stdout.split('\n')
        assert shown == name
    assert len({tuple(found) for found in answers.values()}) == 1


def test_answers_are_plain_values():
    solver = ContactSolver(UNIT, UNIT)
    hit = solver.time_of_impact(Sweep(*WAYS[:2]), Sweep(*WAYS[2:]))
    assert repr(hit).startswith('Approach(time=') and isinstance(hit.time, float)
    with pytest.raises(AttributeError):
        hit.time = 0.0
    way_a, *others = ([way] * 3 for way in WAYS)
    many = solver.time_of_impact_batch(Sweep(way_a, others[0]), Sweep(*others[1:]))
    assert len(many[1:]) == 2 and many[np.array([True, False, False])].time[0] == hit.time
    none = Sweep(*np.zeros((2, 0, 7)))
    assert len(solver.time_of_impact_batch(none, none)) == 0
