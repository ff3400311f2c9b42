"""Compilation of loops, cached for the next start.

numba keeps it in the first folder that can be written: that of the environment variable
NUMBA_CACHE_DIR, beside the source, in the home folder. Where there is none, or the disk is full,
loops are compiled in memory, in each process again.
"""

from __future__ import annotations

import logging
import multiprocessing
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any

import numba
from numba.core.caching import FunctionCache

_LOG = logging.getLogger(__name__)
Decorator = Callable[[Callable[..., Any]], Any]


def whole(**how: Any) -> Decorator:
    """Return the decorator for a loop that Python calls and that releases the GIL.

    Never use ``parallel=True``: numba's workqueue layer aborts when two threads enter it.

    Parameters
    ----------
    how
        Options of ``numba.njit``: how freely it computes.
    """

    def compiled(function: Callable[..., Any]) -> Any:
        dispatcher = numba.njit(nogil=True, **how)(function)
        try:
            dispatcher._cache = _Kept(function)  # type: ignore[no-untyped-call]
        except RuntimeError:  # no folder can be written
            say_that_nothing_is_kept()
        return dispatcher

    return compiled


def part(**how: Any) -> Decorator:
    """Return the decorator for a part of such loops: inlined there, never called by Python.

    Without wrappers for Python and C, compiling takes a fifth less.
    """
    return whole(forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, **how)


class _Kept(FunctionCache):
    """Cache of a compiled function, for as long as its folder can be used."""

    def load_overload(self, *what: Any) -> Any:
        try:
            return super().load_overload(*what)  # type: ignore[no-untyped-call]
        except OSError:
            say_that_nothing_is_kept()
            return None
        except (ImportError, AttributeError):  # a type that the loop takes has another name now
            with suppress(OSError):  # a full disk is noticed when the new code is written
                self.flush()  # type: ignore[no-untyped-call]
            return None

    def save_overload(self, *what: Any) -> None:
        try:
            super().save_overload(*what)  # type: ignore[no-untyped-call]
        except OSError:  # a full disk, a home over quota
            say_that_nothing_is_kept()


@cache
def say_that_nothing_is_kept() -> None:
    """Log one line, except in worker processes."""
    if multiprocessing.parent_process() is None:
        _LOG.warning(
            "Compiled code cannot be kept, so that each start takes longer. Set NUMBA_CACHE_DIR"
            " to a folder that can be written"
        )
