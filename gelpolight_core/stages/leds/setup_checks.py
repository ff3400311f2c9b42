"""The stated set-up of a sensor, judged by itself and against the measured top surface."""

from __future__ import annotations

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.finding import Finding, Verdict, judge
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.session.session import SensorData

LEAST_INDEX, MOST_INDEX = 1.33, 1.66
"""Refractive indices of water, below all gels, and of the densest clear polymers."""


def judge_set_up(sensor: SensorData, ball_radius_mm: float | None = None) -> tuple[Finding, ...]:
    """Judge the stated numbers of a sensor by themselves.

    Parameters
    ----------
    sensor : SensorData
        As stated in the session.
    ball_radius_mm : float, optional
        Usual radius of the balls.

    Returns
    -------
    tuple of Finding
        Those that are not usual; empty where there is nothing to say.
    """
    index = sensor.elastomer_refractive_index
    too_low = index < LEAST_INDEX
    outside_mm = sensor.led_height_mm - sensor.elastomer_thickness_mm
    ball_mm = 2.0 * (ball_radius_mm or 0.0)
    return _poor(
        judge(
            "stated_index",
            "Refractive index of the elastomer, as stated",
            index,
            warn=LEAST_INDEX if too_low else MOST_INDEX,
            remedy="Check the refractive index of the elastomer; silicones have about 1.41",
            higher_is_better=too_low,
        ),
        judge(
            "led_outside_elastomer",
            "Height of the lowest LED below the elastomer",
            outside_mm,
            "mm",
            warn=0.0,
            remedy="Check the LED height and the thickness of the elastomer",
        ),
        judge(
            "ball_over_field",
            "Usual ball diameter over the working diameter",
            ball_mm / sensor.working_diameter_mm,
            warn=1.0,
            remedy="Check the ball diameter: a ball larger than the working area shows hardly any"
            " slope in it",
        ),
    )


def judge_set_up_by_pose(
    sensor: SensorData, camera: CameraModel, plane: TopPlane, led_positions_mm: Float64Array
) -> tuple[Finding, ...]:
    """Judge the stated numbers of a sensor against its measured top surface and lights.

    The LEDs light the membrane from outside the camera's view: one whose mirror spot and stated
    height place it between the camera and the field would be visible in every image.

    Parameters
    ----------
    sensor : SensorData
        As stated in the session.
    camera, plane
        Lens and top surface.
    led_positions_mm : (3, 3)
        LED positions, sensor frame.

    Returns
    -------
    tuple of Finding
        As :func:`judge_set_up`.
    """
    field_mm = sensor.working_diameter_mm
    nearer = 1.0 + led_positions_mm[:, 2] / plane.distance_mm
    distance_mm = np.hypot(led_positions_mm[:, 0], led_positions_mm[:, 1])
    visible_mm = plane.distance_mm * max(camera.width / camera.fx, camera.height / camera.fy)
    return _poor(
        judge(
            "led_in_view",
            "Distance of the nearest LED from the axis, over the camera's view at its height",
            float((distance_mm / (0.5 * field_mm * nearer)).min()),
            warn=1.0,
            remedy="Check the LED height: an LED at the stated height is in the camera's view",
            higher_is_better=True,
        ),
        judge(
            "field_over_view",
            "Working diameter over the visible part of the top surface",
            field_mm / visible_mm,
            warn=1.0,
            remedy="Check the working diameter: it is larger than what the camera sees",
        ),
    )


def _poor(*findings: Finding) -> tuple[Finding, ...]:
    return tuple(finding for finding in findings if finding.verdict is not Verdict.PASS)
