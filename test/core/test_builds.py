# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Other compilers, and an emulated 64-bit ARM: the library's bits, so its laws hold there too.

Forces are among them: where C++ leaves an order open, compilers differ.
"""
from __future__ import annotations

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import poses
import pytest
from test_library import EACH_FUNCTION_ONCE

from box_contact_ros import Body, ContactSolver, PatchForces, Sweep
from box_contact_ros.forces.patch_forces import GRAVITY

CORE = Path(__file__).resolve().parents[2] / 'box_contact_ros' / 'core'
FLAGS = ('-std=c++17', '-O2', '-ffp-contract=off', '-Wno-psabi', '-DBOX_CONTACT_VERSION=""',
         EACH_FUNCTION_ONCE)
BUILDS: dict[str, tuple[str, tuple[str, ...]]] = {
    'clang++': ('clang++', ()),
    'arm': ('aarch64-linux-gnu-g++', ('qemu-aarch64', '-L', '/usr/aarch64-linux-gnu'))}
"""By name, the compiler, and what its programs run in."""


def compile_library(compiler: str, folder: Path) -> Path:
    """Return the program `answers`, with the library in it."""
    sources = [Path(__file__).with_name('answers.cpp'), *(
        CORE / 'src' / f'{name}.cpp' for name in (
            'kernel', 'library/library', 'library/force', 'library/motion'))]
    objects = [folder / f'{source.stem}.o' for source in sources]

    def run(*words: object) -> None:
        subprocess.run([compiler, *map(str, words)], check=True)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda source, made: run(*FLAGS, f'-I{CORE / "include"}', '-c', source, '-o',
                                               made), sources, objects))
    run('-pthread', *objects, '-o', folder / 'answers')
    return folder / 'answers'


def tower() -> np.ndarray:
    """Return poses and velocities (12, 13) at the end of the loop `print_tower` of answers.cpp."""
    count, h = 12, 0.005
    k = np.arange(count)
    poses = np.column_stack([0.03 * (k % 3), 0.02 * (k % 2), k - 0.499, 0 * k, 0 * k, 0.01 * k,
                             1.0 + 0 * k])
    poses[0] = 0, 0, -0.5, 0, 0, 0, 1
    sizes = np.array([(20.0, 20.0, 1.0)] + [(1.0, 1.0, 1.0)] * (count - 1))
    pairs = np.column_stack([k[:-1], k[1:]])
    velocities, weights = np.zeros((2, count, 6))
    weights[1:, 2] = -GRAVITY * 600.0
    solver = ContactSolver((1, 1, 1), (1, 1, 1))
    forces = PatchForces([Body.fixed()]
                         + [Body.of_box((1, 1, 1), 600.0)] * (count - 1))
    for _ in range(400):
        forces.hold(pairs, solver.batch(poses, sizes=sizes, pairs=pairs), poses)
        poses, velocities, *_ = forces.advance(h, poses, velocities, weights)
    return np.hstack([poses, velocities])


@pytest.mark.parametrize('name', [
    pytest.param('clang++', marks=pytest.mark.builds), pytest.param('arm', marks=pytest.mark.arm)])
def test_another_build_has_the_same_bits(name: str, tmp_path: Path) -> None:
    """Verdict, separation, normal of both models, distances, motion; a row is its single call."""
    compiler, emulator = BUILDS[name]
    for program in (compiler, *emulator[:1]):
        if not shutil.which(program):
            pytest.skip(f'{program} is not installed')
    pairs = poses.joined(poses.of_all_kinds(1000, 4), poses.hard_pairs())
    (tmp_path / 'pairs.txt').write_text('\n'.join(
        ' '.join(float(number).hex() for number in row) for row in np.hstack(pairs)))
    program = compile_library(compiler, tmp_path)
    printed = subprocess.run([*emulator, program, tmp_path / 'pairs.txt'], check=True, text=True,
                             stdout=subprocess.PIPE).stdout
    lines = [list(map(float.fromhex, line.split())) for line in printed.splitlines()]
    bodies = tower()
    assert 10.9 < bodies[-1, 2] + 0.5 < 11.0
    assert np.array_equal(lines[-len(bodies):], bodies)
    count = len(pairs.pose_a)
    *of_models, of_distances = np.split(np.array(lines[:3 * count]), 3)
    of_motion = np.array(lines[3 * count:-len(bodies)])
    good = of_motion[:, 0] != -1.0
    ways = [np.roll(pose, shift, axis=0)[good] for pose in pairs[:2] for shift in (0, -1)]
    first, least = (getattr(ContactSolver(), f'{name}_batch')(
        Sweep(*ways[:2]), Sweep(*ways[2:]), size_a=pairs.size_a[good], size_b=pairs.size_b[good])
        for name in ('time_of_impact', 'least_distance'))
    assert good.mean() > 0.5
    assert np.array_equal(of_motion[good], np.column_stack(
        (first.time, least.time, least.nearest.distance)), equal_nan=True)
    nearest = ContactSolver().distance_batch(*pairs[:2], size_a=pairs.size_a, size_b=pairs.size_b)
    assert np.array_equal(of_distances, np.column_stack(
        (nearest.colliding, nearest.distance, nearest.normal)))
    for model, rows in zip(('exact', 'mlp'), of_models):
        wanted = ContactSolver(model=model).batch(
            *pairs[:2], size_a=pairs.size_a, size_b=pairs.size_b)
        assert 0.3 < wanted.colliding.mean() < 0.95
        for column, field in zip((rows[:, 0], rows[:, 1], rows[:, 2:]), poses.fields(wanted)):
            assert np.array_equal(column, field, equal_nan=True), model
