"""Drawings of the lens and the top surface: images with corners, residuals, coverage."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gelpolight_core.optics.lens import LensResult
from gelpolight_core.optics.lens_views import LensView
from gelpolight_core.optics.pose import TopPoseResult, TopPoseView
from gelpolight_core.report.document import Drawing
from gelpolight_core.report.drawing import (
    ACCENT,
    FULL_MM,
    Array,
    Map,
    draw,
    round_to_one_digit,
    show_image,
)
from gelpolight_core.report.typeface import printable
from gelpolight_core.translation import tr

VIEWS_ACROSS = 4


def draw_lens_views(result: LensResult, images: Mapping[str, Map]) -> Drawing:
    """Show every checkerboard image with its corners; those left out are marked.

    Parameters
    ----------
    result : LensResult
        The lens.
    images : mapping
        The stage's images by name.
    """
    views = result.views
    rows = math.ceil(len(views) / VIEWS_ACROSS)

    def paint(figure: Figure) -> None:
        panels = figure.subplots(rows, VIEWS_ACROSS, squeeze=False).ravel()
        for axes, view in zip(panels, views, strict=False):
            _draw_view(axes, view, images[view.name])
        for axes in panels[len(views) :]:
            axes.set_axis_off()

    height = min(rows * FULL_MM / VIEWS_ACROSS * 0.86, 230.0)
    return draw(
        tr("Checkerboard views with the detected corners; views left out have a red cross"),
        height,
        paint,
    )


def _draw_view(axes: Axes, view: LensView, image: Map) -> None:
    show_image(axes, image, width_px=320)
    if view.board is not None:
        corners = view.board.corners_px
        axes.plot(corners[:, 0], corners[:, 1], "+", color=ACCENT, markersize=2.6, mew=0.6)
    if view.used:
        axes.set_title(
            f"{printable(view.name)}\n{view.rms_px:.3f} px", fontsize=6.5, fontweight="normal"
        )
        return
    height, width = image.shape[:2]
    axes.plot([0, width], [0, height], [0, width], [height, 0], color="#c62828", linewidth=1.2)
    axes.set_title(
        tr("{name}\nleft out").format(name=printable(view.name)), fontsize=6.5, color="#c62828"
    )


def draw_lens_residuals(result: LensResult) -> Drawing:
    """Show where corners were found, how many per part, and their residuals."""
    camera = result.camera
    used = [v for v in result.views if v.used and v.board is not None]
    corners = np.concatenate([v.board.corners_px for v in used if v.board is not None])
    off = np.concatenate([v.residuals_px for v in used if v.residuals_px is not None])

    def paint(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=(1.75, 1.0))
        image = left.imshow(
            result.coverage_map,
            extent=(0, camera.width, camera.height, 0),
            cmap="Blues",
            alpha=0.55,
            vmin=0,
            aspect="equal",
        )
        factor = _draw_arrows(left, corners, off, 0.03 * camera.width)
        left.set_title(
            tr("Residuals, {factor:.0f} times enlarged, over corners per part").format(
                factor=factor
            )
        )
        left.set_xlabel("u (px)")
        left.set_ylabel("v (px)")
        figure.colorbar(image, ax=left, label=tr("corners"), shrink=0.8)
        reach = 1.1 * float(np.percentile(np.abs(off), 99.5))
        right.plot(off[:, 0], off[:, 1], ".", color="0.25", markersize=1.5, alpha=0.6)
        right.axhline(0.0, color="0.7", linewidth=0.6)
        right.axvline(0.0, color="0.7", linewidth=0.6)
        right.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        right.set_title(tr("All residuals"))
        right.set_xlabel(tr("horizontal (px)"))
        right.set_ylabel(tr("vertical (px)"))

    return draw(
        tr(
            "Residuals of the fit. Arrows with a common direction in one part of the image, or a "
            "ring in the right plot, would mean that the lens model does not fit; white parts "
            "contain no corners"
        ),
        74.0,
        paint,
    )


def _draw_arrows(axes: Axes, at: Array, off: Array, length_px: float) -> float:
    """Draw residuals so that a typical one has the given length; return the magnification."""
    typical = max(float(np.percentile(np.hypot(off[:, 0], off[:, 1]), 90.0)), 1e-9)
    factor = round_to_one_digit(length_px / typical)
    axes.quiver(
        at[:, 0],
        at[:, 1],
        factor * off[:, 0],
        factor * off[:, 1],
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.0016,
        color="0.15",
    )
    return factor


def draw_top_pose(result: TopPoseResult, images: Mapping[str, Map]) -> tuple[Drawing, ...]:
    """Show each used image of the board on the top surface, with corners and residuals.

    Parameters
    ----------
    result : TopPoseResult
        The top surface.
    images : mapping
        The stage's images by name.
    """
    return tuple(
        _draw_pose(view, images[view.name], result)
        for view in result.views
        if view.used and view.board is not None and view.pose is not None
    )


def _draw_pose(view: TopPoseView, image: Map, result: TopPoseResult) -> Drawing:
    assert view.board is not None and view.pose is not None
    corners, off = view.board.corners_px, view.pose.residuals_px

    def paint(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
        show_image(left, image)
        left.plot(corners[:, 0], corners[:, 1], "+", color=ACCENT, markersize=4.0, mew=0.8)
        left.set_title(printable(view.name))
        factor = _draw_arrows(right, corners, off, 0.4 * view.board.square_px)  # type: ignore[union-attr]
        right.plot(corners[:, 0], corners[:, 1], ".", color=ACCENT, markersize=2.0)
        right.set_aspect("equal")
        right.invert_yaxis()
        right.set_title(
            tr("Residuals, {factor:.0f} times enlarged; RMS {rms:.3f} px").format(
                factor=factor,
                rms=view.pose.rms_px,  # type: ignore[union-attr]
            )
        )
        right.set_xlabel("u (px)")
        right.set_ylabel("v (px)")

    return draw(
        tr(
            "The board on the top surface, {distance:.3f} mm from the camera, tilted by "
            "{tilt:.2f} degrees"
        ).format(distance=result.plane.distance_mm, tilt=result.tilt_deg),
        66.0,
        paint,
    )
