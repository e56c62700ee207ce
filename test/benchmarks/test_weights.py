# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The writer of weights files: what it writes is read back, by everybody."""
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_weights_file import WIDTHS, layers

from benchmarks.weights import CARD_FIELDS, save_weights
from box_contact_ros.models.weights_file import load_weights

pytestmark = pytest.mark.reports

CARD = {**dict.fromkeys(CARD_FIELDS, 'x'), 'architecture': list(WIDTHS)}


def test_what_was_saved_is_loaded(tmp_path: Path) -> None:
    """Numbers and card, in a folder that is made, with the rights that the umask gives."""
    path = tmp_path / 'folder' / 'good.safetensors'
    save_weights(path, {'n': layers()}, CARD)
    weights = load_weights(path)
    assert weights.card == CARD
    for layer, want in zip(weights.networks['n'].layers, layers(), strict=True):
        np.testing.assert_equal(layer, want)
    (path.parent / 'plain').write_bytes(b'')
    assert path.stat().st_mode == (path.parent / 'plain').stat().st_mode


def test_an_incomplete_card_is_not_written(tmp_path: Path) -> None:
    short = {name: value for name, value in CARD.items() if name not in ('seed', 'metrics')}
    with pytest.raises(ValueError, match='lacks seed, metrics'):
        save_weights(tmp_path / 'x', {'n': layers()}, short)
    assert not (tmp_path / 'x').exists()
