# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ten million pairs on many machines, with Dask: `python docs/examples/dask_pairs.py [SCHEDULER]`.

SCHEDULER is the address of a Dask scheduler, such as tcp://10.0.0.5:8786 (`dask scheduler` starts
one, `dask worker ADDRESS` a worker). Without it, two workers start on this machine. Needs the extra
`cluster`, on every machine.

It prints:

    10,000,000 pairs on 2 workers: 9,370,469 contacts
    mean volume 0.671 m³, deepest 0.689 m
"""
import sys

import numpy as np
from distributed import Client, LocalCluster, as_completed

from box_contact_ros import ContactSolver

CONTAINER = (12.192, 2.438, 2.591)
PAIRS, ROWS = 10_000_000, 100_000


def solve(seed: int, rows: int) -> tuple[int, float, float]:
    """Draw pairs of swaying containers; return contacts, sum of volumes, largest depth."""
    random = np.random.default_rng(seed)
    stack = np.tile((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), (rows, 1))
    load = stack.copy()
    load[:, :3] += random.uniform((-1.0, -0.3, 2.55), (1.0, 0.3, 2.65), (rows, 3))
    load[:, 3:6] = random.normal(0.0, 0.01, (rows, 3))
    found = ContactSolver(CONTAINER, CONTAINER, model='exact').batch(load, stack)
    return int(found.colliding.sum()), float(found.volume.sum()), float(-found.separation.min())


def main(pairs: int = PAIRS, rows: int = ROWS) -> None:
    """Share the blocks among all workers, and add up what they return as it arrives."""
    cluster = sys.argv[1] if len(sys.argv) > 1 else LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None)
    with Client(cluster) as client:
        blocks = client.map(solve, range(pairs // rows), rows=rows)
        contacts, volume, depth = 0, 0.0, 0.0
        for _, found in as_completed(blocks, with_results=True):
            contacts += found[0]
            volume += found[1]
            depth = max(depth, found[2])
        workers = len(client.scheduler_info()['workers'])
    print(f'{pairs:,} pairs on {workers} workers: {contacts:,} contacts')
    print(f'mean volume {volume / contacts:.3f} m³, deepest {depth:.3f} m')


if __name__ == '__main__':
    main()
