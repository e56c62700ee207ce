# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random heaps by the forces, a sample of them; and their judge, which finds planted faults."""
from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from benchmarks import fuzz, heaps

SEED = 20260


def test_a_sample_has_no_fault(capsys: pytest.CaptureFixture[str]) -> None:
    """Of 150 heaps; hardly one gains energy."""
    assert fuzz.main(['--heaps', '150', '--seed', str(SEED), '--workers', '1']) == 0
    words = capsys.readouterr().out
    assert words.startswith('150 heaps, ') and int(words.split()[2]) < 5, words


@pytest.mark.parametrize('number', [1311, 2135, 3344, 4287, 6064, 6604, 7281, 7986, 9284])
def test_heaps_that_exploded(number: int) -> None:
    """To 3e189 times their first energy: a free needle at 167 rad/s left a step at 12,632 rad/s.

    Its energy went to the axis of least inertia, and its angular momentum was lost.
    """
    assert heaps.examine(1, number).fault == ''


@pytest.mark.parametrize('number', [335, 419])
def test_heaps_that_gained_energy(number: int) -> None:
    """By up to 0.7 of the first: plates that fall on an edge, solved row by row at their rims."""
    found = heaps.examine(1, number)
    assert not found.fault and found.gain <= 1.0 + 1e-9


def test_heaps_are_as_wide_as_is_said() -> None:
    """Sizes, aspects, ratios of mass and steps come near their limits, and boxes stand flush."""
    drawn = [heaps.Heap.draw(SEED, number) for number in range(500)]
    sizes = np.vstack([heap.sizes[1:] for heap in drawn])
    assert sizes.min() >= 1e-3 and sizes.min() < 2e-3 and sizes.max() <= 100 and sizes.max() > 50
    aspects = sizes.max(axis=1) / sizes.min(axis=1)
    assert 500 < aspects.max() <= 1000 * (1 + 1e-12)
    assert 5e3 < max(heap.masses[1:].max() / heap.masses[1:].min() for heap in drawn) <= 1e4
    lengths = np.concatenate([heap.lengths for heap in drawn])
    assert 1e-6 <= lengths.min() < 1.1e-6 and 0.045 < lengths.max() <= 0.05


@pytest.mark.parametrize('planted, words', [
    (np.nan, 'not finite at step 3'), (1e9, 'energy'), (ValueError('dt is wrong'), 'exception'),
    (ValueError('poses[2] is wrong'), '')])
def test_planted_faults_are_found(planted: float | Exception, words: str,
                                  monkeypatch: pytest.MonkeyPatch) -> None:
    """Only an error that names the body is none."""
    motions = heaps.Heap.motions

    def wrong(heap: heaps.Heap) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        for step, (poses, velocities) in enumerate(motions(heap)):
            if step == 3:
                if isinstance(planted, Exception):
                    raise planted
                velocities = velocities + planted
            yield poses, velocities

    monkeypatch.setattr(heaps.Heap, 'motions', wrong)
    assert heaps.examine(SEED, 1).fault.startswith(words)
    assert bool(heaps.examine(SEED, 1).fault) == bool(words)
