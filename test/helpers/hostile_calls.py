# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hostile calls of the extensions, as a program: a crash ends this process alone.

usage: hostile_calls.py ATTACK | fuzz SEED ROUNDS | allocations LIBRARY

An ATTACK is a function named below. EXTENSIONS may name a folder with other extensions.
"""
from __future__ import annotations

import ctypes
import importlib.util
import os
import resource
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

FOLDERS = {'_native': 'core', '_networks': 'paper'}


def preload(folder: str) -> None:
    """Load extensions from a folder, before the package looks for its own."""
    for path in Path(folder).glob('_n*.so'):
        base = path.name.partition('.')[0]
        name = f'box_contact_ros.{FOLDERS[base]}.{base}'
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec and spec.loader
        sys.modules[name] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)


if 'EXTENSIONS' in os.environ:
    preload(os.environ['EXTENSIONS'])

from box_contact_ros.core import native  # noqa: E402
from box_contact_ros.paper import _networks as networks  # noqa: E402

POSE = np.array([0.0, 0, 0, 0, 0, 0, 1])
ABOVE = np.array([0.1, 0.2, 0.9, 0, 0, 0, 1])
UNIT = (1.0, 1.0, 1.0)


def rows(n: int = 4) -> np.ndarray:
    """Return poses (n, 7) of boxes along a line, neighbours in contact."""
    poses = np.tile(POSE, (n, 1))
    poses[:, 2] = 0.9 * np.arange(n)
    return poses


def exact() -> Any:
    return native.PairSolver('exact', UNIT, UNIT)


OF_KERNEL = np.array([networks.OCTANT, 2, 2, 2, 3, 6, 4, 4, *[0] * (4 * 7 + 4 * 5)], np.float32)
"""The paper's kind of network, packed for its kernel: its answers are the x axis."""


def of_kernel() -> Any:
    return native.PairSolver(networks.KERNEL, UNIT, UNIT, OF_KERNEL)


def a_law(n: int = 2) -> Any:
    return native.Law(np.ones(n), np.ones((n, 3)), np.zeros((n, 3)), 0, 200.0, 0.0, 0.001, 0.5,
                      9.81)


def a_touch(pair: Any = 1) -> tuple[Any, ...]:
    contact = (True, -0.1, np.array([0.0, 0, 1]), np.array([0.0, 0, 0.45]), 0.1, np.eye(3) * 0.08)
    return pair, 0, 1, contact


def near_arguments(n: int = 4) -> list[Any]:
    """Return what near_pairs takes: n boxes, and all pairs of neighbours."""
    first = np.arange(n - 1)
    return [rows(n), np.ones((n, 3)), np.arange(n), np.zeros((n, 3)), np.ones((n, 3)),
            np.ones(n, bool), first, first + 1, np.zeros(n - 1, np.int64),
            np.zeros(n - 1, np.int64)]


def refused(kind: type[Exception], call: Callable[..., Any], *args: Any, **keywords: Any) -> None:
    try:
        call(*args, **keywords)
    except kind:
        return
    raise AssertionError(f'{call} was not refused')


# --- attacks --------------------------------------------------------------------------------------


def places_of_no_box() -> None:
    """`near_pairs` reads and writes at places that it is given."""
    assert native.near_pairs(*near_arguments()) == (3, 0)
    for argument in (2, 6, 7):
        for place in (-1, 4, 2**40, -2**63):
            given = near_arguments()
            given[argument][1] = place
            refused(ValueError, native.near_pairs, *given)


def arrays_too_short() -> None:
    """`near_pairs` writes as many rows as there are pairs."""
    for argument in (0, 1, 3, 4, 5, 7, 8, 9):
        given = near_arguments()
        given[argument] = given[argument][:1]
        refused(ValueError, native.near_pairs, *given)


def overlapping_arrays() -> None:
    """Let `near_pairs` write the places that it reads next."""
    shared, given = np.zeros(64, np.int64), near_arguments()
    given[5][:] = False  # all pairs are unknown, so their numbers are written
    given[6], given[9] = shared[:63], shared[1:]
    given[7] = given[8] = np.zeros(63, np.int64)
    refused(ValueError, native.near_pairs, *given)


def bounds_without_an_order() -> None:
    """Sorting NaN is undefined in C++."""
    rng = np.random.default_rng(3)
    low = rng.normal(size=(4000, 3))
    low[rng.random(4000) < 0.5] = np.nan
    every = np.ones(4000, bool)
    refused(ValueError, native.near_boxes, low, low + 1.0, every, every, 10**9)
    refused(ValueError, native.near_boxes, np.zeros((1, 3)), np.full((1, 3), np.inf), every[:1],
            every[:1], 10)
    refused(OverflowError, native.near_boxes, low, low + 1.0, every, every, 10**30)
    assert native.near_boxes(low, low + 1.0, ~every, every, 10).shape == (0, 2)


def booleans_of_any_byte() -> None:
    """Store 2 in a NumPy boolean: an index elsewhere."""
    low, high = np.zeros((3, 3)), np.ones((3, 3))
    for byte in (2, 0x55, 255):
        odd = np.full(3, byte, np.uint8).view(bool)
        assert len(native.near_boxes(low, high, odd, odd, 10)) == 3
        given = near_arguments()
        given[5] = np.full(4, byte, np.uint8).view(bool)
        assert native.near_pairs(*given) == (3, 0)


def keywords_of_no_name() -> None:
    """Python hands `**{1: 2}` through to C."""
    solver = exact()
    odd_names: list[Any] = [{key: np.ones((4, 3))} for key in (1, None, (), b'size_a')]
    for words in odd_names:
        refused(AttributeError, lambda words=words: solver.batch(rows(), rows(), **words))


def a_list_that_shrinks() -> None:
    """Code of an object that is read may change the list in which it is."""
    law = a_law()

    class Emptying:
        def __init__(self, touches: list[Any]) -> None:
            self.touches = touches

        def __index__(self) -> int:
            self.touches.clear()
            return 5

    for count in (1, 2, 1000):
        touches: list[Any] = []
        touches += [a_touch(Emptying(touches)), *(a_touch(k) for k in range(10, 9 + count))]
        law.hold(touches, rows(2))


def a_solver_made_twice() -> None:
    """Also while another thread uses it."""
    solver = exact()
    solver.solve(rows(1), rows(1), np.ones((1, 3)), np.ones((1, 3)), 1)
    refused(RuntimeError, solver.__init__, 'exact', UNIT, UNIT)
    many = rows(200_000)
    thread = threading.Thread(target=solver.batch, args=(many, many), kwargs={'threads': 2})
    thread.start()
    while thread.is_alive():
        refused(RuntimeError, solver.__init__, 'exact', UNIT, UNIT)
    thread.join()
    refused(RuntimeError, solver.__init__, None, UNIT, UNIT)
    other = native.PairSolver.__new__(native.PairSolver)
    refused(ValueError, other.__init__, 'none', UNIT, UNIT)
    other.__init__('exact', UNIT, UNIT)  # the first that is accepted
    assert other(POSE, ABOVE)[0]


def networks_that_cannot_be_meant() -> None:
    """Offer weights that a loader would refuse."""
    for number in (np.nan, np.inf, -np.inf, 1e5):
        network = np.zeros(1 + 8 * 8, np.float32)
        native.PairSolver('mlp', UNIT, UNIT, network)
        network[-1] = number
        refused(ValueError, native.PairSolver, 'mlp', UNIT, UNIT, network)
    for count in (0, 2, 8):
        refused(ValueError, native.PairSolver, 'mlp', UNIT, UNIT, np.zeros(count, np.float32))


def threads_below_one() -> None:
    """Nobody would solve the rows."""
    one = np.ones((1, 3))
    for threads in (0, -1, -2**63):
        refused(ValueError, exact().solve, rows(), rows(), one, one, threads)


def widths_beyond_the_network() -> None:
    """Their product overflows."""
    for widths in ([2**62, 4], [6, 2**31, 2**31, 4], [6, -1, 4], [6], [], [1] * 10_000):
        refused(ValueError, networks.forward, np.zeros(500, np.float32),
                np.array(widths, dtype=np.int64), np.zeros((1, 6), np.float32))
    for numbers in ([], [1, 2, 2, 2], [1, 2, 2, 2, 3, 6, 4, 4], [1, 2, 2, 2, 1e4, *[1e4] * 40],
                    [1, 2, 2, 2, -3, 6, 4, 4], [np.nan] * 9):
        refused(ValueError, native.PairSolver, networks.KERNEL, UNIT, UNIT,
                np.array(numbers, dtype=np.float32))


def names_that_raise() -> None:
    """Raise from the names: that is raised, once."""
    class Names(tuple[str, ...]):
        asked = 0

        def __contains__(self, name: object) -> bool:
            Names.asked += 1
            raise KeyError(name)

    one = np.ones((1, 3))
    refused(KeyError, native.stages, rows(), rows(), one, one, Names())
    assert Names.asked == 1


def too_little_memory() -> None:
    """By the limit of the process: batches, many near boxes, many bodies."""
    n = 20_000
    many, one = np.tile(POSE, (n, 1)), np.ones((1, 3))
    low, every, solver = np.zeros((n, 3)), np.ones(n, bool), exact()
    places = np.zeros((2_000_000, 2), np.int64)
    in_use = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (in_use + 2**27, -1))
    refused(MemoryError, native.near_boxes, low, low + 1.0, every, every, 10**9)
    refused(MemoryError, solver.solve, many, many, one, one, 2, True, places)
    refused(MemoryError, native.Law, np.broadcast_to(1.0, 2**25), np.ones((1, 3)), one, 0, 1.0, 1.0,
            1.0, 1.0, 1.0)
    assert len(solver.batch(many, many, threads=2)[0]) == n


# --- allocations ----------------------------------------------------------------------------------


def allocations(library: str) -> None:
    """Let each allocation of C++ fail in turn: an error, and the next call answers as before."""
    failing = ctypes.CDLL(library)
    many, one = rows(2000), np.ones((1, 3))
    solver, law, near = exact(), a_law(), near_arguments()
    network, inputs = np.zeros(4 * 7 + 5 * 4, np.float32), np.zeros((2, 6), np.float32)
    poses, motions = rows(2), np.zeros((2, 6))
    spread = np.ones(2000, bool)
    calls: dict[str, Callable[[], Any]] = {
        'PairSolver': lambda: native.PairSolver('mlp', UNIT, UNIT, np.zeros(9, np.float32)),
        'call': lambda: solver(POSE, ABOVE),
        'batch': lambda: solver.batch(many, many, threads=3),
        'solve': lambda: solver.solve(many, many, one, one, 3),
        'stages': lambda: native.stages(many, many, one, one, ['axis', 'covariance']),
        'near_pairs': lambda: native.near_pairs(*near),
        'near_boxes': lambda: native.near_boxes(many[:, :3], many[:, :3] + 1.0, spread, spread,
                                                10**9),
        'Law': a_law, 'copy': law.copy, 'reset': law.reset,
        'hold': lambda: law.hold([a_touch(k) for k in range(40)], poses),
        'wrenches': lambda: law.wrenches(poses, motions),
        'pair_wrench': lambda: law.pair_wrench(3), 'frequency': lambda: law.frequency,
        'forward': lambda: networks.forward(network, np.array([6, 4, 4]), inputs),
        'kernel': lambda: of_kernel().batch(many, many, threads=3),
        'fold': lambda: networks.fold(networks.OCTANT, *(np.ones((1, *shape)) for shape in (
            (3,), (3, 3))), np.zeros(1, np.int64), np.ones((1, 3)))}
    for name, call in calls.items():
        failed = 0
        for allocation in range(1, 10_000):
            failing.fail_at(allocation)
            try:
                call()
            except MemoryError:
                failed += 1
            reached = failing.fail_at(0)
            if not reached:
                break
        call()
        print(name, failed)


# --- fuzz -----------------------------------------------------------------------------------------


class Raising:
    """Refuses to be a number, an array or a sequence."""

    def __index__(self) -> int:
        raise ZeroDivisionError

    __float__ = __bool__ = __len__ = __iter__ = __array__ = __index__  # type: ignore[assignment]


class Posing:
    """Says of itself that it is an array of some shape at no place."""

    __array_interface__ = {'shape': (4, 7), 'typestr': '<f8', 'version': 3}


WHOLES = [0, 1, -1, 2, 3, 4, 7, 2**31, 2**31 - 1, -2**31, 2**62, 2**63 - 1, -2**63, 2**64, 10**400]
FLOATS = [0.0, -0.0, 1.0, np.nan, np.inf, -np.inf, 1e308, 5e-324, 1e50, 1e-50, 1e-100, -1.0]
TYPES = ['f8', 'f4', 'f2', 'i8', 'i4', 'u1', '?', 'c16', 'O', 'S3', 'U3', 'M8[s]', '>f8', '>i8',
         'g', 'V8']
PLAIN: list[Any] = [None, True, 'exact', 'mlp', '', b'\0', '\udcff', (), [], {}, object(),
                    Raising(), Posing(), len, int, tuple, np.ma.masked, range(7), [[]], [0.0] * 7,
                    (1,) * 3, [None] * 7, memoryview(b'1234567'), np.float64(1), np.zeros(()),
                    iter([1, 2])]


def odd_array(rng: np.random.Generator, array: np.ndarray) -> Any:
    """Return an array changed in kind, shape, order of memory or numbers."""
    if array.ndim == 0 or array.size > 2**20 or array.dtype.char not in 'fdl?':
        return array.reshape(-1)[:3]
    changed = array.copy()
    match int(rng.integers(9)):
        case 0:
            flat = changed.reshape(-1)
            for place in rng.integers(flat.size, size=3 if flat.size else 0):
                if changed.dtype.kind == 'i':
                    flat[place] = max(-2**63, min(WHOLES[rng.integers(len(WHOLES))], 2**63 - 1))
                else:
                    flat[place] = FLOATS[rng.integers(len(FLOATS))]
        case 1:  # kind
            with np.errstate(all='ignore'):
                try:
                    changed = changed.astype(TYPES[rng.integers(len(TYPES))])
                except (TypeError, ValueError):
                    pass
        case 2:  # fewer, or more rows
            changed = np.resize(changed, (int(rng.integers(8)), *changed.shape[1:]))
        case 3:
            shape = [int(n) for n in rng.integers(0, 9, size=rng.integers(5))]
            changed = np.resize(changed, shape)
        case 4:  # every second place, or back to front
            wide = np.repeat(changed, 2, axis=-1)
            changed = wide[..., ::2] if rng.random() < 0.5 else changed[::-1]
        case 5:
            changed = np.asfortranarray(changed)
        case 6:  # not aligned
            raw = np.zeros(changed.nbytes + 1, np.uint8)
            changed = np.ndarray(changed.shape, changed.dtype, raw.data, 1)
        case 7:
            changed.flags.writeable = False
        case 8:  # one number, seen in many places
            many = int(rng.choice([1, 4, 2**20, 2**40]))
            try:
                changed = np.broadcast_to(changed.reshape(-1)[:1], (many, *changed.shape[1:]))
            except ValueError:
                pass
    return changed


def odd(rng: np.random.Generator, value: Any) -> Any:
    """Return what may stand in the place of an argument."""
    kind = rng.random()
    if isinstance(value, np.ndarray) and kind < 0.6:
        return odd_array(rng, value)
    if isinstance(value, (tuple, list)) and value and kind < 0.6:
        items = list(value)
        place = int(rng.integers(len(items)))
        items[place] = odd(rng, items[place])
        return type(value)(items[:int(rng.integers(1, 2 + len(items)))])
    pool = [WHOLES, FLOATS, PLAIN][rng.integers(3)]
    return pool[rng.integers(len(pool))]


ALLOWED = (ValueError, TypeError, MemoryError, OverflowError, AttributeError, RuntimeError,
           ZeroDivisionError, BufferError)
"""SystemError is none of them: it says that the extension broke Python's rules."""


def fuzz(seed: int, rounds: int) -> None:
    """Call everything with some arguments replaced; print how many calls were refused."""
    from box_contact_ros import ContactSolver
    from box_contact_ros.solver.contact import Contact, Contacts

    rng = np.random.default_rng(seed)
    solver, public, law = exact(), ContactSolver(UNIT, UNIT), a_law()
    one, places = np.ones((1, 3)), np.array([[0, 1], [2, 3]])
    network, widths = np.zeros(4 * 7 + 5 * 4, np.float32), np.array([6, 4, 4])
    boxes = [np.zeros((4, 3)), np.ones((4, 3)), np.ones(4, bool), np.ones(4, bool), 10]
    targets: list[tuple[Callable[..., Any], list[Any], dict[str, Any]]] = [
        (native.PairSolver, ['mlp', UNIT, UNIT, np.zeros(9, np.float32), 0.1], {}),
        (solver, [POSE, ABOVE], {}), (public, [POSE, ABOVE], {}),
        (solver.batch, [rows(), rows()], {'size_a': np.ones((4, 3)), 'threads': 2, 'patch': True}),
        (public.batch, [rows(), rows()], {'size_b': np.ones((4, 3)), 'threads': 2, 'patch': False}),
        (public.batch, [rows()], {'sizes': np.ones((4, 3)), 'pairs': places}),
        (solver.solve, [rows(), rows(), one, one, 2, True, places], {}),
        (native.stages, [rows(), rows(), one, one, ['axis', 'upper_points']], {}),
        (native.near_pairs, near_arguments(), {}), (native.near_boxes, boxes, {}),
        (native.use_contact_types, [Contact, Contacts], {}),
        (native.Law, [np.ones(2), np.ones((2, 3)), np.zeros((2, 3)), 0, 200.0, 0.0, 0.001, 0.5,
                      9.81], {}),
        (law.hold, [[a_touch(1), a_touch(2)], rows(2)], {}),
        (law.wrenches, [rows(2), np.zeros((2, 6))], {}), (law.pair_wrench, [1], {}),
        (native.PairSolver, [networks.KERNEL, UNIT, UNIT, OF_KERNEL, 0.1], {}),
        (of_kernel().solve, [rows(), rows(), one, one, 2, True, places], {}),
        (networks.fold, [networks.FEATURES, np.ones((2, 3)), np.ones((2, 3, 3)),
                         np.zeros(2, np.int64), np.ones((2, 3))], {}),
        (networks.forward, [network, widths, np.zeros((2, 6), np.float32)], {})]
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
        if rng.random() < 0.05:
            args = args[:int(rng.integers(len(args)))] if rng.random() < 0.5 else [*args, None]
        try:
            function(*args, **keywords)
            answered += 1
        except ALLOWED:
            pass
        native.use_contact_types(Contact, Contacts)
    print(answered, rounds - answered)


if __name__ == '__main__':
    task, *words = sys.argv[1:]
    if task == 'fuzz':
        fuzz(*map(int, words))
    else:
        globals()[task](*words)
