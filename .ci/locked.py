# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Turn pip's report of what it would install into requirements with the hashes of constraints.txt.

usage: locked.py REPORT >REQUIREMENTS

The hashes are comments there, because pip takes none from a constraints file. A wheel with a local
version that lies on this machine, such as torch 2.13.0+cpu in `PIP_FIND_LINKS`, is in no lock: it
is taken as it is, and named. Anything else that the lock does not have is refused.
"""
from __future__ import annotations

import hashlib
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

CONSTRAINTS = Path(__file__).resolve().parents[1] / 'constraints.txt'


def read_lock(text: str) -> dict[tuple[str, str], list[str]]:
    """Return the hashes, such as sha256:…, of each (name, version)."""
    lock: dict[tuple[str, str], list[str]] = {}
    hashes: list[str] = []
    for line in text.splitlines():
        if pin := re.match(r'([a-z0-9-]+)==([^ ;]+)', line):
            hashes = lock.setdefault((pin[1], pin[2]), [])
        elif line.startswith('  # sha256:'):
            hashes.append(line[4:])
    return lock


def locked(report: dict[str, Any], lock: dict[tuple[str, str], list[str]]) -> Iterator[str]:
    """Give a requirement for each archive of a report; SystemExit for what the lock has not."""
    for item in report['install']:
        name = re.sub('[-_.]+', '-', item['metadata']['name']).lower()
        version, url = item['metadata']['version'], item['download_info']['url']
        hashes = lock.get((name, version), [])
        if not hashes and '+' in version and url.startswith('file:'):
            archive = Path(url2pathname(urlsplit(url).path))
            print(f'not in the lock: {name} {version}, taken from {archive}', file=sys.stderr)
            hashes = [f'sha256:{hashlib.sha256(archive.read_bytes()).hexdigest()}']
        if not hashes:
            raise SystemExit(f'error: constraints.txt has no hash of {name} {version} (.ci/lock)')
        yield ' '.join([f'{name}=={version}', *(f'--hash={one}' for one in hashes)])


if __name__ == '__main__':
    print(*locked(json.loads(Path(sys.argv[1]).read_text()), read_lock(CONSTRAINTS.read_text())),
          sep='\n')
