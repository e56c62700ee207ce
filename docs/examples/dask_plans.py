# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A folder of plans on many machines: `python docs/examples/dask_plans.py [FOLDER [SCHEDULER]]`.

All machines must see FOLDER. SCHEDULER is the address of a Dask scheduler, such as
tcp://10.0.0.5:8786 (`dask scheduler` starts one, `dask worker ADDRESS` a worker). Without it, two
workers start on this machine. Needs the extras `cluster` and `plans` on every machine.

It prints:

    lorry.csv: overloaded
    pallet.csv: unsupported, overloaded
    semitrailer.csv: overloaded
    ship.edi: unsupported, goes with what falls
    solution.csv: not read
    5 plans, 0 sound
"""
import sys
from pathlib import Path

from box_contact_ros.extras import require

require('cluster', 'plans')  # what is missing is named in one line
from distributed import Client, LocalCluster

FILES = Path(__file__).with_name('files')


def judge(path: Path) -> tuple[bool, str]:
    """Return whether the plan of a file is sound, and what is wrong with it."""
    from box_contact_ros import inspect_plan

    try:
        found = inspect_plan(path)
    except (OSError, ValueError):  # such as a file without a unit
        return False, 'not read'
    return found.sound, ', '.join(dict.fromkeys(row.kind for row in found.rows())) or 'sound'


def main(folder: Path = FILES, scheduler: str | None = None) -> None:
    """Share the files among all workers, and print what each says."""
    cluster = scheduler or LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    paths = sorted(path.absolute() for path in folder.iterdir())
    with Client(cluster) as client:
        answers = client.gather(client.map(judge, paths))
    for path, (_, text) in zip(paths, answers):
        print(f'{path.name}: {text}')
    print(f'{len(paths):,} plans, {sum(sound for sound, _ in answers):,} sound')


if __name__ == '__main__':
    main(*map(Path, sys.argv[1:2]), *sys.argv[2:3])
