# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Programs whose output goes nowhere end without a traceback, with a status of its own."""
from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import PROGRAMS
from patience import PATIENCE

from box_contact_ros.arguments import NOT_WRITTEN, one_line

SHIP = Path(__file__).resolve().parents[2] / 'docs/examples/files/ship.edi'
MODULES = [*PROGRAMS.values(), 'demo.demo']


def ended(module: str, *words: str | bytes, out: object, **environment: str) -> tuple[int, str]:
    """Return the exit status of a program with its stdout elsewhere, and what is on stderr."""
    done = subprocess.run([sys.executable, '-m', f'box_contact_ros.{module}', *words], stdout=out,
                          stderr=subprocess.PIPE, timeout=PATIENCE, env=os.environ | environment)
    return done.returncode, done.stderr.decode()


@pytest.fixture
def closed_pipe():
    """Return the end of a pipe that nobody reads."""
    reads, writes = os.pipe()
    os.close(reads)
    yield writes
    os.close(writes)


def skip_without(module: str) -> None:
    if module == 'plans.inspect_files':
        pytest.importorskip('clarabel')
    else:
        pytest.importorskip('rclpy')


@pytest.mark.parametrize('module', MODULES)
def test_help_into_a_closed_pipe_and_a_full_device(module, closed_pipe):
    skip_without(module)
    buffered = {'PYTHONUNBUFFERED': ''}  # argparse says nothing of what fails at once
    assert ended(module, '--help', out=closed_pipe, **buffered) == (141, '')
    with open('/dev/full', 'w') as full:
        assert ended(module, '--help', out=full, **buffered) == (
            NOT_WRITTEN, 'No space left on device\n')


@pytest.mark.parametrize('options', [
    ('--json',), (str(SHIP),), pytest.param((), marks=pytest.mark.reports),
    pytest.param(('--csv',), marks=pytest.mark.reports)])
def test_answers_into_a_closed_pipe_and_a_full_device(options, closed_pipe):
    skip_without('plans.inspect_files')
    for unbuffered in '', '1':
        assert ended('plans.inspect_files', str(SHIP), *options, out=closed_pipe,
                     PYTHONUNBUFFERED=unbuffered) == (141, '')
        with open('/dev/full', 'w') as full:
            assert ended('plans.inspect_files', str(SHIP), *options, out=full,
                         PYTHONUNBUFFERED=unbuffered) == (NOT_WRITTEN, 'No space left on device\n')


def test_names_that_the_terminal_cannot_encode(tmp_path):
    skip_without('plans.inspect_files')
    for name in b'k\xc3\xb6rper.csv', b'k\xf6rper.csv':
        path = os.fsencode(tmp_path) + b'/' + name
        with open(path, 'w') as file:
            file.write('name,length,width,height,x,y,z\nhöher,1,1,1,0,0,7\n')
        for options in [], ['--csv'], ['--json'], [path]:
            status, errors = ended('plans.inspect_files', path, *options, PYTHONIOENCODING='ascii',
                                   out=subprocess.DEVNULL)
            assert (status, errors) == (1, '')


def test_one_line():
    assert one_line(ValueError('a\x1b[31m\n b')) == 'a?[31m b'
    assert one_line(OSError(28, 'No space', 'a\nb')) == 'a b: No space'
    assert one_line(OSError('it is odd')) == 'it is odd'
