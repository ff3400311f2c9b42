"""Overlay marks on the image, made from the core's results."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from app.live.overlay import Circle, Line, Marker, Mask, Role
from gelpolight_core.calibration.open_sensor import TOP_POSE
from gelpolight_core.calibration.recipe import Results
from gelpolight_core.channels import channel_name
from gelpolight_core.lights.mirror import MirrorSpots, Spot
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.checkerboard import BoardView
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.optics.resampling import ResamplingTable, boundary_px, seen_at
from gelpolight_core.reflectance.indentation import Indentation
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
LED_ROLES: tuple[Role, Role, Role] = ("led0", "led1", "led2")


def board_outline(view: BoardView, role: Role) -> Line:
    """Return the line through the outermost inner corners."""
    columns, rows = view.board.inner_corners
    grid = view.corners_px.reshape(rows, columns, 2)
    return Line(
        np.concatenate([grid[0], grid[1:, -1], grid[-1, -2::-1], grid[-2:0:-1, 0]]),
        role,
        closed=True,
    )


def board_corners(view: BoardView) -> tuple[Marker, ...]:
    """Return a mark on every corner; the first has a ring, so that a rotated board is visible."""
    crosses = tuple(Marker(float(u), float(v), "plus", "good") for u, v in view.corners_px)
    u, v = view.corners_px[0]
    return (*crosses, Marker(float(u), float(v), "ring", "info", text="1"))


def foot_point(camera: Camera, plane: TopPlane) -> Marker:
    """Return the pixel of the origin of the sensor frame, in air."""
    u, v = camera.project(plane.origin_camera_mm)
    return Marker(float(u), float(v), "ring", "info", text=tr("origin"))


def mirror_positions_px(camera: Camera, plane: TopPlane, led_positions_mm: Array) -> Array:
    """Return the pixels (3, 2) at which a mirror on the top surface would show the LEDs.

    Parameters
    ----------
    camera, plane
        Lens and pose of the top surface.
    led_positions_mm : (3, 3)
        Sensor frame, from a design or an earlier calibration.
    """
    mirrored = np.asarray(led_positions_mm) * np.array([1.0, 1.0, -1.0])
    return camera.project(plane.to_camera(mirrored))


def spot_markers(spots: MirrorSpots, *, editable: bool = False) -> tuple[Marker, ...]:
    """Return the three centroids and the rejected spots; with `editable`, handles mirror.0 to 2."""
    found = tuple(
        Marker(
            *spot.centre_px,
            kind="plus",
            role=LED_ROLES[k],
            text=channel_name(k),
            handle=f"mirror.{k}" if editable else "",
        )
        for k, spot in enumerate(spots.spots)
    )
    glints = tuple(
        Marker(*spot.centre_px, kind="cross", role="bad", text=tr("glint"))
        for spot, _ in spots.rejected
    )
    return (*found, *glints)


def spot_mask(rgb: NDArray[np.generic], spot: Spot, role: Role) -> Mask:
    """Return the pixels above half of a spot's peak, which form its area."""
    reach = 2 + math.ceil(2.0 * spot.elongation * math.sqrt(spot.area_px / math.pi))
    u, v = (round(c) for c in spot.centre_px)
    box = np.s_[max(v - reach, 0) : v + reach + 1, max(u - reach, 0) : u + reach + 1]
    light = rgb[box].sum(axis=2, dtype=np.float64)
    area = np.zeros(rgb.shape[:2], np.bool_)
    area[box] = light > 0.5 * light.max()
    return Mask(area, role)


def working_circle(table: ResamplingTable) -> Line:
    """Return the border of the working area, in the raw image."""
    return Line(boundary_px(table), "info", closed=True)


def ball_contour(found: Indentation, table: ResamplingTable) -> tuple[Line, ...]:
    """Return the detected edge of the contact, and the circle fitted to it."""
    angle = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    fitted = np.asarray(found.centre) + found.contact_radius_px * ring
    return (
        Line(seen_at(table, found.contour), "expected", closed=True),
        Line(seen_at(table, fitted), "good", closed=True),
    )


def ball_handle(found: Indentation, table: ResamplingTable) -> Circle | None:
    """Return the contact as a circle that the user can move; None if it is not visible."""
    centre = np.asarray(found.centre)
    across = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    middle = seen_at(table, centre[None])
    edge = seen_at(table, centre + found.contact_radius_px * across)
    if len(middle) == 0 or len(edge) == 0:
        return None
    radius = float(np.mean(np.linalg.norm(edge - middle[0], axis=1)))
    return Circle(float(middle[0, 0]), float(middle[0, 1]), radius, "good", handle="ball")


def table_of(results: Results) -> ResamplingTable | None:
    """Return the table from image to membrane; None if the top surface is not known."""
    top = results.get(TOP_POSE)
    return None if top is None else top.table
