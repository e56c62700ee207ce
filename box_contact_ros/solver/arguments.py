"""Arguments that several programs have in common."""
from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from .checks import shown
from .models import find_model


def model_name(text: str) -> str:
    """Return the name of a model, as a program's argument."""
    try:
        find_model('model', text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text


def seed_number(text: str) -> int:
    """A seed of random numbers, as a program's argument: a whole number from 0."""
    if not text.isascii() or not text.isdecimal() or len(text) > 18:
        raise argparse.ArgumentTypeError(f'{shown(text)} is no whole number from 0')
    return int(text)


def make_folder(parser: argparse.ArgumentParser, folder: Path) -> Path:
    """Create the folder of `--out`, or refuse, before the work, one that cannot be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        parser.error(f'cannot write to {folder} ({error.strerror}): name another place with --out')
    return folder


def make_room(parser: argparse.ArgumentParser, path: Path) -> Path:
    """Create the folder of a file that `--out` names, as `make_folder`."""
    if path.is_dir():
        parser.error(f'--out {path} is a folder: name a file')
    make_folder(parser, path.parent)
    return path
