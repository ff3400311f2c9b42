"""A wish to stop: asked of whoever leads, and told to workers on other machines by a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gelpolight_core.export.atomic import cannot_write

FILE = ".stop"
"""In the run's folder; while it is there, workers begin no frame."""

Stopped = Callable[[], bool]
"""Returns whether no new frame shall be begun."""


def never() -> bool:
    """Let a run come to its end."""
    return False


def tell_workers(out: Path) -> None:
    """Let no worker that sees a run's folder begin another frame.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    try:
        (out / FILE).touch()
    except OSError as error:
        raise cannot_write(error, out / FILE) from error


def workers_may_go_on(out: Path) -> None:
    """Take back what :func:`tell_workers` told, be it of an earlier run.

    Raises
    ------
    InputError
        If the file cannot be removed.
    """
    try:
        (out / FILE).unlink(missing_ok=True)
    except OSError as error:
        raise cannot_write(error, out / FILE) from error


def shall_stop(out: Path) -> bool:
    """Return whether a worker shall begin no other frame."""
    return (out / FILE).exists()
