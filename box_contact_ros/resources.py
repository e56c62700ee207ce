# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the data files are: weights/, msg_schemas/, launch/, config/.

These folders stand at the top level of the repository, next to the Python package and not inside
it, so `importlib.resources` does not see them. Every kind of install puts them somewhere else:

    checkout, pip install -e, colcon --symlink-install   next to the package
    pip install, apt                                     PREFIX/share/box_contact_ros
    colcon build                                         WORKSPACE/install/.../share/...

This is the one place that knows; everything else asks `resource_path`.
"""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

_PACKAGE = Path(__file__).resolve().parent
_SHARE = Path('share', 'box_contact_ros')


def resource_path(*parts: str) -> Path:
    """Return the path of a data file or folder by its parts, as `'weights', 'x.safetensors'`.

    The first place that has it wins: the checkout, the prefix this package was installed into,
    the ament prefixes (`AMENT_PREFIX_PATH`). `FileNotFoundError` names all of them if none has it.
    """
    if not parts or Path(parts[0]).is_absolute():
        raise ValueError(f'resource_path: a path below the data folders is needed, got {parts!r}')
    places = list(dict.fromkeys(root.joinpath(*parts) for root in _roots()))
    for path in places:
        if path.exists():
            return path
    raise FileNotFoundError(
        f'box_contact_ros has no {os.path.join(*parts)}; looked at:'
        + ''.join(f'\n  {path}' for path in places))


def find_file(name: str | os.PathLike[str]) -> Path:
    """Return the path that a user names, of one of the package's own where it leads nowhere.

    `~` is the user's home, as a launch file or a parameter has it, which no shell has replaced.
    """
    with contextlib.suppress(RuntimeError):  # of a user that is not there
        name = Path(name).expanduser()
    path = Path(name)
    if not path.is_absolute() and not path.exists():
        with contextlib.suppress(FileNotFoundError):
            return resource_path(str(name))
    return path


def open_regular(path: str | os.PathLike[str]) -> BinaryIO:
    """Return a file, open for reading its bytes. Raises OSError, at once, for what is no file.

    A pipe would be waited for, and a device may have no end.
    """
    number = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError('it is not a regular file')
    return os.fdopen(number, 'rb')


def read_regular(path: str | os.PathLike[str], most_bytes: int) -> bytes:
    """Return the bytes of a file. Raises OSError for what is no file, or has more bytes."""
    with open_regular(path) as file:  # which asks for as much memory as it may read
        content = file.read(min(os.fstat(file.fileno()).st_size, most_bytes) + 1)
    if len(content) > most_bytes:
        raise OSError(f'it has more than {most_bytes} bytes')
    return content


def _roots() -> Iterator[Path]:
    # package.xml tells a checkout from site-packages, where `weights` or `config` may well be
    # another project's package.
    checkout = _PACKAGE.parent
    if (checkout / 'package.xml').is_file():
        yield checkout
    # The prefix this very package was installed into, four levels up from
    # PREFIX/lib/python3.x/site-packages/box_contact_ros (one for `pip install --target`). It comes
    # before the ament prefixes: an overlay of another version must not lend us its weights. It also
    # serves a colcon or --user install whose environment has not been sourced.
    for parent in list(_PACKAGE.parents)[:4]:
        if (parent / _SHARE).is_dir():
            yield parent / _SHARE
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        if prefix:
            yield Path(prefix) / _SHARE
