"""LED positions from their mirror spots, and light directions on the membrane (section V-A)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, QualityTable, judge
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.light.directions import direction_condition

from .mirror_spots import MirrorSpots

LED_HEIGHT_SD_MM = 0.2
"""Standard deviation of the stated height of the LEDs."""
CONDITION_LIMIT = 50.0
"""Condition number of the light directions at the sensor's centre: above it, 1 % of noise changes a
normal by half."""


@dataclass(frozen=True, slots=True)
class LedPositionsResult:
    """Positions of the three LEDs (light-emitting points).

    Attributes
    ----------
    led_positions_mm : (3, 3)
        Sensor frame; row k is LED k; z = -led_height_mm.
    led_covariance_mm2 : (3, 3, 3)
        Covariance of each position, propagated.
    bright_points_mm : (3, 2)
        Points on the mirror where each LED is reflected, sensor frame.
    spots : MirrorSpots
        Spots found in the mirror image.
    quality : QualityTable
        Figures, limits and advice.
    """

    led_positions_mm: Float64Array
    led_covariance_mm2: Float64Array
    bright_points_mm: Float64Array
    spots: MirrorSpots
    quality: QualityTable


def locate_led(
    spot_px: Float64Array, camera: CameraModel, plane: TopPlane, *, led_height_mm: float
) -> tuple[Float64Array, Float64Array]:
    """Return an LED's position and bright point, both (3,) in the sensor frame.

    The mirror lies on the top surface, in air: the camera ray is reflected at the bright point; the
    LED is where the reflected ray reaches `led_height_mm` below the surface.

    Parameters
    ----------
    spot_px : (2,)
        Centroid (u, v) of its mirror spot.
    camera, plane
        Lens and top surface.
    led_height_mm : float
        Z1: distance from the light-emitting point to the top surface.
    """
    ray = plane.rotation @ camera.directions(np.asarray(spot_px))
    bright = ray * (plane.distance_mm / ray[2]) - np.array([0.0, 0.0, plane.distance_mm])
    mirrored = ray * np.array([1.0, 1.0, -1.0])
    led = bright + mirrored * (led_height_mm / ray[2])
    return led, bright


def locate_leds(
    spots: MirrorSpots,
    camera: CameraModel,
    plane: TopPlane,
    *,
    led_height_mm: float,
    plane_distance_sd_mm: float = 0.02,
    plane_normal_sd_rad: float = 1e-3,
) -> LedPositionsResult:
    """Locate the three LEDs from their mirror spots.

    Parameters
    ----------
    spots : MirrorSpots
        Centroids, one per LED.
    camera, plane
        Lens and top surface.
    led_height_mm : float
        Z1: distance from the light-emitting points to the top surface, from the housing.
    plane_distance_sd_mm, plane_normal_sd_rad : float, optional
        Standard deviations that are propagated into the positions, in addition to those of the
        centroids and of `led_height_mm`.

    Raises
    ------
    InputError
        If the light directions are too similar to solve for normals.
    """
    leds, brights, covariances = [], [], []
    for spot in spots.spots:
        led, bright = locate_led(
            np.array(spot.centre_px), camera, plane, led_height_mm=led_height_mm
        )
        sds = np.array(
            [max(spot.centre_sd_px, 0.02)] * 2
            + [LED_HEIGHT_SD_MM, plane_distance_sd_mm, plane_normal_sd_rad, plane_normal_sd_rad]
        )
        jacobian = _jacobian(_disturbed(spot.centre_px, camera, plane, led_height_mm), 6)
        leds.append(led)
        brights.append(bright[:2])
        covariances.append((jacobian * sds**2) @ jacobian.T)
    positions = np.array(leds)
    condition = direction_condition(positions, np.zeros(2))
    if not condition <= CONDITION_LIMIT:
        text = (
            f"The three light directions lie nearly in one plane (condition number {condition:.0f})"
        )
        raise InputError(text, "mirror", Remedy.WIDER_LEDS)
    covariance = np.array(covariances)
    quality = QualityTable(_judge(covariance, condition, positions, spots))
    return LedPositionsResult(positions, covariance, np.array(brights), spots, quality)


def _disturbed(
    spot_px: tuple[float, float], camera: CameraModel, plane: TopPlane, height_mm: float
) -> Callable[[Float64Array], Float64Array]:
    """Return the LED position as a function of small disturbances of all its inputs."""

    def led(delta: Float64Array) -> Float64Array:
        normal = plane.rotation.T @ np.array([delta[4], delta[5], 1.0])
        normal /= np.linalg.norm(normal)
        tilted = TopPlane(
            (float(normal[0]), float(normal[1]), float(normal[2])),
            plane.distance_mm + float(delta[3]),
        )
        position, _ = locate_led(
            np.array(spot_px) + delta[:2], camera, tilted, led_height_mm=height_mm + delta[2]
        )
        # Expressed in the undisturbed frame, so that a tilt counts by the shift it causes.
        return plane.to_sensor(tilted.to_camera(position))

    return led


def _jacobian(
    function: Callable[[Float64Array], Float64Array], count: int, step: float = 1e-5
) -> Float64Array:
    columns = []
    for i in range(count):
        delta = np.zeros(count)
        delta[i] = step
        columns.append((function(delta) - function(-delta)) / (2 * step))
    return np.stack(columns, axis=1)


def _judge(
    covariances: Float64Array, condition: float, positions: Float64Array, spots: MirrorSpots
) -> tuple[Finding, ...]:
    lateral = float(np.sqrt(np.trace(covariances[:, :2, :2], axis1=1, axis2=2)).max())
    total = float(np.sqrt(np.trace(covariances, axis1=1, axis2=2)).max())
    radii = np.hypot(positions[:, 0], positions[:, 1])
    return (
        *spots.quality.figures,
        judge(
            "led_lateral_sd_mm",
            "LED position, lateral, standard deviation",
            lateral,
            "mm",
            warn=0.3,
            fail=1.0,
            remedy="Repeat the top pose and the mirror image",
        ),
        judge(
            "led_sd_mm",
            "LED position, standard deviation",
            total,
            "mm",
            warn=0.5,
            fail=1.5,
            remedy="Measure the height of the LEDs below the top surface again",
        ),
        judge(
            "direction_condition",
            "Condition number of the light directions at the centre",
            condition,
            warn=8.0,
            fail=20.0,
            remedy=Remedy.WIDER_LEDS,
        ),
        judge(
            "led_radius_ratio",
            "Ratio of largest to smallest LED distance from the axis",
            float(radii.max() / max(radii.min(), 1e-9)),
            warn=2.0,
            remedy="Check that each spot belongs to its LED",
        ),
    )
