# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A headless Chromium for tests, by the DevTools protocol: opens a page, evaluates, takes pictures.

Rendering is by SwiftShader, in software, so WebGL works without a display and without a GPU.
"""
from __future__ import annotations

import base64
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from patience import PATIENCE
from websockets.sync.client import ClientConnection, connect

from box_contact_ros.processes import end_with_parent

NAMES = ('chromium', 'chromium-browser', 'google-chrome')
FLAGS = ('--headless=new', '--no-sandbox', '--disable-dev-shm-usage', '--hide-scrollbars',
         '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
         '--no-first-run', '--disable-background-networking', '--disable-component-update',
         '--disable-sync', '--mute-audio', '--remote-debugging-port=0')


def chromium() -> str | None:
    """Path of the browser, None if there is none."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Tab:
    """The browser's page."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self._number = 0

    def command(self, method: str, **params: Any) -> dict[str, Any]:
        """Return a DevTools command and its result; events in between are passed over."""
        self._number += 1
        self._connection.send(json.dumps({'id': self._number, 'method': method, 'params': params}))
        while True:
            message = json.loads(self._connection.recv(timeout=PATIENCE))
            if message.get('id') == self._number:
                assert 'error' not in message, message['error']
                return message['result']

    def evaluate(self, expression: str) -> Any:
        """Return the value of a JavaScript expression."""
        answer = self.command('Runtime.evaluate', expression=expression, returnByValue=True)
        assert 'exceptionDetails' not in answer, answer['exceptionDetails']
        return answer['result'].get('value')

    def wait_for(self, expression: str, seconds: float = PATIENCE) -> Any:
        """Wait until an expression is true; its value."""
        deadline = time.monotonic() + seconds
        while not (value := self.evaluate(expression)):
            assert time.monotonic() < deadline, (
                f'{expression} stayed {value!r}; the page says:\n'
                f'{self.evaluate("document.body.innerText")}')
            time.sleep(0.1)
        return value

    def text(self, name: str) -> str:
        """Text of the element with this id, '' if there is none."""
        return self.evaluate(f'document.getElementById({name!r})?.innerText ?? ""')

    def picture(self) -> bytes:
        """Return what the page looks like, as PNG."""
        return base64.b64decode(self.command('Page.captureScreenshot', format='png')['data'])


@contextmanager
def open_page(url: str, width: int = 1280, height: int = 720, *, flags: Sequence[str] = (),
              ) -> Iterator[Tab]:
    """Return the page in a browser of its own, with more flags, which is ended in the end."""
    with tempfile.TemporaryDirectory(prefix='box_contact_browser_',
                                     ignore_cleanup_errors=True) as profile:
        browser = subprocess.Popen(
            [chromium(), *FLAGS, *flags, f'--user-data-dir={profile}',
             f'--window-size={width},{height}', 'about:blank'],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True, preexec_fn=end_with_parent)
        try:
            with connect(_tab_address(browser, Path(profile)), max_size=None, proxy=None) as socket:
                tab = Tab(socket)
                tab.command('Emulation.setDeviceMetricsOverride', width=width, height=height,
                            deviceScaleFactor=1, mobile=False)
                tab.command('Page.navigate', url=url)
                yield tab
        finally:
            _end(browser)


def _tab_address(browser: subprocess.Popen, profile: Path) -> str:
    """Where the tab is to be talked to: the browser writes its port to a file."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        assert browser.poll() is None, f'the browser ended, status {browser.returncode}'
        try:
            port = (profile / 'DevToolsActivePort').read_text().split()[0]
            tabs = f'http://127.0.0.1:{port}/json/list'
            with urllib.request.urlopen(tabs, timeout=PATIENCE) as answer:
                pages = [page for page in json.load(answer) if page['type'] == 'page']
            return pages[0]['webSocketDebuggerUrl']
        except (OSError, IndexError):
            time.sleep(0.1)
    raise TimeoutError(f'no browser within {PATIENCE:g} s')


def _end(browser: subprocess.Popen) -> None:
    try:
        os.killpg(browser.pid, signal.SIGKILL)  # it has nothing to keep
    except ProcessLookupError:
        pass
    browser.wait()
