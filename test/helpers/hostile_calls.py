# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bad arguments to the native extension, and many boxes at once: a crash ends this process alone.

usage: hostile_calls.py [SEED ROUNDS]

The functions named below run first, then ROUNDS random calls. EXTENSION may name another build of
the extension, such as one with sanitizers.
"""
from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np

if 'EXTENSION' in os.environ:  # loaded before the package looks for its own
    name = 'box_contact_ros.core._native'
    spec = importlib.util.spec_from_file_location(name, os.environ['EXTENSION'])
    assert spec and spec.loader
    sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules[name])

sys.path.append(str(Path(__file__).parent))  # tests start Python with a safe path
import poses  # noqa: E402  imports the package

from box_contact_ros import Body, ContactSolver, PatchForces  # noqa: E402
from box_contact_ros.core import native  # noqa: E402

assert native.__file__ == os.environ.get('EXTENSION', native.__file__), native.__file__

POSE = np.array([0.0, 0, 0, 0, 0, 0, 1])
ABOVE = np.array([0.1, 0.2, 0.9, 0, 0, 0, 1])
UNIT = (1.0, 1.0, 1.0)


def rows(n: int = 4) -> np.ndarray:
    """Return poses (n, 7) of boxes along a line, neighbours in contact."""
    line = np.tile(POSE, (n, 1))
    line[:, 2] = 0.9 * np.arange(n)
    return line


def exact() -> Any:
    return native.Exact()


def forces(n: int = 2) -> Any:
    """Return the forces on n bodies of 1 kg."""
    return native.PatchForces(np.ones(n), np.ones((n, 3)), np.zeros((n, 3)), 2, 1, 0.5, 1e-3, True)


def held(pairs: int = 1) -> list[Any]:
    """Return arguments that hold so many contacts of two bodies, one above the other."""
    each = np.ones(pairs)
    return [np.array([(0, 1)] * pairs), -0.1 * each, np.outer(each, [0.0, 0.0, 1.0]),
            np.outer(each, [0.0, 0.0, 0.45]), 0.1 * each, np.tile(0.08 * np.eye(3), (pairs, 1, 1)),
            rows(2), 0.5 * each, None, None, 0.0, 0.0]


def filter_arguments(n: int = 4) -> list[Any]:
    """Return what Filter takes: a listed pair, two groups that meet, no body, an order."""
    return [np.array([[1, 0]]), np.arange(n, dtype=np.int32) % 2,
            np.array([[0, 1], [2, 0]], np.uint8), np.full(n, -1, np.int32),
            np.arange(n, dtype=np.int32)]


def movers_arguments(n: int = 4) -> list[Any]:
    """Return what Movers takes: n boxes, which all move."""
    return [np.ones((n, 3)), 0.0, native.Filter(*filter_arguments(n)), None]


def path_arguments(n: int = 2) -> list[Any]:
    """Return what Path takes: n boxes that go through four."""
    way = np.stack((rows(n), rows(n) + [9.0, 0, 0, 0, 0, 0, 0]))
    return [np.ones((n, 3)), way, np.zeros((n, 3)), np.arange(4, 4 + n),
            native.Index(np.ones((4, 3)), rows()), None, native.Filter(*filter_arguments()), 0.1,
            1e-6, 10**6, 10**6]


def writer_arguments(n: int = 4) -> list[Any]:
    """Return what TickWriter takes: the same boxes; all but the last are parts of a body."""
    return [native.Movers(*movers_arguments(n)), ContactSolver(), 0.1, 9, np.ones((n, 3)),
            rows(n + 1), np.array([n - 1, n]), np.array([n] * (n - 1) + [-1]), rows(n),
            tuple('abcd'), np.array([[1, 0]]), ('named',), np.array([[1, 0, 1, 1]]), (None,),
            'map', 2, 3]


def some_names(rng: np.random.Generator) -> bytes:
    """Return a MultiDOFJointState of two names, in which some bytes are others."""
    message = bytearray(b'\0\1\0\0' + bytes(8) + b'\1\0\0\0' + bytes(4) + b'\2\0\0\0'
                        + b'\2\0\0\0a\0\0\0' + b'\2\0\0\0b\0\0\0' + b'\2\0\0\0' + bytes(120))
    for at in rng.integers(len(message), size=rng.integers(4)):
        message[at] = rng.integers(256)
    return bytes(message[:rng.integers(len(message)) if rng.random() < 0.3 else None])


STAMPED = [(POSE, 'map', 5), (POSE, 'map', 7)]
"""A tick of these boxes."""


def refused(kind: type[Exception], call: Callable[..., Any], *args: Any) -> None:
    try:
        call(*args)
    except kind:
        return
    raise AssertionError(f'{call} was not refused')


# --- what is refused ------------------------------------------------------------------------------


def places_of_no_box() -> None:
    """`Filter` reads at boxes and groups that it is given."""
    assert native.Movers(*movers_arguments()).find(rows(), 9)[0].tolist() == [
        [1, 0], [2, 1], [2, 3]]
    for argument in (0, 1):
        for place in (-1, 4, 2**30, -2**31):
            given = filter_arguments()
            given[argument].flat[1] = place
            refused(ValueError, native.Filter, *given)
    for place in (-1, 2**31, 2**40, -2**62):
        refused(ValueError, native.Filter(*filter_arguments()).sides, np.array([[0, place]]))
        given = path_arguments()
        given[3][1] = place
        refused(ValueError, native.Path, *given)
    for kept in (4, 2**40):
        refused(ValueError, native.Index, np.ones((4, 3)), rows(),
                native.Index(np.ones((4, 3)), rows()), np.array([0, 1, 2, kept]))


def rows_of_no_array() -> None:
    """`write_poses` writes to an array that it is given, at rows that it is given."""
    to, places = rows(), np.array([3, 0])
    assert native.write_poses(to, places, [POSE, None])
    assert to[3].tolist() == list(POSE) and np.isnan(to[0]).all()
    for given in ((POSE, POSE), [POSE], [POSE, POSE[:6]], [POSE, 'a'], [POSE, [True] * 7]):
        assert not native.write_poses(to, places, given)
    for row in (-1, 4, 2**40, -2**62):
        refused(ValueError, native.write_poses, to, np.array([0, row]), [POSE, POSE])
    fixed = rows()
    fixed.flags.writeable = False
    refused(ValueError, native.write_poses, fixed, places, [POSE, POSE])
    refused(ValueError, native.write_poses, np.zeros((4, 6)), places, [POSE, POSE])
    for other in (to[::2], to.astype(np.float32), to.tolist(), None):  # would be copied
        refused(TypeError, native.write_poses, other, places, [POSE, POSE])


def bodies_that_rows_lack() -> None:
    """`place_boxes` reads at rows that it is given, and writes to the first ones."""
    to = rows()
    assert native.place_boxes(to, np.array([3, -1]), rows(2)) == -1 and (to[0] == to[3]).all()
    for row in (4, 2**40):
        refused(ValueError, native.place_boxes, to, np.array([0, row]), rows(2))
    refused(ValueError, native.place_boxes, to, np.zeros(5, np.int64), rows(5))
    refused(ValueError, native.place_boxes, to, np.zeros(2, np.int64), rows(3))
    fixed = rows()
    fixed.flags.writeable = False
    refused(ValueError, native.place_boxes, fixed, np.array([3]), rows(1))
    refused(TypeError, native.place_boxes, to[::2], np.array([1]), rows(1))  # would be copied


def arrays_too_short() -> None:
    for argument in (1, 2, 3, 4):
        given = filter_arguments()
        given[argument] = given[argument][:1]
        refused(ValueError, native.Filter, *given)
    refused(ValueError, native.Movers(*movers_arguments()).find, rows(3), 9)
    refused(ValueError, native.Movers, np.ones((3, 3)), 0.0, None, path_arguments()[4])
    refused(ValueError, native.Index, np.ones((4, 3)), rows(3))
    refused(ValueError, path_arguments()[4].near, np.ones((2, 3)), rows(3), 0.0, 9)
    for argument in (0, 1, 2, 3):
        given = path_arguments()
        given[argument] = given[argument][:1]
        refused(ValueError, native.Path, *given)


def bounds_without_an_order() -> None:
    """Sorting NaN is undefined in C++: none gets there."""
    n = 4000
    movers = native.Movers(np.ones((n, 3)), 0.0, None, None)
    place = rows(n)
    for number in (np.nan, np.inf, -np.inf, 1e60):
        bad = place.copy()
        bad[1234, 1] = number
        assert movers.find(bad, 10**9)[2] == 1234
        refused(ValueError, native.Index, np.ones((n, 3)), bad)
    assert len(movers.find(np.full((n, 7), np.nan), 10**9)[1]) == n
    assert len(movers.find(place, 10**9)[0]) == n - 1


def a_network(rng: np.random.Generator | None = None, inputs: int = native.FEATURES,
              outputs: int = native.OUTPUTS) -> np.ndarray:
    """Return the numbers of a network with eight units in each hidden layer: random, or zeros."""
    has_path = inputs == native.FEATURES
    header = [inputs, 8, 8, outputs, 0, 0, has_path]
    read = -(-inputs // 4) * 4  # numbers, with those that fill the last four
    count = 8 * (1 + read) + 8 * 9 + -(-outputs // 8) * 8 * (9 + has_path * read)
    numbers = np.zeros(count) if rng is None else rng.uniform(-1e4, 1e4, count)
    return np.concatenate([header, numbers]).astype(np.float32)


def networks_that_no_file_has() -> None:
    """Weights that are not finite or too large, and counts that no network has."""
    for number in (np.nan, np.inf, -np.inf, 1e5):
        network = a_network()
        network[-1] = number
        refused(ValueError, native.Mlp, network)
    for count in (0, 2, 7, 9):
        refused(ValueError, native.Mlp, np.zeros(count, np.float32))
    for place in range(7):
        for number in (-1.0, 0.5, 65.0, 1e4):
            network = a_network()
            network[place] = number
            refused(ValueError, native.Mlp, network)
    refused(ValueError, native.Paper, a_network())


def outputs_that_fill_no_group() -> None:
    """Pairs alone, whose units are computed in eights."""
    for model in (native.Mlp(a_network()), native.Paper(a_network(None, 6, 4))):
        assert native.PairSolver(model, UNIT, UNIT)(POSE, ABOVE).colliding


def threads_that_are_none() -> None:
    """Nobody would solve the rows; or more than any machine has."""
    one = np.ones((1, 3))
    for threads in (0, -1, -2**63, 1025, 2**62):
        refused(ValueError, exact().solve, rows(), rows(), one, one, threads)
        refused(ValueError, native.distances, rows(), rows(), one, one, threads, None)


def extreme_numbers() -> None:
    """Rows of numbers at both ends of what is accepted, and beyond, alone and in batches."""
    rng = np.random.default_rng(29)
    for _ in range(20 if 'EXTENSION' in os.environ else 100):  # with sanitizers calls take longer
        for solver in (exact(), native.Mlp(a_network(rng))):
            pairs = poses.extreme_pairs(rng, 200)
            solver.solve(*pairs, 2)
            native.distances(*pairs, 2, None)
            for row in range(0, 200, 10):
                solver.solve(*(part[row:row + 1] for part in pairs), 1)


# --- random calls ---------------------------------------------------------------------------------

WHOLES = [0, 1, -1, 2, 7, 2**31, -2**31, 2**62, 2**63 - 1, -2**63, 2**64, 10**400]
FLOATS = [0.0, -0.0, 1.0, np.nan, np.inf, -np.inf, 1e308, 5e-324, 1e50, 1e-50, 1e-100, -1.0]
TYPES = ['f8', 'f4', 'f2', 'i8', 'i4', 'u1', '?', 'c16', 'O', 'S3', 'M8[s]', '>f8', 'g', 'V8']
PLAIN: list[Any] = [None, True, 'exact', 'mlp', '', b'\0', (), [], {}, object(), len, range(7),
                    [[]], [0.0] * 7, (1,) * 3, [None] * 7, memoryview(b'1234567'), np.float64(1),
                    np.zeros(()), iter([1, 2])]


def odd_array(rng: np.random.Generator, array: np.ndarray) -> Any:
    """Return an array of other numbers, another type, shape or layout."""
    if not array.ndim or not array.size or array.dtype.char not in 'fdl?':
        return array
    changed = array.copy()
    match int(rng.integers(7)):
        case 0:
            pool = WHOLES if changed.dtype.kind == 'i' else FLOATS
            for place in rng.integers(changed.size, size=3):
                value = pool[rng.integers(len(pool))]
                changed.reshape(-1)[place] = (
                    value if pool is FLOATS else max(-2**63, min(value, 2**63 - 1)))
        case 1:
            with np.errstate(all='ignore'):
                try:
                    changed = changed.astype(TYPES[rng.integers(len(TYPES))])
                except (TypeError, ValueError):
                    pass
        case 2:
            changed = np.resize(changed, [int(n) for n in rng.integers(0, 9, rng.integers(5))])
        case 3:  # fewer rows, or more
            changed = np.resize(changed, (int(rng.integers(8)), *changed.shape[1:]))
        case 4:  # every second place, or back to front
            wide = np.repeat(changed, 2, axis=-1)
            changed = wide[..., ::2] if rng.random() < 0.5 else changed[::-1]
        case 5:  # not aligned
            raw = np.zeros(changed.nbytes + 1, np.uint8)
            changed = np.ndarray(changed.shape, changed.dtype, raw.data, 1)
        case 6:
            changed.flags.writeable = False
    return changed


def odd(rng: np.random.Generator, value: Any) -> Any:
    """Return what may stand in the place of an argument."""
    if isinstance(value, np.ndarray) and rng.random() < 0.6:
        return odd_array(rng, value)
    if isinstance(value, (tuple, list)) and value and rng.random() < 0.6:
        items = list(value)
        place = int(rng.integers(len(items)))
        items[place] = odd(rng, items[place])
        return type(value)(items[:int(rng.integers(1, 2 + len(items)))])
    pool = [WHOLES, FLOATS, PLAIN][rng.integers(3)]
    return pool[rng.integers(len(pool))]


ALLOWED = (ValueError, TypeError, MemoryError, OverflowError, AttributeError, RuntimeError)
"""SystemError is none of them: it says that the extension broke Python's rules."""


def pairs_changed_meanwhile() -> None:
    """Another thread writes places that no pose has, and takes them back, while a batch runs."""
    count = 20_000
    pairs, stop = np.tile([[0, 1]], (count, 1)), Event()

    def write() -> None:
        while not stop.is_set():
            for place in (2**40, -2**40, 1):
                pairs[:, 1] = place

    writer = Thread(target=write)
    writer.start()
    solver, one, refused = exact(), np.ones((1, 3)), 0
    for _ in range(100):
        try:
            refused += solver.solve(rows(2), rows(2), one, one, 2, True, pairs)[1] >= 0
            refused += native.distances(rows(2), rows(2), one, one, 2, pairs)[1] >= 0
        except ValueError:
            refused += 1
    stop.set()
    writer.join()
    assert refused > 10, refused


def columns_that_fall() -> None:
    """Boxes of many sizes and masses push each other, in uneven steps, by several threads."""
    rng, columns, high = np.random.default_rng(8), 60, 8
    sizes = 10.0 ** rng.uniform(-1.0, 1.0, (columns, high, 3))
    masses = 10.0 ** rng.uniform(-1.0, 3.0, (columns, high))
    masses[:, 0] = 0.0
    places = np.tile(POSE, (columns, high, 1))
    places[..., 0] = 100.0 * np.arange(columns)[:, None] + rng.uniform(-0.1, 0.1, masses.shape)
    places[..., 2] = sizes[..., 2].cumsum(axis=1) - 0.5 * sizes[..., 2]
    sizes, masses, places = sizes.reshape(-1, 3), masses.ravel(), places.reshape(-1, 7)
    law = PatchForces(list(map(Body.of_box, sizes, masses)), threads=3)
    law.set_boxes(sizes)
    law.hold([pair for first in range(0, columns * high, high)
              for pair in combinations(range(first, first + high), 2)])
    weight, velocities = np.zeros((2, len(masses), 6))
    weight[:, 2] = -9.81 * masses
    for _ in range(30):
        places, velocities, *_ = law.advance(rng.uniform(1e-6, 0.02), places, velocities, weight)
    assert len(law.loads().pairs) >= columns
    assert np.isfinite(places).all()


def random_calls(seed: int, rounds: int) -> None:
    """Call each function with some arguments replaced; print how many calls were refused."""
    rng = np.random.default_rng(seed)
    solver, public, one, law = exact(), ContactSolver(UNIT, UNIT), np.ones((1, 3)), forces()
    places, boxes = np.array([[0, 1], [2, 3]]), np.ones((4, 3))
    targets: list[tuple[Callable[..., Any], list[Any], dict[str, Any]]] = [
        (native.PairSolver, [solver, UNIT, UNIT, 0.1], {}), (native.Mlp, [a_network()], {}),
        (public, [POSE, ABOVE], {}),
        (public.batch, [rows(), rows()], {'size_a': boxes, 'threads': 2, 'patch': True}),
        (public.batch, [rows(), rows()], {'size_b': boxes, 'threads': 2, 'patch': False}),
        (public.batch, [rows()], {'sizes': boxes, 'pairs': places}),
        (public.distance, [POSE, ABOVE], {}),
        (public.distance_batch, [rows(), rows()], {'size_a': boxes, 'threads': 2}),
        (public.distance_batch, [rows()], {'sizes': boxes, 'pairs': places}),
        (native.distances, [rows(), rows(), one, one, 2, places], {}),
        (native.Nearest, [True, 0.0, np.ones(3), np.ones(3), np.ones(3)], {}),
        (solver.solve, [rows(), rows(), one, one, 2, True, places, 0.1], {}),
        (native.Contact, [True, -1.0, np.ones(3), np.ones(3), 1.0, np.eye(3), 2], {}),
        (native.write_poses, [rows(), np.array([3, 0]), [POSE, None]], {}),
        (native.place_boxes, [rows(), np.array([3, -1]), rows(2)], {}),
        (native.Filter, filter_arguments(), {}),
        (native.Filter(*filter_arguments()).sides, [np.array([[0, 1], [7, 2]])], {}),
        (native.Index, [np.ones((4, 3)), rows(), path_arguments()[4], np.array([1, 0, -1, 3])], {}),
        (path_arguments()[4].near, [np.ones((4, 3)), rows(), 0.1, 10], {}),
        (native.Movers, movers_arguments(), {}),
        (native.Movers(*movers_arguments()).find, [rows(), 10], {}),
        (native.Path, path_arguments(), {}),
        (native.Path(*path_arguments()).advance, [100], {}),
        (native.read_pose, [rng.bytes(int(rng.integers(90)))], {}),
        (native.NamedPoses, [tuple('abcd'), 9], {}),
        (native.NamedPoses(tuple('abcd'), 9).read, [some_names(rng)], {}),
        (native.TickWriter, writer_arguments(), {}),
        (native.TickWriter(*writer_arguments()), [list(STAMPED)], {}),
        (native.TickWriter(*writer_arguments()), [[odd(rng, STAMPED[0]), STAMPED[1]]], {}),
        (native.message_numbers, [np.ones((4, 3)), np.ones((4, 3)), np.ones(4), np.ones(4),
                                  np.ones((4, 3, 3)), np.ones(4)], {}),
        (native.face_areas, [boxes, rows(), places], {}),
        (native.face_patches, [boxes, rows(), places, np.eye(3)[:2], 1e-4], {}),
        (native.PatchForces,
         [np.ones(2), np.ones((2, 3)), np.zeros((2, 3)), 2, 1, 0.5, 1e-3, True], {}),
        (law.hold, held(), {}), (law.forget, [[1]], {}),
        (law.advance, [0.001, rows(2), np.zeros((2, 6)), None], {})]
    answered = 0
    for _ in range(rounds):
        function, given, keywords = targets[rng.integers(len(targets))]
        args, keywords = list(given), dict(keywords)
        for _ in range(int(rng.integers(1, 3))):
            if keywords and rng.random() < 0.4:
                name = sorted(keywords)[rng.integers(len(keywords))]
                keywords[name] = odd(rng, keywords[name])
            else:
                place = int(rng.integers(len(args)))
                args[place] = odd(rng, args[place])
        try:
            function(*args, **keywords)
            answered += 1
        except ALLOWED:
            pass
    print(answered, rounds - answered)


if __name__ == '__main__':
    for attack in (places_of_no_box, rows_of_no_array, bodies_that_rows_lack, arrays_too_short,
                   bounds_without_an_order, networks_that_no_file_has,
                   outputs_that_fill_no_group, threads_that_are_none, extreme_numbers,
                   pairs_changed_meanwhile, columns_that_fall):
        attack()
    random_calls(*map(int, sys.argv[1:]))
