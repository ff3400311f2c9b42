"""Drawings of the lights: mirror spots, LED positions, light intensity, reflectance factors."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse
from numpy.typing import NDArray

from gelpolight_core.channels import channel_name
from gelpolight_core.lights.mirror import MirrorSpots, Spot
from gelpolight_core.radiance.whiteboard import RadianceResult
from gelpolight_core.report.document import Drawing
from gelpolight_core.report.drawing import (
    COLOURS,
    MARKERS,
    Array,
    Map,
    draw,
    round_to_one_digit,
    show_image,
    three_maps,
)
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.translation import tr

LEAST_CROP_PX = 6
ELLIPSE_MM = 2.0
FAINT = 0.4
"""The mirror image is dark on purpose: it is shown brighter, so that glints are visible too."""


def draw_mirror_spots(spots: MirrorSpots, image: Map) -> Drawing:
    """Show the mirror image with the spots of the three LEDs, rejected spots, and close-ups.

    Parameters
    ----------
    spots : MirrorSpots
        The detected spots.
    image : (rows, columns, 3) float32
        The mirror image.
    """
    reach = 0.035 * image.shape[1]

    def paint(figure: Figure) -> None:
        grid = figure.add_gridspec(3, 2, width_ratios=(3.4, 1.0))
        whole = figure.add_subplot(grid[:, 0])
        show_image(whole, image**FAINT)
        for k, spot in enumerate(spots.spots):
            whole.add_patch(Circle(spot.centre_px, reach, fill=False, color=COLOURS[k], lw=1.2))
            whole.annotate(
                tr("{name} LED").format(name=channel_name(k)),
                spot.centre_px,
                (spot.centre_px[0], spot.centre_px[1] - 1.25 * reach),
                color="white",
                ha="center",
            )
            _draw_spot(figure.add_subplot(grid[k, 1]), image, spot, k)
        for number, (spot, _) in enumerate(spots.rejected, start=1):
            whole.plot(*spot.centre_px, "x", color="0.75", markersize=6)
            whole.annotate(f" {number}", spot.centre_px, color="0.75", fontsize=7)

    caption = tr(
        "The mirror image with the LED spots, and a close-up of each spot with its centroid"
    )
    if spots.rejected:
        caption += "; " + tr("grey crosses are rejected glints (table below)")
    return draw(caption, 80.0, paint)


def _draw_spot(axes: Axes, image: Map, spot: Spot, channel: int) -> None:
    centre_px = spot.centre_px
    u, v = round(float(centre_px[0])), round(float(centre_px[1]))
    half = max(LEAST_CROP_PX, round(2.0 * spot.area_px**0.5))
    rows = slice(max(v - half, 0), v + half + 1)
    columns = slice(max(u - half, 0), u + half + 1)
    crop = image[rows, columns]
    left, top = columns.start - 0.5, rows.start - 0.5
    extent = (left, left + crop.shape[1], top + crop.shape[0], top)
    show_image(axes, crop, extent=extent)
    axes.axvline(float(centre_px[0]), color="white", lw=0.5, alpha=0.8)
    axes.axhline(float(centre_px[1]), color="white", lw=0.5, alpha=0.8)
    axes.set_title(
        f"{channel_name(channel)} ({centre_px[0]:.2f}, {centre_px[1]:.2f}) px",
        fontsize=6.5,
        color=COLOURS[channel],
    )


def draw_led_plan(calibration: Calibration, bright_points_mm: Array | None = None) -> Drawing:
    """Show the LEDs from above and from the side, with their uncertainty.

    Parameters
    ----------
    calibration : Calibration
        LEDs, covariance and the working area.
    bright_points_mm : (3, 2) or (3, 3), optional
        Points on the mirror that reflected each LED, if known.
    """
    covariance = calibration.led_covariance_mm2
    largest = float(np.sqrt(np.linalg.eigvalsh(covariance[:, :2, :2]).max()))
    factor = max(round_to_one_digit(ELLIPSE_MM / max(largest, 1e-6)), 1.0)

    def paint(figure: Figure) -> None:
        plan, side = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
        _draw_plan(plan, calibration, bright_points_mm, factor)
        _draw_side(side, calibration)
        plan.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=4)

    return draw(
        tr(
            "LED positions in the sensor frame (x and y as in the image). Ellipses: one "
            "standard deviation, drawn {factor:.0f} times as large; bars: one standard "
            "deviation"
        ).format(factor=factor),
        80.0,
        paint,
    )


def _draw_plan(
    axes: Axes, calibration: Calibration, bright_points_mm: Array | None, factor: float
) -> None:
    table, leds = calibration.table, calibration.led_positions_mm
    axes.contourf(
        table.grid.x_mm[::8],
        table.grid.y_mm[::8],
        table.valid[::8, ::8].astype(float),
        levels=[0.5, 1.5],
        colors=["0.88"],
    )
    axes.plot([], [], "s", color="0.85", label=tr("visible membrane"))
    axes.add_patch(
        Circle((0, 0), calibration.sensor.working_diameter_mm / 2, fill=False, color="0.6", ls="--")
    )
    for k in range(3):
        axes.plot(*leds[k, :2], MARKERS[k], color=COLOURS[k], label=channel_name(k), markersize=5)
        axes.add_patch(
            _sd_ellipse(leds[k, :2], factor**2 * calibration.led_covariance_mm2[k, :2, :2], k)
        )
        if bright_points_mm is not None:
            axes.plot(*bright_points_mm[k, :2], "x", color=COLOURS[k], markersize=4)
    axes.plot(0.0, 0.0, "+", color="0.3")
    axes.set_aspect("equal")
    axes.margins(0.12)
    axes.invert_yaxis()
    title = tr("From above")
    axes.set_title(title if bright_points_mm is None else title + tr("; x: its mirror spot"))
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")


def _draw_side(axes: Axes, calibration: Calibration) -> None:
    leds = calibration.led_positions_mm
    sd = np.sqrt(np.diagonal(calibration.led_covariance_mm2, axis1=1, axis2=2))
    for k in range(3):
        axes.errorbar(
            leds[k, 0],
            -leds[k, 2],
            yerr=sd[k, 2],
            fmt=MARKERS[k],
            color=COLOURS[k],
            capsize=3,
            markersize=5,
        )
    axes.axhline(0.0, color="0.3", linewidth=1.0)
    axes.text(0.02, 0.4, tr("top surface"), va="top", transform=axes.get_yaxis_transform())
    top = 1.15 * float(np.max(-leds[:, 2] + sd[:, 2]))
    axes.set_ylim(top, -0.06 * top)
    axes.set_aspect("equal")
    axes.margins(x=0.1)
    axes.set_title(tr("From the side"))
    axes.set_xlabel("x (mm)")
    axes.set_ylabel(tr("below the top surface (mm)"))


def _sd_ellipse(centre: Array, covariance: Array, channel: int) -> Ellipse:
    values, vectors = np.linalg.eigh(covariance)
    width, height = 2.0 * np.sqrt(np.maximum(values, 0.0))
    angle = float(np.degrees(np.arctan2(vectors[1, 0], vectors[0, 0])))
    return Ellipse(
        (float(centre[0]), float(centre[1])),
        float(width),
        float(height),
        angle=angle,
        fill=False,
        color=COLOURS[channel],
        lw=1.0,
    )


def draw_led_moves(calibration: Calibration) -> Drawing:
    """Show how the joint refinement moved the LEDs, compared with the uncertainty of the mirror.

    Parameters
    ----------
    calibration : Calibration
        With the full model.
    """
    full = calibration.full
    assert full is not None
    mirror, covariance = calibration.led_positions_mm, calibration.led_covariance_mm2
    moved = full.led_positions_mm - mirror
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    reach = 1.25 * float(max(np.abs(moved[:, :2]).max(), sd[:, :2].max(), 0.01))

    def paint(figure: Figure) -> None:
        *plans, heights = figure.subplots(1, 4)
        for k, axes in enumerate(plans):
            axes.add_patch(_sd_ellipse(np.zeros(2), covariance[k, :2, :2], k))
            axes.plot(0.0, 0.0, "+", color="0.3")
            axes.errorbar(
                *moved[k, :2],
                xerr=full.led_sd_mm[k, 0],
                yerr=full.led_sd_mm[k, 1],
                fmt=MARKERS[k],
                color=COLOURS[k],
                markersize=4,
                capsize=2,
            )
            axes.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal")
            axes.set_title(tr("{name} LED").format(name=channel_name(k)), color=COLOURS[k])
            axes.set_xlabel(tr("shift in x (mm)"))
        plans[0].set_ylabel(tr("shift in y (mm)"))
        for k in range(3):
            before, after = k - 0.15, k + 0.15
            heights.set_xlim(-0.6, 2.6)
            heights.errorbar(before, -mirror[k, 2], yerr=sd[k, 2], fmt="+", color="0.4", capsize=2)
            heights.errorbar(
                after,
                -full.led_positions_mm[k, 2],
                yerr=full.led_sd_mm[k, 2],
                fmt=MARKERS[k],
                color=COLOURS[k],
                markersize=4,
                capsize=2,
            )
        heights.set_xticks(range(3), [channel_name(k) for k in range(3)])
        heights.set_title(tr("Height"))
        heights.set_ylabel(tr("below the top surface (mm)"))

    return draw(
        tr(
            "LEDs before the joint refinement (grey crosses, with the standard deviation from "
            "the mirror) and after it (coloured)"
        ),
        52.0,
        paint,
    )


def draw_radiance(calibration: Calibration, result: RadianceResult | None = None) -> Drawing:
    """Show the light intensity of each LED and, for a run, the filled areas.

    Parameters
    ----------
    calibration : Calibration
        With |L|.
    result : RadianceResult, optional
        The stage's own result.
    """
    radiance = calibration.radiance
    caption = tr("Light intensity |L| of each LED on the membrane, in pixel values 0..1 (Eq. 5)")
    filled = None
    if result is not None and (result.saturated | result.dust).any():
        filled = result.saturated | result.dust
        caption += tr(
            "; outlined in white: saturated or dusty areas, filled from their surroundings"
        )

    def paint(figure: Figure) -> None:
        panels = three_maps(
            figure,
            radiance,
            np.asarray((radiance > 0.0).all(axis=2)),
            calibration.table.grid,
            "|L|",
        )
        for axes in panels:
            _outline(axes, filled, calibration)

    return draw(caption, 62.0, paint)


def _outline(axes: Axes, area: NDArray[np.bool_] | None, calibration: Calibration) -> None:
    if area is None:
        return
    grid = calibration.table.grid
    axes.contour(
        grid.x_mm, grid.y_mm, area.astype(np.float32), levels=[0.5], colors="white", linewidths=0.6
    )


def draw_factors(calibration: Calibration) -> Drawing:
    """Show the reflectance factors of the bare membrane.

    Parameters
    ----------
    calibration : Calibration
        With rho.
    """
    factors = calibration.factors
    return draw(
        tr(
            "Reflectance factor of the bare membrane (Eq. 9): 1 means as bright as predicted. "
            "Dark specks are dirt or holes; a slope from one side to the other indicates that a "
            "light has moved"
        ),
        62.0,
        lambda figure: _paint_factors(figure, factors, calibration),
    )


def _paint_factors(figure: Figure, factors: Map, calibration: Calibration) -> None:
    known = np.asarray((factors > 0.0).all(axis=2))
    three_maps(figure, factors, known, calibration.table.grid, tr("factor"))
