# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measure how many frames a second the page draws: `python test/helpers/view_speed.py`.

The page of `view --scene` runs in a headless Chromium, which renders in software: every pixel and
every edge costs the processor time. Frames that the browser drew are counted over some seconds.
"""
from __future__ import annotations

import argparse
import json
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from browser import Tab, open_page

ROOT = Path(__file__).resolve().parents[2]
CONTAINER = (12.192, 2.438, 2.591)
FRAMES = """new Promise(done => { let count = 0; const start = performance.now();
    function frame() { count += 1; const took = performance.now() - start;
        if (took < 1000 * %g) requestAnimationFrame(frame); else done(1000 * count / took); }
    requestAnimationFrame(frame); })"""


def stacks(boxes: int) -> str:
    """Return the text of a scene of half as many loads, each over a fixed container of its own."""
    text: dict = {'boxes': {}, 'pairs': []}
    columns = 10
    for number in range(boxes // 2):
        place = [14.0 * (number // columns), 3.0 * (number % columns), 0.5 * CONTAINER[2]]
        text['boxes'][f'load_{number}'] = {'size': CONTAINER}
        text['boxes'][f's{number}'] = {'size': CONTAINER, 'pose': [*place, 0, 0, 0, 1]}
        text['pairs'].append({'id': number, 'name': f'load_{number}_s{number}',
                              'a': f'load_{number}', 'b': f's{number}'})
    return json.dumps(text)


@contextmanager
def page_of(scene: str, *arguments: str) -> Iterator[str]:
    """Give the address of the page of a scene, an inline text; end all programs afterwards."""
    with tempfile.NamedTemporaryFile('w', suffix='.yaml') as file:
        file.write(scene)
        file.flush()
        view = subprocess.Popen(
            [sys.executable, '-u', '-m', 'box_contact_ros', 'view', '--no-browser', '--scene',
             file.name, *arguments], cwd=ROOT, stdout=subprocess.PIPE, text=True)
        try:
            yield re.search(r'http://\S+', view.stdout.readline()).group()
        finally:
            view.send_signal(signal.SIGINT)
            view.wait(30)


def frames_per_second(tab: Tab, seconds: float) -> float:
    """Return how often the browser draws a frame."""
    answer = tab.command('Runtime.evaluate', expression=FRAMES % seconds, awaitPromise=True,
                         returnByValue=True)
    return float(answer['result']['value'])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--boxes', type=int, nargs='+', default=[2, 200, 400])
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--window', type=int, nargs=2, default=[1280, 720], metavar='PIXELS')
    parser.add_argument('--rate', default='50', help='ticks a second')
    parser.add_argument('--picture', type=Path, help='file for the last page')
    options = parser.parse_args()
    print('| boxes | frames drawn [1/s] | answers [1/s] |\n|---:|---:|---:|')
    for boxes in options.boxes:
        with (page_of(stacks(boxes), '--rate', options.rate) as url,
              open_page(url, *options.window) as tab):
            tab.wait_for(
                'document.getElementById("verdict")?.innerText.startsWith("contact, ")', 200)
            time.sleep(2.0)
            frames = frames_per_second(tab, options.seconds)
            print(f'| {boxes} | {frames:.1f} | {tab.text("rate").split()[0]} |', flush=True)
            if options.picture:
                options.picture.write_bytes(tab.picture())


if __name__ == '__main__':
    main()
