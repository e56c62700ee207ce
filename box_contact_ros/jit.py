"""Compilation of the numeric kernels: one decorator, so that every kernel is built alike.

Kernels are Numba functions compiled at first use and cached on disk. Numba takes a cached kernel
for good as long as its own file is unchanged, even if a kernel that it calls has changed; here an
edit at the top of the package compiles all of them anew, one in a folder below it those of that
folder, so an upgrade in place cannot mix versions.
Where no cache folder can be written (a read-only installation) kernels are compiled without one,
and a single warning says so. With NUMBA_DISABLE_JIT=1 they are plain Python, a thousand times as
slow, for a debugger or a coverage tool.
"""
from __future__ import annotations

import functools
import logging
import math
import warnings
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
from numba.core import event

_warned = False


@functools.cache
def _stamp(folder: Path) -> tuple[tuple[str, int, int], ...]:
    """What kernels of a folder are made from: its modules, and those at the top of the package."""
    return tuple(sorted((str(path), path.stat().st_mtime_ns, path.stat().st_size)
                        for place in {folder, Path(__file__).parent}
                        for path in place.glob('*.py')))


class _Notice(event.Listener):
    """Says once a process that it compiles, which takes long enough to be taken for hanging."""

    said = False

    def on_start(self, event: Any) -> None:
        function = getattr(event.data.get('dispatcher'), 'py_func', None)
        module = getattr(function, '__module__', None) or ''  # others may have none
        if not self.said and module.partition('.')[0] == __package__:
            self.said = True
            logging.getLogger(__package__).warning(
                'compiling the kernels: up to a minute%s',
                '' if _warned else '; later starts load them')

    def on_end(self, event: Any) -> None:
        pass


event.register('numba:compile', _Notice())  # type: ignore[no-untyped-call]


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` with Numba, cached where possible.

    Divisions follow IEEE 754 (no ZeroDivisionError), which lets loops be vectorised; fast-math
    stays off, so that a row gives the same bits alone and within a batch.
    """
    return _compiled(function)


def inlined(function: Callable[..., Any]) -> Any:
    """Like `kernel`, for the small parts of a block kernel: without a call its loop vectorises."""
    return _compiled(function, forceinline=True)


def fused_kernel(function: Callable[..., Any]) -> Any:
    """Like `kernel`, for the float32 networks only.

    In it a·b + c is rounded once, and a / b is a times a refined estimate of 1 / b, right to a few
    units of 2⁻²⁴.
    """
    return _compiled(function, fastmath={'contract', 'arcp'})


def fused_inlined(function: Callable[..., Any]) -> Any:
    """`fused_kernel` and `inlined` in one."""
    return _compiled(function, fastmath={'contract', 'arcp'}, forceinline=True)


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    global _warned
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]  # put there at run time
        return _interpreted(function)
    try:
        compiled = numba.njit(cache=True, error_model='numpy', **options)(function)
        compiled._cache._cache_file._source_stamp = _stamp(
            Path(function.__code__.co_filename).parent)
        return compiled
    except RuntimeError as error:  # numba: 'cannot cache function ...: no locator available'
        if 'cannot cache' not in str(error):
            raise
        if not _warned:
            _warned = True
            warnings.warn(
                'no folder for compiled kernels can be written, so they are compiled anew in '
                'every process; set NUMBA_CACHE_DIR to a writable folder', RuntimeWarning,
                stacklevel=4)
        return numba.njit(error_model='numpy', **options)(function)


def _interpreted(function: Any) -> Any:
    """The function itself, with what else is used of a compiled one."""
    # math.sqrt gives a Python float, and that one's division by zero raises.
    function.__globals__['math'] = _IEEE_MATH
    function.py_func = function
    function.disable_compile = lambda: None
    return function


_IEEE_MATH = SimpleNamespace(**{**vars(math), 'sqrt': np.sqrt})
