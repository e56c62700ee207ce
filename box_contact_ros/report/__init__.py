"""Programs that print or draw what the project claims, from the shipped weights."""
from __future__ import annotations

import argparse
from pathlib import Path

from ..arguments import make_folder


def add_out(parser: argparse.ArgumentParser, files: str) -> None:
    """Add `--out`, of a program that has `--quick`; `results_folder` reads it."""
    parser.add_argument('--out', type=Path, metavar='DIR',
                        help=f'folder for {files} (default: docs, or quick-results with --quick)')


def results_folder(parser: argparse.ArgumentParser, options: argparse.Namespace) -> Path:
    """Where results are written: a quick run never replaces those of a full one unasked."""
    return make_folder(parser, options.out or Path('quick-results' if options.quick else 'docs'))
