# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Take docs/figures/view.png: the page of `view`, in a headless Chromium, while the load settles.

Run as `python test/helpers/make_view_picture.py [--out FILE]` on a machine that does nothing else:
the picture shows the latency of a tick.
"""
from __future__ import annotations

import argparse
import io
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

from browser import open_page
from patience import PATIENCE
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
SETTLING = 2.0  # time [s] from the touch to the picture
DARK = 60  # shade of the darkest lines of the drawing


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, default=ROOT / 'docs' / 'figures' / 'view.png')
    out = parser.parse_args().out
    demo = subprocess.Popen([sys.executable, '-u', '-m', 'box_contact_ros.demo.demo', '--view'],
                            cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        url = next(filter(None, map(re.compile(r'http://\S+').search, demo.stdout))).group()
        os.nice(19)  # this script, and the browser that it starts, which renders in software
        with open_page(url, 1280, 640) as tab:
            # The page says that rendering in software is slow; that is no news here.
            close = 'document.querySelector(".mantine-Notification-closeButton")'
            tab.wait_for(f'!!{close}')
            tab.evaluate(f'{close}.click()')
            verdict = 'document.getElementById("verdict")?.innerText'
            tab.wait_for(f'{verdict} == "no contact"')  # of a landing that is seen from the start
            tab.wait_for(f'{verdict}.startsWith("contact, ")')
            time.sleep(SETTLING)
            shade = 255
            while shade > DARK:  # a slow browser still fades the drawing in
                picture = Image.open(io.BytesIO(tab.picture())).convert('RGB')
                shade, _ = picture.crop((0, 0, 900, 640)).convert('L').getextrema()
            # 60 kB instead of 340.
            picture.quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
                out, optimize=True)
    finally:
        demo.send_signal(signal.SIGINT)
        demo.wait(PATIENCE)


if __name__ == '__main__':
    main()
