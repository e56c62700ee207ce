# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blocks of patches that are solved side by side have the bits that they have alone."""
from __future__ import annotations

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
from patience import PATIENCE
from worlds import FLOOR, World, turned

from box_contact_ros import ContactSolver
from box_contact_ros.core import instruction_sets

TOWERS, HEIGHT = 11, 3
KINDS = ('steady', 'uneven', 'impacts', 'belts', 'turntable', 'spins', 'late', 'finer')
SPINS = np.array([300.0, 1e-10, 30.0])  # of a tower's boxes by their sizes beyond 0.4 m [rad/s/m]


def towers(kind: str) -> list[list[tuple]]:
    """Return the rows of boxes that stand askew on the floor, each tower apart from the others.

    So few on each other are solved one by one. Towers side by side fill the lanes.
    """
    random, found = np.random.default_rng(3), []
    for tower in range(TOWERS):
        rows, top = [], 0.0
        for level in range(HEIGHT):
            size = random.uniform(0.4, 0.8, 3)
            gap = 0.02 * (tower % 4) if kind == 'impacts' else -1e-4
            at = *(random.uniform(-0.15, 0.15, 2) + (2.0 * (tower % 4), 2.0 * (tower // 4))), \
                top + gap + 0.5 * size[2]
            mass = 10.0 ** (level * (tower % 3)) if kind in ('impacts', 'finer') else 20.0
            tilt = 0.02 * random.normal() if kind == 'impacts' else 0.0
            rows.append((size, mass, at, turned((1, 0, 0), tilt)))
            top = at[2] + 0.5 * size[2]
        found.append(rows)
    return found


def motion(kind: str, chosen: list[list[tuple]]) -> np.ndarray:
    """Return poses, velocities and wrenches (steps, towers, 57) of towers in one world."""
    rows = [FLOOR, *(row for tower in chosen for row in tower)]
    pairs = np.array([(k if level else 0, k + 1) for k, level in
                      enumerate(level for _ in chosen for level in range(HEIGHT))])
    belts = np.tile((0.3, 0.1, 0.0), (len(pairs), 1)) if kind == 'belts' else None
    world = World(*rows, pairs=[] if kind == 'late' else pairs.tolist())
    if kind != 'late':
        world.forces.hold(pairs, surface_velocity=belts)
    random, found = np.random.default_rng(4), []
    for k in range(80):
        if kind == 'late':
            if k % 5 == 0:
                asked, solver = world.poses.copy(), ContactSolver()
                contacts = solver.batch(asked, sizes=world.size, pairs=pairs)
            if k % 5 == 2:
                world.forces.hold(pairs, contacts, asked, age=0.01, period=0.025)
        if kind == 'turntable':
            world.velocities[0, 5] = 0.5
        if kind == 'spins' and k % 20 == 0:
            spins = np.tile(SPINS, len(chosen))[:, None]
            world.velocities[1:, 3:] = spins * (world.size[1:] - 0.4)
        world.step(random.uniform(1e-6, 0.02) if kind == 'uneven' else 0.005)
        moved = np.hstack([world.poses, world.velocities, world.wrenches])[1:]
        found.append(moved.reshape(len(chosen), -1))
    return np.array(found)


@pytest.mark.parametrize('kind', KINDS)
def test_a_tower_beside_others_has_the_bits_that_it_has_alone(kind: str) -> None:
    all_towers = towers(kind)
    together = motion(kind, all_towers)
    for k, tower in enumerate(all_towers):
        assert motion(kind, [tower]).tobytes() == together[:, [k]].tobytes(), f'tower {k}'


def pile(threads: int, *, find_pairs: bool = False) -> bytes:
    """Return poses and velocities of boxes that have fallen on each other."""
    random = np.random.default_rng(5)
    rows = [(random.uniform(0.2, 0.5, 3), 10.0 ** random.uniform(0, 1.5),
             (*random.uniform(-0.8, 0.8, 2), 0.4 + 0.12 * k), turned(random.normal(size=3), 2.0))
            for k in range(40)]
    rows = [(size, mass, at, turn / np.linalg.norm(turn)) for size, mass, at, turn in rows]
    world = World(FLOOR, *rows, threads=threads, rest=False, find_pairs=find_pairs)
    for _ in range(150):
        world.step(0.01)
    return world.poses.tobytes() + world.velocities.tobytes()


def print_hash() -> None:
    every = b''.join(motion(kind, towers(kind)).tobytes() for kind in KINDS)
    print(hashlib.sha256(every + pile(1) + pile(1, find_pairs=True)).hexdigest())


def test_instruction_sets_have_the_same_bits() -> None:
    found = {}
    for name in instruction_sets():
        found[name] = subprocess.run(
            [sys.executable, __file__], check=True, text=True, timeout=PATIENCE,
            stdout=subprocess.PIPE,
            env={**os.environ, 'BOX_CONTACT_INSTRUCTION_SET': name,
                 'PYTHONPATH': os.pathsep.join(sys.path)}).stdout
    assert len(set(found.values())) == 1, found


def test_threads_have_the_same_bits() -> None:
    assert pile(1) == pile(3) == pile(3, find_pairs=True)


def advance_here_and_in_a_fork() -> None:
    """Fork between two steps of separate boxes; both processes end at the same poses."""
    rows = [((0.5, 0.5, 0.5), 1.0, (k % 20, k // 20, 0.25 + 0.001 * (k % 7))) for k in range(300)]
    world = World(FLOOR, *rows, threads=3).step(0.01)
    ours, theirs = os.pipe()
    child = os.fork()
    found = world.step(0.01).poses.tobytes()
    if not child:
        os.write(theirs, hashlib.sha256(found).digest())
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
    assert os.read(ours, 100) == hashlib.sha256(found).digest()


def test_a_process_that_forks_has_the_same_bits() -> None:
    subprocess.run([sys.executable, '-W', 'ignore', __file__, 'fork'], check=True,
                   timeout=PATIENCE, env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})


if __name__ == '__main__':
    if sys.argv[1:] == ['fork']:
        advance_here_and_in_a_fork()
    else:
        print_hash()
