# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What reports are written with: what the installed bench has, pages from templates, numbers."""
from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from box_contact_ros.output import (
    figure,
    log_errors,
    machine,
    make_folder,
    markdown_table,
    percentiles,
    processor,
    subplots,
    versions,
    write_csv,
)

__all__ = [
    'command_line', 'figure', 'log_errors', 'machine', 'make_folder', 'make_room', 'markdown_table',
    'number', 'page', 'percentiles', 'processor', 'read_csv', 'results_folder', 'subplots',
    'versions', 'write_csv']

ROOT = Path(__file__).resolve().parents[1]
RESULTS, QUICK_RESULTS = Path('docs/results'), Path('quick-results')


def make_room(parser: argparse.ArgumentParser, path: Path) -> Path:
    """Create the folder of a file that `--out` names, as `make_folder`."""
    if path.is_dir():
        parser.error(f'--out {path} is a folder: name a file')
    make_folder(parser, path.parent)
    return path


def results_folder(parser: argparse.ArgumentParser, options: argparse.Namespace) -> Path:
    """Return the folder of results; a quick run replaces a full run's only where `--out` says."""
    return make_folder(parser, options.out or (QUICK_RESULTS if options.quick else RESULTS))


def command_line(program: str, args: Sequence[str] | None) -> str:
    """Return the command that a page names; `args` as `main` received them."""
    given = sys.argv[1:] if args is None else args
    return ' '.join(['python -m', program, *given])


def page(template: str, **values: object) -> str:
    """Return a page or a part of one: a Markdown file of the checkout, its `{fields}` filled in."""
    return (ROOT / f'{template}.md').read_text('utf-8').format(**values)


def read_csv(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file by column name."""
    with path.open(encoding='utf-8', newline='') as file:
        return list(csv.DictReader(file))


def number(value: float, digits: int = 3) -> str:
    """Return a value with so many digits, never in powers of ten; NaN is a dash."""
    if math.isnan(value):
        return '–'
    if value == 0.0:
        return '0'
    if value < 10.0 ** -digits:
        return f'<{10.0 ** -digits:g}'
    if value >= 1e3:
        return f'{value:,.0f}'
    return f'{value:.{max(0, digits - 1 - math.floor(math.log10(value)))}f}'
