# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all reports share: readable numbers."""
from __future__ import annotations

import math

from benchmarks import output


def test_numbers_are_readable() -> None:
    values = (math.nan, 0.0, 1e-9, 0.0123, 1.2345, 98.76, 1234.5)
    assert [output.number(value) for value in values] == [
        '–', '0', '<0.001', '0.0123', '1.23', '98.8', '1,234']
