# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The soup node: the contact node's work done by a polygon soup, the source paper's rival.

Subscribes box_a/pose and box_b/pose like the contact node. Publishes the same messages under
soup/contact/point, soup/contact/normal and soup/contacts, and /diagnostics. Both nodes can run side
by side on one input.
"""
from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any

from ..arguments import program_main
from ..extras import require
from ..models.make_model import MOST_SOUP_DIVISIONS, SOUP_DIVISIONS
from .contact_node import PARAMETERS as CONTACT_PARAMETERS
from .contact_node import ContactNode, run
from .parameters import Setting, whole_number

require('soup')
PARAMETERS = {
    'divisions': Setting(
        SOUP_DIVISIONS, f'squares along each edge of a face, 1 to {MOST_SOUP_DIVISIONS}; '
        'N make 12 N² triangles a box', whole_number(1, MOST_SOUP_DIVISIONS)),
} | {name: setting for name, setting in CONTACT_PARAMETERS.items() if name != 'model'}


class SoupNode(ContactNode):
    """ContactNode on model `soup-N`."""

    name = 'soup_node'
    prefix = 'soup/'
    parameters = PARAMETERS

    @staticmethod
    def model_of(values: Mapping[str, Any]) -> str:
        """Return the name of a soup of so many divisions."""
        return f'soup-{values["divisions"]}'


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(SoupNode, __doc__, args)


if __name__ == '__main__':
    sys.exit(main())
