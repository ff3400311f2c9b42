"""One decorator for the compiled loops of the simulation, and how long work is stopped."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

Interrupt = Callable[[], None]
"""Called now and then during long work; what it raises stops the work."""


def compiled(function: Function) -> Function:
    """Compile a loop once, keep it on disk, and let other threads run beside it.

    Never ``parallel=True``: numba's workqueue layer aborts when two threads enter it.
    """
    return cast(Function, numba.njit(function, cache=True, nogil=True, error_model="numpy"))


def never() -> None:
    """Let the work run to its end."""
