"""The workspace: a folder with one folder per sensor, holding its calibrations and sessions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Workspace:
    """The folder in which everything is kept."""

    folder: Path
