# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The source paper's Tables 1 to 4 and Figures 4, 9 and 10, redone: paper_tables.md.

All are made, unless some are chosen: these go to quick-results/. It needs the extras report and
soup (matplotlib, tqdm, python-fcl); of Tables 1 and 2 and Figure 9 report alone.
"""
from __future__ import annotations

import sys
from collections.abc import Collection, Sequence
from pathlib import Path

from box_contact_ros.extras import require

from .. import output
from . import tables

TABLES, FIGURES = (1, 2, 3, 4), (4, 9, 10)
QUICK = 10  # `--quick` looks at every tenth pattern


def report(numbers: Collection[int], drawn: Collection[int], folder: Path, *, quick: bool) -> str:
    """Return the page with some of the tables and figures; pictures and CSV go to `folder`."""
    note = f' Quick run: every {QUICK}th pattern only, and fewer for the soup.' if quick else ''
    sections = []
    if {1, 2} & set(numbers):
        _begin('tables 1 and 2')
        sections += tables.sections_1_and_2(numbers, QUICK if quick else 1, folder)
    if 9 in drawn:
        _begin('figure 9')
        tables.draw_figure_9(folder / 'paper_figure_9.png')
        sections.append(output.page('benchmarks/paper/pages/figure_9', shown=tables.SHOWN))
    if 4 in drawn:
        from . import rotation  # only here: python-fcl is an extra

        _begin('figure 4')
        rows = rotation.measure(quick=quick)
        rotation.draw(rows, folder / 'paper_figure_4.png')
        sections.append(rotation.section(rows))
    if {3, 4} & set(numbers) or 10 in drawn:
        from . import soup_tables  # only here: python-fcl is an extra

        _begin('soup of tables 3 and 4')
        written, touching = (tables.with_sets(tables.TABLE_1[name])[1]['seed_1']['external'].inputs
                             for name in ('as written', 'dropped'))
        result = soup_tables.measure(written, touching, quick=quick)
        output.write_csv(folder / 'paper_soup.csv', result.rows,
                         about=output.machine(('numpy', 'python-fcl')))
        if 10 in drawn:
            soup_tables.draw_figure_10(result, folder / 'paper_figure_10.png')
        sections += [section(result) for number, section in soup_tables.SECTIONS.items()
                     if number in {*numbers, *drawn}]
        sections.append(soup_tables.section_errors(result))
    head = output.page('benchmarks/paper/pages/page', machine=output.machine(), note=note,
                       took=output.took())
    return '\n'.join([head, *sections])


def _begin(part: str) -> None:
    """Print what the program works on: all parts take minutes."""
    print(f'paper: {part} ...', flush=True)


def main(args: Sequence[str] | None = None) -> int:
    """Write the page and its pictures."""
    parser = output.report_parser(
        'python -m benchmarks.paper', __doc__, out='page, pictures and CSV',
        quick=f'look at every {QUICK}th pattern only, and at fewer for the soup')
    parser.add_argument('--table', type=int, action='append', choices=TABLES,
                        help='only this table; may be given several times')
    parser.add_argument('--figure', type=int, action='append', choices=FIGURES,
                        help='only this figure; may be given several times')
    options = parser.parse_args(args)
    chosen = options.table or options.figure
    folder = output.results_folder(parser, options, part=bool(chosen))
    numbers = options.table or (() if chosen else TABLES)
    drawn = options.figure or (() if chosen else FIGURES)
    of_soup = not {3, 4}.isdisjoint(numbers) or not {4, 10}.isdisjoint(drawn)
    require('report', *(['soup'] if of_soup else []))
    page = report(numbers, drawn, folder, quick=options.quick)
    (folder / 'paper_tables.md').write_text(page, encoding='utf-8')
    print(f'written to {folder / "paper_tables.md"}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
