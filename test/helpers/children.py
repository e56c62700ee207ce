# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which processes a program under test has started."""
from __future__ import annotations

import contextlib
from pathlib import Path


def children(pid: int) -> list[int]:
    """Return the processes that a process has started, in whatever group they are.

    Before a child runs its own program, it borrows its parent's memory: who stops it then stops
    the parent too, and no signal ends that.
    """
    def command(of: int | str) -> bytes:
        return Path(f'/proc/{of}/cmdline').read_bytes()

    found = []
    for stat in Path('/proc').glob('[0-9]*/stat'):
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            child = stat.parent.name
            if (stat.read_text().rpartition(')')[2].split()[1] == str(pid)
                    and command(child) != command(pid)):
                found.append(int(child))
    return found
