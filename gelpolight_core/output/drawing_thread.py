"""Matplotlib, which the extra ``report`` installs, and the one thread in which it draws."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, TypeVar

from gelpolight_core.base.errors import not_installed

try:
    from matplotlib import get_data_path, rc_context
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.colors import ListedColormap, LogNorm
    from matplotlib.figure import Figure
    from matplotlib.font_manager import get_font
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle, Ellipse, Rectangle
except ModuleNotFoundError as error:
    raise not_installed("Matplotlib", "Reports and figures", "report") from error

__all__ = [
    "Axes",
    "Circle",
    "Ellipse",
    "Figure",
    "FigureCanvasAgg",
    "FigureCanvasSVG",
    "Line2D",
    "ListedColormap",
    "LogNorm",
    "Rectangle",
    "get_data_path",
    "get_font",
    "in_drawing_thread",
    "rc_context",
]

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
