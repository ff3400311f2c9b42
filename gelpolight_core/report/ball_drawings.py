"""Drawings of the ball presses: contours, reflectance curves with their scatter, misfits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import PurePath

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from gelpolight_core.calibration.joint import JointResult
from gelpolight_core.calibration.scatter import ReflectanceScatter
from gelpolight_core.channels import channel_name
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.quality import Verdict
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.reflectance.table import ReflectanceTable
from gelpolight_core.report.document import MARKS, Drawing
from gelpolight_core.report.drawing import (
    ACCENT,
    COLOURS,
    FULL_MM,
    Array,
    Map,
    draw,
    grid_extent,
    show_image,
)
from gelpolight_core.report.typeface import printable
from gelpolight_core.translation import tr

BALLS_ACROSS = 5
VERDICT_COLOURS = {Verdict.PASS: "0.1", Verdict.WARN: "#b36b00", Verdict.FAIL: "#c62828"}
SAMPLES = 400


def draw_balls(
    presses: Sequence[BallPress], images: Sequence[Map], table: ResamplingTable
) -> Drawing:
    """Show every ball press with the detected contour and the fitted circle.

    Parameters
    ----------
    presses, images : sequences of equal length
        The balls, and their images resampled onto the grid.
    table : ResamplingTable
        The grid.
    """
    rows = math.ceil(len(presses) / BALLS_ACROSS)

    def paint(figure: Figure) -> None:
        panels = figure.subplots(rows, BALLS_ACROSS, squeeze=False).ravel()
        for axes, press, image in zip(panels, presses, images, strict=False):
            _draw_ball(axes, press, image, table)
        for axes in panels[len(presses) :]:
            axes.set_axis_off()

    return draw(
        tr(
            "Ball presses: points on the contact edge (dots) and the circle through them; the "
            "cross is the centre after refinement on the shading"
        ),
        min(rows * FULL_MM / BALLS_ACROSS * 1.16, 230.0),
        paint,
    )


def _draw_ball(axes: Axes, press: BallPress, image: Map, table: ResamplingTable) -> None:
    found, grid = press.indentation, table.grid
    origin = np.array([grid.x_mm[0], grid.y_mm[0]])
    show_image(axes, image, width_px=700, extent=grid_extent(grid))
    contour = origin + grid.pitch_mm * found.contour
    axes.plot(contour[:, 0], contour[:, 1], ".", color="white", markersize=1.8, mew=0.0)
    centre = origin + grid.pitch_mm * np.asarray(found.centre)
    radius = grid.pitch_mm * found.contact_radius_px
    axes.add_patch(
        Circle((centre[0], centre[1]), radius, fill=False, color=ACCENT, lw=0.7, zorder=3)
    )
    axes.plot(*press.pose.centre_mm, "+", color=ACCENT, markersize=7, mew=1.0)
    reach = 2.2 * radius
    axes.set_xlim(centre[0] - reach, centre[0] + reach)
    axes.set_ylim(centre[1] + reach, centre[1] - reach)
    verdict = press.quality.verdict
    axes.set_title(
        tr("{mark} {name}\nR {radius:.2f}, depth {depth:.2f} mm").format(
            mark=MARKS[verdict],
            name=printable(PurePath(press.name).name),
            radius=press.pose.radius_mm,
            depth=press.pose.depth_mm,
        ),
        fontsize=6.5,
        fontweight="normal",
        color=VERDICT_COLOURS[verdict],
    )


def draw_curves(table: ReflectanceTable, scatter: ReflectanceScatter | None = None) -> Drawing:
    """Show each channel's reflectance curve, its scatter, and where it is extrapolated.

    Parameters
    ----------
    table : ReflectanceTable
        The curves.
    scatter : ReflectanceScatter, optional
        The ball pixels of the fit.
    """

    def paint(figure: Figure) -> None:
        panels = figure.subplots(1, 3, sharey=True)
        top = 1.1 * max(float(values[-1]) for values in table.values)
        for k, axes in enumerate(panels):
            if scatter is not None:
                _draw_density(axes, scatter.cosines[k], scatter.values[k], top)
            _draw_curve(axes, table, k, top)
        panels[0].set_ylabel(tr("pixel value / light, I / (\N{GREEK SMALL LETTER RHO}|L|)"))
        panels[1].legend(loc="upper left")

    caption = tr(
        "Reflectance curve of each channel; hatched: extrapolated, not covered by any ball"
    )
    if scatter is not None:
        caption += tr("; grey: ball pixels, darker where there are more (logarithmic)")
    return draw(caption, 66.0, paint)


def _draw_density(axes: Axes, cosines: Array, values: Array, top: float) -> None:
    counts, x, y = np.histogram2d(cosines, values, bins=(160, 160), range=((0.0, 1.0), (0.0, top)))
    if counts.any():
        axes.pcolormesh(
            x,
            y,
            np.ma.masked_equal(counts.T, 0.0),
            cmap="Greys",
            norm=LogNorm(0.5, float(counts.max())),
            rasterized=True,
        )


def _draw_curve(axes: Axes, table: ReflectanceTable, channel: int, top: float) -> None:
    low, high = table.coverage[channel]
    for start, stop in ((0.0, low), (high, 1.0)):
        axes.axvspan(start, stop, facecolor="0.95", edgecolor="0.8", hatch="////", linewidth=0.0)
    cosine = np.linspace(0.0, 1.0, SAMPLES)
    value = table.response(channel, cosine)
    seen = (cosine >= low) & (cosine <= high)
    axes.plot(cosine, value, "--", color=COLOURS[channel], lw=1.0, label=tr("extrapolated"))
    axes.plot(
        cosine, np.where(seen, value, np.nan), color=COLOURS[channel], lw=1.8, label=tr("measured")
    )
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, top))
    axes.set_title(
        tr("{name}: measured from {low:.2f} to {high:.2f}").format(
            name=channel_name(channel), low=low, high=high
        ),
        color=COLOURS[channel],
    )
    axes.set_xlabel(tr("cosine of the angle to the light"))


def draw_misfits(presses: Sequence[BallPress], joint: JointResult) -> Drawing:
    """Show the unexplained part of each press, for the ball alone and for the joint model.

    Parameters
    ----------
    presses : sequence of BallPress
        With the misfit of their separate refinement.
    joint : JointResult
        With the misfit of each press after the joint refinement.
    """
    names = [printable(PurePath(press.name).name) for press in presses]
    bars = np.arange(len(names))

    def paint(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
        alone = [100.0 * press.shading_misfit for press in presses]
        left.bar(bars - 0.2, alone, 0.38, color="0.75", label=tr("each ball alone"))
        left.bar(
            bars + 0.2,
            100.0 * joint.ball_misfits,
            0.38,
            color="0.25",
            label=tr("all together, with their drapes"),
        )
        left.set_xticks(bars, names, rotation=45, ha="right", rotation_mode="anchor")
        left.set_ylabel(tr("misfit of the shading (%)"))
        left.legend(loc="upper left", bbox_to_anchor=(0.0, 1.22), ncols=2)
        right.axhline(0.0, color="0.7", lw=0.6)
        right.axvline(0.0, color="0.7", lw=0.6)
        moved = np.array(
            [
                np.subtract(after.centre_mm, press.pose.centre_mm)
                for after, press in zip(joint.balls, presses, strict=True)
            ]
        )
        deeper = [a.depth_mm - p.pose.depth_mm for a, p in zip(joint.balls, presses, strict=True)]
        right.plot(bars, 1e3 * moved[:, 0], "o", color="#d55e00", markersize=3, label="x")
        right.plot(bars, 1e3 * moved[:, 1], "s", color="#0072b2", markersize=3, label="y")
        right.plot(bars, 1e3 * np.array(deeper), "^", color="0.2", markersize=3, label=tr("depth"))
        right.set_xticks(bars, names, rotation=45, ha="right", rotation_mode="anchor")
        right.set_ylabel(tr("shift of the ball (\N{MICRO SIGN}m)"))
        right.legend(loc="upper left", bbox_to_anchor=(0.0, 1.22), ncols=3)

    return draw(
        tr("Residual of each ball press, and the shift of the balls by the joint refinement"),
        66.0,
        paint,
    )
