# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The speed gates: flush stacks are flush, limits break, and a quick run writes all."""
from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from benchmarks import frontier, speed
from benchmarks.speed import UNIT
from benchmarks.timing import Timing
from box_contact_ros import ContactSolver
from box_contact_ros.core import instruction_sets, stages
from box_contact_ros.output import processor, versions
from box_contact_ros.solver.models import models_with_patch


def test_flush_stacks_are_aligned_and_flush() -> None:
    """Right angles to rounding; of the sides, those along y in one plane; the depth is small."""
    pairs = speed.flush_stacks(np.random.default_rng(1), 2000)
    found = stages(*pairs, names=('rotation', 'offset_a'))
    np.testing.assert_allclose(np.abs(found.rotation), np.broadcast_to(np.eye(3), (2000, 3, 3)),
                               atol=1e-15)
    assert np.abs(found.offset_a[:, 1]).max() < 1e-14
    assert 0.3 < np.mean(np.abs(found.offset_a[:, 0]) < 1e-14) < 0.7
    contacts = ContactSolver((1, 1, 1), (1, 1, 1), model='exact').batch(
        pairs.pose_a, pairs.pose_b, size_a=pairs.size_a, size_b=pairs.size_b)
    depth = -contacts.separation / pairs.size_a[:, 2]
    assert contacts.colliding.all()
    assert 0.99e-5 < depth.min() < 2e-5 and 0.008 < depth.max() < 1.1e-2


def run_of(exact: float, batches: list[float], *, unit: float | None = 1000.0,
           mlp: float = 300.0, mlp_batches: Sequence[float] = (80.0, 80.0, 80.0)) -> list[Timing]:
    """Return timings of one instruction set [ns]."""
    common = {'instruction_set': 'AVX2'}
    found = [Timing(name=name, kind='single', rounds=[value], **common)
             for name, value in (('exact', exact), ('mlp', mlp), (UNIT, unit)) if value is not None]
    return found + [Timing(name=f'{model}: set {k}', kind='batch', rounds=[value], **common)
                    for model, values in (('exact', batches), ('mlp', mlp_batches))
                    for k, value in enumerate(values)]


EXACT_BATCHES = [140.0, 150.0, 160.0]


@pytest.mark.parametrize(('timings', 'broken'), [
    (run_of(480.0, EXACT_BATCHES), []),
    (run_of(490.0, EXACT_BATCHES), ['single call of `exact`']),
    (run_of(480.0, EXACT_BATCHES, mlp=361.0), ['single call of `mlp`']),
    (run_of(480.0, [155.0, 160.0, 169.0]), ['in a batch of `exact`']),
    (run_of(480.0, [140.0, 145.0, 175.0], unit=1100.0), ['set 2 take `exact`']),
    (run_of(480.0, EXACT_BATCHES, mlp_batches=[90.0, 90.0, 95.0]), ['set 2 take `mlp`']),
    (run_of(480.0, EXACT_BATCHES, mlp_batches=[99.0, 98.0, 98.0]), ['`exact` on set 0']),
    (run_of(480.0, EXACT_BATCHES, unit=None),
     ['single call of `mlp`', 'single call of `exact`', 'in a batch of `exact`']),
])
def test_limits_break(timings: list[Timing], broken: list[str]) -> None:
    """Each limit alone; without the unit nothing by it holds."""
    claims = speed.claims_of(timings, best=True)
    assert len(claims) == 6
    found = [claim.text for claim in claims if not claim.holds]
    assert len(found) == len(broken)
    assert all(part in text for part, text in zip(broken, found))
    assert len(speed.claims_of(timings, best=False)) == 4


def test_limits_of_threads_and_starts_break() -> None:
    def timings(gain: float) -> list[Timing]:
        return [Timing(name=f'{model}: set', kind=kind, instruction_set='AVX2', rounds=[value])
                for model in models_with_patch()
                for kind, value in zip(speed.SHARED, (gain, 1.0))]

    assert all(claim.holds for claim in speed.thread_claims(timings(1.81)))
    broken, = (claim for claim in speed.thread_claims(timings(1.79)) if not claim.holds)
    assert '`exact`' in broken.text
    assert speed.start_claim([0.1, 0.14, 9.0]).holds
    assert not speed.start_claim([0.1, 0.16, 0.2]).holds


def test_quick_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Rows of every instruction set; the page names all figures, whether or not they hold."""
    pytest.importorskip('mujoco')
    assert frontier.main(['--speed', '--quick', '--out', str(tmp_path)]) in (0, 1)
    with (tmp_path / 'speed.csv').open(encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    by_set = {row['instruction_set'] for row in rows if row['kind'] == 'single'}
    assert len(by_set) == len(instruction_sets())
    for label in by_set:
        names = {row['name'] for row in rows if row['instruction_set'] == label}
        assert names >= {f'{model}: {name}'
                         for model in models_with_patch() for name in speed.BATCH_SETS}
    assert all(float(row['ns']) > 0.0 for row in rows)
    assert {row['processor'] for row in rows} == {processor()}
    assert 'new process' in {row['kind'] for row in rows}
    text = (tmp_path / 'speed.md').read_text('utf-8')
    assert versions(speed.PACKAGES) in text and 'aligned flush stacks' in text
    assert 'nan' not in text and text in capsys.readouterr().out
