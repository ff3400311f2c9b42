"""The decorator for compiled loops of the simulation, and the way to stop long work."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

Interrupt = Callable[[], None]
"""Called regularly during long work; an exception raised by it stops the work."""


def compiled(function: Function) -> Function:
    """Compile a loop once, cache it on disk, and release the GIL while it runs.

    Never use ``parallel=True``: numba's workqueue layer aborts when two threads enter it.
    """
    return cast(Function, numba.njit(function, cache=True, nogil=True, error_model="numpy"))


def never() -> None:
    """Never interrupt the work."""
