# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments that several programs have in common."""
from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import Any, TypeVar

from .models import check_model

Number = TypeVar('Number', int, float)


def program_parser(program: str, doc: str | None, **options: Any) -> argparse.ArgumentParser:
    """Return the parser of a program, whose help begins with `doc`."""
    return argparse.ArgumentParser(prog=program, description=doc, **options,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)


def model_name(text: str) -> str:
    """Return the name of a model, as a program's argument."""
    try:
        check_model('model', text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text


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
