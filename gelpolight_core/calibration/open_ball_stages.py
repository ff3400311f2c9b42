"""The stages of the ball presses of an open sensor: balls and reflectance."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import (
    Finding,
    QualityTable,
    Verdict,
    join_quality_tables,
    judge_excluded_images,
)
from gelpolight_core.geometry.membrane_shape import FLAT

from .ball_image import BallImageResult, what_changed
from .open_sensor_recipe import (
    BACKGROUND,
    LENS,
    LIGHTS,
    TOP_POSE,
    same_size,
    with_response,
)
from .recipe import QualityTableSpec, Stage, StageContext, StageResults

if TYPE_CHECKING:
    from gelpolight_core.base.arrays import Float32Array
    from gelpolight_core.geometry.camera import CameraModel
    from gelpolight_core.geometry.membrane_shape import MembraneShape
    from gelpolight_core.geometry.refraction import LayerStack
    from gelpolight_core.geometry.sensor_frame import TopPlane
    from gelpolight_core.health.health_check import HealthCheck
    from gelpolight_core.session.decisions import PlacedCircle
    from gelpolight_core.session.session import Session
    from gelpolight_core.stages.balls.ball_press import BallPress, PlacedContact
    from gelpolight_core.stages.balls.reflectance_stage import ReflectanceResult
    from gelpolight_core.stages.flat_field.factor_map import ReflectanceFactorResult


@dataclass(frozen=True, slots=True)
class BallsStageResult:
    """Detected balls, with findings on the background and the roundness of contacts."""

    seen: tuple[BallImageResult, ...]
    background: tuple[Finding, ...] = ()
    roundness: tuple[Finding, ...] = ()

    @property
    def presses(self) -> tuple[BallPress, ...]:
        """The detected balls."""
        return tuple(ball.press for ball in self.seen if ball.press is not None)

    @property
    def images(self) -> tuple[Float32Array, ...]:
        """Their images, resampled."""
        return tuple(ball.image for ball in self.seen if ball.image is not None)

    @property
    def together(self) -> QualityTable:
        """Figures of all presses together, with the captures that were left out."""
        refused = [
            f"{ball.file}: {ball.fault.found}. {ball.fault.advice}"
            for ball in self.seen
            if ball.fault is not None
        ]
        left_out = judge_excluded_images("balls_left_out", "Captures left out", refused)
        return QualityTable((left_out, *self.background, *self.roundness))

    @property
    def quality(self) -> QualityTable:
        """What was left out, and of each figure of the presses the worst."""
        worst = worst_figures([press.quality for press in self.presses])
        return QualityTable((*self.together.figures, *worst))


def worst_figures(tables: Sequence[QualityTable]) -> tuple[Finding, ...]:
    """Return the worst-judged instance of each figure of several tables, in their order."""
    order = list(Verdict)
    worst: dict[str, Finding] = {}
    for table in tables:
        for figure in table.figures:
            before = worst.get(figure.key)
            if before is None or order.index(figure.verdict) > order.index(before.verdict):
                worst[figure.key] = figure
    return tuple(worst.values())


def _require_balls(results: StageResults) -> None:
    """Refuse results without any ball, with the fault of the background or of the first capture."""
    balls = results[BALLS]
    if balls.presses:
        return
    for figure in (*balls.background, *results[BACKGROUND].quality.figures):
        if figure.verdict is Verdict.FAIL:
            text = (
                f"No ball was found with this background ({figure.text}: "
                f"{figure.value:.1f} {figure.unit})"
            )
            raise InputError(text, "background", figure.remedy)
    for ball in balls.seen:
        if ball.fault is not None:
            raise ball.fault


def _run_balls(work: StageContext) -> BallsStageResult:
    """Find the ball in each image. Balls found earlier from the same inputs are used again."""
    from gelpolight_core.base.parallel import in_parallel
    from gelpolight_core.stages.balls.press_agreement import judge_roundness
    from gelpolight_core.stages.leds.crosstalk import unmix

    from .background_consistency import judge_background, mean_light_of_cells, suspect_share
    from .ball_press_light import press_light_check

    session, before = with_response(work.session, work.results), work.results.get(BALLS)
    ball_by_key = {ball.key: ball for ball in (() if before is None else before.seen)}
    depends_on = tuple(work.inputs[need.key].fingerprint for need in BALLS.needs)
    hashes = dict(work.inputs[BALLS.key].images)
    files = session.files(BALLS.folder)
    background, lights = work[BACKGROUND], work[LIGHTS]
    table, crosstalk = background.table, lights.crosstalk.matrix
    bare = unmix(background.light, crosstalk)
    check = press_light_check(
        background.light, table, work[LENS].camera, crosstalk, lights.leds.led_positions_mm
    )

    def ball(path: Path) -> BallImageResult:
        name, placed = path.name, session.decisions.balls.get(path.name)
        inputs = (*depends_on, hashes[name]), (name, session.ball_radius_mm(name), placed)
        key = hashlib.sha256(repr(inputs).encode()).hexdigest()
        return ball_by_key.get(key) or _find_ball(path, key, session, work, bare, check)

    balls: list[BallImageResult] = []
    with closing(in_parallel(ball, files)) as detections:
        for detection in detections:
            work.progress(len(balls) / len(files))
            balls.append(detection)
    agreement = judge_background(
        mean_light_of_cells(background.light, table),
        suspect_share(background.suspect, table, work[LENS].camera),
        [ball for ball in balls if ball.cells is not None],
        table,
    )
    found_balls = BallsStageResult(tuple(balls), agreement)
    return replace(found_balls, roundness=judge_roundness(found_balls.presses, table))


def _find_ball(
    path: Path,
    key: str,
    session: Session,
    work: StageContext,
    bare: Float32Array,
    check: HealthCheck,
) -> BallImageResult:
    from gelpolight_core.sensor.sensor_calibration import sensor_stack
    from gelpolight_core.session.session_images import require_colour
    from gelpolight_core.stages.balls.ball_press import find_ball
    from gelpolight_core.stages.leds.crosstalk import unmix

    from .background_consistency import mean_light_of_cells
    from .ball_press_light import measure_press_light, undo_light_change

    lens, lights, bare_membrane = work[LENS], work[LIGHTS], work[BACKGROUND]
    table, plane = bare_membrane.table, work[TOP_POSE].pose.plane
    radius_mm = session.ball_radius_mm(path.name)
    placed = session.decisions.balls.get(path.name)
    try:
        raw = session.image(path)
        require_colour(raw, where=str(path))
        same_size(raw, lens, BALLS.folder)
    except InputError as fault:
        return BallImageResult(path.name, key, fault=fault)
    filled = bare_membrane.bad.fill_bad_pixels(raw.rgb)
    light = measure_press_light(filled, check)
    image = table.apply(undo_light_change(filled, light.gain))
    try:
        contact = None
        if placed is not None:
            stack = sensor_stack(session.sensor, plane)
            contact = placed_contact(placed, lens.camera, plane, stack, table.surface)
        press = find_ball(
            unmix(image, lights.crosstalk.matrix),
            bare,
            table,
            lights.leds.led_positions_mm,
            radius_mm=radius_mm,
            name=f"{BALLS.folder}/{path.name}",
            usable=bare_membrane.radiance.usable,
            placed=contact,
        )
    except InputError as fault:
        reason = fault
        if light.uncorrected:
            text = f"{what_changed(light.uncorrected)} differs from the background: {fault.found}"
            reason = InputError(text, fault.where, Remedy.SAME_LIGHT)
        cells = mean_light_of_cells(image, table)
        return BallImageResult(path.name, key, fault=reason, light=light, cells=cells)
    cells = mean_light_of_cells(image, table, press)
    return BallImageResult(path.name, key, image, press, light=light, cells=cells)


def placed_contact(
    circle: PlacedCircle,
    camera: CameraModel,
    plane: TopPlane,
    stack: LayerStack,
    surface: MembraneShape = FLAT,
) -> PlacedContact:
    """Return the circle on the undeformed membrane for a circle set in the raw image.

    Raises
    ------
    InputError
        If it extends beyond the visible part of the membrane.
    """
    from gelpolight_core.geometry.refraction import camera_to_membrane
    from gelpolight_core.stages.balls.ball_press import PlacedContact

    turns = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    u = circle.u_px + circle.radius_px * np.cos(turns)
    v = circle.v_px + circle.radius_px * np.sin(turns)
    pixels = np.stack([u, v], axis=-1)
    edge_mm, _ = camera_to_membrane(camera.directions(pixels), plane, stack, surface)
    if not np.isfinite(edge_mm).all():
        text = "The circle set by hand extends beyond the visible membrane"
        raise InputError(text, "balls", Remedy.MOVE_INSIDE)
    middle = edge_mm.mean(axis=0)
    radius_mm = float(np.hypot(*(edge_mm - middle).T).mean())
    return PlacedContact((float(middle[0]), float(middle[1])), radius_mm)


BALLS = Stage(
    "balls",
    "Ball presses",
    _run_balls,
    (BACKGROUND,),
    "balls",
    "ball",
    stated=lambda s: (
        (sorted(s.ball_radii_mm.items()), s.ball_default_radius_mm),
        sorted(s.decisions.balls.items()),
    ),
    share=30,
    colour=True,
    lit=True,
    tables=(
        QualityTableSpec(
            "balls",
            "Ball presses",
            lambda balls: balls.together,
            "Finds the pressed balls, whose slopes are known",
        ),
    ),
    require=_require_balls,
    settles=((BACKGROUND.key, "pressed"),),
)


@dataclass(frozen=True, slots=True)
class ReflectanceStageResult:
    """The reflectance table of the membrane with the factors of each place."""

    table: ReflectanceResult
    factors: ReflectanceFactorResult

    @property
    def quality(self) -> QualityTable:
        """Figures of both."""
        return join_quality_tables((self.table.quality, self.factors.quality))


def _run_reflectance(work: StageContext) -> ReflectanceStageResult:
    """Fit the table, then the factors, and feed these back once (section V-E)."""
    from gelpolight_core.stages.balls.reflectance_stage import calibrate_reflectance
    from gelpolight_core.stages.flat_field.factor_map import calibrate_factors

    background, balls = work[BACKGROUND], work[BALLS]
    table, leds_mm = background.table, work[LIGHTS].leds.led_positions_mm
    radiance, bare = background.radiance, background.light
    presses, images = balls.presses, balls.images
    first = calibrate_reflectance(presses, images, table, leds_mm, radiance)
    factors = calibrate_factors(bare, table, leds_mm, radiance, first.table)
    second = calibrate_reflectance(presses, images, table, leds_mm, radiance, factors.factors)
    return ReflectanceStageResult(
        second, calibrate_factors(bare, table, leds_mm, radiance, second.table)
    )


def _reflectance_entries(results: StageResults) -> dict[str, Any]:
    reflectance = results[REFLECTANCE].table
    return {
        "balls": [
            {
                "file": Path(press.name).name,
                "radius_mm": press.pose.radius_mm,
                "centre_mm": list(press.pose.centre_mm),
                "depth_mm": press.pose.depth_mm,
                "contact_radius_mm": press.contact_radius_mm,
                "centre_sd_mm": press.centre_sd_mm,
            }
            for press in reflectance.presses
        ],
        "reflectance": [
            {
                "cosines": fit.cosines.tolist(),
                "values": fit.values.tolist(),
                "coverage": fit.coverage.tolist(),
                "scatter": fit.spread,
            }
            for fit in reflectance.fits
        ],
    }


REFLECTANCE = Stage(
    "reflectance",
    "Reflectance",
    _run_reflectance,
    (BALLS,),
    share=5,
    tables=(
        QualityTableSpec(
            "reflectance",
            "Reflectance",
            lambda made: made.table.quality,
            "Measures the reflectance of the membrane with balls of known diameter",
        ),
        QualityTableSpec(
            "factors",
            "Reflectance factors",
            lambda made: made.factors.quality,
            "Compares the brightness of the untouched membrane with the model, pixel by pixel",
        ),
    ),
    entries=_reflectance_entries,
)
