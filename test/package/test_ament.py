"""ament's linters, as a ROS package runs them: skipped where they are not installed."""
from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = [str(ROOT / name) for name in ('box_contact_ros', 'launch', 'setup.py', 'test')]

CONFIG = str(Path(__file__).with_name('flake8.ini'))
NOT_FOLLOWED = ['D213', 'D401']
"""Rules of ament's pep257 that the package does not follow. PEP 257 itself lets a summary stand on
the first line or on the second (D213), and what a function gives is often said shorter by naming
it than by an imperative (D401)."""


def test_flake8() -> None:
    linter = pytest.importorskip('ament_flake8.main')
    status, errors = linter.main_with_errors(argv=['--config', CONFIG, *SOURCES])
    assert status == 0, '\n'.join(errors)


def test_pep257(capsys: pytest.CaptureFixture[str]) -> None:
    linter = pytest.importorskip('ament_pep257.main')
    status = linter.main(argv=['--add-ignore', *NOT_FOLLOWED, '--', *SOURCES])
    assert status == 0, capsys.readouterr().out
