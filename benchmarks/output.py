# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all reports share: arguments, folder, tables, CSV files, figures, pages, the machine."""
from __future__ import annotations

import argparse
import csv
import math
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from box_contact_ros.arguments import program_parser, within
from box_contact_ros.core import native

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[1]
RESULTS, QUICK_RESULTS = Path('docs/results'), Path('quick-results')
DPI = 110  # of pictures
COLOURS = {'exact': '#1f77b4', 'mlp': '#2ca02c', 'paper': '#9467bd', 'soup': '#8c564b',
           'MuJoCo': '#ff7f0e', 'Bullet': '#e377c2', 'Coal': '#bcbd22', 'Drake': '#17becf',
           'FCL': '#d62728', 'echo': '#7f7f7f', 'other': '#7f7f7f', 'new': '#000000'}
"""The colour of each contestant, in every picture."""
BEGIN = time.monotonic()  # of the program [s]


def report_parser(program: str, doc: str | None, *, quick: str, seed: int | None = None,
                  out: str = '') -> argparse.ArgumentParser:
    """Return the parser of a report, whose help begins with `doc`.

    quick: help of `--quick`; seed: default of `--seed`; out: the files that go to the folder of
    `--out`. The report has those of the last two that are given.
    """
    parser = program_parser(program, doc)
    parser.add_argument('--quick', action='store_true', help=quick)
    if seed is not None:
        parser.add_argument('--seed', type=within(0), default=seed,
                            help='seed of the random numbers (default: %(default)s)')
    if out:
        parser.add_argument('--out', type=Path, metavar='DIR', help=f'folder for {out} (default: '
                            'docs/results, or quick-results with --quick)')
    return parser


def make_folder(parser: argparse.ArgumentParser, folder: Path) -> Path:
    """Create the folder of `--out`, or refuse, before the work, one that cannot be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        parser.error(f'cannot write to {folder} ({error.strerror}): name another place with --out')
    return folder


def results_folder(parser: argparse.ArgumentParser, options: argparse.Namespace, *,
                   part: bool = False) -> Path:
    """Return the folder of results.

    A quick run, or a part of a report, replaces a full run's results only where `--out` says.
    """
    whole = not (options.quick or part)
    return make_folder(parser, options.out or (RESULTS if whole else QUICK_RESULTS))


def command_line(program: str, args: Sequence[str] | None) -> str:
    """Return the command that a page names; `args` as `main` received them."""
    given = sys.argv[1:] if args is None else args
    return ' '.join(['python -m', program, *given])


def took() -> str:
    """Return how long this program has worked, as a page says it."""
    seconds = time.monotonic() - BEGIN
    return f'{seconds:.0f} s' if seconds < 100.0 else f'{seconds / 60.0:.0f} minutes'


def page(template: str, **values: object) -> str:
    """Return a page or a part of one: a Markdown file of the checkout, its `{fields}` filled in."""
    return (ROOT / f'{template}.md').read_text('utf-8').format(**values)


def write_page(folder: Path, name: str, args: Sequence[str] | None, **values: object) -> str:
    """Write benchmarks/pages/NAME.md, its fields filled in, to a folder; return the text.

    args: as `main` of benchmarks.NAME received them; the page names the command and its time.
    """
    made = f'`{command_line(f"benchmarks.{name}", args)}` in {took()}'
    text = page(f'benchmarks/pages/{name}', made=made, **values)
    (folder / f'{name}.md').write_text(text, encoding='utf-8')
    return text


def read_csv(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file by column name."""
    with path.open(encoding='utf-8', newline='') as file:
        return list(csv.DictReader(file))


def number(value: float, digits: int = 3) -> str:
    """Return a value with so many digits, never in powers of ten; NaN is a dash."""
    if math.isnan(value):
        return '–'
    if value == 0.0:
        return '0'
    if value < 10.0 ** -digits:
        return f'<{10.0 ** -digits:g}'
    if value >= 1e3:
        return f'{value:,.0f}'
    return f'{value:.{max(0, digits - 1 - math.floor(math.log10(value)))}f}'


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[object]], *, words: int = 1) -> str:
    """Return a Markdown table; the first `words` columns are set to the left, the others right."""
    lines = [[str(cell) for cell in line] for line in (head, *rows)]
    rule = ['---' if column < words else '---:' for column in range(len(head))]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in (lines[0], rule, *lines[1:]))


def write_csv(path: Path, rows: Iterable[Mapping[str, object]], *, digits: int = 6,
              about: Machine | None = None) -> None:
    """Write rows by column name; the columns are those of all rows, in the order of appearance.

    about: the machine, whose columns every row gets at its end, but for those that it has itself.
    A float has `digits` significant digits. A missing value, None and NaN are empty cells.
    """
    here = asdict(about) if about else {}
    # A row stands first for the order of the columns, and last as its own values count.
    listed = [{**row, **here, **row} for row in rows]
    columns = list(dict.fromkeys(name for row in listed for name in row))
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(columns)
        writer.writerows([_cell(row.get(name), digits) for name in columns] for row in listed)


def _cell(value: object, digits: int) -> object:
    if isinstance(value, float):
        return '' if math.isnan(value) else f'{value:.{digits}g}'
    return value  # the writer leaves a None empty


def subplots(rows: int, columns: int, size: tuple[float, float], **shared: Any,
             ) -> tuple[Figure, np.ndarray]:
    """Return a figure of a size [inch], and its axes (rows, columns); no display is needed."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout='constrained', dpi=DPI)
    return figure, figure.subplots(rows, columns, squeeze=False, **shared)


def log_errors(axis: Axes, least: float, most: float) -> Callable[[float], float]:
    """Make the y axis logarithmic, with a band for 0 below; return where an error is drawn.

    Errors between 0 and `least` are drawn at `least`.
    """
    band = max(0.7, 0.1 * math.log10(most / least))  # its height in decades
    bottom, middle = least / 10.0**band, least / 10.0**(0.5 * band)
    ticks = [10.0**power for power in range(math.ceil(math.log10(least)),
                                            math.floor(math.log10(most)) + 1)]
    axis.set_yscale('log')
    axis.set_ylim(bottom, most)
    axis.set_yticks([middle, *ticks], ['exact (0)', *(f'{tick:g}' for tick in ticks)])
    axis.minorticks_off()
    axis.axhspan(bottom, least / 1.1, color='0.92', zorder=0)
    axis.grid(color='0.9', linewidth=0.5)
    axis.set_axisbelow(True)
    return lambda error: middle if error == 0.0 else min(max(error, least), most)


def percentiles(values: Sequence[float] | np.ndarray, *percents: float) -> tuple[float, ...]:
    """Return percentiles of values (n,), 0 being the least and 100 the largest; NaN of none."""
    if not len(values):
        return (math.nan,) * len(percents)
    return tuple(float(value) for value in np.percentile(values, percents))


@dataclass(frozen=True, kw_only=True)
class Machine:
    """What a figure was measured on; `dataclasses.asdict` gives the columns of a CSV file."""

    processor: str  # name, CPU family and model
    instruction_set: str
    compiler: str
    versions: str  # versions of Python and of packages

    def __str__(self) -> str:
        return ', '.join(astuple(self))


def machine(packages: Sequence[str] = ('numpy',)) -> Machine:
    """Return this machine's description, with the versions of packages."""
    compiler = native.compiler
    return Machine(
        processor=processor(), instruction_set=native.instruction_set,
        compiler=f'GCC {compiler}' if compiler[:1].isdigit() else compiler,
        versions=versions(packages))


def processor() -> str:
    """Return name, CPU family and model of the processor, as the system tells them."""
    found = _cpu_fields()
    name = found.get('model name') or platform.processor() or platform.machine()
    if not {'cpu family', 'model'} <= found.keys():
        return name
    return f'{name} (family {found["cpu family"]}, model {found["model"]})'


def _cpu_fields(path: Path = Path('/proc/cpuinfo')) -> dict[str, str]:
    """Return the fields of the first processor, none on another system than Linux."""
    try:
        text = path.read_text().split('\n\n')[0]
    except OSError:
        return {}
    pairs = (line.partition(':') for line in text.splitlines())
    return {name.strip(): value.strip() for name, _, value in pairs}


def versions(packages: Sequence[str] = ('numpy',)) -> str:
    """Return the versions of Python and of packages that are installed."""
    found = [f'Python {platform.python_version()}']
    for package in packages:
        try:
            found.append(f'{package} {metadata.version(package)}')
        except metadata.PackageNotFoundError:
            print(f'{package} is not installed', file=sys.stderr)
    return ', '.join(found)
