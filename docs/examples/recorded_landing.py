# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Analyse a recorded landing: `python docs/examples/recorded_landing.py [BAG]`.

Reads the two boxes' poses from a bag, solves all of them again in one batch, and prints when the
load touched, how deep it went, and how far model `mlp` was from the exact point. Needs the extra
`bag`. Without a bag it takes the shipped one.

It prints:

    800 ticks, 700 in contact, first at tick 100
    depth: 0.9 mm at most, 0.02 mm at the end
    point: 0.001 mm a tick at most in the last 100 ticks
    mlp: 2 µm off the exact point at most
"""
import sys
from pathlib import Path

import numpy as np

from box_contact_ros import ContactSolver
from box_contact_ros.resources import resource_path
from box_contact_ros.view.recording.bag_file import read_replay


def main() -> None:
    """Print the analysis of one recording."""
    bag = Path(sys.argv[1]) if len(sys.argv) > 1 else resource_path('recordings', 'crane_landing')
    replay = read_replay(bag)
    contacts = {model: ContactSolver(replay.size_a, replay.size_b, model=model).batch(
        replay.pose_a, replay.pose_b) for model in ('exact', 'mlp')}
    exact, mlp = contacts['exact'], contacts['mlp']
    touching = exact.colliding
    depth = -exact.separation[touching]
    wander = np.linalg.norm(np.diff(exact.point[touching], axis=0), axis=1)
    error = np.linalg.norm((mlp.point - exact.point)[touching], axis=1)
    print(f'{len(touching)} ticks, {touching.sum()} in contact, first at tick {touching.argmax()}')
    print(f'depth: {1e3 * depth.max():.1f} mm at most, {1e3 * depth[-1]:.2f} mm at the end')
    print(f'point: {1e3 * wander[-100:].max():.3f} mm a tick at most in the last 100 ticks')
    print(f'mlp: {1e6 * error.max():.0f} µm off the exact point at most')


if __name__ == '__main__':
    main()
