# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of the report `distance`: times beside MuJoCo's, and worst errors, by family."""
from __future__ import annotations

from pathlib import Path

from . import output

DRAWN = {'bc_distance, single': ('bc_distance', 'exact', 'o'),
         'bc_distance_rows, batch': ('in a batch', 'exact', 'D'),
         'mj_geomDistance, single': ('MuJoCo mj_geomDistance', 'MuJoCo', 'o'),
         'Coal ComputeDistance, single': ('Coal', 'Coal', 'o'),
         'FCL distance, single': ('FCL', 'FCL', 'o'),
         'Bullet btGjkPairDetector, single': ('Bullet', 'Bullet', 'o')}
"""Contestants of the CSV: their names here, whose colour they have, and their marks."""


def draw(path: Path, table: Path, instruction_set: str) -> None:
    """Draw times with the range of all copies, and the largest errors, from the CSV."""
    found = {(row['family'], row['contestant']): row for row in output.read_csv(table)
             if row['instruction_set'] == instruction_set}
    families = list(dict.fromkeys(family for family, _ in found))
    figure, axes = output.subplots(1, 2, (10.0, 1.9 + 0.27 * len(families)), sharey=True)
    times, errors = axes[0]
    for number, (name, (shown, whose, mark)) in enumerate(DRAWN.items()):
        rows = [(place + 0.12 * (number - 2.5), found[family, name])
                for place, family in enumerate(families) if (family, name) in found]
        look = {'color': output.COLOURS[whose], 'fmt': mark, 'markersize': 5, 'elinewidth': 1.2,
                'markerfacecolor': 'white' if mark == 'D' else None}
        middle, low, high, worst = ([float(row[column]) for _, row in rows] for column in (
            'by_unit', 'by_unit_low', 'by_unit_high', 'error_worst'))
        places = [place for place, _ in rows]
        times.errorbar(middle, places, xerr=[[m - least for m, least in zip(middle, low)],
                                             [most - m for m, most in zip(middle, high)]],
                       label=shown, **look)
        errors.errorbar(worst, places, **look)
    times.axvline(1.0, color=output.COLOURS['MuJoCo'], linewidth=0.8)
    times.set_yticks(range(len(families)), families)
    times.invert_yaxis()
    times.set(xscale='log', xlabel=f'time of a pair from C [times mj_geomDistance, '
              f'{instruction_set}]')
    times.set_xticks([0.1, 0.2, 0.5, 1, 2, 3], ['0.1', '0.2', '0.5', '1', '2', '3'])
    errors.set(xscale='log', xlabel='largest error [of size + distance of the centres]')
    for axis in (times, errors):
        axis.minorticks_off()
        axis.grid(color='0.9', linewidth=0.5)
        axis.set_axisbelow(True)
    figure.suptitle('Distances are exact to rounding, and take less time than MuJoCo '
                    'does, unless boxes are far apart', fontsize=12)
    figure.legend(loc='outside lower center', ncols=6, fontsize=9, frameon=False)
    figure.savefig(path, metadata={'Software': None})
