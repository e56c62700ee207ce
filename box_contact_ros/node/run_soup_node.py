# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The soup node: the contact node's work done by a polygon soup, the source paper's rival.

Subscribes box_a/pose and box_b/pose like the contact node. Publishes the same messages under
soup/contact/point, soup/contact/normal and soup/contacts, and /diagnostics. Both nodes can run side
by side on one input.
"""
from __future__ import annotations

import sys
from collections.abc import Sequence

from ..arguments import parse_command_line, program_main
from ..extras import require
from .parameters import SOUP_PARAMETERS


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    parse_command_line('soup_node', __doc__, SOUP_PARAMETERS, args)
    require('ros', 'soup')
    from .contact_node import run
    from .soup_node import SoupNode
    return run(SoupNode, args)


if __name__ == '__main__':
    sys.exit(main())
