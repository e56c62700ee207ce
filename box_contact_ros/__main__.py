# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""`python -m box_contact_ros PROGRAM [ARGUMENT ...]`: start one of the package's programs.

`--cmakedir` and `--includes` print where C and C++ programs find the library.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from .cli import reader_is_gone, run, usage

_CORE = Path(__file__).resolve().parent / 'core'
PLACES = {'--cmakedir': str(_CORE / 'cmake'), '--includes': f'-I{_CORE / "include"}'}
"""What the options print: the folder for `box_contact_ros_DIR`, and the compiler's option."""


def main(args: Sequence[str] | None = None) -> int:
    """Run the program named by the first argument; without one, list the programs."""
    args = sys.argv[1:] if args is None else args
    if not args or args[0] in ('-h', '--help'):
        try:
            print(usage(), flush=True)
        except BrokenPipeError:
            return reader_is_gone()
        return 0
    if args[0] in PLACES:
        print(PLACES[args[0]])
        return 0
    return run(args[0], args[1:])


if __name__ == '__main__':
    sys.exit(main())
