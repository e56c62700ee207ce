# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of a plan: its words, what a click hits, the program, and the page in a real browser."""
from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from patience import PATIENCE

pytest.importorskip('viser')
pytest.importorskip('clarabel')

from browser import chromium, open_page

from box_contact_ros import Plan, inspect_plan, read_plan
from box_contact_ros.solver.pose import rotation_matrix
from box_contact_ros.view.plan_page import (
    CLICK_HINT,
    MOST_NAMES,
    PlanPage,
    hit_by,
    lines_of,
    table,
    worst_boxes,
)

SHIP = Path(__file__).resolve().parents[2] / 'docs' / 'examples' / 'files' / 'ship.edi'


@pytest.fixture(scope='module')
def found():
    """Return what is wrong with a ship."""
    return inspect_plan(read_plan(SHIP), bears='corners')


def test_what_is_known_of_a_box(found):
    assert lines_of(found, found.plan.names.index('0100304'))[0].startswith('unsupported')
    lines = lines_of(found, found.plan.names.index('0090102'))
    assert lines[:2] == ['0090102: sound', '21,000 kg'] and lines[-1] == '6.058 × 2.438 × 2.591 m'
    afloat = inspect_plan(Plan((1, 1, 1), [[0, 0, 0, 0, 0, 0, 1]], names=['a']))  # nothing is fixed
    assert lines_of(afloat, 0)[0] == 'a: not judged'


def test_the_worst_boxes_have_buttons(found):
    """What falls comes before what goes with it; of many there are forty."""
    assert list(worst_boxes(found)) == ['0100304', '0100306']
    assert [found.plan.names[box] for box in worst_boxes(found).values()] == list(
        worst_boxes(found))
    poses = [[3.0 * x, 0, 0, 0, 0, 0, 1] for x in range(60)]
    assert len(worst_boxes(inspect_plan(Plan((1, 1, 1), poses, ground=0)))) == MOST_NAMES


def test_a_page_bears_any_name_of_a_file(found):
    """It was no UTF-8 for viser, which ended."""
    title = os.fsdecode(b'sch\xf6n <b>.edi')
    assert 'sch?n &lt;b&gt;.edi' in table(title, found).encode('utf-8').decode()


def test_a_ray_hits_the_first_box():
    """As steps of a millimetre along the ray find it, in random boxes."""
    rng = np.random.default_rng(3)
    for _ in range(30):
        sizes = rng.uniform(0.5, 2.0, (6, 3))
        poses = np.hstack((rng.uniform(-3, 3, (6, 3)), rng.normal(size=(6, 4))))
        origin = rng.uniform(8, 9, 3)
        direction = poses[0, :3] - origin
        points = origin + np.arange(0, 25, 1e-3)[:, None] * direction / np.linalg.norm(direction)
        local = np.einsum('nij,pni->pnj', rotation_matrix(poses[:, 3:]),
                          points[:, None] - poses[:, :3])
        inside = (np.abs(local) < sizes / 2).all(axis=2)
        assert inside[inside.any(axis=1).argmax(), hit_by(sizes, poses, origin, direction)]
    assert hit_by(np.ones((1, 3)), np.array([[0, 0, 0, 0, 0, 0, 1.0]]), np.array([0, 0, 5.0]),
                  np.array([0, 0, 1.0])) is None
    assert hit_by(np.ones((1, 3)), np.array([[0, 0, 0, 0, 0, 0, 1.0]]), np.array([0, 0, 5.0]),
                  np.array([0, 0, -1.0])) == 0


def test_the_program(program, tmp_path):
    running = program('view', str(SHIP), '--port', '8460')
    running.wait_for_output('view: open http://127.0.0.1:')
    running.process.send_signal(signal.SIGTERM)
    assert running.process.wait(PATIENCE) == 0
    done = subprocess.run([sys.executable, '-m', 'box_contact_ros.view.view', str(tmp_path / 'no')],
                          capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 2 and done.stderr == f'{tmp_path / "no"}: No such file or directory\n'


@contextmanager
def busy_loops():
    """Run two loops that never sleep for each processor, and this process at low priority."""
    loops = [subprocess.Popen([sys.executable, '-c', 'while True: pass'])
             for _ in range(2 * (os.cpu_count() or 1))]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


@pytest.mark.skipif(chromium() is None, reason='no browser is installed')
@pytest.mark.parametrize('is_busy', [False, True])
def test_the_page_in_a_browser(found, is_busy, tmp_path):
    """It says what is wrong, draws in the colours of causes, and a click shows the box's row."""
    image = pytest.importorskip('PIL.Image')
    with closing(PlanPage('127.0.0.1', 8470, 'ship.edi', found)) as page, (
            busy_loops() if is_busy else closing(open(os.devnull))), open_page(page.url) as tab:
        tab.wait_for('document.getElementById("verdict") !== null')
        assert tab.text('verdict').endswith(': not sound') and tab.text('file') == 'ship.edi'
        assert 'unsupported           0100304' in tab.text('rows')
        assert 'unsupported (1)' in tab.text('legend')
        assert tab.text('clicked') == CLICK_HINT

        def red() -> np.ndarray:
            (tmp_path / 'page.png').write_bytes(tab.picture())
            pixels = np.asarray(image.open(tmp_path / 'page.png').convert('RGB')).astype(int)
            return np.argwhere((pixels[:, :850, 0] > 150) & (pixels[:, :850, 1] < 110)
                               & (pixels[:, :850, 2] < 110))
        for _ in range(100):
            spots = red()
            if len(spots) > 200:
                break
        y, x = spots[len(spots) // 2].tolist()
        for kind in ('mouseMoved', 'mousePressed', 'mouseReleased'):
            tab.command('Input.dispatchMouseEvent', type=kind, x=x, y=y, button='left',
                        clickCount=1)
        tab.wait_for(f'document.getElementById("clicked").innerText != {CLICK_HINT!r}')
        assert tab.text('clicked').startswith('unsupported')

        tab.evaluate('[...document.querySelectorAll("button")].find('
                     'button => button.innerText == "0100306").click()')
        tab.wait_for('document.getElementById("clicked").innerText.startsWith("goes with")')
        switch = '[...document.querySelectorAll("input[type=checkbox]")].at(-1)'
        assert page._shown.all()
        tab.evaluate(f'{switch}.click()')
        tab.wait_for(f'{switch}.checked')
        for _ in range(200):
            if not page._shown.all():
                break
            time.sleep(0.05)
        assert page._shown.tolist() == (found.verdicts != 'sound').tolist()


@pytest.mark.skipif(chromium() is None, reason='no browser is installed')
def test_on_a_phone_the_panel_is_below_the_drawing(found):
    """390 pixels: both as wide as the screen, and neither hides the other."""
    with closing(PlanPage('127.0.0.1', 8470, 'ship.edi', found)) as page, open_page(
            page.url, 390, 844) as tab:
        tab.wait_for('document.getElementById("verdict") !== null')
        panel = 'document.querySelector(".mantine-Paper-root:has(#verdict)")'
        box, drawing = (f'{element}.getBoundingClientRect()' for element in (
            panel, 'document.querySelector("canvas")'))
        tab.wait_for(f'Math.abs({drawing}.height - 0.54 * 844) < 2')
        assert tab.evaluate(f'{box}.width') == tab.evaluate(f'{drawing}.width') == 390
        assert tab.evaluate(f'{box}.top') >= tab.evaluate(f'{drawing}.bottom') - 1
