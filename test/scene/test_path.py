# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""check_path: brute force on random yards, lifts and landings, laws, absent boxes, refusals."""
from __future__ import annotations

import time

import numpy as np
import poses
import pytest

from box_contact_ros import Box, ContactSolver, Frame, Pair, PathCheck, Scene, SceneSolver, Sweep

TOLERANCE = 1e-6
LOOKS = 50
"""Times at which brute force looks for where a pair parts, on a segment."""
UNIT = (1.0, 1.0, 1.0)


def at(*place, turn=(0.0, 0.0, 0.0, 1.0)):
    return [*map(float, place), *turn]


def yaw(angle):
    return 0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)


# --- brute force ----------------------------------------------------------------------------------


class Wanted:
    """What all pairs of a scene do on a path: each of them on each of its segments."""

    def __init__(self, scene, path, clearance):
        """Take poses (m, n, 7) of `scene.moving`."""
        self.scene, self.path, self.clearance = scene, np.asarray(path), clearance
        self.first, self.least, self.at_start = {}, {}, set()
        index, ways = scene.index_of, [self.way(box) for box in range(len(scene.names))]
        self.pairs = [(index[pair.a], index[pair.b]) for pair in scene.every_pair()]
        self.pairs = [pair for pair in self.pairs
                      if not any(np.isnan(ways[box][0]).any() for box in pair)]
        held = self.judge(self.pairs, ways)
        for pair in held:
            self.judge_lift(pair, *(ways[box] for box in pair))
            self.judge_depth(pair, *(ways[box] for box in pair))

    def way(self, box):
        """Return the poses (m, 7) of a box, and its centre of turning (3,)."""
        names, body = self.scene.moving, self.scene.boxes[self.scene.names[box]].body
        mover = body or self.scene.names[box]
        part = self.scene.bodies[mover] if body else self.scene.boxes[mover]
        own = np.array(self.scene.boxes[self.scene.names[box]].pose if body else at(0, 0, 0))
        base = (np.broadcast_to(part.pose, (len(self.path), 7)) if part.pose is not None else
                self.path[:, names.index(mover)])
        turn = base[:, 3:] / np.linalg.norm(base[:, 3:], axis=1)[:, None]
        own[3:] /= np.linalg.norm(own[3:])
        inverse = own[3:] * [-1, -1, -1, 1]
        return (np.hstack((base[:, :3] + poses.rotate(turn, np.tile(own[:3], (len(turn), 1))),
                           poses.multiply(turn, np.tile(own[3:], (len(turn), 1))))),
                poses.rotate(inverse[None], -own[None, :3])[0])

    def judge(self, pairs, ways):
        """Set the first times and least distances of pairs; return those that begin within it."""
        segments = len(self.path) - 1
        a, b = ([np.concatenate([part(ways[pair[side]]) for pair in pairs]) for part in (
            lambda way: way[0][:-1], lambda way: way[0][1:],
            lambda way: np.tile(way[1], (segments, 1)))] for side in (0, 1))
        sizes = [np.repeat(self.scene.sizes[[pair[side] for pair in pairs]], segments, axis=0)
                 for side in (0, 1)]
        sweeps, asked = (Sweep(*a), Sweep(*b)), {'size_a': sizes[0], 'size_b': sizes[1]}
        solver = ContactSolver()
        first = solver.time_of_impact_batch(*sweeps, clearance=self.clearance, **asked)
        least = solver.least_distance_batch(*sweeps, **asked)
        begin = solver.distance_batch(a[0], b[0], size_a=sizes[0], size_b=sizes[1])
        for row, pair in enumerate(pairs):
            rows = slice(row * segments, (row + 1) * segments)
            if begin.distance[rows][0] <= self.clearance + TOLERANCE:
                self.at_start.add(pair)
                continue
            self.least[pair] = least.nearest.distance[rows].min()
            for k in np.flatnonzero(np.isfinite(first.time[rows]))[:1]:
                self.first[pair] = (k + first.time[rows][k], first.closing_speed[rows][k])
        return self.at_start

    def judge_lift(self, pair, a, b):
        """Set the first time of a pair that begins within the clearance."""
        solver, segments = ContactSolver(*self.scene.sizes[list(pair)]), len(self.path) - 1
        shares = np.tile(np.arange(1, LOOKS + 1) / LOOKS, segments)
        rows = np.repeat(np.arange(segments), LOOKS)
        seen = [poses.on_the_way(way[rows], way[rows + 1], np.tile(centre, (len(rows), 1)), shares)
                for way, centre in (a, b)]
        apart = solver.distance_batch(*seen).distance > self.clearance + 2 * TOLERANCE
        if not apart.any():
            return
        row = int(np.argmax(apart))
        for k in range(rows[row], segments):
            share = shares[row] if k == rows[row] else 0.0
            (start_a, end_a), (start_b, end_b) = (
                (place[row] if share else way[k], way[k + 1])
                for (way, _), place in zip((a, b), seen))
            impact = solver.time_of_impact(Sweep(start_a, end_a, a[1]), Sweep(start_b, end_b, b[1]),
                                           clearance=self.clearance)
            if np.isfinite(impact.time) and share < 1.0:
                self.first[pair] = (k + share + (1 - share) * impact.time,
                                    impact.closing_speed / (1 - share))
                return

    def judge_depth(self, pair, a, b):
        """Set the time at which such a pair gets 0.1 mm deeper than it was, if that is the first.

        Smaller boxes then touch. Where these touch from the start, no depth is judged.
        """
        sizes = self.scene.sizes[list(pair)]
        depth = max(0.0, -ContactSolver(*sizes)(a[0][0], b[0][0]).separation)
        solver = ContactSolver(*np.maximum(sizes - depth - 1e-4, 1e-3 * sizes))
        for k in range(len(self.path) - 1):
            impact = solver.time_of_impact(*(Sweep(way[k], way[k + 1], centre)
                                             for way, centre in (a, b)))
            if k + impact.time == 0.0:
                return
            if np.isfinite(impact.time):
                self.first[pair] = min(self.first.get(pair, (np.inf, 0.0)),
                                       (k + impact.time, impact.closing_speed))
                return

    def assert_is(self, answer):
        """Hold an answer against it; a time may differ by what the tolerance allows."""
        assert {tuple(pair) for pair in answer.at_start.tolist()} == self.at_start
        found = dict(zip(map(tuple, answer.pairs.tolist()), answer.impacts))
        assert len(found) == len(answer.pairs) and list(answer.impacts.time) == sorted(
            answer.impacts.time)
        for pair in self.first.keys() ^ found.keys():  # it grazes the clearance
            assert abs(self.least[pair] - self.clearance) <= 2 * TOLERANCE
        for pair in self.first.keys() & found.keys():
            impact, (when, speed) = found[pair], self.first[pair]
            assert abs(impact.time - when) <= 1e-9 + 4 * TOLERANCE / max(speed, 1e-3), pair
            assert impact.nearest.distance <= self.clearance + TOLERANCE
        if self.least:
            least = min(self.least.values())
            assert abs(answer.least.nearest.distance - least) <= TOLERANCE
            assert self.least[tuple(answer.least_pair.tolist())] <= least + 2 * TOLERANCE
        else:
            assert answer.least is None and answer.least_pair is None


def random_yard(seed):
    """Return a scene and a path (m, n, 7): a load is lifted from a stack, and guests go about.

    Boxes stand in stacks, some of them turned. A spreader is on the load, a body of three boxes and
    a loose box go their own ways.
    """
    rng = np.random.default_rng(seed)
    size, boxes = rng.uniform(0.5, 2.0, 3), {}
    heights = rng.integers(1, 4, 9)
    for stack, height in enumerate(heights):
        x, y = 1.3 * size[:2] * np.divmod(stack, 3)
        for tier in range(height):
            turn = yaw(rng.choice([0.0, 0.0, 0.3]))
            boxes[f'stack{stack}_{tier}'] = Box(size, at(x, y, (tier + 0.5) * size[2], turn=turn))
    boxes['load'], boxes['spreader'] = Box(size), Box((*(0.9 * size[:2]), 0.2))
    for part in range(3):
        boxes[f'part{part}'] = Box(rng.uniform(0.2, 0.6, 3), (*rng.uniform(-0.5, 0.5, 3),
                                                            *rng.normal(size=4)), body='crane')
    boxes['wall'] = Box((0.2, 5.0, 5.0), at(0, 0, 0), body='hall')
    boxes['guest'] = Box(rng.uniform(0.3, 1.0, 3))
    patterns = [(('*', '*'),), (('load', '*'), ('*', 'spreader')), ()][seed % 3]
    listed = (Pair.between('load', 'stack0_0'), Pair.between('part0', 'load'),
              Pair.between('guest', 'part1'), Pair.between('wall', 'guest'))
    scene = Scene(boxes, listed if seed % 2 or not patterns else (), patterns=patterns,
                  poses='named', bodies={'crane': Frame(), 'hall': Frame(at(-1.5 * size[0], 0, 0))})
    count = int(rng.integers(2, 7))
    path = np.zeros((count, len(scene.moving), 7))
    path[..., :3] = rng.uniform(-1.0, 5.0, (count, len(scene.moving), 3))
    path[..., 3:] = poses.unit_quaternions(rng, count * len(scene.moving)).reshape(count, -1, 4)
    load, spreader = map(scene.moving.index, ('load', 'spreader'))
    way = np.cumsum(rng.uniform(-1.5, 1.5, (count, 3)) * [1, 1, 0.5], axis=0)
    way -= way[0]
    path[:, load, :3] = [0, 0, (heights[0] + 0.5) * size[2]] + way
    path[1, load, 2] += 1.0 - way[1, 2]
    path[:, load, 3:] = [yaw(angle) for angle in np.append(0.0, rng.uniform(-0.5, 0.5, count - 1))]
    path[:, spreader] = path[:, load]
    path[:, spreader, 2] += 0.5 * size[2] + 0.1
    if seed % 5 == 0:
        path[:, scene.moving.index('guest')] = np.nan
    if seed % 4 == 0:
        path[..., 3:] *= rng.uniform(0.5, 2.0, path[..., 3:4].shape) * rng.choice(
            [-1, 1], path[..., 3:4].shape)
    return scene, path, float(rng.choice([0.0, 0.0, 0.05, 0.3]))


@pytest.mark.parametrize('seed', range(0, 100, 10))
def test_it_is_brute_force(seed):
    met = 0
    for number in range(seed, seed + 10):
        scene, path, clearance = random_yard(number)
        wanted, answer = Wanted(scene, path, clearance), SceneSolver(scene).check_path(
            path, clearance=clearance)
        wanted.assert_is(answer)
        met += len(answer.pairs)
    assert met > 10


# --- lifts and landings ---------------------------------------------------------------------------


def crane_scene(**more):
    """Return a scene of two stacks of cubes, heights 1 and 2, a load and a spreader."""
    boxes = {'low': Box(UNIT, at(0, 0, 0.5)), 'one': Box(UNIT, at(3, 0, 0.5)),
             'two': Box(UNIT, at(3, 0, 1.5)), 'load': Box(UNIT), 'spreader': Box((1, 1, 0.2))}
    return Scene(boxes, patterns=(('load', '*'), ('spreader', '*')), **more)


def carried(*places):
    """Return a path (m, 2, 7) of the load, on which the spreader stands."""
    return [[at(*place), at(place[0], place[1], place[2] + 0.6)] for place in places]


def names_of(answer, pairs):
    return [answer.scene.pair_of(*pair).label for pair in pairs.tolist()]


@pytest.mark.parametrize('clearance', [0.0, 0.1])
def test_a_lift_is_free_and_a_landing_is_the_first_impact(clearance):
    """From the low stack, up, across and down onto the other one: it lands at a quarter of 2 m."""
    solver = SceneSolver(crane_scene())
    answer = solver.check_path(carried((0, 0, 1.5), (0, 0, 4), (3, 0, 4), (3, 0, 2)),
                               clearance=clearance)
    assert isinstance(answer, PathCheck) and not answer.is_free
    assert names_of(answer, answer.at_start) == ['load_low', 'load_spreader']
    assert [pair.label for pair, _ in answer.named()] == ['load_two']
    when = 2 + (1.5 - clearance) / 2
    assert when - TOLERANCE <= answer.impacts.time[0] <= when
    assert answer.impacts.closing_speed[0] == pytest.approx(2.0)
    assert answer.least.nearest.distance <= TOLERANCE
    assert answer.least.time == pytest.approx(2.75, abs=TOLERANCE)
    assert names_of(answer, answer.least_pair[None]) == ['load_two']
    above = solver.check_path(carried((0, 0, 1.5), (0, 0, 4), (3, 0, 4), (3, 0, 2.7)),
                              clearance=clearance)
    assert above.is_free and above.least.nearest.distance == pytest.approx(0.2, abs=TOLERANCE)
    assert above.least.time == 3.0


def test_a_load_that_is_put_back_lands():
    """Where it was: the pair is judged again from where it is apart."""
    solver = SceneSolver(crane_scene())
    answer = solver.check_path(carried((0, 0, 1.5), (0, 0, 1.75), (0, 0, 1.4)))
    assert [pair.label for pair, _ in answer.named()] == ['load_low']
    assert answer.impacts.time[0] == pytest.approx(1 + 0.25 / 0.35, abs=1e-5)
    rests = solver.check_path(carried((0, 0, 1.5), (0.2, 0, 1.5), (0.1, 0, 1.5)))
    assert rests.is_free and 'load_low' in names_of(rests, rests.at_start)


@pytest.mark.parametrize('clearance', [0.0, 0.2])
@pytest.mark.parametrize('way, time', [
    ([(1.1, 0, 0), (0.5, 0, 0)], 0.1 / 0.6), ([(1.1, 0, 0), (-3, 0, 0)], 0.1 / 4.1),
    ([(0, 0, 1), (0, 0, 0)], 0.0), ([(0, 0, 1), (0, 0, 1.1), (0, 0, 0.8)], 1 + 0.1 / 0.3),
    ([(0, 0, 0.9), (0, 0, 0.8)], 0.0), ([(0, 0, 1), (0, 0, 3)], None),
    ([(0, 0, 0.9), (0, 0, 3)], None), ([(0, 0, 1), (0.3, 0, 1)], None),
    ([(0, 0, 0.99995), (0, 0, 0.9999)], None), ([(0, 0, 0), (0, 0, 0)], None)])
def test_what_begins_within_the_clearance_must_not_get_into_each_other(way, time, clearance):
    """Towards a cube, through it, into it from its top, and away; by 0.1 mm it may get deeper."""
    scene = Scene({'cube': Box(UNIT, at(0, 0, 0)), 'load': Box(UNIT)}, patterns=(('*', '*'),),
                  poses='named')
    answer = SceneSolver(scene).check_path([[at(*place)] for place in way], clearance=clearance)
    assert answer.is_free == (time is None)
    if time is not None:
        assert answer.impacts.time[0] == pytest.approx(time, abs=2e-3)
        assert answer.impacts.nearest.distance[0] <= TOLERANCE


def test_a_pair_that_parts_and_meets_on_one_segment():
    """A tooth on an arm turns away from a wall, and 170 degrees on it is at the wall again."""
    radius, half, angle = 1.0, 0.05, np.radians(85.0)
    face = radius * np.cos(angle) - half * (np.cos(angle) + np.sin(angle))
    boxes = {'tooth': Box((2 * half,) * 3, at(radius, 0, 0), body='arm'),
             'wall': Box((1, 4, 1), at(face - 0.5, 0, 0))}
    scene = Scene(boxes, patterns=(('tooth', 'wall'),), bodies={'arm': Frame()})
    answer = SceneSolver(scene).check_path(
        [[at(0, 0, 0, turn=yaw(-angle))], [at(0, 0, 0, turn=yaw(angle + np.radians(3.0)))]])
    assert len(answer.at_start) == len(answer.pairs) == 1
    assert answer.least is None
    assert answer.impacts.time[0] == pytest.approx(170 / 173, abs=1e-5)


# --- what a tick has: bodies, absent boxes, revisions ---------------------------------------------


def test_the_next_corner_of_a_long_load_that_turns_beside_a_wall_is_an_impact():
    """Its first corner is at the wall. It is away from it for 0.6 rad of a turn by 2.9 rad."""
    half = np.arctan(0.3)
    reach, closest = np.hypot(1.0, 0.3), 1e-3  # [m]; each corner would be so deep in the wall
    scene = Scene({'load': Box((2.0, 0.6, 1.0)),
                   'wall': Box((0.2, 10.0, 10.0), at(reach - closest + 0.1, 0, 0))},
                  patterns=(('*', '*'),), poses='named')
    path = [[at(0, 0, 0, turn=yaw(angle))] for angle in (-half, 2.9 - half)]
    answer = SceneSolver(scene).check_path(path)
    assert len(answer.at_start) == len(answer.pairs) == 1
    touch = (2.0 * half - np.arccos(1.0 - closest / reach)) / 2.9
    assert answer.impacts.time[0] == pytest.approx(touch, abs=1e-5)


def test_a_box_of_a_body_goes_on_an_arc():
    """A boom of 4 m turns by a right angle past a post that is nearer than the chord."""
    boxes = {'tip': Box((0.2, 0.2, 0.2), at(4, 0, 0), body='boom'),
             'post': Box((0.2, 0.2, 1), at(3.1, 3.1, 0))}
    scene = Scene(boxes, patterns=(('tip', 'post'),), bodies={'boom': Frame()})
    answer = SceneSolver(scene).check_path(
        [[at(0, 0, 0)], [at(0, 0, 0, turn=yaw(np.pi / 4))], [at(0, 0, 0, turn=yaw(np.pi / 2))]])
    assert answer.least.time == pytest.approx(1.0, abs=0.05)
    assert answer.least.nearest.distance == pytest.approx(
        np.hypot(3.0, 3.0) - np.hypot(4.1, 0.1), abs=TOLERANCE)  # between two corners


def test_absent_boxes_and_boxes_that_stand_still():
    solver = SceneSolver(crane_scene())
    path = np.array(carried((0, 0, 3), (3, 0, 3)))
    path[:, 1] = np.nan
    answer = solver.check_path(path)
    assert answer.is_free and names_of(answer, answer.least_pair[None]) == ['load_two']
    assert answer.least.nearest.distance == pytest.approx(0.5)
    path[:, 0] = np.nan
    nothing = solver.check_path(path)
    assert nothing.is_free and nothing.least is None and nothing.least_pair is None
    stays = solver.check_path(carried((0, 0, 1.5), (0, 0, 1.5)))
    assert stays.is_free and len(stays.at_start) == 2


def test_no_tick_changes_and_revisions_count():
    scene = crane_scene(poses='named')
    solver = SceneSolver(scene)
    tick = carried((3, 0, 2.4))[0]
    before = solver(tick)
    revision = solver.set_boxes(fixed={'two': Box(UNIT, at(3, 0, 5.5))})
    answer = solver.check_path(carried((0, 0, 3), (3, 0, 3)))
    assert answer.revision == revision == 1 and answer.scene is solver.scene
    assert answer.least.nearest.distance == pytest.approx(1.3)
    assert len(before.pairs) == 2
    after = solver(tick)
    solver.check_path(carried((9, 0, 9), (9, 0, 8)))
    again = solver(tick)
    assert np.array_equal(after.pairs, again.pairs)
    poses.assert_same_bits(after.contacts, again.contacts)


# --- laws -----------------------------------------------------------------------------------------


def agree(one, other, clearance, when=lambda time: time):
    """Hold two answers to one question against each other, by names."""
    def by_boxes(answer):
        names = answer.scene.names
        return {frozenset((names[a], names[b])): impact
                for (a, b), impact in zip(answer.pairs.tolist(), answer.impacts)}

    first, second = by_boxes(one), by_boxes(other)
    least = min(one.least.nearest.distance, other.least.nearest.distance)
    for pair in first.keys() ^ second.keys():
        assert abs(least - clearance) <= 2 * TOLERANCE, pair
    for pair in first.keys() & second.keys():
        slow = max(min(first[pair].closing_speed, second[pair].closing_speed), 1e-3)
        assert abs(first[pair].time - when(second[pair].time)) <= 1e-9 + 8 * TOLERANCE / slow
    assert one.least.nearest.distance == pytest.approx(other.least.nearest.distance,
                                                       abs=2 * TOLERANCE)


yards = pytest.mark.parametrize('seed', range(1000, 1008))


@yards
def test_a_swap_of_boxes_a_and_b_changes_sides_alone(seed):
    """With the boxes of the scene in the opposite order, patterns and pairs swapped."""
    scene, path, clearance = random_yard(seed)
    names = list(scene.boxes)[::-1]
    swapped = Scene({name: scene.boxes[name] for name in names},
                    tuple(Pair.between(pair.b, pair.a) for pair in scene.pairs), poses='named',
                    patterns=tuple((b, a) for a, b in scene.patterns), bodies=scene.bodies)
    order = [scene.moving.index(name) for name in swapped.moving]
    agree(SceneSolver(scene).check_path(path, clearance=clearance),
          SceneSolver(swapped).check_path(path[:, order], clearance=clearance), clearance)


@yards
def test_a_common_rigid_motion_changes_nothing(seed):
    """Of some metres, or to coordinates of a map."""
    scene, path, clearance = random_yard(seed)
    rng = np.random.default_rng(seed)
    turn = poses.unit_quaternions(rng, 1)
    shift = rng.uniform(-1.0, 1.0, 3) * (4e6 if seed % 2 else 50.0)

    def moved(rows):
        return poses.moved(np.asarray(rows, float).reshape(-1, 7), shift, turn)

    boxes = {name: box if box.pose is None or box.body else Box(box.size, moved(box.pose)[0])
             for name, box in scene.boxes.items()}
    bodies = {name: frame if frame.pose is None else Frame(moved(frame.pose)[0])
              for name, frame in scene.bodies.items()}
    elsewhere = Scene(boxes, scene.pairs, poses='named', patterns=scene.patterns, bodies=bodies)
    agree(SceneSolver(scene).check_path(path, clearance=clearance),
          SceneSolver(elsewhere).check_path(moved(path).reshape(path.shape), clearance=clearance),
          clearance)


@yards
def test_a_path_that_is_cut_in_two_is_the_same_path(seed):
    """A pose more on a segment, where it goes anyhow."""
    scene, path, clearance = random_yard(seed)
    rng = np.random.default_rng(seed)
    k, share = int(rng.integers(len(path) - 1)), float(rng.uniform(0.05, 0.95))
    count = path.shape[1]
    between = poses.on_the_way(path[k], path[k + 1], np.zeros((count, 3)), np.full(count, share))
    cut = np.insert(path, k + 1, between, axis=0)

    def when(time):
        return time if time <= k else time - 1 if time >= k + 2 else (
            k + share * (time - k) if time <= k + 1 else k + share + (1 - share) * (time - k - 1))

    agree(SceneSolver(scene).check_path(path, clearance=clearance),
          SceneSolver(scene).check_path(cut, clearance=clearance), clearance, when)


# --- refusals -------------------------------------------------------------------------------------

HALF_TURN = [carried((0, 0, 3))[0], [at(0, 0, 3, turn=(0, 0, 1, 0)), at(0, 0, 3.6)]]
GONE = [[at(0, 0, 3), at(0, 0, 3.6)], [at(0, 0, 3), [np.nan] * 7]]
REFUSED = {
    'no array': ('path', {}, r'poses must be poses \(m, 2, 7\).*load, spreader'),
    'one box': (np.zeros((2, 1, 7)), {}, r'not an array of shape \(2, 1, 7\)'),
    'one pose': (carried((0, 0, 3)), {}, 'poses must be those of 2 times or more, not 1'),
    'no pose': (carried((0, 0, 3), (np.inf, 0, 3)), {}, r'poses\[1\] of load: position'),
    'half a turn': (HALF_TURN, {}, r'poses\[0\] to poses\[1\] of load: a turn by 180 degrees'),
    'gone': (GONE, {}, r'poses\[1\] of spreader: it is there at some times alone'),
    'a clearance': (carried((0, 0, 3), (0, 0, 4)), {'clearance': -1.0}, '^clearance must'),
    'far away': (carried((0, 0, 1e9), (1, 0, 1e9)), {}, 'tolerance 1e-06 is below')}


@pytest.mark.parametrize('name', REFUSED)
def test_what_is_refused(name):
    path, options, words = REFUSED[name]
    with pytest.raises(ValueError, match=words):
        SceneSolver(crane_scene()).check_path(path, **options)


# --- time -----------------------------------------------------------------------------------------


def big_yard():
    """Return 5,000 containers in stacks of four, and a load under its spreader."""
    size = poses.CONTAINER
    boxes = {f'c{row}': Box(size, at(12.6 * (row // 200), 2.9 * (row // 4 % 50),
                                     (row % 4 + 0.5) * size[2])) for row in range(5000)}
    boxes |= {'load': Box(size), 'spreader': Box((12.2, 2.4, 0.5))}
    return Scene(boxes, patterns=(('load', '*'), ('spreader', '*')))


@pytest.mark.parametrize('room', [0.5, 20.0])
def test_a_long_path_over_a_big_yard(room):
    """100 poses, turning, with room to spare."""
    solver, share = SceneSolver(big_yard()), np.linspace(0.0, 1.0, 100)
    path = np.zeros((100, 2, 7))
    path[..., 0], path[..., 1] = (20 + 200 * share)[:, None], (10 + 100 * share)[:, None]
    path[..., 2] = 4.5 * poses.CONTAINER[2] + room
    path[..., 3:] = np.array([yaw(angle) for angle in 0.3 * np.sin(3 * share)])[:, None]
    path[:, 1, 2] += 0.5 * poses.CONTAINER[2] + 0.25
    answer, best = solver.check_path(path), np.inf
    assert answer.is_free and names_of(answer, answer.at_start) == ['load_spreader']
    assert answer.least.nearest.distance == pytest.approx(room, abs=TOLERANCE)
    for _ in range(20):
        begin = time.process_time()
        solver.check_path(path)
        best = min(best, time.process_time() - begin)
    assert best < 0.02  # 5 ms on an idle core
