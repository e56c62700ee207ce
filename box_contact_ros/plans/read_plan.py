# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A plan from a file, whatever its format: the content tells it, and else the file's ending."""
from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..resources import read_regular
from ..solver.checks import short_repr
from .forms import NOTHING, ORIGINS, UNITS, Given
from .packing import is_first, is_header, read_csv, read_packing
from .plan import MOST_BYTES, Plan

FORMATS = 'SMDG BAPLIE, and packing plans as CSV or JSON'
WORLDS = ('it is a world or a model of a simulator, which is no plan; fill a Plan from it, as '
          'docs/examples/mujoco_plan.py does')


class ReadPlan(NamedTuple):
    """A plan, and how its boxes stand on each other."""

    plan: Plan
    bears: str
    """'corners' of containers, else 'faces', as `inspect_plan` takes it."""
    form: str = ''
    """How the file of a known packer was read, for people; '' for other files."""


def read_plan(path: str | os.PathLike[str], *, origin: str | None = None, unit: str | None = None,
              container: Sequence[float] | None = None) -> Plan:
    """Return the plan of a file: SMDG BAPLIE, CSV or JSON.

    origin, unit, container: of CSV and JSON alone, what the file does not tell. origin: 'centre' or
    'corner', what `x y z` are. unit: 'm', 'cm' or 'mm'. container: (3,) the inner size of each
    container, in the unit of the file.

    What a file says wrongly about some boxes is among the plan's faults. Raises OSError, and
    ValueError with the file and the reason for what is no plan.
    """
    return read_any(path, Given(origin, unit, container)).plan


def read_any(path: str | os.PathLike[str], given: Given = NOTHING) -> ReadPlan:
    """Return the plan of a file as `read_plan` does, and how its boxes stand on each other."""
    file = Path(path)
    for name, value, words in (('origin', given.origin, ORIGINS), ('unit', given.unit, [*UNITS])):
        if value is not None and value not in words:
            raise ValueError(f'{name} must be one of {", ".join(words)}, not {short_repr(value)}')
    try:
        data = read_regular(file, MOST_BYTES)
        return _read(file, data, given)
    except OSError as error:
        if error.filename is not None:
            raise
        raise ValueError(f'{file}: {error}') from None
    except RecursionError:
        raise ValueError(f'{file}: it is nested too deeply') from None
    except UnicodeDecodeError as error:
        raise ValueError(f'{file}: byte {error.start} is not UTF-8; what is read: {FORMATS}'
                         ) from None
    except ValueError as error:
        if str(error).startswith(str(file)):
            raise
        raise ValueError(f'{file}: {error}') from None


def _read(file: Path, data: bytes, given: Given) -> ReadPlan:
    start = data[:4096].decode('latin-1').removeprefix('ï»¿').lstrip()
    ending = file.suffix.lower()
    if start[:1] in ('{', '['):
        return _read_json(data, given)
    first = next(filter(is_first, start.splitlines()), '')
    is_edi = start[:4] in ('UNA:', 'UNB+') or start[:3] in ('UNA', 'UNB', 'UNH') or ending == '.edi'
    if not is_edi and (ending in ('.csv', '.tsv') or is_header(first)):
        plan, form = read_csv(data.decode('utf-8'), given)
        return ReadPlan(plan, 'faces', form)
    _tells_itself(given)
    if is_edi:
        from .baplie import read_baplie
        return ReadPlan(read_baplie(data.decode('latin-1')), 'corners')
    if start.startswith('<'):
        raise ValueError(WORLDS)
    shown = start.partition('\n')[0].strip()[:60].lower()
    raise ValueError(f'line 1: {shown!r} begins no format that is read: {FORMATS}' if shown else
                     f'it is empty; what is read: {FORMATS}')


def _tells_itself(given: Given) -> None:
    """Raise ValueError for what is given of a file that tells it itself."""
    for name, value in given._asdict().items():
        if value is not None:
            raise ValueError(f'{name} must not be given: it is for CSV and JSON of packers alone')


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object. Raises ValueError for a key that comes twice."""
    document = dict(pairs)
    if len(document) < len(pairs):
        twice = next(key for key, count in Counter(key for key, _ in pairs).items() if count > 1)
        raise ValueError(f'the key {short_repr(twice)} comes twice')
    return document


def _read_json(data: bytes, given: Given) -> ReadPlan:
    try:
        document = json.loads(data, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise ValueError(f'line {error.lineno}: it is not JSON: {error.msg}') from None
    read = read_packing(document, given)
    if read is not None:
        return ReadPlan(read.plan, 'faces', read.form)
    raise ValueError('it is JSON, but no packing plan (boxes: [...], see msg_schemas/plan.json)')
