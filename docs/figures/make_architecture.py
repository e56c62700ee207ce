# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draw which folder of the package imports which: `python docs/figures/make_architecture.py`.

Reads the imports of every module with `ast`, and writes `architecture.svg` next to this file, or
into the folder of `--out`. An arrow runs from the folder that imports to the folder that is
imported. Arrows that follow from others by a detour are left out.
"""
from __future__ import annotations

import argparse
import ast
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / 'box_contact_ros'
PLACES = {  # column and row of a folder's box, and what it is for
    'bench': (0, 0, 'A/B latency'), 'demo': (1, 0, 'the crane, the demo'),
    'view': (2, 0, 'live page, markers'), 'node': (1, 1, 'all rclpy of the product'),
    'stream': (1, 2, 'poses → ticks, bytes'), 'plans': (2, 2, 'is this plan sound?'),
    'models': (0, 3, 'networks, polygon soup'), 'scene': (1, 3, 'boxes, pairs, one tick'),
    'forces': (2, 3, 'what contacts carry'), 'solver': (1, 4, 'boxes without a scene'),
    'core': (1, 5, 'poses → contact, C++17')}
WIDTH, HEIGHT, COLUMN, ROW = 190, 50, 240, 90


def imports(folder: str) -> set[str]:
    """Return the other folders of the package whose modules a folder imports."""
    found = set()
    for path in (PACKAGE / folder).rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text('utf-8'))):
            if isinstance(node, ast.ImportFrom) and node.level:
                above = path.relative_to(PACKAGE).parts[:-node.level]
                names = [node.module] if node.module else [name.name for name in node.names]
                found |= {(*above, *name.split('.'))[0] for name in names}
            elif isinstance(node, ast.ImportFrom) and node.module.startswith(PACKAGE.name + '.'):
                found.add(node.module.split('.')[1])
    return (found & PLACES.keys()) - {folder}


def arrows() -> list[tuple[str, str]]:
    """Return the pairs (imports, is imported), without those that follow from others."""
    graph = {folder: imports(folder) for folder in PLACES}

    def reachable(folder: str) -> set[str]:
        return graph[folder].union(*map(reachable, graph[folder]))

    return [(folder, other) for folder in PLACES for other in PLACES
            if other in graph[folder]
            and not any(other in reachable(between) for between in graph[folder] - {other})]


def drawing() -> str:
    """Return the SVG."""
    middle = {name: (20 + WIDTH / 2 + COLUMN * column, 20 + HEIGHT / 2 + ROW * row)
              for name, (column, row, _) in PLACES.items()}
    width = max(x for x, _ in middle.values()) + WIDTH / 2 + 20
    height = max(y for _, y in middle.values()) + HEIGHT / 2 + 20
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" '
             'font-family="sans-serif" text-anchor="middle">',
             '<defs><marker id="head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" '
             'markerHeight="8" orient="auto"><path d="M0,0 L10,5 L0,10 z" fill="#555"/></marker>'
             '</defs>', f'<rect width="{width:g}" height="{height:g}" fill="white"/>']
    for name, other in arrows():
        (x1, y1), (x2, y2) = middle[name], middle[other]
        aside = WIDTH / 2 if x2 > x1 else -WIDTH / 2
        if y1 == y2:
            x1, x2 = x1 + aside, x2 - aside
        elif PLACES[name][0] == 1 and x1 != x2:  # from the middle column to the side
            x1, y2 = x1 + aside, y2 - HEIGHT / 2
        elif x1 != x2:
            x2, y1 = x2 - aside, y1 + HEIGHT / 2
        else:
            y1, y2 = y1 + HEIGHT / 2, y2 - HEIGHT / 2
        lines.append(f'<line x1="{x1:g}" y1="{y1:g}" x2="{x2:g}" y2="{y2:g}" stroke="#555" '
                     'marker-end="url(#head)"/>')
    for name, (x, y) in middle.items():
        lines += [f'<rect x="{x - WIDTH / 2:g}" y="{y - HEIGHT / 2:g}" width="{WIDTH}" '
                  f'height="{HEIGHT}" rx="6" fill="#e8eef5" stroke="#4477aa"/>',
                  f'<text x="{x:g}" y="{y - 4:g}" font-weight="bold">{name}/</text>',
                  f'<text x="{x:g}" y="{y + 15:g}" font-size="13">{PLACES[name][2]}</text>']
    return '\n'.join([*lines, '</svg>', ''])


def main() -> None:
    """Write the drawing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, default=Path(__file__).parent,
                        help='folder for architecture.svg (default: that of this program)')
    (parser.parse_args().out / 'architecture.svg').write_text(drawing(), 'utf-8')


if __name__ == '__main__':
    main()
