"""All stability cases, in the order of the report."""

from __future__ import annotations

from gelpolight_core.experiments.reproducibility import number_cases
from gelpolight_core.experiments.stability import Case
from gelpolight_core.experiments.stability_calibrations import calibration_cases
from gelpolight_core.experiments.stability_grids import grid_cases
from gelpolight_core.experiments.stability_images import image_cases
from gelpolight_core.experiments.stability_sensors import sensor_cases
from gelpolight_core.experiments.stability_sessions import session_cases


def all_cases() -> tuple[Case, ...]:
    """Return the cases of all subjects."""
    return (
        *image_cases(),
        *sensor_cases(),
        *calibration_cases(),
        *session_cases(),
        *grid_cases(),
        *number_cases(),
    )
