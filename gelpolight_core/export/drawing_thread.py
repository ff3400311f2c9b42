"""All drawings are made in one thread."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

THREAD_NAME = "drawings"
_HERE = threading.local()


def _enter() -> None:
    _HERE.draws = True


_THREAD = ThreadPoolExecutor(1, THREAD_NAME, initializer=_enter)


def in_drawing_thread(draw: Callable[P, R]) -> Callable[P, R]:
    """Let a function that draws with Matplotlib run in the thread of all drawings.

    Matplotlib's settings belong to the whole program, so two drawings at a time would change each
    other's; and it opens every typeface anew for each thread that ever drew, and keeps it open.

    Parameters
    ----------
    draw : callable
        The function; its results and errors come to the caller, who waits for them.
    """

    @functools.wraps(draw)
    def there(*arguments: P.args, **named: P.kwargs) -> R:
        if getattr(_HERE, "draws", False):
            return draw(*arguments, **named)
        return _THREAD.submit(draw, *arguments, **named).result()

    return there
