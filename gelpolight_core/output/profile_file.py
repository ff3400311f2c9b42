"""Write a profile as a table for spreadsheets."""

from __future__ import annotations

import math
from typing import BinaryIO

from gelpolight_core.base.csv_table import csv_text
from gelpolight_core.measurement.profile import Profile

COLUMNS = ("along_mm", "x_mm", "y_mm", "depth_mm", "depth_sd_mm", "flags")


def write_profile_csv(profile: Profile, file: BinaryIO) -> None:
    """Write a profile as CSV (UTF-8, decimal points).

    One row per point: distance from the start, position, depth, its standard deviation and the
    flags. A cell is empty if the depth or its deviation is unknown.
    """
    rows, depth_sd_mm = [], profile.depth_sd_mm
    for k, (x, y) in enumerate(profile.points_mm.tolist()):
        sd_mm = math.nan if depth_sd_mm is None else float(depth_sd_mm[k])
        lengths_mm = (float(profile.along_mm[k]), x, y, float(profile.depth_mm[k]), sd_mm)
        cells = [f"{v:.6f}" if math.isfinite(v) else "" for v in lengths_mm]
        rows.append([*cells, int(profile.flags[k])])
    file.write(csv_text(COLUMNS, rows).encode())
