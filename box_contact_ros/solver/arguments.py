"""Arguments of programs, and how they are refused: models, seeds, numbers, output folders."""
from __future__ import annotations

import argparse
import math

from ..output import make_folder, make_room
from .checks import shown
from .models import find_model

__all__ = ['check_ranges', 'make_folder', 'make_room', 'model_name', 'seed_number']


def model_name(text: str) -> str:
    """Return the name of a model, as a program's argument."""
    try:
        find_model('model', text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text


def seed_number(text: str) -> int:
    """Return a seed of random numbers, as a program's argument: a whole number from 0."""
    if not text.isascii() or not text.isdecimal() or len(text) > 18:
        raise argparse.ArgumentTypeError(f'{shown(text)} is no whole number from 0')
    return int(text)


def check_ranges(parser: argparse.ArgumentParser, options: argparse.Namespace,
                 **ranges: tuple[float, float | None]) -> None:
    """Refuse options outside their ranges (low, high or None: no limit); None is not checked."""
    for name, (low, high) in ranges.items():
        value = getattr(options, name)
        if value is not None and not low <= value <= (math.inf if high is None else high):
            limits = f'be at least {low}' if high is None else f'lie in {low} to {high}'
            parser.error(f'--{name} must {limits}, got {value}')
