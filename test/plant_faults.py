# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plant faults in the code, one at a time, and tell which of them no test sees.

`python test/plant_faults.py --count 20 --seed 1` draws places among core/src, solver/, scene/ and
plans/: a comparison, a sign, a logical operator or a number becomes another one. It builds where
the file is C++, runs the tests of the file's folder, and restores the file. The status is 1 if a
fault survives. Name files to draw among these alone. A survivor gets a law, or what it is in goes.
"""
from __future__ import annotations

import argparse
import os
import random
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
CODE = ROOT / 'box_contact_ros'
TESTS = {'core/src/force': ('forces', 'core/test_library.py'),
         'core/src/faces': ('plans', 'solver'),
         'core/src/mlp': ('core', 'models', 'solver'), 'core/src/motion': ('core', 'scene'),
         'core/src': ('core', 'solver', 'scene'),
         'solver': ('solver', 'models', 'scene', 'core/test_motion.py'),
         'scene': ('scene', 'node/test_check.py', 'node/test_check_path.py'), 'plans': ('plans',)}
"""What tests a folder: the first that a file is in."""
SWAPS = {'<': '<=', '<=': '<', '>': '>=', '>=': '>', '==': '!=', '!=': '==', '+': '-', '-': '+',
         '&&': '||', '||': '&&', 'and': 'or', 'or': 'and', 'min': 'max', 'max': 'min'}
TOKEN = re.compile(r'(?<= )(?:<=?|>=?|==|!=|\+|-|&&|\|\||and|or)(?= )|\bmin\b(?=\()|'
                   r'\bmax\b(?=\()|(?<![\w.])\d+\.\d+(?![\w.])')
PROSE = re.compile(r'//.*|/\*.*?\*/|#.*|"""(?:.|\n)*?"""|\'(?:[^\'\\\n]|\\.)*\'|'
                   r'"(?:[^"\\\n]|\\.)*"|template <.*|^from .*|^import .*', re.MULTILINE)
PATIENCE = 900  # of the tests of a folder [s]


class Fault(NamedTuple):
    """A token of a file that becomes another one."""

    file: Path
    begin: int
    end: int
    other: str

    def __str__(self) -> str:
        text = self.file.read_text('utf-8')
        line = text.count('\n', 0, self.begin)
        return (f'{self.file.relative_to(ROOT)}:{line + 1}: {text[self.begin:self.end]} → '
                f'{self.other}: {text.splitlines()[line].strip()}')


def faults_of(file: Path) -> Iterator[Fault]:
    """Yield what may be planted in a file, outside of comments and text."""
    text = file.read_text('utf-8')
    code = PROSE.sub(lambda found: re.sub(r'[^\n]', ' ', found[0]), text)
    for token in TOKEN.finditer(code):
        other = SWAPS.get(token[0]) or f'{0.8 * float(token[0]) or 0.2:g}'
        yield Fault(file, *token.span(), other)


def tests_of(file: Path) -> list[str]:
    """Return the tests of a file's folder."""
    inner = file.relative_to(CODE).as_posix()
    folder = next(folder for folder in TESTS if inner.startswith(f'{folder}/'))
    return [f'test/{name}' for name in TESTS[folder]]


def run(*words: str) -> int:
    """Run a program on this checkout's package; return its status, or 1 after PATIENCE."""
    try:
        return subprocess.run([sys.executable, *words], cwd=ROOT, timeout=PATIENCE,
                              env={**os.environ, 'PYTHONPATH': str(ROOT)},
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
    except subprocess.TimeoutExpired:
        return 1


def build(file: Path) -> bool:
    """Build what a file is compiled into; return whether it compiles."""
    return file.suffix == '.py' or run('setup.py', '-q', 'build_ext', '--inplace') == 0


def verdict(fault: Fault) -> str:
    """Plant a fault, ask the tests, and restore the file."""
    text = fault.file.read_text('utf-8')
    try:
        fault.file.write_text(text[:fault.begin] + fault.other + text[fault.end:], 'utf-8')
        if not build(fault.file):
            return 'does not compile'
        failed = run('-m', 'pytest', '-x', '-q', '-p', 'no:cacheprovider', *tests_of(fault.file))
        return 'killed' if failed else 'SURVIVES'
    finally:
        fault.file.write_text(text, 'utf-8')


def main() -> int:
    """Plant, and print a line for each; 1 if one survives."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('files', nargs='*', type=lambda name: Path(name).resolve())
    parser.add_argument('--count', type=int, default=10, help='valid faults (default: 10)')
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    files = options.files or sorted(
        path for folder in ('core/src', 'solver', 'scene', 'plans')
        for suffix in ('hpp', 'cpp', 'py') for path in (CODE / folder).rglob(f'*.{suffix}'))
    rng, valid, survivors = random.Random(options.seed), 0, 0
    compiled = False
    while valid < options.count:
        file = rng.choice(files)
        if not (drawn := list(faults_of(file))):
            continue
        fault = rng.choice(drawn)
        said, found = str(fault), verdict(fault)
        compiled |= file.suffix != '.py'
        print(f'{found:16} {said}', flush=True)
        valid += found != 'does not compile'
        survivors += found == 'SURVIVES'
    if compiled:
        build(CODE / 'core/src/kernel.cpp')
    print(f'{survivors} of {valid} survive')
    return int(survivors > 0)


if __name__ == '__main__':
    sys.exit(main())
