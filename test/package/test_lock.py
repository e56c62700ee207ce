# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""constraints.txt pins all that is asked for, once, and set-ups check each archive by its hash."""
from __future__ import annotations

import hashlib
import re
import runpy
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest
import tomllib

ROOT = Path(__file__).resolve().parents[2]
LOCKED = runpy.run_path(str(ROOT / '.ci' / 'locked.py'))
LOCK: dict[tuple[str, str], list[str]] = LOCKED['read_lock'](LOCKED['CONSTRAINTS'].read_text())


def test_every_pin_is_the_only_one_and_has_hashes() -> None:
    lines = [line for line in LOCKED['CONSTRAINTS'].read_text().splitlines()
             if line and not line.startswith('#')]
    assert len({name for name, _ in LOCK}) == len(LOCK) > 250
    assert len(lines) == len(LOCK) + sum(map(len, LOCK.values()))
    for hashes in LOCK.values():
        assert hashes and len(set(hashes)) == len(hashes)
        assert all(re.fullmatch(r'sha256:[0-9a-f]{64}', one) for one in hashes)


def test_all_that_is_asked_for_is_pinned(setup_arguments: dict[str, Any]) -> None:
    asked = [*setup_arguments['install_requires'], *sum(
        setup_arguments['extras_require'].values(), []), 'pip', 'setuptools', 'wheel']
    missing = {re.split('[=<>]', one)[0] for one in asked} - {name for name, _ in LOCK}
    assert not missing


def test_isolated_builds_have_the_tools_of_the_lock() -> None:
    """Also where pip is not told of constraints.txt."""
    requires = tomllib.loads((ROOT / 'pyproject.toml').read_text())['build-system']['requires']
    assert len(requires) == 2
    for one in requires:
        assert tuple(one.split('==')) in LOCK


def an_item(name: str, version: str, url: str) -> dict[str, Any]:
    return {'metadata': {'name': name, 'version': version}, 'download_info': {'url': url}}


def test_what_the_lock_has_not_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                          ) -> None:
    """But for a wheel with a local version that lies on this machine, which is named."""
    lock, local = {('one-two', '1.0'): ['sha256:12', 'sha256:34']}, tmp_path / 'torch 1+cpu.whl'
    local.write_bytes(b'wheel')

    def locked(*item: str) -> list[str]:
        return list(LOCKED['locked']({'install': [an_item(*item)]}, lock))

    assert locked('One_Two', '1.0', 'https://any') == [
        'one-two==1.0 --hash=sha256:12 --hash=sha256:34']
    for item in (('one-two', '1.1', 'https://any'), ('other', '1.0', 'file:///any'),
                 ('one-two', '1.0+cpu', 'https://any')):
        with pytest.raises(SystemExit, match=re.escape(f'has no hash of {item[0]} {item[1]}')):
            locked(*item)
    assert locked('torch', '1+cpu', local.as_uri()) == [
        f'torch==1+cpu --hash=sha256:{hashlib.sha256(b"wheel").hexdigest()}']
    assert f'not in the lock: torch 1+cpu, taken from {local}' in capsys.readouterr().err


def test_pip_refuses_another_archive(tmp_path: Path) -> None:
    """An archive of the right name and version, but not of the hash, is not installed."""
    wheel = tmp_path / 'one_two-1.0-py3-none-any.whl'
    with zipfile.ZipFile(wheel, 'w') as archive:
        archive.writestr('one_two.py', '')
        archive.writestr('one_two-1.0.dist-info/METADATA',
                         'Metadata-Version: 2.1\nName: one-two\nVersion: 1.0\n')
        archive.writestr('one_two-1.0.dist-info/WHEEL',
                         'Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n')
        archive.writestr('one_two-1.0.dist-info/RECORD', '')
    right = f'sha256:{hashlib.sha256(wheel.read_bytes()).hexdigest()}'
    for hashes, code in ([right], 0), ([f'sha256:{"0" * 64}'], 1):
        report = {'install': [an_item('one-two', '1.0', wheel.as_uri())]}
        (tmp_path / 'locked.txt').write_text(
            '\n'.join(LOCKED['locked'](report, {('one-two', '1.0'): hashes})))
        done = subprocess.run(
            [sys.executable, '-m', 'pip', 'install', '--no-deps', '--no-index', '--find-links',
             tmp_path, '--target', tmp_path / f'target{code}', '-r', tmp_path / 'locked.txt'],
            capture_output=True, text=True)
        assert done.returncode == code, done.stderr
        assert ('DO NOT MATCH THE HASHES' in done.stderr) == bool(code)
