# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Print where C and C++ programs find the library."""
from __future__ import annotations

import argparse
from pathlib import Path

_CORE = Path(__file__).resolve().parent / 'core'


def main() -> None:
    """Print what the options ask for."""
    parser = argparse.ArgumentParser(prog='python -m box_contact_ros', description=__doc__)
    options = parser.add_mutually_exclusive_group(required=True)
    options.add_argument('--cmakedir', dest='place', action='store_const',
                         const=str(_CORE / 'cmake'), help='the folder for box_contact_ros_DIR')
    options.add_argument('--includes', dest='place', action='store_const',
                         const=f'-I{_CORE / "include"}', help="the compiler's option")
    print(parser.parse_args().place)


if __name__ == '__main__':
    main()
