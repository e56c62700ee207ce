# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments that several programs have in common."""
from __future__ import annotations

import argparse
import math
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from .checks import shown
from .models import MODELS, check_model

Number = TypeVar('Number', int, float)


class WholeNames(argparse.RawDescriptionHelpFormatter):
    """Help that keeps its description as written, and breaks no name at a hyphen."""

    def _split_lines(self, text: str, width: int) -> list[str]:
        return textwrap.wrap(' '.join(text.split()), width, break_on_hyphens=False)


def program_parser(program: str, doc: str | None, *, quick: str = '', seed: int | None = None,
                   out: str = '', **options: Any) -> argparse.ArgumentParser:
    """Return the parser of a program, whose help begins with `doc`.

    quick: help of `--quick`; seed: default of `--seed`; out: the files that go to the folder of
    `--out`. The program has those of them that are given.
    """
    parser = argparse.ArgumentParser(
        prog=program, description=doc, formatter_class=WholeNames, **options)
    if quick:
        parser.add_argument('--quick', action='store_true', help=quick)
    if seed is not None:
        parser.add_argument('--seed', type=seed_number, default=seed,
                            help='seed of the random numbers (default: %(default)s)')
    if out:
        parser.add_argument('--out', type=Path, metavar='DIR', help=f'folder for {out} (default: '
                            'docs/results, or quick-results with --quick)')
    return parser


def add_models(parser: argparse.ArgumentParser, flag: str, default: str | Sequence[str]) -> None:
    """Add an option of one model, or of several where the default is a list."""
    shown_default = default if isinstance(default, str) else ' '.join(default)
    parser.add_argument(flag, nargs=None if isinstance(default, str) else '+', type=model_name,
                        default=default, metavar='MODEL',
                        help=f'one of {", ".join(MODELS)} (default: {shown_default})')


def model_name(text: str) -> str:
    """Return the name of a model, as a program's argument."""
    try:
        check_model('model', text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text


def seed_number(text: str) -> int:
    """Return a seed of random numbers, as a program's argument: a whole number from 0."""
    if not text.isascii() or not text.isdecimal() or len(text) > 18:
        raise argparse.ArgumentTypeError(f'{shown(text)} is not a whole number from 0')
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
