# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page `Check a plan you have`: the program prints what it shows."""
from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from box_contact_ros.plans import inspect_files

pytest.importorskip('clarabel')

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / 'docs/how-to/from_a_file.md').read_text('utf-8')
SHOWN = re.findall(r'^```console\n\$ box_contact_inspect (.*)\n((?:.*\n)*?)```$', PAGE, re.M)


@pytest.mark.parametrize(('arguments', 'printed'), SHOWN)
def test_the_page_shows_what_is_printed(arguments, printed, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    assert inspect_files.main(shlex.split(arguments)) == 1
    assert capsys.readouterr().out == printed


def test_the_page_has_a_packers_file_a_lorry_and_a_ship():
    assert [Path(arguments).suffix for arguments, _ in SHOWN] == ['.csv', '.csv', '.edi']


def test_every_fault_is_on_the_page():
    from box_contact_ros.plans.inspection import CAUSES
    from box_contact_ros.plans.plan import FAULT_KINDS
    kinds = (*FAULT_KINDS, *CAUSES, 'overlap', 'outside')
    assert [kind for kind in kinds if f'`{kind}`' not in PAGE] == []
