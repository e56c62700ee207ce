# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A plan from a file, whatever its format: the content tells it, and else the file's ending."""
from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..resources import read_regular
from ..solver.checks import short_repr
from .baplie import read_baplie
from .forms import FORMS
from .packing import read_packing
from .plan import MOST_BYTES, Plan
from .roles import NOTHING, Given
from .table import Table, header_of, is_first, read_csv, read_tables

FORMATS = 'SMDG BAPLIE, and packing plans as CSV or JSON'
WORLDS = ('it is a world or a model of a simulator, which is no plan; fill a Plan from it, as '
          'docs/examples/mujoco_plan.py does')
FEWEST = 4  # columns of a table whose file's ending does not tell that it is one


class ReadPlan(NamedTuple):
    """A plan, and how its boxes stand on each other."""

    plan: Plan
    bears: str  # 'corners' of containers, else 'faces', as `inspect_plan` takes it
    taken: str = ''  # what was taken of a table, for people; '' for other files


def read_plan(path: str | os.PathLike[str], *, origin: str | None = None, unit: str | None = None,
              container: Sequence[float] | None = None, columns: Mapping[str, str] | None = None,
              ignore: Sequence[str] = (), up: str | None = None, turns: str | None = None,
              frames: str | None = None) -> Plan:
    """Return the plan of a file: SMDG BAPLIE, CSV or JSON.

    The options are of CSV and JSON alone, what the file does not tell. origin: 'centre' or
    'corner', what `x y z` are. unit: 'm', 'cm', 'mm', 'in' or 'ft', of all lengths. container: (3,)
    the inner size of each container, in the unit of the file. columns: by role, such as {'mass':
    'gross'}. ignore: columns that decide on nothing. up: 'x', 'y' or 'z', the axis of the file that
    is up. turns: 'degrees' or 'radians'. frames: 'own' or 'one', whether each container has a frame
    of its own.

    What a file says wrongly about some boxes is among the plan's faults. Raises OSError, and
    ValueError with the file and the reason for what is no plan, or with all that is open about it.
    """
    return read_any(path, Given(origin, unit, container, columns or {}, ignore, up, turns,
                                frames)).plan


def read_any(path: str | os.PathLike[str], given: Given = NOTHING) -> ReadPlan:
    """Return the plan of a file as `read_plan` does, and how its boxes stand on each other."""
    file = Path(path)
    given.check()
    try:
        return _read(file, read_regular(file, MOST_BYTES), given)
    except OSError as error:
        if error.filename is not None:
            raise
        raise ValueError(f'{file}: {error}') from None
    except RecursionError:
        raise ValueError(f'{file}: it is nested too deeply') from None
    except ValueError as error:
        raise ValueError(f'{file}: {error}') from None


def _read(file: Path, data: bytes, given: Given) -> ReadPlan:
    start = data[:4096].decode('latin-1').removeprefix('ï»¿').lstrip()
    ending = file.suffix.lower()
    if start[:1] in ('{', '['):
        plan, taken = read_packing(_tables(data), given)
        return ReadPlan(plan, 'faces', taken)
    is_edi = start[:3] in ('UNA', 'UNB', 'UNH') or ending == '.edi'
    if not is_edi:
        cells, delimiter = header_of(next(filter(is_first, start.splitlines()), ''))
        if ending in ('.csv', '.tsv') or delimiter and len(cells) >= FEWEST or any(
                form.header == tuple(cells) for form in FORMS):
            plan, taken = read_packing([read_csv(data.decode('utf-8'))], given)
            return ReadPlan(plan, 'faces', taken)
    for name, value in given._asdict().items():
        if value:
            raise ValueError(f'{name} must not be given: it is for CSV and JSON alone')
    if is_edi:
        return ReadPlan(read_baplie(data.decode('latin-1')), 'corners')
    if start.startswith('<'):
        raise ValueError(WORLDS)
    shown = start.partition('\n')[0].strip()[:60].lower()
    raise ValueError(f'line 1: {shown!r} begins no format that is read: {FORMATS}' if shown else
                     f'it is empty; what is read: {FORMATS}')


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object. Raises ValueError for a key that comes twice."""
    document = dict(pairs)
    if len(document) < len(pairs):
        twice = next(key for key, count in Counter(key for key, _ in pairs).items() if count > 1)
        raise ValueError(f'the key {short_repr(twice)} comes twice')
    return document


def _tables(data: bytes) -> list[Table]:
    """Return the tables of a JSON document. Raises ValueError where it has none."""
    try:
        document = json.loads(data, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise ValueError(f'line {error.lineno}: it is not JSON: {error.msg}') from None
    tables = read_tables(document)
    if not tables:
        raise ValueError('it is JSON, but has no list of boxes')
    return tables
