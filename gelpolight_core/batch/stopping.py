"""Requests to stop: polled by the main process, and passed to remote workers by a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gelpolight_core.io.atomic import cannot_write

FILE = ".stop"
"""In the run's folder; while this file exists, workers begin no frame."""

Stopped = Callable[[], bool]
"""Returns whether no new frame may be begun."""


def never() -> bool:
    """Never stop the run."""
    return False


def tell_workers(out: Path) -> None:
    """Prevent all workers that see a run's folder from beginning another frame.

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
    """Cancel the request of :func:`tell_workers`, also one from an earlier run.

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
    """Return whether a worker must not begin another frame."""
    return (out / FILE).exists()
