# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The list of attacks: for each program a test that exists, or a reason that the list gives."""
from __future__ import annotations

import ast
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
LIST = yaml.safe_load(Path(__file__).with_name('attacks.yaml').read_text('utf-8'))
PROGRAMS = ['contact_node', 'soup_node', 'markers', 'view', 'record', 'crane', 'bench']


def existing() -> set[str]:
    """Return all tests as the list names them, `file::function`."""
    return {f'{file.stem}::{node.name}' for file in (ROOT / 'test').rglob('test_*.py')
            for node in ast.parse(file.read_text('utf-8')).body
            if isinstance(node, ast.FunctionDef) and node.name.startswith('test_')}


def test_each_program_has_a_test_or_a_reason():
    known, reasons, used = existing(), LIST['reasons'], set()
    assert len(LIST['attacks']) > 20
    for row in LIST['attacks']:
        attack = row.pop('attack')
        assert list(row) == PROGRAMS, attack
        used |= set(row.values()) & set(reasons)
        tests = set(row.values()) - set(reasons)
        assert tests and tests <= known, f'{attack}: {tests - known}'
    assert used == set(reasons)
