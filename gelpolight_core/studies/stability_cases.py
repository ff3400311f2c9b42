"""The table of all stability cases."""

from __future__ import annotations

from gelpolight_core.studies.extreme_calibrations import calibration_cases
from gelpolight_core.studies.extreme_grids import grid_cases
from gelpolight_core.studies.extreme_images import image_cases
from gelpolight_core.studies.extreme_sensors import sensor_cases
from gelpolight_core.studies.stability import Case


def all_cases() -> tuple[Case, ...]:
    """Return the cases of all subjects, in the order of the table."""
    return (
        *image_cases(),
        *sensor_cases(),
        *calibration_cases(),
        *grid_cases(),
    )
