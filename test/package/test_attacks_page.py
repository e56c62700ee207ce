# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The table of attacks: each cell names a test that exists, or a reason that the page gives."""
from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / 'docs' / 'contributing' / 'attacks.md').read_text('utf-8')
PROGRAMS = ['contact_node', 'soup_node', 'markers', 'view', 'record', 'crane', 'bench']


def existing():
    """Return all tests as the page names them, `file::function`."""
    return {f'{file.stem}::{node.name}' for file in (ROOT / 'test').rglob('test_*.py')
            for node in ast.parse(file.read_text('utf-8')).body
            if isinstance(node, ast.FunctionDef) and node.name.startswith('test_')}


def test_each_cell_is_a_test_or_a_reason():
    head, _, *rows = [[cell.strip() for cell in line.strip('|').split(' | ')]
                      for line in PAGE.splitlines() if line.startswith('|')]
    assert head == ['Attack', *PROGRAMS] and len(rows) > 20
    reasons = set(re.findall(r'^- (\w): ', PAGE, re.MULTILINE))
    known, used = existing(), set()
    for attack, *cells in rows:
        assert len(cells) == len(PROGRAMS), attack
        for cell in cells:
            if cell.startswith('– '):
                used.add(cell.removeprefix('– '))
            else:
                assert cell.strip('`') in known, f'{attack}: {cell}'
        assert any(cell.startswith('`') for cell in cells), attack
    assert used == reasons
