# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Streams of pose pairs for the bench: named, seeded, each with the box sizes it is meant for.

All poses of a stream are made before it is played, so that playing one costs nothing but sending.
"""
from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks import pose_sets
from benchmarks.pose_sets import CONTAINER, CUBE, SETS, Pairs, coplanar, drawn
from box_contact_ros.scene.scene_solver import Box, Pair, Scene
from box_contact_ros.view.recording.stream import Size, Stream

GAPS = (1e-3, 1.0)  # least and largest SAT gap of the pairs that are apart [m]


def separated(rng: np.random.Generator, n: int) -> Pairs:
    """Draw cubes of edge 2 in any pose, apart by a SAT gap of 1 mm to 1 m."""
    sizes = np.tile(CUBE, (n, 1))
    return pose_sets.any_pose(rng, sizes, sizes, -pose_sets.log_uniform(rng, *GAPS, n))


def crane_run(rng: np.random.Generator, n: int) -> Pairs:
    """Lower a container onto another by a crane and lift it: the whole motion, in n poses.

    The motion takes 18 s; it is played faster or slower if n poses take another time to send.
    """
    from box_contact_ros.demo.mujoco_crane import (  # only here: MuJoCo is an extra
        Crane,
        CraneScenario,
    )

    scenario = CraneScenario.drawn(int(rng.integers(1, 2**31)))
    crane = Crane(scenario, n / scenario.duration)
    a, b = np.empty((n, 7)), np.empty((n, 7))
    for row in range(n):
        a[row], b[row] = crane.load_pose, crane.stack_pose
        crane.step()
    return Pairs(a, b, np.tile(scenario.size, (n, 1)), np.tile(scenario.stack_size, (n, 1)))


@dataclass(frozen=True)
class StreamSource:
    """Where a stream comes from: how it is drawn, the size of both boxes [m], what it is."""

    draw: Callable[[np.random.Generator, int], Pairs]
    size: Size
    description: str


STREAMS: dict[str, StreamSource] = {name: StreamSource(*source) for name, source in {
    'random': (partial(drawn, SETS['random cubes']), CUBE,
               'cubes in any pose, 0.1 to 10 % deep'),
    'touching': (partial(drawn, SETS['touching']), CUBE, 'cubes in any pose that just touch'),
    'near-parallel': (partial(drawn, SETS['stacks']), CUBE,
                      'stacked cubes, tilt 1e-6 to 1e-3 rad, 1 mm deep'),
    'coplanar': (coplanar, CUBE, 'stacked cubes, faces exactly coplanar'),
    'separated': (partial(drawn, separated), CUBE, 'cubes in any pose, 1 mm to 1 m apart'),
    'containers': (partial(drawn, SETS['containers']), CONTAINER,
                   '40 ft containers with sway, 0.1 to 10 % deep'),
    'crane': (crane_run, CONTAINER, 'a recorded run of the crane'),
}.items()}
"""The streams by name; neighbours are for boxes of the same sizes."""


def make_stream(name: str, count: int, seed: int = 1) -> Stream:
    """Return `count` pairs of a named stream; the same for the same seed.

    Raises ValueError for a name that is not one of STREAMS or a count below 1.
    """
    if name not in STREAMS:
        raise ValueError(f'stream {name!r} is not one of: {", ".join(STREAMS)}')
    if count < 1:
        raise ValueError(f'a stream needs 1 pair or more, not {count}')
    source = STREAMS[name]
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    pairs = source.draw(rng, count)
    return Stream(name, source.size, source.size, pairs.pose_a, pairs.pose_b)


def by_sizes(streams: Sequence[Stream]) -> list[list[Stream]]:
    """Group streams for boxes of the same sizes, in the order in which they first come."""
    groups: dict[tuple[Size, Size], list[Stream]] = {}
    for stream in streams:
        groups.setdefault(stream.sizes, []).append(stream)
    return list(groups.values())


SWING_TICKS = 100  # of a period of the crowd's motion
STEPS = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 0, 1))
"""From a box of the crowd to its neighbours, the likeliest to touch first."""


def crowd(boxes: int, seed: int = 1) -> tuple[Scene, np.ndarray]:
    """Return cubes that swing in a block, five pairs a box, and poses (ticks, boxes, 7).

    Neighbours are 1.1 edges apart and swing by 0.08 along each axis: some touch in every tick.
    """
    rng = np.random.default_rng([seed, boxes])
    side = int(np.ceil(boxes ** (1 / 3)))
    places = np.argwhere(np.ones((side, side, side)))[:boxes]
    names = {tuple(place): f'b{number}' for number, place in enumerate(places)}
    pairs = [Pair.between(name, names[other]) for step in STEPS for place, name in names.items()
             if (other := tuple(np.add(place, step))) in names]
    swing = np.arange(SWING_TICKS)[:, None, None] / SWING_TICKS + rng.random((boxes, 3))
    poses = np.zeros((SWING_TICKS, boxes, 7))
    poses[..., :3] = 1.1 * places + 0.08 * np.sin(2.0 * np.pi * swing)
    poses[..., 6] = 1.0
    return Scene({name: Box(name, (1.0, 1.0, 1.0)) for name in names.values()},
                 tuple(pairs[:5 * boxes]), pose_array=True), poses
