# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""libbox_contact for C, C++ and others: its interface, and each way in which programs find it.

ament_cmake is not installed here: a plain CMake project stands in for one of an ament package,
which finds the library by the same `find_package`.
"""
from __future__ import annotations

import ctypes
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
from ctypes import POINTER, byref, c_bool, c_double, c_int, c_int32, c_int64, c_size_t
from importlib import metadata
from pathlib import Path

import numpy as np
import poses
import pytest
from patience import PATIENCE
from poses import Pairs, assert_same_bits, fields

from box_contact_ros import Body, ContactSolver, PatchForces, face_patches, make_model
from box_contact_ros.core import FORCE, instruction_sets
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.solver.pose import rotation_matrix

ROOT = Path(__file__).resolve().parents[2]
PREFIX = next(prefix for prefix in map(Path, [*os.environ.get('AMENT_PREFIX_PATH', '').split(':'),
                                              sys.prefix])
              if (prefix / 'lib' / 'libbox_contact.so').is_file())
"""Where colcon or pip has installed the library."""
LIBRARY = PREFIX / 'lib' / 'libbox_contact.so'
INCLUDES = f'-I{PREFIX / "include"}'
LINKED = (str(LIBRARY), f'-Wl,-rpath,{LIBRARY.parent}')
"""What a compiler is told to link the library."""
EACH_FUNCTION_ONCE = '-Dalways_inline=noinline'
"""Compile no function of the core in each of its callers: a kernel takes 2 s in place of 12."""
EXAMPLE = ROOT / 'docs' / 'examples' / 'cpp'
STRICT = ('-Wall', '-Wextra', '-Wshadow', '-Wconversion', '-Werror', '-pedantic')
EXAMPLE_SAYS = [
    'height 2.600 m: no contact, gap 0.009 m',
    'height 2.590 m: contact, depth 0.001 m, normal (0.000, 0.000, -1.000), '
    'point (0.142, 0.044, 1.295) m',
    'batch: 1 0, volumes 0.030 0.000 m3, first refused row -1',
    'refused: pose_a quaternion (0, 0, 0, 0) has no length within 1e-100 to 1e100']


def run(*words: object, **environment: str) -> str:
    done = subprocess.run(list(map(str, words)), env={**os.environ, **environment}, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=PATIENCE)
    assert done.returncode == 0, done.stdout[-4000:]
    return done.stdout


def tool(name: str) -> str:
    """Return the path of a program, which may be in the environment's bin alone, or skip."""
    path = shutil.which(name) or shutil.which(name, path=sysconfig.get_path('scripts'))
    if not path:
        pytest.skip(f'{name} is not installed')
    return path


def test_tools_of_the_environment_are_found(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where its bin is not in PATH, as under make."""
    program = tmp_path / 'cmake'
    program.touch(0o755)
    monkeypatch.setenv('PATH', '')
    monkeypatch.setattr(sysconfig, 'get_path', lambda name: str(tmp_path))
    monkeypatch.setattr(pytest, 'skip', pytest.fail)
    assert tool('cmake') == str(program)


# --- C, and a language that calls C ---------------------------------------------------------------


def test_a_c_program(tmp_path: Path) -> None:
    """Contacts, rows, refusals; by every instruction set."""
    program = tmp_path / 'library_test'
    run(tool('gcc'), '-std=c11', *STRICT, INCLUDES, ROOT / 'test/core/library_test.c',
        *LINKED, '-lm', '-o', program)
    for name in instruction_sets():
        assert run(program, **{FORCE: name}).endswith(f', {name}: 0 failures\n')
    assert subprocess.run([program], env={FORCE: 'none'}).returncode == 1


class Query(ctypes.Structure):
    """`bc_query`."""

    _fields_ = [('size', c_size_t), ('model', c_int), ('patch', c_int), ('margin', c_double)]

    @classmethod
    def of(cls, model: int = 0, patch: int = 2, margin: float = 0.0) -> Query:
        return cls(ctypes.sizeof(cls), model, patch, margin)


class Rows(ctypes.Structure):
    """`bc_rows`."""

    _fields_ = [('size', c_size_t), ('count', c_int64), ('pose_count', c_int64),
                *((name, POINTER(c_double)) for name in (
                    'poses_a', 'poses_b', 'sizes_a', 'sizes_b')),
                ('size_count_a', c_int64), ('size_count_b', c_int64), ('pairs', POINTER(c_int64))]


class Results(ctypes.Structure):
    """`bc_results`."""

    _fields_ = [('size', c_size_t), ('colliding', POINTER(c_bool)),
                *((name, POINTER(c_double)) for name in (
                    'separation', 'normal', 'point', 'volume', 'covariance')),
                ('axis', POINTER(c_int32))]


@pytest.fixture(scope='module')
def library() -> ctypes.CDLL:
    return ctypes.CDLL(str(LIBRARY))


def by_ctypes(library: ctypes.CDLL, model: str, pairs: Pairs, threads: int = 1,
              places: np.ndarray | None = None) -> Contacts:
    """Return what the library says of rows with sizes of their own."""
    def at(array: np.ndarray, kind: type) -> object:
        return array.ctypes.data_as(POINTER(kind))

    poses = len(pairs.pose_a)
    count = poses if places is None else len(places)
    found = Contacts(np.empty(count, bool), np.empty(count), np.empty((count, 3)),
                     np.empty((count, 3)), np.empty(count), np.empty((count, 3, 3)),
                     np.empty(count, np.int32))
    rows = Rows(ctypes.sizeof(Rows), count, poses, *(at(part, c_double) for part in pairs), poses,
                poses, None if places is None else at(places, c_int64))
    results = Results(ctypes.sizeof(Results), at(found.colliding, c_bool),
                      *(at(field, c_double) for field in fields(found)[1:-1]),
                      at(found.axis, c_int32))
    query = Query.of(model=int(model == 'mlp'))
    assert library.bc_collide_rows(byref(rows), byref(query), byref(results), threads, None) == 0
    return found


def some_pairs() -> Pairs:
    return poses.of_all_kinds(500, 6)


@pytest.mark.parametrize('model', ['exact', 'mlp'])
def test_other_languages_get_the_bits_of_python(library: ctypes.CDLL, model: str) -> None:
    """By ctypes; in one thread and in three, row by row and by place."""
    pairs = some_pairs()
    solver = ContactSolver(model=model)
    wanted = solver.batch(*pairs[:2], size_a=pairs.size_a, size_b=pairs.size_b)
    assert 0.3 < wanted.colliding.mean() < 0.9
    for threads in (1, 3):
        found = by_ctypes(library, model, pairs, threads)
        assert_same_bits(found, wanted)
    n = len(pairs.pose_a)
    all_poses = Pairs(*2 * (np.concatenate(pairs[:2]),), *2 * (np.concatenate(pairs[2:]),))
    places = np.random.default_rng(8).permutation(np.column_stack([np.arange(n), n + np.arange(n)]))
    found = by_ctypes(library, model, all_poses, 2, places)
    assert_same_bits(found, wanted[places[:, 0]])


def test_movers_allocate_no_memory(tmp_path: Path) -> None:
    program = tmp_path / 'movers_test'
    source = ROOT / 'test/core/movers_test.cpp'
    run(tool('g++'), '-std=c++17', '-O2', *STRICT, INCLUDES, source, *LINKED, '-o', program)
    assert run(program).endswith(' 0 failures\n')


def test_where_memory_ends_a_call_is_as_if_it_had_not_been(tmp_path: Path) -> None:
    """At each allocation of create, find, a path, set_boxes, hold, copy and advance in turn."""
    program = tmp_path / 'no_memory_test'
    run(tool('g++'), '-std=c++17', *STRICT, INCLUDES, ROOT / 'test/core/no_memory_test.cpp',
        *LINKED, '-o', program)
    for line in run(program).splitlines():
        assert line.endswith(' allocations, 0 faults')


@pytest.mark.parametrize('source', ['force_test.c', 'force_test.cpp'])
def test_forces_have_the_bits_of_python(tmp_path: Path, source: str) -> None:
    """A load that is dropped and pushed: 2,000 steps in C, in C++ and here."""
    compiler, standard = ('gcc', 'c11') if source.endswith('.c') else ('g++', 'c++17')
    program = tmp_path / 'force_test'
    run(tool(compiler), f'-std={standard}', '-O2', '-ffp-contract=off', *STRICT,
        INCLUDES, ROOT / 'test/core' / source, *LINKED, '-lm',
        '-o', program)
    *found, failures, _ = run(program).split()
    assert failures == '0'
    size, pair = (12.192, 2.438, 2.591), np.array([(0, 1)])
    solver = ContactSolver(size, size, model='exact')
    forces = PatchForces([Body(mass=20000.0, inertia=(1e12, 1e12, 1e12)),
                          Body.fixed()])
    poses = np.array([[0.3, 0.1, 2.601, 0.001, 0.002, 0.003, 1.0], [0, 0, 0, 0, 0, 0, 1.0]])
    velocities, outside = np.zeros((2, 6)), np.zeros((2, 6))
    outside[0, 2] = -9.81 * 20000.0
    for step in range(2000):
        if step % 5 == 0:
            contacts, asked = solver.batch(poses[:1], poses[1:]), poses.copy()
        if step % 5 == 2:
            forces.hold(pair, contacts, asked, age=0.002)
        outside[0, 0] = 40000.0 if step > 1000 else 0.0
        poses, velocities, wrenches, _ = forces.advance(0.001, poses, velocities, outside)
    assert [float.fromhex(number) for number in found] == [*poses[0, :3], *wrenches[0]]
    assert wrenches[0, 2] == pytest.approx(20000.0 * 9.81, rel=1e-3)
    assert wrenches[0, 0] == pytest.approx(-40000.0, rel=1e-3)
    assert np.abs(velocities).max() < 1e-3


def test_the_interface_alone_is_exported() -> None:
    """Nothing of the library meets a program's own names."""
    names = {line.split()[-1] for line in run(
        tool('nm'), '-D', '--defined-only', LIBRARY).splitlines()}
    assert 'bc_collide' in names and all(name.startswith('bc_') for name in names)


# --- how programs find it -------------------------------------------------------------------------


def example(program: Path) -> list[str]:
    return run(program).splitlines()


@pytest.mark.builds
def test_by_the_compiler_alone(tmp_path: Path) -> None:
    """Without a warning, and with C++20."""
    for standard in ('c++17', 'c++20'):
        run(tool('g++'), f'-std={standard}', *STRICT, INCLUDES,
            EXAMPLE / 'first_contact.cpp', *LINKED, '-o', tmp_path / standard)
        assert example(tmp_path / standard) == EXAMPLE_SAYS


@pytest.mark.builds
def test_without_exceptions(tmp_path: Path) -> None:
    """The header compiles; the words of what would be thrown are printed, and the program ends."""
    source, program = tmp_path / 'one.cpp', tmp_path / 'one'
    source.write_text('#include "box_contact/box_contact.hpp"\n'
                      'int main(int argc, char**) {\n'
                      '  box_contact::Box a{{{0, 0, 0}, {0, 0, 0, 1}}, {1, 1, 1}}, b = a;\n'
                      '  b.size.extent[2] = 2.0 - argc;\n'
                      '  return box_contact::collide(a, b).colliding - 1;\n}\n')
    run(tool('g++'), '-std=c++17', *STRICT, '-fno-exceptions', '-fno-rtti', INCLUDES,
        source, *LINKED, '-o', program)
    assert run(program) == ''
    done = subprocess.run([program, 'flat'], stderr=subprocess.PIPE, text=True)
    assert done.returncode < 0
    assert done.stderr == 'box_contact: size_b (1, 1, 0) is not within 1e-50 to 1e50 m\n'


def configure(source: Path, folder: Path, *options: str, **environment: str) -> None:
    run(tool('cmake'), '-S', source, '-B', folder, *options, **environment)
    run(tool('cmake'), '--build', folder, '--parallel', **environment)


@pytest.mark.builds
def test_by_find_package(tmp_path: Path) -> None:
    """No option is needed where the environment is active; and a version that there is not."""
    active = f'{PREFIX / "bin"}:{os.environ["PATH"]}'
    configure(EXAMPLE, tmp_path, PATH=active)
    found = re.search('^box_contact_ros_DIR:PATH=(.*)$', (tmp_path / 'CMakeCache.txt').read_text(),
                      re.M)
    assert found[1] == str(PREFIX / 'lib/cmake/box_contact_ros')
    assert example(tmp_path / 'first_contact') == EXAMPLE_SAYS
    for name, lines in (('stack', 3), ('landing', 7), ('yard_path', 4)):
        says = example(tmp_path / name)
        assert len(says) == lines
        text = (EXAMPLE / f'{name}.cpp').read_text()
        assert '\n'.join(f'//   {line}' for line in says) in text
    version = metadata.version('box_contact_ros')
    (tmp_path / 'CMakeLists.txt').write_text(
        'cmake_minimum_required(VERSION 3.18)\nproject(one LANGUAGES CXX)\n'
        f'find_package(box_contact_ros {version.rpartition(".")[0]} REQUIRED)\n'
        f'find_package(box_contact_ros {version} EXACT REQUIRED)\n'
        'find_package(box_contact_ros 99 QUIET)\n'
        'if(box_contact_ros_FOUND)\n  message(FATAL_ERROR found)\nendif()\n')
    run(tool('cmake'), '-S', tmp_path, '-B', tmp_path / 'versions', PATH=active)


@pytest.mark.builds
def test_by_pkg_config(tmp_path: Path) -> None:
    found = run(tool('pkg-config'), '--cflags', '--libs', 'box_contact',
                PKG_CONFIG_PATH=str(PREFIX / 'lib' / 'pkgconfig'))
    run(tool('g++'), '-std=c++17', EXAMPLE / 'first_contact.cpp', *shlex.split(found), '-o',
        tmp_path / 'one')
    assert example(tmp_path / 'one') == EXAMPLE_SAYS


ROWS = """
#include <cstdio>
#include <vector>
#include "box_contact/box_contact.hpp"
using namespace box_contact;

int main() {
  const std::vector<Pose> poses{{{0, 0, 0}, {0, 0, 0, 1}}, {{0, 0, 2.5}, {0, 0, 0, 1}}};
  const std::vector<Size> sizes{{2, 2, 2}, {4, 4, 4}};
  std::vector<std::int64_t> pairs{1, 0};
  std::vector<double> separation(2, 7.0);
  Results results;
  results.separation = separation.data();
  const auto refused = collide({poses, poses, sizes, sizes, pairs}, results);
  std::printf("%d %g %g\\n", int(refused), separation[0], separation[1]);
  collide({poses, poses, sizes, sizes, std::vector<std::int64_t>()}, results);
  std::printf("%g %g\\n", separation[0], separation[1]);
  collide({poses, poses, sizes, sizes}, results);
  std::printf("%g %g\\n", separation[0], separation[1]);
  try {
    collide({poses, poses, sizes, std::vector<Size>()}, results);
  } catch (const std::invalid_argument& error) {
    std::puts(error.what());
  }
}
"""


def test_rows_by_place(tmp_path: Path) -> None:
    """Sizes go with poses; a tick without near pairs has no rows, and not all of them.

    No sizes are refused.
    """
    (tmp_path / 'rows.cpp').write_text(ROWS)
    run(tool('g++'), '-std=c++17', *STRICT, INCLUDES, tmp_path / 'rows.cpp', *LINKED, '-o',
        tmp_path / 'rows')
    assert run(tmp_path / 'rows') == (
        '-1 -0.5 7\n-0.5 7\n-2 -4\nsizes must be one, or one for each pose, not 0\n')


DISTANCES = """
#include <cstdio>
#include <vector>
#include "box_contact/box_contact.hpp"
using namespace box_contact;

int main() {
  const Box a{{{0, 0, 0}, {0, 0, 0, 1}}, {2, 2, 2}}, b{{{4, 5, 1}, {0, 0, 0, 1}}, {2, 2, 2}};
  const Nearest nearest = distance(a, b);
  std::printf("%g %g %g %d\\n", nearest.distance, nearest.point_a[2], nearest.normal[1],
              nearest.colliding);
  const std::vector<Pose> poses{a.pose, b.pose};
  const std::vector<Size> sizes{a.size};
  std::vector<std::int64_t> pairs{1, 0, 0, 0};
  std::vector<double> distances(2), points(6);
  NearestResults results;
  results.distance = distances.data(), results.point_b = points.data();
  const auto refused = distance({poses, poses, sizes, sizes, pairs}, results, 2);
  std::printf("%d %g %g %g\\n", int(refused), distances[0], points[0], distances[1]);
  try {
    distance(a, {{{0, 0, 0}, {0, 0, 0, 0}}, {2, 2, 2}});
  } catch (const std::invalid_argument& error) {
    std::puts(error.what());
  }
}
"""


def test_distances_in_cpp(tmp_path: Path) -> None:
    """Edge to edge, by rows and places too, and a refusal."""
    (tmp_path / 'distances.cpp').write_text(DISTANCES)
    run(tool('g++'), '-std=c++17', *STRICT, INCLUDES, tmp_path / 'distances.cpp', *LINKED, '-o',
        tmp_path / 'distances')
    assert run(tmp_path / 'distances') == (
        '3.60555 0.5 0.83205 0\n-1 3.60555 1 0\n'
        'pose_b quaternion (0, 0, 0, 0) has no length within 1e-100 to 1e100\n')


class Polygon(ctypes.Structure):
    """`bc_polygon`."""

    _fields_ = [('size', c_size_t), ('count', c_int32), ('corners', 9 * (3 * c_double)),
                ('area', c_double), ('centre', 3 * c_double)]


def test_patches_of_faces_have_the_bits_of_python(library: ctypes.CDLL, tmp_path: Path) -> None:
    """In C, by ctypes, and in C++, without memory: containers, tilted by nothing and by degrees."""
    pairs = poses.joined(poses.near_parallel_pairs(np.random.default_rng(5), 500), some_pairs())
    found = ContactSolver(model='exact').batch(*pairs[:2], size_a=pairs.size_a, size_b=pairs.size_b)
    pairs, normal = Pairs(*(part[found.colliding] for part in pairs)), found.normal[found.colliding]
    count = len(normal)
    rows = np.column_stack((np.arange(count), count + np.arange(count)))
    wanted = face_patches(np.concatenate(pairs[2:]), np.concatenate(pairs[:2]), rows, normal)
    assert {0, 3, 4, 5, 6, 7} <= set(wanted.corner_count.tolist())
    want = np.column_stack((wanted.corner_count, wanted.area, wanted.centre,
                            wanted.polygon.reshape(-1, 27)))

    given = np.column_stack((*pairs, normal))
    patch = Polygon(ctypes.sizeof(Polygon))
    for pair, row in zip(given, want):
        a, b = (pair[[*range(7 * k, 7 * k + 7), *range(14 + 3 * k, 17 + 3 * k)]] for k in (0, 1))
        pointers = [array.ctypes.data_as(POINTER(c_double)) for array in (a, b, pair[20:].copy())]
        assert library.bc_face_patch(*pointers, c_double(1e-4), byref(patch)) == 0
        assert np.array_equal(row, [patch.count, patch.area, *patch.centre,
                                    *np.ravel(patch.corners)], equal_nan=True)

    program = tmp_path / 'face_patch_test'
    run(tool('g++'), '-std=c++17', '-O2', *STRICT, INCLUDES,
        ROOT / 'test/core/face_patch_test.cpp', *LINKED, '-o', program)
    (tmp_path / 'pairs').write_text('\n'.join(' '.join(map(float.hex, row)) for row in given))
    *lines, allocated = run(program, tmp_path / 'pairs').splitlines()
    assert allocated == '0 allocations'
    assert np.array_equal(want, [[float.fromhex(word) for word in line.split()] for line in lines],
                          equal_nan=True)


def test_a_debug_build_is_as_fast(tmp_path: Path) -> None:
    """The library is optimised whatever the simulator's configuration."""
    run(tool('cmake'), '-S', ROOT, '-B', tmp_path, '-DCMAKE_BUILD_TYPE=Debug',
        '-DCMAKE_EXPORT_COMPILE_COMMANDS=ON')
    commands = json.loads((tmp_path / 'compile_commands.json').read_text())
    assert len(commands) >= 3
    assert all(' -O3 ' in command['command'] for command in commands)


LIBRARY_CPP = 'box_contact_ros/core/src/library/library.cpp'
OTHER_FLAGS = f"""
cmake_minimum_required(VERSION 3.18)
project(others LANGUAGES CXX)
add_compile_options(-fno-exceptions -fno-rtti -fsanitize=address,undefined)
add_subdirectory({ROOT} box_contact)
"""


@pytest.mark.builds
@pytest.mark.parametrize('wanted', ['OFF', 'ON'])
def test_a_part_of_a_project_without_exceptions_and_with_sanitizers(
        tmp_path: Path, wanted: str) -> None:
    """The library keeps its exceptions; its kernels are sanitized where that is asked for alone."""
    (tmp_path / 'CMakeLists.txt').write_text(OTHER_FLAGS)
    run(tool('cmake'), '-S', tmp_path, '-B', tmp_path, '-DCMAKE_EXPORT_COMPILE_COMMANDS=ON',
        f'-DBOX_CONTACT_SANITIZE={wanted}')
    commands = json.loads((tmp_path / 'compile_commands.json').read_text())
    kernels = [command for command in commands if command['file'].endswith('kernel.cpp')]
    assert len(kernels) >= 1
    for command in commands:
        words = shlex.split(command['command'])
        assert words.index('-fexceptions') > words.index('-fno-exceptions')
        is_sanitized = command not in kernels or wanted == 'ON'
        assert ('-fno-sanitize=all' in words[words.index('-fsanitize=address,undefined'):]) != (
            is_sanitized)
    if wanted == 'OFF':
        run('make', '-C', tmp_path / 'box_contact', f'{LIBRARY_CPP}.o')


# --- machines -------------------------------------------------------------------------------------

def test_a_machine_without_avx_takes_the_baseline(tmp_path: Path) -> None:
    """One library runs on each: it asks the processor. A set that this one lacks is refused."""
    program = tmp_path / 'library_test'
    emulator = tool('qemu-x86_64')
    run(tool('gcc'), '-std=c11', INCLUDES, ROOT / 'test/core/library_test.c', *LINKED, '-lm', '-o',
        program)
    assert run(emulator, '-cpu', 'Nehalem', program).endswith(', baseline: 0 failures\n')
    done = subprocess.run([emulator, '-cpu', 'Nehalem', program], text=True,
                          env=os.environ | {FORCE: 'avx2'}, capture_output=True)
    assert 'BOX_CONTACT_INSTRUCTION_SET is none of: baseline' in done.stdout


def test_points_without_the_patch() -> None:
    """Verdict, separation and normal have the same bits; points are within both error bounds."""
    pairs = some_pairs()
    for model in ('exact', 'mlp'):
        solver = ContactSolver(model=model)
        sizes = {'size_a': pairs.size_a, 'size_b': pairs.size_b}
        whole = solver.batch(*pairs[:2], **sizes)
        point = solver.batch(*pairs[:2], **sizes, patch=False)
        assert_same_bits(whole, point, 'colliding', 'separation', 'normal')
        touching = whole.colliding
        size = np.maximum(pairs.size_a.max(axis=1), pairs.size_b.max(axis=1))
        depth = np.maximum(-whole.separation, 1e-9 * size)
        reach = np.abs(np.hstack(pairs[:2])).max(axis=1)
        bound = 2.0 * np.maximum(1e-9, 1e-14 * size / depth) * size + 1e-14 * reach
        off = np.linalg.norm(whole.point - point.point, axis=1)
        assert np.all(off[touching] <= bound[touching])
        assert np.isnan(point.volume[touching]).all() and not point.volume[~touching].any()
        assert point.covariance.shape == (len(touching), 3, 3)
        assert np.isnan(point.covariance).all()


def test_normals_within_the_margin() -> None:
    """Those of pairs apart point from A to B along the axis of their gap."""
    pairs = some_pairs()
    sizes = {'size_a': pairs.size_a, 'size_b': pairs.size_b}
    plain = ContactSolver().batch(*pairs[:2], **sizes)
    for margin in (0.1, np.inf):
        solver = ContactSolver(model='exact', margin=margin)
        found = solver.batch(*pairs[:2], **sizes)
        near = plain.colliding | (plain.separation <= margin)
        assert np.array_equal(np.isfinite(found.normal).all(axis=1), near)
        assert np.array_equal(found.normal[plain.colliding], plain.normal[plain.colliding])
        assert np.allclose(np.linalg.norm(found.normal[near], axis=1), 1.0, rtol=0.0, atol=1e-12)
        assert_same_bits(found, plain, 'colliding', 'separation', 'point', 'volume', 'covariance')
    apart = np.array([0.0, 0, 3.5, 0, 0, 0, 1])
    near = ContactSolver(poses.CUBE, poses.CUBE, margin=1.5)(poses.IDENTITY, apart)
    assert not near.colliding and near.normal.tolist() == [0.0, 0.0, 1.0]
    for bad in (np.nan, -1.0, 'far', [1.0]):
        with pytest.raises(ValueError, match='^margin '):
            ContactSolver(poses.CUBE, poses.CUBE, margin=bad)
    near = ContactSolver(poses.CUBE, poses.CUBE, model=make_model('mlp'), margin=1.5)
    assert near(poses.IDENTITY, apart).normal.tolist() == [0.0, 0.0, 1.0]
    with pytest.raises(ValueError, match='^margin 1 has no effect on model <.*Paper'):
        ContactSolver(poses.CUBE, poses.CUBE, model=make_model('paper'), margin=1.0)


@pytest.mark.parametrize('model', ['exact', 'mlp'])
def test_the_winning_axis(model: str) -> None:
    """The normal lies along the face of A or of B, or across both edges, also of pairs apart."""
    pairs = some_pairs()
    solver = ContactSolver(model=model, margin=np.inf)
    found = solver.batch(*pairs[:2], size_a=pairs.size_a, size_b=pairs.size_b)
    assert set(found.axis) == set(range(15))
    a, b = rotation_matrix(pairs.pose_a[:, 3:]), rotation_matrix(pairs.pose_b[:, 3:])
    rows, edges = np.arange(len(a)), found.axis >= 6
    for axes, first in ((a, 0), (b, 3)):
        face = (found.axis >= first) & (found.axis < first + 3)
        along = axes[rows, :, (found.axis - first) % 3]
        assert np.abs(np.abs((along * found.normal).sum(axis=1)[face]) - 1.0).max() < 1e-12
    for axes, edge in ((a, (found.axis - 6) // 3), (b, (found.axis - 6) % 3)):
        along = axes[rows, :, edge % 3]
        assert np.abs((along * found.normal).sum(axis=1)[edges]).max() < 1e-6
    one = ContactSolver(pairs.size_a[0], pairs.size_b[0], model=model)
    assert one(pairs.pose_a[0], pairs.pose_b[0]).axis == found.axis[0]


def test_a_place_without_a_pose_is_named() -> None:
    """A pair's place that there is not."""
    solver, twice = ContactSolver(poses.CUBE, poses.CUBE), np.array([poses.IDENTITY] * 2)
    with pytest.raises(ValueError, match=r'pairs\[1\] is \(1, 9\), but there are 2 poses'):
        solver.batch(twice, sizes=np.full((2, 3), 2.0), pairs=[[0, 1], [1, 9]])
