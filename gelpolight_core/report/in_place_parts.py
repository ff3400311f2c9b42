"""Facts, drawings and tables of a closed sensor's calibration for its report."""

from __future__ import annotations

import math
from pathlib import PurePath

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from gelpolight_core.in_place.calibrate import FoundPress, InPlaceResult
from gelpolight_core.optics.resampling import MembraneGrid
from gelpolight_core.reconstruction.in_place.calibration import InPlaceCalibration
from gelpolight_core.report.document import Drawing, Listing, Parts
from gelpolight_core.report.drawing import ACCENT, draw, grid_extent, show_image
from gelpolight_core.translation import tr

Facts = list[tuple[str, str]]


def in_place_facts(c: InPlaceCalibration) -> Facts:
    """Return the known and the unknown quantities of a closed sensor."""
    grid, errors = c.in_place.grid, c.in_place.errors
    return [
        (tr("Image"), f"{c.camera.width} \N{MULTIPLICATION SIGN} {c.camera.height} px"),
        (
            tr("Scale"),
            f"{grid.mm_per_px:.5f} mm/px \N{PLUS-MINUS SIGN} {100.0 * c.in_place.scale_sd:.2g} %",
        ),
        (
            tr("Error of a depth"),
            tr("{share:.2g} % of it, and {floor:.2g} mm").format(
                share=100.0 * errors.depth_share, floor=errors.depth_floor_mm
            ),
        ),
        (tr("Not known"), tr("optics, refraction, temperature")),
    ]


def in_place_parts(c: InPlaceCalibration, result: InPlaceResult | None = None) -> dict[str, Parts]:
    """Return drawings and tables by stage.

    Parameters
    ----------
    c : InPlaceCalibration
        The calibration.
    result : InPlaceResult, optional
        Of the run that made it; a file does not contain the figures of the presses.
    """
    balls = Parts((_draw_places(c),), _refused(result) if result else ())
    drawings = [_draw_errors(c)]
    if result is None:
        return {"balls": balls, "in_place": Parts(tuple(drawings))}
    if len(result.learning) > 1:
        drawings.append(_draw_learning(result))
    return {"balls": balls, "in_place": Parts(tuple(drawings), (_presses(c, result.presses),))}


def _draw_places(c: InPlaceCalibration) -> Drawing:
    grid = c.in_place.grid
    whole = MembraneGrid(grid.x_mm, grid.y_mm, grid.pitch_mm)

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        show_image(axes, c.in_place.background, extent=grid_extent(whole))
        for _, x, y, contact, _ in c.balls:
            axes.add_patch(Circle((x, y), contact, fill=False, color=ACCENT, lw=0.7))
        axes.set_xlim(*grid_extent(whole)[:2])
        axes.set_ylim(*grid_extent(whole)[2:])

    rows, columns = grid.shape
    height = 90.0
    caption = tr("The untouched membrane and the contact of each press that was used")
    return draw(caption, height, paint, width_mm=min(height * columns / rows, 160.0))


def _draw_errors(c: InPlaceCalibration) -> Drawing:
    errors = c.in_place.errors
    slope = np.degrees(np.arctan(errors.slopes))
    # The error of an angle is that of its slope times cos^2.
    spread = np.degrees(errors.slope_sd * np.cos(np.arctan(errors.slopes)) ** 2)

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(slope, spread, "o-", color=ACCENT)
        axes.set_xlabel(tr("slope of the ball (degrees)"))
        axes.set_ylabel(tr("error (degrees)"))
        axes.set_ylim(bottom=0.0)

    return draw(
        tr("Error of the slope along x or y, by presses that were left out"),
        60.0,
        paint,
        width_mm=110.0,
    )


def _draw_learning(result: InPlaceResult) -> Drawing:
    counts, errors = zip(*result.learning, strict=True)

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(counts, errors, "o-", color=ACCENT)
        axes.set_xlabel(tr("number of balls"))
        axes.set_ylabel(tr("error of the slope"))
        axes.set_ylim(bottom=0.0)

    return draw(
        tr("Error of the slope of other presses, by the number of balls"),
        60.0,
        paint,
        width_mm=110.0,
    )


def _presses(c: InPlaceCalibration, presses: tuple[FoundPress, ...]) -> Listing:
    rows = []
    for press, (name, x, y, contact, radius) in zip(presses, c.balls, strict=True):
        found = press.held_out
        rows.append(
            (
                PurePath(name).name,
                f"{radius:.3f}",
                f"{x:.2f}, {y:.2f}",
                f"{contact:.2f}",
                f"{found.normal_deg:.2f}\N{DEGREE SIGN}",
                _percent(found.cap_ratio),
                _percent(found.diameter_ratio),
            )
        )
    heads = (
        tr("image"),
        tr("radius (mm)"),
        tr("position (mm)"),
        tr("contact (mm)"),
        tr("normals"),
        tr("height"),
        tr("diameter"),
    )
    title = tr("Each press compared with the other presses")
    return Listing(title, heads, tuple(rows), (1.6, 0.9, 1.2, 0.9, 0.8, 0.8, 0.8))


def _percent(ratio: float) -> str:
    return f"{100.0 * (ratio - 1.0):+.1f} %" if math.isfinite(ratio) else ""


def _refused(result: InPlaceResult) -> tuple[Listing, ...]:
    rows = tuple(
        (PurePath(name).name, f"{fault.found}. {fault.advice}.")
        for name, fault in sorted(result.refused.items())
    )
    if not rows:
        return ()
    return (Listing(tr("Presses left out"), (tr("image"), tr("reason")), rows, (1.0, 4.0)),)
