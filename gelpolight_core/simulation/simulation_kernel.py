"""The decorator for compiled loops of the simulation, and the interrupt of long work."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from gelpolight_core.base.compiling import whole

Function = TypeVar("Function", bound=Callable[..., Any])

Interrupt = Callable[[], None]
"""Called regularly during long work; an exception raised by it stops the work."""


def compiled(function: Function) -> Function:
    """Compile a loop once, without the GIL while it runs."""
    return cast(Function, whole(error_model="numpy")(function))


def never_interrupt() -> None:
    """Never interrupt the work."""
