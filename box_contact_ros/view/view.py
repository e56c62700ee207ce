# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A page in the browser: of the plan of a file if one is named, else of running nodes."""
from __future__ import annotations

import sys
from collections.abc import Sequence

from ..arguments import outside_ros_args, program_main
from ..extras import MissingExtra, require


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Serve the page until SIGINT or SIGTERM; return the exit status."""
    args = sys.argv[1:] if args is None else args
    if any(not arg.startswith('-') for arg in outside_ros_args(args)):
        from . import plan_page
        return plan_page.main(args)
    try:
        require('ros')
    except MissingExtra as error:
        raise MissingExtra(f'{error}; or name a FILE to see its plan', name=error.name) from None
    from .live import view_node
    return view_node.main(args)


if __name__ == '__main__':
    sys.exit(main())
