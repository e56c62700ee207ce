"""Programs that print or draw what the project claims, from the shipped weights."""
from __future__ import annotations

import argparse
from pathlib import Path

from ..checks import shown
from ..solver import MODEL_NAMES, MODELS, soup_divisions


def add_out(parser: argparse.ArgumentParser, files: str) -> None:
    """Add `--out`, of a program that has `--quick`; `results_folder` reads it."""
    parser.add_argument('--out', type=Path, metavar='DIR',
                        help=f'folder for {files} (default: docs, or quick-results with --quick)')


def model_name(text: str) -> str:
    """The name of a model, as a program's argument."""
    try:
        if text in MODELS or soup_divisions(text):
            return text
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    raise argparse.ArgumentTypeError(f'{shown(text)} is not one of: {MODEL_NAMES}')


def seed_number(text: str) -> int:
    """A seed of random numbers, as a program's argument: a whole number from 0."""
    if not text.isascii() or not text.isdecimal() or len(text) > 18:
        raise argparse.ArgumentTypeError(f'{shown(text)} is no whole number from 0')
    return int(text)


def results_folder(options: argparse.Namespace) -> Path:
    """Where results are written: a quick run never replaces those of a full one unasked."""
    return options.out or Path('quick-results' if options.quick else 'docs')
