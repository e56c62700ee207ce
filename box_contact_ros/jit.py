"""Compilation of the numeric kernels: one decorator, so that every kernel is built alike.

Kernels are Numba functions compiled at first use and cached on disk. Where no cache folder can be
written (a read-only installation) they are compiled without one, and a single warning says so.
"""
from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numba

_warned = False


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` with Numba, cached where possible.

    Divisions follow IEEE 754 (no ZeroDivisionError), which lets loops be vectorised; fast-math
    stays off, so that a row gives the same bits alone and within a batch.
    """
    global _warned
    try:
        return numba.njit(cache=True, error_model='numpy')(function)
    except RuntimeError as error:  # numba: 'cannot cache function ...: no locator available'
        if 'cannot cache' not in str(error):
            raise
        if not _warned:
            _warned = True
            warnings.warn(
                'no folder for compiled kernels can be written, so they are compiled anew in '
                'every process; set NUMBA_CACHE_DIR to a writable folder', RuntimeWarning,
                stacklevel=3)
        return numba.njit(error_model='numpy')(function)
