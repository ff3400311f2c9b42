"""The recipe of a closed sensor: the untouched membrane, and balls pressed into it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from gelpolight_core.base.finding import QualityTable

from .recipe import Facts, QualityTableSpec, Recipe, Stage, StageContext, StageResults, shape_facts

if TYPE_CHECKING:
    from gelpolight_core.calibration.closed_sensor.pixel_scale import MeasuredScale
    from gelpolight_core.image.linear_image import LinearImage
    from gelpolight_core.sensor.closed_sensor.closed_sensor_data import ClosedSensor
    from gelpolight_core.sensor.closed_sensor.slope_model import InPlaceModel
    from gelpolight_core.sensor.sensor_calibration import Calibration, Provenance
    from gelpolight_core.session.session import Session

    from .closed_sensor_stages import SlopesStageResult


@dataclass(frozen=True, slots=True)
class ClosedBackgroundStageResult:
    """Image of the untouched membrane with its figures."""

    image: LinearImage
    quality: QualityTable


def _run_background(work: StageContext) -> ClosedBackgroundStageResult:
    from gelpolight_core.session.session import ClosedSensorSettings
    from gelpolight_core.session.session_images import require_colour
    from gelpolight_core.stages.flat_field.bare_membrane_check import check_bare_membrane

    from .closed_sensor_stages import stated_grid

    image = work.session.averaged(BACKGROUND.folder)
    grid = stated_grid(work.session.in_place or ClosedSensorSettings(), image.size)
    membrane = replace(image, rgb=grid.cut(image.rgb))
    require_colour(membrane, where=str(work.session.folder / BACKGROUND.folder))
    return ClosedBackgroundStageResult(image, check_bare_membrane(membrane.rgb).quality)


def _region_stated(session: Session) -> object:
    """Return the declared response and, where it is stated, the membrane's region."""
    region_px = None if session.in_place is None else session.in_place.region_px
    response = session.declared_response
    return response if region_px is None else (response, region_px)


BACKGROUND = Stage(
    "background",
    "Background",
    _run_background,
    folder="background",
    stated=_region_stated,
    share=5,
    one_image=True,
    colour=True,
    lit=True,
    tables=(),
)


def _run_scale(work: StageContext) -> MeasuredScale:
    from .closed_sensor_stages import measured_scale

    return measured_scale(work.session, work[BACKGROUND].image)


SCALE = Stage(
    "scale",
    "Scale",
    _run_scale,
    (BACKGROUND,),
    "scale",
    stated=lambda s: s.in_place,
    used=lambda s: s.in_place is not None and s.in_place.mm_per_px is None,
    share=5,
    colour=True,
    tables=(),
)


def _run_balls(work: StageContext, towards: InPlaceModel | None = None) -> SlopesStageResult:
    from .closed_sensor_stages import find_slopes

    image, scale = work[BACKGROUND].image, work.results.get(SCALE)
    return find_slopes(
        work.session,
        image,
        scale if SCALE.used(work.session) else None,
        towards=towards,
        progress=work.progress,
    )


def _stated(session: Session) -> object:
    """Return the radii, the circles drawn by hand, and the stated scale."""
    radii = sorted(session.ball_radii_mm.items()), session.ball_default_radius_mm
    circles, in_place = sorted(session.decisions.balls.items()), session.in_place
    assert in_place is not None
    scale = in_place.stated_scale, in_place.mm_per_px_sd, in_place.pressed_scale
    region = () if in_place.region_px is None else (in_place.region_px,)
    return (radii, circles, scale, *region, *(() if session.surface.flat else (session.surface,)))


def _ball_facts(c: ClosedSensor) -> Facts:
    text = f"{len(c.balls)}, slopes up to {math.degrees(math.atan(c.in_place.steepest)):.1f} deg"
    return (("Balls", text),)


def _ball_entries(results: StageResults) -> dict[str, Any]:
    return results[BALLS].entries


BALLS = Stage(
    "balls",
    "Ball presses",
    _run_balls,
    (BACKGROUND, SCALE),
    "balls",
    "ball",
    stated=_stated,
    share=95,
    colour=True,
    lit=True,
    tables=(
        QualityTableSpec(
            "scale",
            "Scale",
            lambda slopes: slopes.tables["scale"],
            "Size of a camera pixel on the membrane, stated or measured",
        ),
        QualityTableSpec(
            "balls",
            "Ball presses",
            lambda slopes: slopes.tables["balls"],
            "Finds the pressed balls, whose slopes are known",
            _ball_facts,
        ),
        QualityTableSpec(
            "in_place",
            "Slopes of presses left out",
            lambda slopes: slopes.tables["in_place"],
            (
                "Fits the slope as a function of colour change and position. Each press "
                "is compared with the result of the other presses"
            ),
        ),
        # A calibration gets this one when its background is replaced.
        QualityTableSpec(
            "gel",
            "Gel change",
            lambda _slopes: QualityTable(),
            "Keeps the slopes of an earlier gel with the background of this one",
        ),
    ),
    entries=_ball_entries,
    lines=lambda slopes: slopes.lines,
)


def _finish(
    session: Session, results: StageResults, quality: dict[str, QualityTable], made: Provenance
) -> Calibration:
    from .closed_sensor_stages import in_place_calibration

    return in_place_calibration(session, results[BALLS], quality, made)


def _facts(c: ClosedSensor) -> Facts:
    """Return the known and the unknown quantities of a closed sensor."""
    grid, errors = c.in_place.grid, c.in_place.errors
    error = f"{100.0 * errors.depth_share:.2g} % of it, and {errors.depth_floor_mm:.2g} mm"
    sizes = " \N{MULTIPLICATION SIGN} ".join(f"{size:.5f}" for size in dict.fromkeys(grid.pixel_mm))
    scale = f"{sizes} mm/px \N{PLUS-MINUS SIGN} {100.0 * c.in_place.scale_sd:.2g} %"
    return (
        ("Image", f"{c.camera.width} \N{MULTIPLICATION SIGN} {c.camera.height} px"),
        ("Scale", scale),
        ("Error of a depth", error),
        *shape_facts(grid.surface),
        ("Not known", "optics, refraction, temperature"),
    )


IN_PLACE = Recipe(
    "in-place",
    "in place, closed sensor",
    (BACKGROUND, SCALE, BALLS),
    _finish,
    _facts,
    closed=True,
    depends_on=lambda session, inputs: (inputs[BALLS.key], session.serial),
)


def recipe_with_prior(earlier: InPlaceModel) -> Recipe:
    """Return the recipe for few presses of a new gel, which correct an earlier calibration.

    Parameters
    ----------
    earlier : InPlaceModel
        The slopes of the earlier calibration.
    """
    balls = replace(BALLS, run=lambda work: _run_balls(work, earlier))
    return replace(IN_PLACE, stages=(BACKGROUND, SCALE, balls))
