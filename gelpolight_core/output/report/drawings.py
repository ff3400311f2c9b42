"""The drawings of a calibration's report, in the order of its stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import PurePath

import numpy as np
from numpy.typing import ArrayLike

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.reflectance_scatter import ReflectanceScatter
from gelpolight_core.geometry.resampling import MembraneGrid, ResamplingTable
from gelpolight_core.light.reflectance_table import ReflectanceTable
from gelpolight_core.output.drawing_thread import Axes, Circle, Figure, ListedColormap, LogNorm
from gelpolight_core.sensor.closed_sensor.closed_sensor_data import ClosedSensor
from gelpolight_core.sensor.sensor_calibration import OpenSensor
from gelpolight_core.stages.balls.ball_press import BallPress
from gelpolight_core.stages.checkerboards.lens import LensResult
from gelpolight_core.stages.checkerboards.lens_views import LensView
from gelpolight_core.stages.checkerboards.top_surface_pose import TopPoseResult, TopPoseView
from gelpolight_core.stages.flat_field.whiteboard_stage import LightIntensityResult
from gelpolight_core.stages.leds.mirror_spots import MirrorSpot, MirrorSpots

from .document import ReportDrawing
from .drawing_tools import (
    ACCENT,
    COLOURS,
    ColourTable,
    draw_three_maps,
    drawing,
    grid_extent,
    image_axes,
    printable,
    round_to_one_digit,
    show_image,
)
from .result_pictures import (
    DIVERGING,
    LED_ROLES,
    Bars,
    Field,
    Label,
    Level,
    Line,
    Mark,
    ResultPicture,
)

ROLE_COLOURS = dict(zip(LED_ROLES, COLOURS, strict=True))
ROLE_COLOURS |= {"accent": "#1f4fbf", "warn": "#c77800", "muted": "0.6"}
BEHIND = {"fc": "white", "ec": "none", "pad": 0.5}
"""A text lies on no line."""
VERDICT_COLOURS = {Verdict.PASS: "0.1", Verdict.WARN: "#8a5200", Verdict.FAIL: "#b3211d"}


@drawing(240.0)
def lens_views(figure: Figure, result: LensResult, images: Mapping[str, Float32Array]) -> str:
    """Show every checkerboard image with its corners. Mark the excluded ones.

    Parameters
    ----------
    figure : Figure
        Empty.
    result : LensResult
        The lens.
    images : mapping
        The stage's images by name.
    """
    for axes, view in zip(image_axes(figure, len(result.views), 0.95), result.views, strict=True):
        _paint_view(axes, view, images[view.name])
    return "Checkerboard views with the detected corners; views left out have a red cross"


def _paint_view(axes: Axes, view: LensView, image: Float32Array) -> None:
    show_image(axes, image, width_px=360)
    if view.board is not None:
        u, v = view.board.corners_px.T
        axes.plot(u, v, "+", color=ACCENT, markersize=2.6, mew=0.6)
    name = printable(view.name)
    if view.used:
        axes.set_title(f"{name}\n{view.rms_px:.3f} px", fontsize=6.5)
    else:
        height, width = image.shape[:2]
        axes.plot([0, width], [0, height], [0, width], [height, 0], color=COLOURS[0], lw=1.2)
        axes.set_title(f"{name}\nleft out", fontsize=6.5, color=COLOURS[0])


@drawing(68.0)
def lens_residuals(figure: Figure, result: LensResult) -> str:
    """Show where corners were found, how many per part, and their residuals."""
    camera = result.camera
    used = [v for v in result.views if v.used and v.board is not None]
    corners = np.concatenate([v.board.corners_px for v in used if v.board is not None])
    residuals = np.concatenate([v.residuals_px for v in used if v.residuals_px is not None])
    field_axes, cloud_axes = figure.subplots(1, 2, width_ratios=(1.75, 1.0))
    extent = (0, camera.width, camera.height, 0)
    image = field_axes.imshow(result.coverage_map, extent=extent, cmap="Blues", alpha=0.55, vmin=0)
    factor = _paint_arrows(field_axes, corners, residuals, 0.03 * camera.width)
    title = f"Residuals, {factor:.0f} times enlarged, over corners per part"
    field_axes.set(title=title, xlabel="u (px)", ylabel="v (px)")
    figure.colorbar(image, ax=field_axes, label="corners", shrink=0.8)
    reach = 1.1 * float(np.percentile(np.abs(residuals), 99.5))
    cloud_axes.plot(*residuals.T, ".", color="0.25", markersize=1.5, alpha=0.6)
    cloud_axes.axhline(0.0, color="0.7", linewidth=0.6)
    cloud_axes.axvline(0.0, color="0.7", linewidth=0.6)
    cloud_axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    cloud_axes.set(title="All residuals", xlabel="horizontal (px)", ylabel="vertical (px)")
    return (
        "Residuals of the fit. Arrows with a common direction in one part of the image, or a ring "
        "in the right plot, would mean that the lens model does not fit; white parts: no corners"
    )


def _paint_arrows(axes: Axes, at: Float64Array, residuals: Float64Array, length_px: float) -> float:
    """Draw residuals so that a typical one has the given length. Return the magnification."""
    typical = max(float(np.percentile(np.hypot(*residuals.T), 90.0)), 1e-9)
    factor = round_to_one_digit(length_px / typical)
    u, v = residuals.T
    arrows = (*at.T, factor * u, factor * v)
    axes.quiver(*arrows, angles="xy", scale_units="xy", scale=1.0, width=0.0016, color="0.15")
    return factor


def top_pose(
    result: TopPoseResult, images: Mapping[str, Float32Array]
) -> tuple[ReportDrawing, ...]:
    """Show each used image of the board on the top surface, with corners and residuals.

    Parameters
    ----------
    result : TopPoseResult
        The top surface.
    images : mapping
        The stage's images by name.
    """
    used = (v for v in result.views if v.used and v.board is not None and v.pose is not None)
    return tuple(_paint_pose(view, images[view.name], result) for view in used)


@drawing(62.0)
def _paint_pose(
    figure: Figure, view: TopPoseView, image: Float32Array, result: TopPoseResult
) -> str:
    assert view.board is not None and view.pose is not None
    corners = view.board.corners_px
    image_axes, residual_axes = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    show_image(image_axes, image)
    image_axes.plot(*corners.T, "+", color=ACCENT, markersize=4.0, mew=0.8)
    image_axes.set_title(printable(view.name))
    factor = _paint_arrows(
        residual_axes, corners, view.pose.residuals_px, 0.4 * view.board.square_px
    )
    residual_axes.plot(*corners.T, ".", color=ACCENT, markersize=2.0)
    title = f"Residuals, {factor:.0f} times enlarged; RMS {view.pose.rms_px:.3f} px"
    residual_axes.set(aspect="equal", title=title, xlabel="u (px)", ylabel="v (px)")
    residual_axes.invert_yaxis()
    caption = f"The board on the top surface, {result.plane.distance_mm:.3f} mm from the camera"
    return f"{caption}, tilted by {result.tilt_deg:.2f} degrees"


@drawing(68.0)
def mirror_spots(figure: Figure, spots: MirrorSpots, image: Float32Array) -> str:
    """Show the mirror image with the spots of the three LEDs, rejected spots, and close-ups.

    Parameters
    ----------
    figure : Figure
        Empty.
    spots : MirrorSpots
        The detected spots.
    image : (rows, columns, 3) float32
        The mirror image.
    """
    reach = 0.035 * image.shape[1]
    grid = figure.add_gridspec(3, 2, width_ratios=(3.4, 1.0))
    whole = figure.add_subplot(grid[:, 0])
    # The mirror image is dark on purpose: it is shown brighter, so that glints are visible too.
    show_image(whole, image**0.4)
    for k, spot in enumerate(spots.spots):
        u, v = map(float, spot.centre_px)
        whole.add_patch(Circle((u, v), reach, fill=False, color=COLOURS[k], lw=1.2))
        name = f"{CHANNEL_KEYS[k]} LED"
        whole.text(u, v - 1.25 * reach, name, color="white", ha="center")
        _paint_spot(figure.add_subplot(grid[k, 1]), image, spot, k)
    for number, (spot, _) in enumerate(spots.rejected, start=1):
        whole.plot(*spot.centre_px, "x", color="0.75", markersize=6)
        whole.annotate(f" {number}", spot.centre_px, color="0.75", fontsize=7)
    caption = "The mirror image with the LED spots, and a close-up of each spot with its centroid"
    if spots.rejected:
        caption += "; " + "grey crosses are rejected glints (table below)"
    return caption


def _paint_spot(axes: Axes, image: Float32Array, spot: MirrorSpot, channel: int) -> None:
    u, v = map(float, spot.centre_px)
    half = max(6, round(2.0 * spot.area_px**0.5))
    top, left = max(round(v) - half, 0), max(round(u) - half, 0)
    crop = image[top : round(v) + half + 1, left : round(u) + half + 1]
    rows, columns = crop.shape[:2]
    extent = (left - 0.5, left + columns - 0.5, top + rows - 0.5, top - 0.5)
    show_image(axes, crop, extent=extent)
    axes.axvline(u, color="white", lw=0.5, alpha=0.8)
    axes.axhline(v, color="white", lw=0.5, alpha=0.8)
    title = f"{CHANNEL_KEYS[channel]} ({u:.2f}, {v:.2f}) px"
    axes.set_title(title, fontsize=6.5, color=COLOURS[channel])


@drawing(66.0, 140.0)
def result_picture(figure: Figure, picture: ResultPicture) -> str:
    """Draw a picture of the result."""
    axes = figure.subplots()
    for mark in picture.marks:
        _paint_mark(axes, mark)
    axes.set(title=picture.title, xlabel=picture.labels[0], ylabel=picture.labels[1])
    if any(picture.labels):
        axes.set_ylim(0.0, 1.1 * axes.get_ylim()[1])  # room for the text of a limit
    else:
        axes.margins(0.15)
        top_down = sorted(axes.get_ylim(), reverse=True)
        axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)", ylim=top_down)
    return picture.caption.rstrip(".")


def _paint_mark(axes: Axes, mark: Mark) -> None:
    match mark:
        case Bars(names, values, roles):
            at = range(len(names))
            axes.bar(at, values, 0.7, color=[ROLE_COLOURS[role] for role in roles])
            axes.set_xticks(at, map(printable, names), rotation=90.0 if len(names) > 12 else 0.0)
        case Line(x, y, role):
            axes.plot(x, y, color=ROLE_COLOURS[role], lw=1.0)
        case Label(x, y, text, role, above_end):
            ha, va = ("right", "bottom") if above_end else ("center", "center")
            axes.text(x, y, printable(text), color=ROLE_COLOURS[role], ha=ha, va=va, bbox=BEHIND)
        case Level(value, text, role, place):
            axes.axhline(value, color=ROLE_COLOURS[role], ls="--", lw=0.8)
            across = axes.get_yaxis_transform()  # a share of the width, and the value
            ha = "right" if place == 1.0 else "center"
            axes.text(place, value, text, transform=across, ha=ha, va="bottom", bbox=BEHIND)
        case Field(values, (left, right, top, bottom), reach):
            extent, colours = (left, right, bottom, top), ListedColormap(DIVERGING / 255.0)
            image = axes.imshow(values, extent=extent, cmap=colours, vmin=-reach, vmax=reach)
            axes.figure.colorbar(image, ax=axes, label="%")


@drawing(58.0)
def radiance(
    figure: Figure,
    calibration: OpenSensor,
    result: LightIntensityResult | None = None,
    colours: ColourTable | None = None,
) -> str:
    """Show the light intensity of each LED and, for a run, the filled areas.

    Parameters
    ----------
    figure : Figure
        Empty.
    calibration : OpenSensor
        With |L|.
    result : LightIntensityResult, optional
        The stage's own result.
    colours : (256, 3) uint8, optional
        Colours of the maps.
    """
    grid = calibration.table.grid
    panels = draw_three_maps(figure, calibration.radiance, grid, "|L|", colours)
    caption = "Light intensity |L| of each LED on the membrane, in pixel values 0..1 (Eq. 5)"
    if result is None or not (result.saturated | result.dust).any():
        return caption
    filled = (result.saturated | result.dust).astype(np.float32)
    for axes in panels:
        axes.contour(grid.x_mm, grid.y_mm, filled, [0.5], colors="white", linewidths=0.6)
    return caption + "; outlined in white: saturated or dusty areas, filled from their surroundings"


@drawing(58.0)
def factors(figure: Figure, calibration: OpenSensor, colours: ColourTable | None = None) -> str:
    """Show the reflectance factors of the bare membrane."""
    draw_three_maps(figure, calibration.factors, calibration.table.grid, "factor", colours)
    return (
        "Reflectance factor of the bare membrane (Eq. 9): 1 means as bright as predicted. Dark "
        "specks are dirt or holes; a slope from side to side indicates that a light has moved"
    )


@drawing(240.0)
def balls(
    figure: Figure,
    presses: Sequence[BallPress],
    images: Sequence[Float32Array],
    table: ResamplingTable,
) -> str:
    """Show every ball press with the detected contour and the fitted circle.

    Parameters
    ----------
    figure : Figure
        Empty.
    presses, images : sequences of equal length
        The balls, and their images resampled onto the grid.
    table : ResamplingTable
        The grid.
    """
    panels = image_axes(figure, len(presses), 1.2)
    for axes, press, image in zip(panels, presses, images, strict=True):
        _paint_ball(axes, press, image, table.grid)
    return (
        "Ball presses: points on the contact edge (dots) and the circle through them; the cross "
        "is the centre after refinement on the shading"
    )


def _paint_ball(axes: Axes, press: BallPress, image: Float32Array, grid: MembraneGrid) -> None:
    indentation, pitch_mm = press.indentation, grid.pitch_mm
    origin = np.array([grid.x_mm[0], grid.y_mm[0]])
    show_image(axes, image, width_px=700, extent=grid_extent(grid))
    edge = origin + pitch_mm * indentation.contour
    axes.plot(*edge.T, ".", color="white", markersize=1.8, mew=0.0)
    x, y = origin + pitch_mm * np.asarray(indentation.centre)
    radius = pitch_mm * indentation.contact_radius_px
    axes.add_patch(Circle((x, y), radius, fill=False, color=ACCENT, lw=0.7, zorder=3))
    axes.plot(*press.pose.centre_mm, "+", color=ACCENT, markersize=7, mew=1.0)
    reach = 2.2 * radius
    axes.set(xlim=(x - reach, x + reach), ylim=(y + reach, y - reach))
    verdict, name = press.quality.verdict, printable(PurePath(press.name).name)
    size = f"R {press.pose.radius_mm:.2f}, depth {press.pose.depth_mm:.2f} mm"
    axes.set_title(f"{verdict.sign} {name}\n{size}", fontsize=6.5, color=VERDICT_COLOURS[verdict])


@drawing(62.0)
def curves(
    figure: Figure, table: ReflectanceTable, scatter: ReflectanceScatter | None = None
) -> str:
    """Show each channel's reflectance curve with scatter and extrapolated parts.

    Parameters
    ----------
    figure : Figure
        Empty.
    table : ReflectanceTable
        The curves.
    scatter : ReflectanceScatter, optional
        The ball pixels of the fit.
    """
    panels = figure.subplots(1, 3, sharey=True)
    top = 1.1 * max(float(values[-1]) for values in table.values)
    for k, axes in enumerate(panels):
        if scatter is not None:
            _paint_density(axes, scatter.cosines[k], scatter.values[k], top)
        _paint_curve(axes, table, k)
        axes.set(xlim=(0.0, 1.0), ylim=(0.0, top), xlabel="cosine of the angle to the light")
    panels[0].set_ylabel("pixel value / light, I / (\N{GREEK SMALL LETTER RHO}|L|)")
    panels[1].legend(loc="upper left")
    caption = "Reflectance curve of each channel; hatched: extrapolated, not covered by any ball"
    if scatter is not None:
        caption += "; grey: ball pixels, darker where there are more (logarithmic)"
    return caption


def _paint_density(axes: Axes, cosines: Float64Array, values: Float64Array, top: float) -> None:
    limits = ((0.0, 1.0), (0.0, top))
    counts, x, y = np.histogram2d(cosines, values, bins=160, range=limits)
    if counts.any():
        density = np.ma.masked_equal(counts.T, 0.0)
        norm = LogNorm(0.5, float(counts.max()))
        extent = (x[0], x[-1], y[0], y[-1])
        axes.imshow(density, cmap="Greys", norm=norm, extent=extent, origin="lower", aspect="auto")


def _paint_curve(axes: Axes, table: ReflectanceTable, channel: int) -> None:
    low, high = table.coverage[channel]
    for start, stop in ((0.0, low), (high, 1.0)):
        axes.axvspan(start, stop, facecolor="0.95", edgecolor="0.8", hatch="////", linewidth=0.0)
    cosine = np.linspace(0.0, 1.0, 400)
    value, colour = table.response(channel, cosine), COLOURS[channel]
    covered = np.where((cosine >= low) & (cosine <= high), value, np.nan)
    axes.plot(cosine, value, "--", color=colour, lw=1.0, label="extrapolated")
    axes.plot(cosine, covered, color=colour, lw=1.8, label="measured")
    title = f"{CHANNEL_KEYS[channel]}: measured from {low:.2f} to {high:.2f}"
    axes.set_title(title, fontsize=7.0, color=colour)


@drawing(52.0, 110.0)
def slope_errors(figure: Figure, c: ClosedSensor) -> str:
    """Show the error of the slope of a closed sensor by the slope."""
    angles, sd = np.arctan(c.in_place.errors.slopes), c.in_place.errors.slope_sd
    # The error of an angle is that of its slope times cos^2.
    errors_deg = np.degrees(sd * np.cos(angles) ** 2)
    labels = "slope of the ball (degrees)", "error (degrees)"
    _paint_line(figure, np.degrees(angles), errors_deg, labels)
    return "Error of the slope along x or y, by presses that were left out"


@drawing(52.0, 110.0)
def learning(figure: Figure, errors: Sequence[tuple[int, float]]) -> str:
    """Show the error of the slope of a closed sensor by the number of presses."""
    counts, slopes = zip(*errors, strict=True)
    _paint_line(figure, counts, slopes, ("number of balls", "error of the slope"))
    return "Error of the slope of other presses, by the number of balls"


def _paint_line(figure: Figure, x: ArrayLike, y: ArrayLike, labels: tuple[str, str]) -> None:
    axes = figure.subplots()
    axes.plot(x, y, "o-", color=ACCENT)
    axes.set(xlabel=labels[0], ylabel=labels[1])
    axes.set_ylim(bottom=0.0)
