# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Probes: what lies behind the answers of the core, for training, the fuzzer and tests.

The first call compiles probes.cpp with the core's sources into build/, which takes half a minute.
Pairs are poses (n, 7) and full extents (n, 3) of boxes A and B, as `pose_sets.Pairs` has them. All
raise ValueError for a row whose poses or sizes are refused.
"""
from __future__ import annotations

import ctypes
import fcntl
import functools
import hashlib
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from box_contact_ros.core import FEATURES

ROOT = Path(__file__).resolve().parents[1]
CORE = ROOT / 'box_contact_ros' / 'core'
SOURCE = Path(__file__).with_suffix('.cpp')
FLAGS = ('-std=c++17', '-O2', '-ffp-contract=off', '-fno-tree-slp-vectorize', '-Wno-psabi', '-fPIC',
         '-shared', f'-I{CORE / "include"}', f'-I{CORE / "src"}')


@functools.cache
def library() -> ctypes.CDLL:
    """Return the probes, compiled if the sources have changed; raises `RuntimeError`."""
    sources = [SOURCE, *sorted(CORE.rglob('*.h')), *sorted(CORE.rglob('*.hpp'))]
    compiler = os.environ.get('CXX', 'g++')
    key = hashlib.sha256(b''.join(map(Path.read_bytes, sources)) + compiler.encode()).hexdigest()
    built = ROOT / 'build' / f'probes-{key[:16]}.so'
    built.parent.mkdir(exist_ok=True)
    with (built.parent / 'probes.lock').open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # tests run in several processes
        if not built.exists():
            made = built.with_suffix('.tmp')
            done = subprocess.run([*compiler.split(), *FLAGS, str(SOURCE), '-o', str(made)],
                                  stderr=subprocess.PIPE, text=True)
            if done.returncode:
                raise RuntimeError(f'{SOURCE.name} does not compile: {done.stderr[-2000:]}')
            made.replace(built)
    return ctypes.CDLL(str(built))


def _ask(probe: str, pairs: Sequence[np.ndarray], *found: np.ndarray) -> None:
    """Let a probe fill arrays."""
    arrays = [np.require(part, np.float64, 'CA') for part in pairs]
    n = len(arrays[0])
    if [array.shape for array in arrays] != [(n, 7), (n, 7), (n, 3), (n, 3)]:
        raise ValueError('pairs must be poses (n, 7), (n, 7) and sizes (n, 3), (n, 3)')
    call = getattr(library(), probe)
    call.restype = ctypes.c_int64
    rows = (ctypes.c_void_p * 4)(*(array.ctypes.data for array in arrays))
    refused = call(ctypes.c_int64(n), rows, *(ctypes.c_void_p(array.ctypes.data)
                                              for array in found))
    if refused >= 0:
        raise ValueError(f'row {refused} is refused: its poses or sizes are not valid')


def patch_boxes(pairs: Sequence[np.ndarray],
                ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return what model `mlp` makes of n pairs that touch.

    axes (n, 3, 3), middle (n, 3), half (n, 3) of the patch box: its axes as columns, mirrored as
    the features are, common frame [m]. features (n, FEATURES) of the network.
    """
    n = len(pairs[0])
    found = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3)), np.empty((n, FEATURES))
    _ask('patch_boxes', pairs, *found)
    return found


def clipped(pairs: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points (n, 3), volumes (n,), covariances (n, 3, 3) of pairs that touch, by clipping.

    Common frame, SI units.
    """
    n = len(pairs[0])
    found = np.empty((n, 3)), np.empty(n), np.empty((n, 3, 3))
    _ask('clipped', pairs, *found)
    return found


def is_clipped(pairs: Sequence[np.ndarray]) -> np.ndarray:
    """Return which pairs (n,) model `exact` clips: planes are not certain of their overlap."""
    found = np.empty(len(pairs[0]), bool)
    _ask('is_clipped', pairs, found)
    return found
