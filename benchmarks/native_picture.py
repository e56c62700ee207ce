# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of the report `native`: single calls relative to MuJoCo's, with their ranges."""
from __future__ import annotations

import statistics
from pathlib import Path

from . import output

UNIT_NAME = 'mjc_BoxBox'
DRAWN = {'exact volume': ('exact', 'exact', 'o'),
         'exact covariance': ('exact, with covariance', 'exact', 'D'),
         'mlp volume': ('mlp', 'mlp', 'o'), 'Bullet btBoxBoxDetector': ('Bullet', 'Bullet', 'o'),
         'mj_geomDistance': ('MuJoCo mj_geomDistance', 'MuJoCo', 'o'),
         'Coal ComputeContactPatch': ('Coal, contact patch', 'Coal', 'o')}
"""Contestants of the CSV: their names here, whose colour they have, and their marks."""


def draw(path: Path, table: Path, instruction_set: str, sets: list[str]) -> None:
    """Draw the median ratios of all copies with the lowest and the highest, from the CSV."""
    ratios = {(row['set'], row['contestant'].removesuffix(', single')): row
              for row in output.read_csv(table) if row['instruction_set'] == instruction_set
              and row['contestant'].endswith(', single')}
    median = statistics.median(float(ratios[of_set, 'exact volume']['by_unit']) for of_set in sets)
    figure, axes = output.subplots(1, 1, (7.0, 1.6 + 0.33 * len(sets)))
    axis = axes[0, 0]
    for number, (name, (shown, whose, mark)) in enumerate(DRAWN.items()):
        rows = [(place, ratios[of_set, name]) for place, of_set in enumerate(sets)
                if (of_set, name) in ratios]
        middle, low, high = ([float(row[column]) for _, row in rows] for column in (
            'by_unit', 'by_unit_low', 'by_unit_high'))
        axis.errorbar(middle, [place + 0.1 * (number - 2.5) for place, _ in rows],
                      xerr=[[m - least for m, least in zip(middle, low)],
                            [most - m for m, most in zip(middle, high)]],
                      fmt=mark, markersize=5, color=output.COLOURS[whose], label=shown,
                      markerfacecolor='white' if mark == 'D' else None, elinewidth=1.2)
    axis.axvline(1.0, color=output.COLOURS['MuJoCo'], linewidth=1.2, label=f'MuJoCo {UNIT_NAME}')
    axis.set_yticks(range(len(sets)), sets)
    axis.invert_yaxis()
    axis.set(xscale='log', xlabel=f'time of a call from C [times {UNIT_NAME}]',
             title=f'In the median set exact takes {median:.1f} times as long as MuJoCo '
                   f'({instruction_set})')
    axis.set_xticks([0.5, 1, 2, 5, 10], ['0.5', '1', '2', '5', '10'])
    axis.minorticks_off()
    axis.grid(color='0.9', linewidth=0.5)
    axis.set_axisbelow(True)
    figure.legend(loc='outside lower center', ncols=3, fontsize=9, frameon=False)
    figure.savefig(path, metadata={'Software': None})
