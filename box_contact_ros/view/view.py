# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A live page in the browser: boxes, contacts, depth and force over time.

It draws the boxes of a scene as the running nodes publish them, and the contacts that answer them.
It also shows which model the contact node runs, and the force on a crane's load. It prints the
page's address.

`view FILE` shows the plan of a file instead, and what is wrong with it. It needs no ROS:
`view FILE --help`.
"""
from __future__ import annotations

import sys
from collections.abc import Sequence

from ..arguments import outside_ros_args, parse_command_line, program_main
from ..extras import MissingExtra, require
from . import VIEW_PARAMETERS


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Serve the page until SIGINT or SIGTERM; return the exit status."""
    args = sys.argv[1:] if args is None else args
    if any(not arg.startswith('-') for arg in outside_ros_args(args)):
        from . import plan_page
        return plan_page.main(args)
    parse_command_line('view', __doc__, VIEW_PARAMETERS, args)
    try:
        require('ros', 'view')
    except MissingExtra as error:
        raise MissingExtra(f'{error}; or name a FILE to see its plan', name=error.name) from None
    from ..node.runtime import run_node
    from .live.view_node import ViewNode

    # The page is served by another thread, which must not wait until this one is idle.
    return run_node(ViewNode, args, undisturbed=False)


if __name__ == '__main__':
    sys.exit(main())
