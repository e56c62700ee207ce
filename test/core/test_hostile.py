# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Garbage from Python or C is an error, never a crash.

helpers/hostile_calls.py attacks the extensions in processes of their own, once with sanitizers; the
C interface is attacked from here.
"""
from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterator
from ctypes import byref, c_double, c_int64, c_void_p
from pathlib import Path

import numpy as np
import pytest
from test_library import BAD_WEIGHTS, LIBRARY, WEIGHTS, Options, Results, Rows, Size, run, tool

pytest.importorskip('benchmarks')

import hostile_calls

from box_contact_ros.core import FORCE, native
from box_contact_ros.paper import _networks

ROOT = Path(__file__).resolve().parents[2]
CALLS = hostile_calls.__file__
ATTACKS = [name for name, value in vars(hostile_calls).items()
           if value.__class__ is type(run) and value.__module__ == 'hostile_calls'
           and value.__code__.co_argcount == 0 and value.__annotations__['return'] == 'None']
BAD_ARGUMENT, NO_MEMORY = 1, 6


def attack(*words: object, **environment: str) -> str:
    """Run a process of hostile calls; a signal that ends it is a failure."""
    return run(sys.executable, '-W', 'ignore', CALLS, *words, **environment)


# --- Python ---------------------------------------------------------------------------------------


@pytest.mark.parametrize('name', ATTACKS)
def test_attacks(name: str) -> None:
    attack(name)


def test_random_hostile_calls() -> None:
    """20,000 of all functions; some are answered, most are refused."""
    answered, refused = map(int, attack('fuzz', 36, 20_000).split())
    assert answered > 1000 and refused > 1000


ALONE = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location('_native', sys.argv[1])
core = importlib.util.module_from_spec(spec)
spec.loader.exec_module(core)
try:
    solver = core.PairSolver('exact', (1.0, 1, 1), (1.0, 1, 1))
except RuntimeError as error:
    sys.exit(str(error))
assert type(solver([0] * 6 + [1], [0, 0, 0.9, 0, 0, 0, 1])) is tuple
"""


def test_the_extension_alone() -> None:
    """Without the package it answers by plain tuples, and refuses an unknown instruction set."""
    words = [sys.executable, '-c', ALONE, native.__file__]
    run(*words)
    done = subprocess.run(words, env=os.environ | {FORCE: 'none'}, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (
        1, 'the environment names an unknown instruction set\n')


ALLOCATOR = """
#include <cstdlib>
#include <new>

// Let the allocation of this number fail, counted from now on in all threads. Returns how many of
// the last number have failed: 0 where it was not reached.
static long left;
extern "C" long fail_at(long number) {
  long before = __atomic_exchange_n(&left, number, __ATOMIC_SEQ_CST);
  return before < 0;
}

void* operator new(std::size_t size) {
  long mine = __atomic_load_n(&left, __ATOMIC_SEQ_CST);
  if (mine > 0 && __atomic_sub_fetch(&left, 1, __ATOMIC_SEQ_CST) == 0) {
    __atomic_store_n(&left, -1, __ATOMIC_SEQ_CST);
    throw std::bad_alloc();
  }
  if (void* found = std::malloc(size ? size : 1)) return found;
  throw std::bad_alloc();
}
void operator delete(void* place) noexcept { std::free(place); }
void operator delete(void* place, std::size_t) noexcept { std::free(place); }
"""


@pytest.fixture(scope='module')
def allocator(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a library whose `new` fails on demand."""
    folder = tmp_path_factory.mktemp('allocator')
    (folder / 'allocator.cpp').write_text(ALLOCATOR)
    run(tool('g++'), '-O1', '-shared', '-fPIC', folder / 'allocator.cpp', '-o',
        folder / 'allocator.so')
    return folder / 'allocator.so'


def test_each_allocation_may_fail(allocator: Path) -> None:
    """Each in turn is a MemoryError, or is not needed; then the same call is answered."""
    lines = attack('allocations', allocator, LD_PRELOAD=str(allocator)).splitlines()
    failed = {name: int(count) for name, count in map(str.split, lines)}
    for name in ('PairSolver', 'batch', 'near_boxes', 'Law', 'copy', 'hold', 'forward'):
        assert failed[name] > 0, name


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_with_sanitizers(tmp_path: Path) -> None:
    """No access out of bounds and no undefined behaviour in the binding, by the same calls."""
    arguments = ['-std=c++17', '-Og', '-g1', '-w', '-Wno-psabi', '-fPIC', '-shared',
                 '-fvisibility=hidden',
                 '-fsanitize=address,undefined,float-cast-overflow', '-fno-sanitize-recover=all',
                 '-DBOX_CONTACT_VERSION=""', '-ffp-contract=off', '-fno-tree-slp-vectorize',
                 f'-I{sysconfig.get_path("include")}', f'-I{np.get_include()}']
    core = ROOT / 'box_contact_ros' / 'core'
    sources = [core / 'binding' / 'module.cpp', *(
        core / 'src' / 'library' / f'{name}.cpp' for name in ('kernel', 'library', 'force'))]
    paper = Path(_networks.__file__).with_name('networks.cpp')
    builds = [subprocess.Popen([tool('g++'), *arguments, *map(str, given), '-o',
                                str(tmp_path / Path(made.__file__).name)])
              for made, given in ((native, sources), (_networks, [paper]))]
    assert [build.wait() for build in builds] == [0, 0]
    libraries = [run('g++', f'-print-file-name=lib{name}.so').strip() for name in ('asan', 'ubsan')]
    environment = {'EXTENSIONS': str(tmp_path), 'LD_PRELOAD': ' '.join(libraries),
                   'ASAN_OPTIONS': 'detect_leaks=0:allocator_may_return_null=1'}
    for name in ATTACKS:
        if name != 'too_little_memory':  # shadow memory takes all that there is
            attack(name, **environment)
    last = attack('fuzz', 37, 5000, **environment).splitlines()[-1]
    answered, refused = map(int, last.split())
    assert answered > 200 and refused > 200


# --- C --------------------------------------------------------------------------------------------


class CLibrary(ctypes.CDLL):
    """libbox_contact with a solver, a law, and what they are asked of."""

    def __init__(self) -> None:
        super().__init__(str(LIBRARY))
        for name in ('bc_error_text', 'bc_instruction_set'):
            getattr(self, name).restype = ctypes.c_char_p
        self.size, self.solver, self.law = Size((c_double * 3)(1, 1, 1)), c_void_p(), c_void_p()
        assert self.create(None) == 0
        body = (c_double * 8)(1, 1, 1, 1)
        assert self.bc_law_create(body, c_int64(1), None, byref(self.law)) == 0

    def create(self, options: Options | None) -> int:
        made = c_void_p()
        status: int = self.bc_solver_create(byref(self.size), byref(self.size),
                                            byref(options) if options else None, byref(made))
        assert bool(made) == (status == 0)
        if made:
            self.bc_solver_destroy(self.solver)
            self.solver = made
        return status


@pytest.fixture(scope='module')
def library() -> CLibrary:
    return CLibrary()


def status_with(library: CLibrary, path: Path | str) -> tuple[int, str]:
    """Return the status and the words of making a solver with a weights file."""
    status = library.create(Options(ctypes.sizeof(Options), 1, os.fsencode(path), 0.0))
    return status, library.bc_error_text().decode()


def test_null_pointers(library: CLibrary) -> None:
    """In the place of each argument that must not be one."""
    pose, contact, rows = (c_double * 7)(0, 0, 0, 0, 0, 0, 1), (c_double * 64)(), Rows()
    rows.size, results = ctypes.sizeof(Rows), Results(ctypes.sizeof(Results))
    made, wrench, size = c_void_p(), (c_double * 6)(), byref(library.size)
    calls: list[tuple[Callable[..., int], list[object], set[int]]] = [
        (library.bc_solver_create, [size, size, None, byref(made)], {0, 1, 3}),
        (library.bc_solve, [library.solver, pose, pose, None, None, 2, contact], {0, 1, 2, 6}),
        (library.bc_solve_rows, [library.solver, byref(rows), byref(results), 1, None], {0, 1, 2}),
        (library.bc_law_create, [(c_double * 8)(1, 1, 1, 1), c_int64(1), None, byref(made)],
         {0, 3}),
        (library.bc_law_copy, [library.law, byref(made)], {0, 1}),
        (library.bc_law_hold, [library.law, None, c_int64(0), pose], {0, 3}),
        (library.bc_law_wrenches, [library.law, pose, wrench, wrench], {0, 1, 2, 3}),
        (library.bc_law_pair_wrench, [library.law, c_int64(1), wrench], {0, 2})]
    for call, given, needed in calls:
        assert call(*given) == 0, call.__name__
        for place in needed:
            changed = [None if place == k else value for k, value in enumerate(given)]
            assert call(*changed) == BAD_ARGUMENT, (call.__name__, place)
            assert b'is a null pointer' in library.bc_error_text()
    for name in ('bc_solver_destroy', 'bc_law_destroy', 'bc_law_reset', 'bc_law_frequency'):
        getattr(library, name)(None)


def test_numbers_of_nothing(library: CLibrary) -> None:
    """A patch, a model, a use, or a count that there is not."""
    pose, contact = (c_double * 7)(0, 0, 0, 0, 0, 0, 1), (c_double * 64)(*[7.0] * 64)
    for patch in (3, -1, 2**31 - 1):
        assert library.bc_solve(library.solver, pose, pose, None, None, patch, contact) == (
            BAD_ARGUMENT)
    assert set(contact) == {7.0}
    for model in (2, -1):
        assert library.create(Options(ctypes.sizeof(Options), model, None, 0.0)) == BAD_ARGUMENT
    for count in (-1, -2**63, 2**57, 2**62, 2**63 - 1):
        rows = Rows(ctypes.sizeof(Rows), count, pose, pose, None, None, None, 1)
        results, refused = Results(ctypes.sizeof(Results)), c_int64()
        assert library.bc_solve_rows(library.solver, byref(rows), byref(results), 1,
                                     byref(refused)) == BAD_ARGUMENT
        assert refused.value == -1
    law = c_void_p()
    for use in (3, -1):
        loop = (ctypes.c_int64 * 7)(56, use & 0xffffffff)
        assert library.bc_law_create((c_double * 8)(1, 1, 1, 1), c_int64(1), loop, byref(law)) == (
            BAD_ARGUMENT) and not law


@pytest.fixture(params=['a FIFO', 'a folder', 'zeros without end', 'too large'])
def no_weights(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[Path, str]]:
    """Return the path of something that holds no weights, and what the library says of it."""
    path, words = tmp_path / 'weights.safetensors', 'is no regular file'
    if request.param == 'a FIFO':
        os.mkfifo(path)
    elif request.param == 'a folder':
        path.mkdir()
    elif request.param == 'zeros without end':
        path = Path('/dev/zero')
    else:
        words = 'is larger than 16 MiB'
        path.touch()
        os.truncate(path, 2**40)
    yield path, words


@pytest.mark.timeout(20)
def test_what_is_no_weights_file(library: CLibrary, no_weights: tuple[Path, str]) -> None:
    """Nothing waits, and no more than the limit is read."""
    path, words = no_weights
    status, said = status_with(library, path)
    assert (status, said) == (BAD_WEIGHTS, f'weights file {path} {words}')


SHAPES = {'a product that overflows': [2**62, 2**62], 'one number beyond all': [2**64 + 1],
          'three dimensions': [1, 1, 1], 'none': [], 'below zero': [-1], 'a thousand': [1] * 1000}


@pytest.mark.parametrize('tensor', ['share.0.bias', 'share.0.weight', 'share.1.weight',
                                    'share.1.bias'])
@pytest.mark.parametrize('shape', SHAPES)
def test_shapes_that_no_tensor_has(library: CLibrary, tmp_path: Path, tensor: str,
                                   shape: str) -> None:
    data = WEIGHTS.read_bytes()
    length = int.from_bytes(data[:8], 'little')
    entries = json.loads(data[8:8 + length])
    for offsets in (entries[tensor]['data_offsets'], [4, 4], [0, 2**64 - 4]):
        changed = {**entries, tensor: {**entries[tensor], 'shape': SHAPES[shape],
                                       'data_offsets': offsets}}
        header = json.dumps(changed, separators=(',', ':')).encode()
        path = tmp_path / 'weights.safetensors'
        path.write_bytes(len(header).to_bytes(8, 'little') + header + data[8 + length:])
        status, said = status_with(library, path)
        assert status == BAD_WEIGHTS and tensor in said


OUT_OF_MEMORY = """
import ctypes, sys
sys.path[:0] = sys.argv[1:3]
from test_hostile import *
failing, library = ctypes.CDLL(sys.argv[3]), CLibrary()
poses = (c_double * (7 * 2000))(*[0, 0, 0, 0, 0, 0, 1] * 2000)
rows = Rows(ctypes.sizeof(Rows), 2000, poses, poses, None, None, None, 2000)
colliding = (ctypes.c_bool * 2000)()
results = Results(ctypes.sizeof(Results), colliding)
options = Options(ctypes.sizeof(Options), 1, os.fsencode(WEIGHTS), 0.0)
made, loop = c_void_p(), None
calls = {
    'create': lambda: library.create(options),
    'rows': lambda: library.bc_solve_rows(library.solver, byref(rows), byref(results), 3, None),
    'law': lambda: library.bc_law_create((c_double * 8)(1, 1, 1, 1), c_int64(1), None, byref(made)),
    'copy': lambda: library.bc_law_copy(library.law, byref(made))}
for name, call in calls.items():
    statuses = set()
    for allocation in range(1, 10_000):
        failing.fail_at(ctypes.c_long(allocation))
        statuses.add(call())
        if not failing.fail_at(ctypes.c_long(0)):
            break
    assert call() == 0
    assert statuses == {0, NO_MEMORY}, (name, statuses)
    print(name, allocation - 1)
"""


def test_each_allocation_of_the_library_may_fail(allocator: Path) -> None:
    """The status says so; solver and law stay as they were."""
    tests = ROOT / 'test'
    lines = run(sys.executable, '-c', OUT_OF_MEMORY, tests / 'core', tests / 'helpers', allocator,
                LD_PRELOAD=str(allocator)).splitlines()
    assert [line.split()[0] for line in lines] == ['create', 'rows', 'law', 'copy']
