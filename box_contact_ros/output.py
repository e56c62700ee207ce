"""Programs that print or draw what the project claims, from the shipped weights."""
from __future__ import annotations

import argparse
import platform
import sys
from importlib import metadata
from pathlib import Path

from .solver.arguments import make_folder


def add_out(parser: argparse.ArgumentParser, files: str) -> None:
    """Add `--out`, of a program that has `--quick`; `results_folder` reads it."""
    parser.add_argument('--out', type=Path, metavar='DIR',
                        help=f'folder for {files} (default: docs, or quick-results with --quick)')


def results_folder(parser: argparse.ArgumentParser, options: argparse.Namespace) -> Path:
    """Where results are written: a quick run never replaces those of a full one unasked."""
    return make_folder(parser, options.out or Path('quick-results' if options.quick else 'docs'))


# --- what a figure was measured on ----------------------------------------------------------------

_AMD = ((23, 0x00, 0x2f, 'Zen'), (23, 0x30, 0xff, 'Zen 2'), (25, 0x00, 0x0f, 'Zen 3'),
        (25, 0x10, 0x1f, 'Zen 4'), (25, 0x20, 0x5f, 'Zen 3'), (25, 0x60, 0x7f, 'Zen 4'),
        (25, 0xa0, 0xaf, 'Zen 4'), (26, 0x00, 0xff, 'Zen 5'))
_INTEL = ((6, 85, 85, 'Skylake-SP or Cascade Lake'), (6, 106, 108, 'Ice Lake-SP'),
          (6, 140, 141, 'Tiger Lake'), (6, 143, 143, 'Sapphire Rapids'),
          (6, 151, 151, 'Alder Lake'), (6, 154, 154, 'Alder Lake'), (6, 173, 174, 'Granite Rapids'),
          (6, 183, 183, 'Raptor Lake'), (6, 207, 207, 'Emerald Rapids'))
_GENERATIONS = {'AuthenticAMD': _AMD, 'GenuineIntel': _INTEL}
"""By vendor: CPU family, first and last model, generation."""


def _cpu_fields(path: Path = Path('/proc/cpuinfo')) -> dict[str, str]:
    """Return the fields of the first processor, none on another system than Linux."""
    try:
        text = path.read_text().split('\n\n')[0]
    except OSError:
        return {}
    pairs = (line.partition(':') for line in text.splitlines())
    return {name.strip(): value.strip() for name, _, value in pairs}


def generation(vendor: str, family: int, model: int) -> str | None:
    """Return the name of a processor's generation, or None where it is not known here."""
    for known, first, last, name in _GENERATIONS.get(vendor, ()):
        if family == known and first <= model <= last:
            return name
    return None


def processor() -> str:
    """Return name, CPU family, model and, where it is known, generation of the processor."""
    found = _cpu_fields()
    name = found.get('model name') or platform.processor() or platform.machine()
    try:
        family, model = int(found['cpu family']), int(found['model'])
    except (KeyError, ValueError):
        return name
    known = generation(found.get('vendor_id', ''), family, model)
    return f'{name} ({known + ", " if known else ""}family {family}, model {model})'


def versions(packages: tuple[str, ...] = ('numpy',)) -> str:
    """Return the versions of Python and of packages that are installed."""
    found = [f'Python {platform.python_version()}']
    for package in packages:
        try:
            found.append(f'{package} {metadata.version(package)}')
        except metadata.PackageNotFoundError:
            print(f'{package} is not installed', file=sys.stderr)
    return ', '.join(found)
