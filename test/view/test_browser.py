# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The browser of tests ends with them, whatever ends them."""
from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import chromium
from patience import PATIENCE

OPENS = """
import time
from browser import open_page
with open_page('about:blank'):
    print('open', flush=True)
    time.sleep(1000)
"""


def with_word(word: str) -> list[Path]:
    """Return the processes that have a word in their arguments."""
    found = []
    for place in Path('/proc').glob('[0-9]*/cmdline'):
        try:
            if word.encode() in place.read_bytes():
                found.append(place.parent)
        except OSError:  # it has ended
            pass
    return found


@pytest.fixture
def short_path() -> Iterator[str]:
    """Chromium's sockets take no more than 107 characters, and `tmp_path` is long in a worker."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as path:
        yield path


@pytest.mark.skipif(chromium() is None, reason='no browser is installed')
@pytest.mark.skipif(sys.platform != 'linux', reason='only Linux has /proc')
def test_a_browser_ends_with_a_test_that_is_killed(short_path: str) -> None:
    profile = f'--user-data-dir={short_path}/'
    test = subprocess.Popen([sys.executable, '-c', OPENS], stdout=subprocess.PIPE, env={
        **os.environ, 'PYTHONPATH': os.pathsep.join(sys.path), 'TMPDIR': short_path})
    with test:
        assert test.stdout is not None and test.stdout.readline() == b'open\n'
        assert with_word(profile)
        test.kill()
    deadline = time.monotonic() + PATIENCE
    while with_word(profile):
        assert time.monotonic() < deadline, 'the browser is left'
        time.sleep(0.1)
