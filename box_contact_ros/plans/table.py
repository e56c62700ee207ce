# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of a file, cell by cell: a CSV file, or the lists of records in a JSON document.

What is in a record is a cell, its keys joined by dots; places of a list are `.0 .1 .2`. Lists whose
records have the same keys are one table. What stands above a list belongs to all rows of it.
"""
from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from .plan import Fault

DELIMITERS = ',;\t'
MOST_TABLES = 200
MOST_CELLS = 5_000_000
"""Of a JSON document, and of a table with cells that are not there: what is looked at."""
PLAIN = re.compile(r'[-+]?(\d*)([.,]?)(\d*)([eE][-+]?\d+)?')
"""A number with a decimal mark, or with one mark of thousands."""
THOUSANDS = re.compile(r'[-+]?[1-9]\d{0,2}[.,]\d{3}')
"""What may be a number with a mark of thousands."""
Cells = Mapping[str, Any]


@dataclass(frozen=True)
class Rows:
    """A list of rows, and what stands above it, the nearest last: paths and cells."""

    label: str
    above: tuple[tuple[str, Cells], ...] = ()


@dataclass(frozen=True)
class Record:
    """A row: its number, from 1, in a list, and its cells."""

    number: int
    cells: Cells
    rows: Rows


@dataclass
class Table:
    """Rows with the same columns."""

    path: str
    columns: tuple[str, ...]  # of the rows, then of what stands above them
    records: list[Record]
    mark: str = '.'  # the decimal mark; '': its texts tell it
    odd: dict[int, str] = field(default_factory=dict)
    """What is wrong with the cells of a row, by its number."""
    faults: list[Fault] = field(default_factory=list)
    above: dict[str, tuple[str, str]] = field(default_factory=dict)
    """Path and key of each column that stands above the rows."""

    def cell(self, record: Record, column: str) -> Any:
        """Return what a row has in a column; None where it has nothing."""
        if column not in self.above:
            return record.cells.get(column)
        path, key = self.above[column]
        return next((cells.get(key) for place, cells in record.rows.above if place == path), None)

    def values(self, column: str) -> list[Any]:
        """Return a column's cells, one of a list for those that stand above it."""
        if column not in self.above:
            return [record.cells.get(column) for record in self.records]
        path, key = self.above[column]
        return [cells.get(key) for cells in self._cells_above[path]]

    def number(self, value: Any) -> float:
        """Return a number, or one that a text has; NaN for anything else."""
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            return math.nan
        if isinstance(value, str):
            mark = self.decimal_mark
            if '_' in value or (found := PLAIN.fullmatch(value)) is None or (
                    found[2] and found[2] != mark):
                return math.nan
            value = value.replace(',', '.')
        try:
            return float(value)
        except (ValueError, OverflowError):
            return math.nan

    def numbers(self, column: str) -> list[float]:
        """Return a column's numbers; NaN for cells that have none."""
        return [self.number(value) for value in self.values(column)]

    @cached_property
    def decimal_mark(self) -> str:
        """Return the decimal mark of texts, as those tell that cannot have a mark of thousands."""
        if self.mark:
            return self.mark
        found = {parts[2] for column in self.columns for value in self.values(column)
                 if isinstance(value, str) and (parts := PLAIN.fullmatch(value))
                 and parts[2] and not THOUSANDS.fullmatch(value)}
        return found.pop() if len(found) == 1 else ''

    @cached_property
    def lists(self) -> list[Rows]:
        """Return the lists of the rows, in order."""
        return [*{id(record.rows): record.rows for record in self.records}.values()]

    @cached_property
    def _cells_above(self) -> dict[str, list[Cells]]:
        """Return all that stands above rows, by path."""
        found: dict[str, dict[int, Cells]] = {}
        for rows in self.lists:
            for path, cells in rows.above:
                found.setdefault(path, {})[id(cells)] = cells
        return {path: [*some.values()] for path, some in found.items()}

    def check_size(self) -> None:
        """Raise ValueError for more columns, times rows, than are looked at."""
        most = len(self.columns) * max(len(self.records), 1)
        if most > MOST_CELLS:
            raise ValueError(f'{len(self.records):,} rows have {len(self.columns):,} columns: more '
                             'than are read')

    def add_above(self) -> None:
        """Add the columns that stand above the rows; one with the name of a cell gets a dot."""
        own = {*self.columns}
        for path, some in self._cells_above.items():
            for key in dict.fromkeys(key for cells in some for key in cells):
                name = _joined(path, key)
                self.above[f'.{name}' if name in own else name] = path, key
        self.columns += tuple(self.above)


# --- CSV ------------------------------------------------------------------------------------------


def is_first(line: str) -> bool:
    """Return whether a line is the first one that counts: neither blank nor a comment."""
    return line.strip()[:1] not in ('', '#')


def header_of(line: str) -> tuple[list[str], str]:
    """Return the cells of a header, and what separates them; '' for blanks."""
    delimiter = max(DELIMITERS, key=line.count)
    if delimiter not in line:
        return line.split(), ''
    return _stripped(next(csv.reader([line], delimiter=delimiter), [])), delimiter


def read_csv(text: str) -> Table:
    """Return the table of a CSV file. Raises ValueError for other files."""
    lines = list(io.StringIO(text.removeprefix('\ufeff'), newline=''))
    start = next((n for n, line in enumerate(lines) if is_first(line)), None)
    if start is None:
        raise ValueError('it is empty')
    delimiter = header_of(lines[start])[1]
    if not delimiter:  # columns, and a rule below the header
        lines[start:] = [','.join(line.split()) for line in lines[start:] if line.strip(' -\r\n')]
    reader = csv.reader(lines[start:], delimiter=delimiter or ',', strict=True)
    try:
        header, *rows = reader
    except csv.Error as error:  # such as a quote that is not closed
        raise ValueError(f'line {start + reader.line_num}: it is not CSV: {error}') from None
    names = _stripped(header)
    for key, count in Counter(name.lower() for name in names if name).items():
        if count > 1:
            raise ValueError(f'line {start + 1}: the column {key} comes twice')
    columns = tuple(name or f'column {n}' for n, name in enumerate(names, 1))
    table = Table('', columns, [], mark='.' if delimiter in (',', '') else '')
    rows = [row for row in rows if any(cell.strip() for cell in row)]
    is_cut = not text.endswith(('\n', '\r'))
    whole = Rows('')
    for number, row in enumerate(rows, 1):
        cells = {name: cell.strip() for name, cell in zip(columns, row) if cell.strip()}
        count = min(len(row), max(len(columns), len(_stripped(row))))
        hidden = sum((delimiter or ',') in line for cell in row
                     for line in cell.strip().splitlines()[1:])
        if hidden:
            table.faults.append(Fault('cut', (f'row {number}',), f'a quote goes on over {hidden} '
                                                                 'lines that may be rows'))
        if count != len(columns):
            table.odd[number] = f'row {number} has {count} cells, and the header {len(columns)}'
            if count > len(columns) and delimiter == ',':
                table.odd[number] += '; are commas decimal marks? Then separate the columns by ;'
            if count > len(columns) or (is_cut and number == len(rows)):
                cells = {}  # which cells are right is not known
        table.records.append(Record(number, cells, whole))
    table.check_size()
    return table


def _stripped(cells: Iterable[str]) -> list[str]:
    """Return cells without blanks around them, and without blank ones at the end."""
    stripped = [cell.strip() for cell in cells]
    while stripped and not stripped[-1]:
        stripped.pop()
    return stripped


# --- JSON -----------------------------------------------------------------------------------------


def read_tables(document: Any) -> list[Table]:
    """Return the tables of a JSON document. Raises ValueError for too many."""
    found: dict[str, list[Record]] = {}
    for path, record in _records(document, '', (), ''):
        found.setdefault(path, []).append(record)
    by_keys: dict[frozenset[str], Table] = {}
    for path, records in found.items():
        columns = tuple(dict.fromkeys(key for record in records for key in record.cells))
        table = by_keys.setdefault(frozenset(columns), Table(path, columns, []))
        table.records += records
    if len(by_keys) > MOST_TABLES:
        raise ValueError(f'it has {len(by_keys):,} lists of different records')
    for table in by_keys.values():
        table.add_above()
        table.check_size()
    return [*by_keys.values()]


def _records(value: Any, path: str, above: tuple[tuple[str, Cells], ...], label: str,
             ) -> Iterator[tuple[str, Record]]:
    """Yield the records of all lists in a value, each with the path of its list."""
    if isinstance(value, Mapping):
        cells, lists = _parted(value)
        if cells:
            above = (*above, (path, cells))
        name = _label(cells)
        for key, inner in lists:
            yield from _records(inner, _joined(path, key), above, name or key)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        rows = Rows(label, above)
        for number, entry in enumerate(value, 1):
            if isinstance(entry, list):
                entry = {str(n): part for n, part in enumerate(entry)}
            cells, lists = _parted(entry) if isinstance(entry, Mapping) else ({}, [])
            yield path, Record(number, cells, rows)
            name = _label(cells) if lists else ''
            for key, inner in lists:
                yield from _records(inner, _joined(path, key), (*above, (path, cells)),
                                    name or f'{key} {number}')


def _label(cells: Cells) -> str:
    """Return by which name people know what has these cells; '' where it has none."""
    return next((str(value) for key, value in cells.items() if value not in (None, '') and (
        key in ('partno', 'name', 'id', 'label') or key.endswith(('_id', '_name', 'Id', 'Name')))),
        '')


def _parted(record: Cells) -> tuple[dict[str, Any], list[tuple[str, Any]]]:
    """Return the cells of a record, and the lists of records in it, by keys with dots."""
    cells: dict[str, Any] = {}
    lists: list[tuple[str, Any]] = []
    todo = [*record.items()][::-1]
    while todo:
        key, value = todo.pop()
        if isinstance(value, Mapping):
            todo += [(f'{key}.{inner}', part) for inner, part in [*value.items()][::-1]]
        elif isinstance(value, list) and any(isinstance(part, Mapping | list) for part in value):
            lists.append((key, value))
        elif isinstance(value, list):
            todo += [(f'{key}.{n}', part) for n, part in [*enumerate(value)][::-1]]
        else:
            cells[key] = value
    return cells, lists


def _joined(path: str, key: str) -> str:
    return f'{path}.{key}' if path else key
