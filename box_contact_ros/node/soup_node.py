# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The soup node as a class: the contact node on the source paper's rival."""
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .contact_node import ContactNode
from .parameters import SOUP_PARAMETERS


class SoupNode(ContactNode):
    """ContactNode on model `soup-N`."""

    name = 'soup_node'
    prefix = 'soup/'
    parameters = SOUP_PARAMETERS

    @staticmethod
    def model_of(values: Mapping[str, Any]) -> str:
        """Return the name of a soup of so many divisions."""
        return f'soup-{values["divisions"]}'
