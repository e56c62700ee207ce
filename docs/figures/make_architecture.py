# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draw how data go through the package: `python docs/figures/make_architecture.py`.

It writes `architecture.svg`, and `ros.svg` of the contact node, next to this file or into the
folder of `--out`. An arrow carries what stands beside it, from what comes in above to what goes
out below.
"""
from __future__ import annotations

import argparse
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / 'box_contact_ros'
PLACES = {  # column and row of a box, its name, and what it does or has; a folder ends in '/'
    'messages in': (0, 0, 'ROS messages', 'poses, questions'),
    'program in': (1, 0, 'your program', 'Python, C or C++'),
    'file in': (2, 0, 'a file', 'ship, pallet, world'),
    'read messages': (0, 1, 'node/, stream/', 'bytes → a tick'),
    'read files': (2, 1, 'plans/', 'rows → boxes, faults'),
    'scene': (1, 2, 'scene/', 'which boxes are near'),
    'solver': (1, 3, 'solver/, models/, core/', 'where do they touch?'),
    'write messages': (0, 4, 'node/, view/', 'arrays → bytes'),
    'forces': (1, 4, 'forces/', 'what contacts carry'),
    'inspect': (2, 4, 'plans/', 'statics: what falls'),
    'messages out': (0, 5, 'ROS messages', 'Contacts, Near, markers'),
    'program out': (1, 5, 'your program', 'or a simulator'),
    'verdict': (2, 5, 'you', 'lines, JSON, a page'),
}
FLOWS = [  # from, to, and what goes there
    ('messages in', 'read messages', 'bytes'),
    ('read messages', 'scene', 'poses of all boxes'), ('program in', 'scene', 'poses'),
    ('scene', 'solver', 'pairs'), ('file in', 'read files', 'text'),
    ('read files', 'solver', 'sizes, poses'),
    ('solver', 'write messages', 'contacts, distances'), ('solver', 'forces', 'contacts'),
    ('solver', 'inspect', 'contacts, patches of faces'),
    ('write messages', 'messages out', 'bytes'),
    ('forces', 'program out', 'wrenches or poses, loads'),
    ('inspect', 'verdict', 'causes, loads'),
]
NODE = {
    'poses': (0, 0, 'your simulator', 'two boxes, or a yard'),
    'node': (0, 1, 'contact_node', 'exact, or SAT and mlp'),
    'contacts': (0, 2, 'your controller', 'or RViz, ros2 bag'),
}
TOPICS = [('poses', 'node', 'box_a/pose, box_b/pose'),
          ('node', 'contacts', 'contact/point, contact/normal')]
"""The same of `ros.svg`."""
WIDTH, HEIGHT, COLUMN, ROW = 190, 50, 290, 100


def drawing(places: dict[str, tuple[int, int, str, str]], flows: list[tuple[str, str, str]],
            ) -> str:
    """Return the SVG."""
    middle = {key: (20 + WIDTH / 2 + COLUMN * column, 20 + HEIGHT / 2 + ROW * row)
              for key, (column, row, *_) in places.items()}
    width = max(x for x, _ in middle.values()) + WIDTH / 2 + 20
    height = max(y for _, y in middle.values()) + HEIGHT / 2 + 20
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" '
             f'width="{2 * width:g}" height="{2 * height:g}" '  # wide: a table gives it room
             'font-family="sans-serif" text-anchor="middle">',
             '<defs><marker id="head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" '
             'markerHeight="8" orient="auto"><path d="M0,0 L10,5 L0,10 z" fill="#555"/></marker>'
             '</defs>', f'<rect width="{width:g}" height="{height:g}" fill="white"/>']
    for start, end, what in flows:
        (x1, y1), (x2, y2) = middle[start], middle[end]
        aside = (x2 > x1) - (x2 < x1)
        x1, x2, y1, y2 = (x1 + 0.3 * aside * WIDTH, x2 - 0.3 * aside * WIDTH,
                          y1 + HEIGHT / 2, y2 - HEIGHT / 2)
        x, y = (x1 + x2) / 2, (y1 + y2) / 2 + 4
        lines += [f'<line x1="{x1:g}" y1="{y1:g}" x2="{x2:g}" y2="{y2:g}" stroke="#555" '
                  'marker-end="url(#head)"/>',
                  f'<text x="{x:g}" y="{y:g}" font-size="12" fill="#333" stroke="white" '
                  f'stroke-width="5" paint-order="stroke">{what}</text>']
    for key, (x, y) in middle.items():
        name, what = places[key][2:]
        is_ours = '/' in name or name.endswith('_node')
        fill, line = ('#e8eef5', '#4477aa') if is_ours else ('white', '#999')
        lines += [f'<rect x="{x - WIDTH / 2:g}" y="{y - HEIGHT / 2:g}" width="{WIDTH}" '
                  f'height="{HEIGHT}" rx="6" fill="{fill}" stroke="{line}"/>',
                  f'<text x="{x:g}" y="{y - 4:g}" font-weight="bold">{name}</text>',
                  f'<text x="{x:g}" y="{y + 15:g}" font-size="13">{what}</text>']
    return '\n'.join([*lines, '</svg>', ''])


def main() -> None:
    """Write the drawing; a folder that it names must be there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, default=Path(__file__).parent,
                        help='folder for both (default: that of this program)')
    folder = parser.parse_args().out
    for _, _, name, _ in PLACES.values():
        for part in name.split(', '):
            if part.endswith('/') and not (PACKAGE / part).is_dir():
                raise FileNotFoundError(f'the package has no folder {part}')
    (folder / 'architecture.svg').write_text(drawing(PLACES, FLOWS), 'utf-8')
    (folder / 'ros.svg').write_text(drawing(NODE, TOPICS), 'utf-8')


if __name__ == '__main__':
    main()
