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
    """Decorate a function that draws with Matplotlib so that it runs in the drawing thread.

    Matplotlib's settings are global, so two drawings at the same time would change each other's
    settings; and it opens every font again for each drawing thread, and keeps it open.

    Parameters
    ----------
    draw : callable
        The function; the caller waits for its result or exception.
    """

    @functools.wraps(draw)
    def there(*arguments: P.args, **named: P.kwargs) -> R:
        if getattr(_HERE, "draws", False):
            return draw(*arguments, **named)
        return _THREAD.submit(draw, *arguments, **named).result()

    return there
