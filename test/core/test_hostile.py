# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bad arguments from Python or C are errors, never a crash.

helpers/hostile_calls.py calls the extension in a process of its own, once with sanitizers; the C
interface is called from here.
"""
from __future__ import annotations

import ctypes
import sys
import sysconfig
from collections.abc import Callable
from ctypes import byref, c_double, c_int64, c_void_p
from pathlib import Path

import hostile_calls
import numpy as np
import pytest
from test_library import EACH_FUNCTION_ONCE, LIBRARY, Query, Results, Rows, run, tool

from box_contact_ros.core import instruction_sets, native

CORE = Path(__file__).resolve().parents[2] / 'box_contact_ros' / 'core'
BAD_ARGUMENT = 1


def attack(seed: int, rounds: int, **environment: str) -> tuple[int, int]:
    """Return how many of the random calls were answered, and how many refused."""
    answered, refused = run(sys.executable, '-W', 'ignore', hostile_calls.__file__, seed, rounds,
                            **environment).splitlines()[-1].split()
    return int(answered), int(refused)


# --- Python ---------------------------------------------------------------------------------------


def test_bad_arguments_are_refused() -> None:
    """Those with a name, and 20,000 random calls of all functions."""
    assert min(attack(36, 20_000)) > 1000


@pytest.mark.builds
def test_with_sanitizers(tmp_path: Path) -> None:
    """No access out of bounds and no undefined behaviour in the library and its binding."""
    extension, kernel = tmp_path / Path(native.__file__).name, tmp_path / 'kernel.o'
    compiler = (
        tool('g++'), '-std=c++17', '-g1', '-w', '-Wno-psabi', '-fPIC', '-fvisibility=hidden',
        # Null pointers and ends of objects are the address sanitizer's too; twice takes long.
        '-fsanitize=address,undefined,float-cast-overflow', '-fno-sanitize-recover=all',
        '-fno-sanitize=null,object-size,pointer-overflow',
        '-DBOX_CONTACT_VERSION=""', '-ffp-contract=off', EACH_FUNCTION_ONCE)
    # The kernel has no virtual function, and its arrays are those that the library has taken.
    run(*compiler, '-fno-sanitize=alignment,vptr', '-c', CORE / 'src/kernel.cpp', '-o', kernel)
    run(*compiler, '-shared', f'-I{sysconfig.get_path("include")}', f'-I{np.get_include()}', kernel,
        CORE / 'binding/module.cpp', *(CORE / 'src/library' / f'{name}.cpp' for name in (
            'library', 'force', 'index', 'motion')), '-o', extension)
    libraries = [run('g++', f'-print-file-name=lib{name}.so').strip() for name in ('asan', 'ubsan')]
    assert min(attack(37, 5000, EXTENSION=str(extension), LD_PRELOAD=' '.join(libraries),
                      ASAN_OPTIONS='detect_leaks=0:allocator_may_return_null=1')) > 200


# --- C --------------------------------------------------------------------------------------------


class CLibrary(ctypes.CDLL):
    """libbox_contact with the forces of one body."""

    def __init__(self) -> None:
        super().__init__(str(LIBRARY))
        self.bc_error_text.restype = ctypes.c_char_p
        self.forces = c_void_p()
        assert self.bc_patch_forces_create((c_double * 7)(1, 1, 1, 1), c_int64(1), None,
                                           byref(self.forces)) == 0


@pytest.fixture(scope='module')
def library() -> CLibrary:
    return CLibrary()


def test_null_pointers(library: CLibrary) -> None:
    """In the place of each argument that must not be one."""
    pose, contact, rows = (c_double * 7)(0, 0, 0, 0, 0, 0, 1), (c_double * 64)(), Rows()
    rows.size, results = ctypes.sizeof(Rows), Results(ctypes.sizeof(Results))
    nearest, nearest_results = (c_int64 * 12)(12 * 8), (c_int64 * 6)(6 * 8)
    sweep = (c_double * 20)(*pose, *pose, 1, 1, 1)
    approach, approach_results = (c_int64 * 15)(15 * 8), (c_int64 * 9)(9 * 8, 0, 0, 6 * 8)
    sweep_rows = (c_int64 * 16)(16 * 8, ctypes.sizeof(Rows))  # no rows
    no, fine = c_double(0.0), c_double(1e-6)
    answer = (c_int64 * 12)(12 * 8)  # a bc_patches without rows
    body_box = (c_double * 11)(0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1)
    step, motion = c_double(0.001), (c_int64 * 4)(4 * 8)  # a bc_motion that wants nothing
    made, wrench, box = c_void_p(), (c_double * 6)(), (c_double * 10)(*[0.0] * 6, *[1.0] * 4)
    calls: list[tuple[Callable[..., int], list[object], set[int]]] = [
        (library.bc_collide, [box, box, None, contact], {0, 1, 3}),
        (library.bc_collide_rows, [byref(rows), None, byref(results), 1, None], {0, 2}),
        (library.bc_distance, [box, box, nearest], {0, 1, 2}),
        (library.bc_distance_rows, [byref(rows), nearest_results, 1, None], {0, 1}),
        (library.bc_time_of_impact, [sweep, sweep, no, fine, approach], {0, 1, 4}),
        (library.bc_least_distance, [sweep, sweep, fine, approach], {0, 1, 3}),
        (library.bc_time_of_impact_rows, [sweep_rows, no, fine, approach_results, 1, None], {0, 3}),
        (library.bc_least_distance_rows, [sweep_rows, fine, approach_results, 1, None], {0, 2}),
        (library.bc_patch_forces_create,
         [(c_double * 7)(1, 1, 1, 1), c_int64(1), None, byref(made)], {0, 3}),
        (library.bc_patch_forces_copy, [library.forces, byref(made)], {0, 1}),
        (library.bc_patch_forces_set_bodies,
         [library.forces, (c_double * 7)(1, 1, 1, 1), c_int64(1)], {0, 1}),
        (library.bc_patch_forces_hold, [library.forces, answer, pose], {0, 1}),
        (library.bc_patch_forces_set_boxes, [library.forces, body_box, c_int64(1)], {0, 1}),
        (library.bc_patch_forces_ahead, [library.forces, step, pose, wrench, pose], {0, 2, 3, 4}),
        (library.bc_patch_forces_advance,
         [library.forces, step, pose, wrench, None, motion], {0, 2, 3, 5}),
        (library.bc_patch_forces_forget,
         [library.forces, byref(c_int64(0)), c_int64(1)], {0, 1})]
    for call, given, needed in calls:
        assert call(*given) == 0, call.__name__
        for place in needed:
            changed = [None if place == k else value for k, value in enumerate(given)]
            assert call(*changed) == BAD_ARGUMENT, (call.__name__, place)
            assert b'is a null pointer' in library.bc_error_text()
    for name in ('bc_patch_forces_destroy', 'bc_patch_forces_reset', 'bc_patch_forces_bodies'):
        getattr(library, name)(None)


SIZES_BELOW_ZERO = """
#include "query.hpp"

using namespace box_contact::BOX_CONTACT_SET;

int main() {
  Query<double> asked;
  const Vec<double> size{-1.0, -1.0, -1.0};
  const Pose<double> a{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};
  const Pose<double> b{{0.1, 0.2, 0.9}, {0.0, 0.0, 0.0, 1.0}};
  query(a, b, size, size, asked);
  return asked.pair.valid || asked.axis.axis < 0 || asked.axis.axis > 14;
}
"""


def test_sizes_below_zero_have_an_axis(tmp_path: Path) -> None:
    """They are refused after the test of axes, where a tolerance below zero left no best axis."""
    if 'avx2' not in instruction_sets():
        pytest.skip('a single pair is a vector of the machine from AVX2 on')
    source, program = tmp_path / 'sizes.cpp', tmp_path / 'sizes'
    source.write_text(SIZES_BELOW_ZERO)
    run(tool('g++'), '-std=c++17', '-O1', '-Wno-psabi', '-march=x86-64-v3', '-ffp-contract=off',
        '-fsanitize=undefined', '-fno-sanitize-recover=all', f'-I{CORE / "src"}', source, '-o',
        program)
    run(program)


def test_numbers_of_nothing(library: CLibrary) -> None:
    """A patch, a model, or a count that there is not."""
    box, contact = (c_double * 10)(*[0.0] * 6, *[1.0] * 4), (c_double * 64)(*[7.0] * 64)
    wrong = [{'patch': patch} for patch in (3, -1, 2**31 - 1)]
    wrong += [{'model': model} for model in (2, -1)]
    for fields in wrong:
        query = Query.of(**fields)
        assert library.bc_collide(box, box, byref(query), contact) == BAD_ARGUMENT
    assert set(contact) == {7.0}
    for count in (-1, -2**63, 2**57, 2**62, 2**63 - 1):
        rows = Rows(ctypes.sizeof(Rows), count, 1, box, box, box, box, 1, 1, None)
        results, refused = Results(ctypes.sizeof(Results)), c_int64()
        assert library.bc_collide_rows(byref(rows), None, byref(results), 1,
                                       byref(refused)) == BAD_ARGUMENT
        assert refused.value == -1
