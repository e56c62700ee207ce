# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The program `yard_growth`, with a limit that the field checks of tests meet."""
from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks import yard_growth

pytestmark = pytest.mark.reports


def test_a_yard_grows(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yard_growth, 'MOST_WAIT', math.inf)
    assert yard_growth.main(['--boxes', '2000']) == 0, capfd.readouterr().out
    assert '2000 boxes in ' in capfd.readouterr().out
    monkeypatch.setattr(yard_growth, 'MOST_WAIT', 0.0)
    assert yard_growth.main(['--boxes', '100']) == 1


def test_how_long_ticks_wait() -> None:
    """One that comes in the middle of an event, one in idle time, and one after a preemption."""
    events = np.array([(0, 0), (20, 10), (100, 15), (140, 30)]) * 10**6  # wall, thread [ns]
    ticks = np.array([(15, 8), (80, 14), (110, 25)]) * 10**6  # by the wall, by the thread [ns]
    assert yard_growth.waits_of(ticks, events).tolist() == [3.0, 4.0, 10.0]
