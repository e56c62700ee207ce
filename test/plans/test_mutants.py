# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mutated files end in a status within a second, and are never sound with boxes that went missing.

BOX_CONTACT_MUTANTS=10000 makes so many.
"""
from __future__ import annotations

import io
import json
import os
import random
import re
import resource
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from box_contact_ros.plans import inspect_files
from box_contact_ros.plans.plan import GROUND
from box_contact_ros.plans.read_plan import read_plan

pytest.importorskip('clarabel')

from test_read_plan import FILES, baplie, document, sheet

COUNT = int(os.environ.get('BOX_CONTACT_MUTANTS', '100'))
"""Files in all."""
LONGEST = 1.0  # of a file [s of the processor]
MEMORY = 300 * 2**10  # that this process may need more [kB]
SHIP = baplie(*(f'{bay:03}{row:02}{tier} 22G1' for bay in (1, 3) for row in (1, 2, 3)
                for tier in (82, 84, 86)))
UNT = 56  # segments from UNH on before it
SEEDS = {
    'ship.edi': SHIP, 'small.edi': (FILES / 'ship.edi').read_text('utf-8'),
    'rows.csv': sheet('a,1,1,1,0,0,0.5,100,500,', 'b,1,1,1,0,0,1.5,100,500,', more=',mass,limit,'
                      'fixed'),
    'rows.json': document(mass=3, limit=4),
    'goods.csv': 'id;l_mm;w_mm;h_mm;x_mm;y_mm;z_mm;yaw_deg;pallet;mu\n1;600;400;300;0;0;150;90;A;,5'
                 '\n2;600;400;300;0;0,5;450;90;A;,4\n3;400;400;300;0;0;150;;B;,5\n',
    'orders.json': json.dumps({name: [{'item': {
        'id': 7, 'sequence': n, 'weight/kg': 2, 'length/mm': 600, 'width/mm': 400,
        'height/mm': 300}, 'flb_coordinates': [0, 0, 300 * n], 'orientation': n}
        for n in range(2)] for name in 'ab'})}


HIDING = ((b'"', b'"'), (b'FTX+AAA+++', b"'"), (b'"note": [', b'],'), (b'# ', b'\n'), (b'?', b'?'))
"""What may hide a piece of a file."""


def counted(name: str, text: str) -> int:
    """Return how many boxes a file has, as a reader counts them who knows rows and tags alone."""
    if name.endswith('.csv'):
        return sum(max(line.count(','), line.count(';')) >= 6
                   for line in re.split('[\r\n]+', text.strip())[1:])
    if name.endswith('.json'):
        return text.count('"length')
    return len(re.findall(r"'\s*LOC\+147", re.sub('[\r\n]', '', text).replace("?'", '')))


def mutated(data: bytes, draw: random.Random) -> bytes:
    """Return data in which a few bytes or lines are cut, flipped, doubled or moved."""
    for _ in range(draw.choice((1, 1, 1, 2, 5))):
        start = draw.randrange(len(data) + 1)
        end = min(len(data), start + draw.choice((1, 1, 2, 8, 40, 400)))
        what = draw.randrange(7)
        if what == 0:  # the end is missing
            data = data[:start]
        elif what == 1:  # a piece is missing
            data = data[:start] + data[end:]
        elif what == 2 and data:  # a byte is another one
            place = draw.randrange(len(data))
            data = data[:place] + bytes([data[place] ^ 1 << draw.randrange(8)]) + data[place + 1:]
        elif what == 3:  # a piece comes twice
            data = data[:end] + data[start:]
        elif what == 4:  # a line comes twice, or is missing
            lines = data.splitlines(keepends=True) or [b'']
            place = draw.randrange(len(lines))
            lines[place:place + 1] = draw.choice(([lines[place]] * 2, []))
            data = b''.join(lines)
        elif what == 5:  # a piece is hidden
            opening, closing = draw.choice(HIDING)
            data = data[:start] + opening + data[start:end] + closing + data[end:]
        else:  # a number is another one
            places = [n for n, mark in enumerate(data) if 48 <= mark <= 57] or [0]
            place = draw.choice(places)
            data = data[:place] + draw.choice((b'-', b'1e9', b'nan', b'0', b'9')) + data[place + 1:]
    return data


def judged(path: Path) -> tuple[int, str, float]:
    """Return the exit status of the program, what it prints, and its time of the processor [s]."""
    out, start = io.StringIO(), time.process_time()
    with redirect_stdout(out), redirect_stderr(out):
        status = inspect_files.main([str(path)])
    return status, out.getvalue(), time.process_time() - start


@pytest.mark.parametrize('name', SEEDS)
def test_mutants(name: str, tmp_path: Path) -> None:
    """A ship whose segments are fewer or more than UNT counts is not sound, nor are fewer boxes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss + MEMORY
    draw = random.Random(name)
    path = tmp_path / name
    for n in range(COUNT // len(SEEDS)):
        data = mutated(SEEDS[name].encode(), draw)
        path.write_bytes(data)
        status, printed, seconds = judged(path)
        assert status in (0, 1, 2, 3) and printed.endswith('\n'), (n, data)
        assert status != 2 or printed.count('\n') == 1, (n, printed)
        assert seconds < LONGEST, (n, seconds, data)
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < peak, (n, data)
        if status == 0:
            boxes = len([box for box in read_plan(path).names if box not in (GROUND, 'ship')])
            assert boxes >= counted(name, data.decode('utf-8', 'replace')), (n, printed, data)
        if status == 0 and name == 'ship.edi':
            tags = [part.strip()[:3] for part in data.split(b"'") if part.strip()]
            assert tags.index(b'UNT') - tags.index(b'UNH') == UNT, (n, data)
            told = any(kind in printed for kind in ('left out', 'mass ', 'dimension ', 'slot '))
            assert told or printed.startswith('18 boxes'), (n, printed, data)
