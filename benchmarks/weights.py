# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The writer of weights files, whose format is that of `box_contact_ros.models.weights_file`."""
from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import save

from box_contact_ros.core import FEATURES, OUTPUTS
from box_contact_ros.models.weights_file import Layers

CARD_FIELDS = ('name', 'model', 'architecture', 'inputs', 'outputs', 'sizes', 'data', 'seed',
               'commit', 'metrics')
"""Entries that every model card has: `inputs` with their ranges, `sizes` it was trained for."""


def mlp_shapes(hidden: Sequence[int]) -> list[tuple[int, int]]:
    """Return units and inputs of each layer of `mlp`: the last one reads the features, too."""
    inputs = [FEATURES, *hidden]
    inputs[-1] += FEATURES
    return list(zip((*hidden, OUTPUTS), inputs))


def save_weights(path: Path, networks: dict[str, Layers], card: dict[str, Any]) -> None:
    """Write networks, each a list of (weight, bias) per layer, and their model card.

    Raises ValueError where the card lacks an entry.
    """
    missing = [field for field in CARD_FIELDS if field not in card]
    if missing:
        raise ValueError(f'the model card lacks {", ".join(missing)}')
    tensors = {f'{name}.{number}.{part}': np.ascontiguousarray(array, np.float32)
               for name, layers in networks.items() for number, layer in enumerate(layers)
               for part, array in zip(('weight', 'bias'), layer)}
    path.parent.mkdir(parents=True, exist_ok=True)
    # Not safetensors' save_file, which leaves the file readable to its owner only.
    path.write_bytes(save(tensors, metadata={'card': json.dumps(card, ensure_ascii=False)}))
