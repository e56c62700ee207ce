# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The program `yard_clients`, with a limit that a busy machine meets."""
from __future__ import annotations

import math
from collections import OrderedDict

import numpy as np
import pytest
from typed_messages import joint_state

from benchmarks import yard_clients
from benchmarks.yard_clients import Judge
from box_contact_ros import SceneSolver, read_contacts
from box_contact_ros.scene.boxes import NOWHERE, Box
from box_contact_ros.scene.scene import Scene
from box_contact_ros.stream.pairing import StampedPose
from box_contact_ros.stream.write_contacts import TickWriter

pytestmark = pytest.mark.reports


def test_two_clients_of_a_yard(capfd: pytest.CaptureFixture[str],
                               monkeypatch: pytest.MonkeyPatch) -> None:
    """Every answer is that of its revision; a sender that is killed finds what moves again.

    On a busy machine times say nothing, and memory grows at the start.
    """
    monkeypatch.setattr(yard_clients, 'LATE', math.inf)
    monkeypatch.setattr(yard_clients, 'SLOPE', math.inf)
    assert yard_clients.main(['--changes', '60', '--kills', '2', '--executors', 'events']) == 0, (
        capfd.readouterr().out)
    assert '0 wrong' in capfd.readouterr().out


def test_a_wrong_answer_is_found() -> None:
    """Another contact, another name, a pair that is called stale; and an answer that is late."""
    cubes = {name: Box((2, 2, 2)) for name in ('a', 'b', 'c')}
    scene = Scene(cubes, patterns=(('*', '*'),), poses='named')
    judge = object.__new__(Judge)
    judge.scenes, judge._solvers, judge.acknowledged = {0: scene}, OrderedDict(), []
    judge.contacts = judge.worst = judge.late = 0
    poses = {'a': (0, 0, 0, 0, 0, 0, 1), 'b': (0, 0, 1.9, 0, 0, 0, 1)}
    told = read_contacts(bytes(TickWriter(SceneSolver(scene), {})(
        [StampedPose(np.array([*poses.values(), NOWHERE]), 'map', 7)])[0]))
    sent = joint_state(poses, 'map', 7)
    assert judge._fault(7, sent, told) == '' and told.stale == ['c']
    assert judge._fault(7, sent, told._replace(stale=[])).startswith('stale [] instead of')
    assert 'instead of' in judge._fault(7, sent, told._replace(names=[('x', 'a', 'b')]))
    told.contacts.separation[0] -= 1e-12
    assert judge._fault(7, sent, told) == 'another separation' and not judge.late
    judge.acknowledged = [10]
    judge._fault(10 + 10**9, sent, told)
    assert judge.late == 1 and judge.worst == 10**9
