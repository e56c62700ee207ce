"""Arguments that several programs have in common."""
from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import TypeVar

from ..output import make_folder, make_room
from .checks import shown
from .models import find_model

__all__ = ['make_folder', 'make_room', 'model_name', 'seed_number', 'within']

Number = TypeVar('Number', int, float)


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


def within(low: Number, high: Number | None = None) -> Callable[[str], Number]:
    """Return an argument type: a number from `low` to `high`, whole where `low` is."""
    kind = type(low)

    def number(text: str) -> Number:
        value = kind(text)  # argparse reports what is no number
        if not low <= value <= (math.inf if high is None else high):
            limits = f'be at least {low:g}' if high is None else f'lie in {low:g} to {high:g}'
            raise argparse.ArgumentTypeError(f'must {limits}, got {text}')
        return value
    return number
