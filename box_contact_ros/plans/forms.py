# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What columns and keys of packing plans mean, by their names."""
from __future__ import annotations

import re

EXTENTS, PLACE, TURN = ('length', 'width', 'height'), ('x', 'y', 'z'), ('qx', 'qy', 'qz', 'qw')
AMOUNT = re.compile(
    '.*(mass|weight|gewicht|poids|peso|limit|capacity|strength|payload|traglast|auflast).*|'
    'kgs?|kilos?|kilograms?|lbs?|kn|tons?|tonnes?|gross|net|tare|brutto|'
    'netto|vgm|max|maximum|stackable|maxload')
"""Words in the names of columns that may mean a mass or a limit."""


def means_amount(key: str) -> bool:
    """Return whether a name may mean a mass or a limit, such as gross_weight, kg or maxLoad."""
    words = re.findall('[a-zäöüß]+', re.sub('([a-z])([A-Z])', r'\1 \2', key).lower())
    return any(map(AMOUNT.fullmatch, words)) or words[-1:] == ['load']
