"""How long a recording can go on: its size limit and the room on the disk."""

from __future__ import annotations

import math
import shutil
from dataclasses import dataclass
from pathlib import Path

from app.sources.recorder import RecorderFigures

# Left free for the system and for the results of measurements.
RESERVE_BYTES = 1_000_000_000
# A rate from a shorter time is not known well enough.
LEAST_S = 1.0
SOON_S = 60.0


@dataclass(frozen=True, slots=True)
class Room:
    """Space that a recording can still use.

    Attributes
    ----------
    left_bytes : float
        Bytes up to the size limit or to the reserve on the disk, whichever comes first.
    left_s : float
        The same as time at the present rate. Infinite while the rate is not known.
    by_limit : bool
        Whether the size limit comes first.
    """

    left_bytes: float
    left_s: float
    by_limit: bool

    @property
    def full(self) -> bool:
        """Whether the recording must stop now."""
        return self.left_bytes <= 0.0

    @property
    def soon_full(self) -> bool:
        """Whether it must stop within a minute."""
        return self.left_s < SOON_S


def room_for(figures: RecorderFigures, *, free_bytes: float, limit_bytes: float) -> Room:
    """Return the space that a recording can still use.

    Parameters
    ----------
    figures : RecorderFigures
        Of the recording.
    free_bytes : float
        Free space on its disk.
    limit_bytes : float
        Largest size of a recording.
    """
    by_limit = limit_bytes - figures.size_bytes
    by_disk = free_bytes - RESERVE_BYTES
    left = min(by_limit, by_disk)
    known = figures.seconds >= LEAST_S and figures.size_bytes > 0
    rate = figures.size_bytes / figures.seconds if known else 0.0
    left_s = max(left, 0.0) / rate if rate > 0.0 else math.inf
    return Room(left, left_s, by_limit <= by_disk)


def free_bytes(path: Path) -> float:
    """Return the free space on the disk of a file. Infinite if the system does not say."""
    try:
        return float(shutil.disk_usage(path.parent).free)
    except OSError:
        return math.inf
