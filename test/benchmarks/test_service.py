# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The program `service`, with limits that a busy machine meets."""
from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks import service

pytestmark = pytest.mark.reports


@pytest.mark.reports
def test_ticks_come_first_beside_a_planner(capfd: pytest.CaptureFixture[str],
                                           monkeypatch: pytest.MonkeyPatch) -> None:
    """A planner that asks for 4,095 contacts without pause leaves a client in lockstep its ticks.

    No tick is lost. On a busy machine times and shares say nothing, so they have no limit here:
    the next test judges planted ones.
    """
    monkeypatch.setattr(service, 'LIMITS', dict.fromkeys(service.QUESTIONS, math.inf))
    monkeypatch.setattr(service, 'LEAST_SHARE', 0.0)
    assert service.main(['--quick']) == 0, capfd.readouterr().out
    assert '50 of 50 ticks answered' in capfd.readouterr().out


@pytest.mark.parametrize('node, share, lost, wanted', [
    (129.0, 0.76, 0, []), (131.0, 0.76, 0, ['a guest']), (129.0, 0.74, 0, ['lockstep']),
    (129.0, 0.76, 1, ['ticks'])])
def test_what_is_beyond_a_limit_is_named(node: float, share: float, lost: int, wanted: list[str],
                                         ) -> None:
    medians = {'two boxes': np.array([119.0, 100.0]), 'a guest': np.array([node, 100.0])}
    assert service.not_met(medians, share, lost) == wanted


def test_each_question_has_its_contact() -> None:
    """Of 2,001 boxes, one touches: an answer without a contact would be cheap."""
    answerer = service.CheckAnswerer(service.SceneSolver(service.yard()))
    for question in service.QUESTIONS.values():
        service.finished(answerer.answer(question, response := service.Check.Response()))
        assert len(response.contacts.contacts) == 1
    service.finished(answerer.answer(service.PLAN, response := service.Check.Response()))
    assert len(response.contacts.contacts) == 4095
