# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a file may cost: nothing is waited for, and little memory and time is taken."""
from __future__ import annotations

import json
import os
import random
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from box_contact_ros.plans import inspect_files

pytest.importorskip('clarabel')

from test_read_plan import FILES, sheet, written

MEMORY, SECONDS = 300 * 2**20, 2.0
"""That the program may take, with all its imports [bytes, s of the processor]."""
MOST_MEMORY, MOST_SECONDS = 2**30, 20.0
"""The same for any file of 1 MB."""


def judged(path: Path, *options: str) -> tuple[int, str, float, int]:
    """Return exit status, what is printed, processor time [s] and memory [bytes] of the program."""
    started = resource.getrusage(resource.RUSAGE_CHILDREN)
    # VmHWM is the program's own; ru_maxrss also counts the process that started it.
    done = subprocess.run([sys.executable, '-c', (
        'import resource, sys\nfrom box_contact_ros.plans.inspect_files import main\n'
        'status = main(sys.argv[1:])\nown = next(int(line.split()[1]) for line in '
        'open("/proc/self/status") if line.startswith("VmHWM"))\n'
        'print(max(own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss), '
        'file=sys.stderr)\nsys.exit(status)'),
        str(path), *options], capture_output=True, text=True, timeout=100)
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    *errors, peak = done.stderr.splitlines()
    seconds = ended.ru_utime - started.ru_utime + ended.ru_stime - started.ru_stime
    return done.returncode, done.stdout + '\n'.join(errors), seconds, 1024 * int(peak)


@pytest.mark.parametrize('name', ['p.csv', 'p.sdf', 'p'])
@pytest.mark.parametrize('make', [os.mkfifo, os.mkdir, lambda path: os.symlink('/dev/zero', path)])
def test_what_is_no_file_is_refused_at_once(name, make, tmp_path, capsys):
    path = tmp_path / name
    make(path)
    assert inspect_files.main([str(path)]) == 2
    assert capsys.readouterr().err == f'{path}: it is not a regular file\n'


@pytest.mark.parametrize('name', ['p.csv', 'p.edi', 'p.sdf'])
def test_a_file_without_permission(name, tmp_path):
    path = written(tmp_path, name, 'x')
    path.chmod(0)
    # Who may read everything, as root, does without that right.
    start = ['setpriv', '--bounding-set', '-dac_override,-dac_read_search'] * (os.geteuid() == 0)
    if start and not shutil.which(start[0]):
        pytest.skip('setpriv is not installed')
    done = subprocess.run([*start, sys.executable, '-m', 'box_contact_ros.plans.inspect_files',
                           str(path)], capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stdout) == (2, '')
    assert done.stderr == f'{path}: Permission denied\n'


def test_too_many_overlaps(tmp_path):
    """2,000 boxes in one place took 1.3 GB."""
    text = sheet(*(f'{n},1,1,1,0,0,0.5' for n in range(2000)))
    status, printed, seconds, peak = judged(written(tmp_path, 'p.csv', text))
    assert status == 2 and 'too many to be judged' in printed
    assert seconds < SECONDS and peak < MEMORY


def slats(count):
    """Return two layers of slats, each of which crosses all of the other layer."""
    long, places = count / 50, [n / 50 + 0.01 for n in range(count)]
    return sheet(*(f'a{n},{long},.01,.1,{long / 2},{at},.05,1' for n, at in enumerate(places)),
                 *(f'b{n},.01,{long},.1,{at},{long / 2},.15,1' for n, at in enumerate(places)),
                 more=',mass')


def pyramid(side, *others):
    """Return bricks that stand on four each, and other rows."""
    rows = [f'{z}/{x}/{y},.2,.1,.1,{.2 * x + .1 * z},{.1 * y + .05 * z},{.1 * z + .05},1'
            for z in range(side) for x in range(side - z) for y in range(side - z)]
    return sheet(*rows, *others, more=',mass')


@pytest.mark.parametrize('text, status, line', [
    pytest.param(slats(440), 3, 'what was read is sound, but 880 were not judged',
                 marks=pytest.mark.reports),
    (slats(250), 3, 'what was read is sound, but 500 were not judged'),
    pytest.param(pyramid(44), 3, 'what was read is sound, but 29,370 were not judged',
                 marks=pytest.mark.reports),
    (pyramid(27), 3, 'what was read is sound, but 6,930 were not judged'),
    (pyramid(27, 'a,.1,.1,.1,0,0,9,1'), 1, 'not sound; 6,930 were not judged')])
def test_loads_that_take_too_much_are_not_judged(text, status, line, tmp_path):
    """880 slats took 2 GB, 29,370 bricks 1.6 GB, and 4,000 bricks 122 s."""
    found, printed, seconds, peak = judged(written(tmp_path, 'p.csv', text))
    assert found == status and line in printed
    assert 'not judged: too many boxes bear on each other' in printed
    assert seconds < MOST_SECONDS and peak < MOST_MEMORY


@pytest.mark.parametrize('order', ['at random', 'from above'])
@pytest.mark.parametrize('weighed', [pytest.param(True, marks=pytest.mark.reports), False])
def test_steps_are_a_part_of_the_work(order, weighed, tmp_path):
    """4,000 boxes with an order, which has 116 kB, took 131 s."""
    number = [*range(4000, 0, -1)]
    if order == 'at random':
        random.Random(1).shuffle(number)
    places = [(.3 * (x + z % 2 / 3) + .15, .2 * (y + z % 2 / 3) + .1, .2 * z + .1)
              for z in range(10) for x in range(20) for y in range(20)]
    text = sheet(*(f'{n},.3,.2,.2,{x},{y},{z},{step}{",1" * weighed}' for n, ((x, y, z), step) in
                   enumerate(zip(places, number))), more=f',order{",mass" * weighed}')
    status, printed, seconds, peak = judged(written(tmp_path, 'p.csv', text))
    assert status == 1 and ' hangs' in printed and 'were not judged' in printed
    assert seconds < MOST_SECONDS and peak < MOST_MEMORY


@pytest.mark.reports
def test_many_boxes_that_hang(tmp_path):
    """33 s went into how high 30,000 boxes hang."""
    text = sheet(*(f'{n},.3,.2,.2,{n % 40 / 2},{n // 40 % 40 / 2},{n // 1600 / 2 + .2:.1f}'
                   for n in range(30_000)))
    status, _, seconds, peak = judged(written(tmp_path, 'p.csv', text))
    assert status == 1 and seconds < MOST_SECONDS and peak < MOST_MEMORY


def test_a_small_file_needs_little_memory(tmp_path):
    """256 MiB were asked for at once, whatever the size."""
    path = written(tmp_path, 'p.csv', sheet('a,1,1,1,0,0,.5'))
    limit = 200 * 2**20
    done = subprocess.run([sys.executable, '-c', (
        'import resource, sys\nfrom box_contact_ros.resources import read_regular\n'
        f'now = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()\n'
        f'resource.setrlimit(resource.RLIMIT_AS, (now + {limit}, now + {limit}))\n'
        'print(len(read_regular(sys.argv[1], 2**28)))'), str(path)], capture_output=True, text=True,
        timeout=100)
    assert (done.stdout, done.stderr) == (f'{path.stat().st_size}\n', '')


def test_too_little_memory_is_a_line(tmp_path, monkeypatch, capsys):
    def fails(*_, **__):
        raise MemoryError
    monkeypatch.setattr(inspect_files, 'inspect_plan', fails)
    path = written(tmp_path, 'p.csv', sheet('a,1,1,1,0,0,.5'))
    assert inspect_files.main([str(path)]) == 2
    assert capsys.readouterr().err == f'{path}: it needs more memory than there is\n'


def test_a_closed_stdout_is_a_line(tmp_path):
    path = written(tmp_path, 'p.csv', sheet('a,1,1,1,0,0,.5'))
    for options in '', '--csv', '--json':
        done = subprocess.run(f'{sys.executable} -m box_contact_ros.plans.inspect_files {path} '
                              f'{options} >&-', shell=True, capture_output=True, text=True,
                              timeout=100)
        assert (done.returncode, done.stderr) == (74, 'stdout is closed\n')


@pytest.mark.reports
def test_real_pallets_are_judged_whatever_their_number(tmp_path):
    orders = json.loads((FILES.parent / 'pallets/packing_plans.json').read_bytes())
    copies = {f'{name}/{n}': items for n in range(27) for name, items in orders.items()}
    found, printed, seconds, peak = judged(written(tmp_path, 'p.json', json.dumps(copies)))
    assert found == 1 and '5,103 boxes' in printed and 'not judged' not in printed
    assert seconds < MOST_SECONDS and peak < MOST_MEMORY
