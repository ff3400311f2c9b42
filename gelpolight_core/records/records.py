"""The lab's records: the store of a workspace."""

from __future__ import annotations

from pathlib import Path

from gelpolight_core.io.store import BUSY_S, Store
from gelpolight_core.records.earlier import take_measurements

NAME = "records.sqlite"


def open_records(path: Path, *, busy_s: float = BUSY_S) -> Store:
    """Open or create the records; those of earlier versions are moved over.

    Parameters
    ----------
    path : Path
        The file; its folder must exist.
    busy_s : float, optional
        Longest time to wait for another program, in seconds.

    Raises
    ------
    InputError
        See :class:`~gelpolight_core.io.store.Store`.
    """
    return Store(path, take_measurements, busy_s=busy_s)
