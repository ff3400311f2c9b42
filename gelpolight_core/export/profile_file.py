"""Write a profile as a table for spreadsheets."""

from __future__ import annotations

import math
from pathlib import Path

from gelpolight_core.io.atomic import write_text
from gelpolight_core.io.table import csv_text
from gelpolight_core.measurement.profile import Profile

COLUMNS = ("along_mm", "x_mm", "y_mm", "depth_mm", "depth_sd_mm", "flags")


def write_profile(profile: Profile, path: Path) -> None:
    """Write a profile as CSV (UTF-8, decimal points), completely or not at all.

    One row per point: distance from the start, position, depth, its standard deviation and the
    flags. A cell is empty if the depth or its deviation is unknown.

    Parameters
    ----------
    profile : Profile
        The profile.
    path : Path
        The file.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    rows, sd = [], profile.depth_sd_mm
    for k, (x, y) in enumerate(profile.points_mm.tolist()):
        spread = math.nan if sd is None else float(sd[k])
        lengths = (float(profile.along_mm[k]), x, y, float(profile.depth_mm[k]), spread)
        cells = [f"{v:.6f}" if math.isfinite(v) else "" for v in lengths]
        rows.append([*cells, int(profile.flags[k])])
    write_text(path, csv_text(COLUMNS, rows))
