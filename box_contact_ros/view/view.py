# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A page in the browser, of running nodes."""
from __future__ import annotations

import sys
from collections.abc import Sequence


def main(args: Sequence[str] | None = None) -> int:
    """Serve the page until SIGINT or SIGTERM; return the exit status."""
    from .live import view_node
    return view_node.main(args)


if __name__ == '__main__':
    sys.exit(main())
