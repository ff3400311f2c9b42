"""The pictures of a calibration's result, described once for the window and for the report.

A picture is a title, a caption and marks; a painter knows the five marks, and nothing of sensors.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from pathlib import PurePath
from typing import Literal, NamedTuple

import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.compared_quantity import COVERAGE, PAPER_PERCENT
from gelpolight_core.base.finding import Verdict, join_quality_tables
from gelpolight_core.calibration.closed_sensor_recipe import BALLS as CLOSED_BALLS
from gelpolight_core.calibration.joint_stage import JOINT
from gelpolight_core.calibration.open_ball_stages import BALLS, REFLECTANCE
from gelpolight_core.calibration.open_sensor_recipe import LENS, TOP_POSE
from gelpolight_core.calibration.project import CalibrationRun
from gelpolight_core.calibration.recipes import recipe_named
from gelpolight_core.calibration.refinement_stage import RefinementStageResult
from gelpolight_core.measurement.size_uncertainty import expected_sd
from gelpolight_core.sensor.closed_sensor.closed_sensor_data import ClosedSensor
from gelpolight_core.sensor.sensor_calibration import Calibration, OpenSensor

Role = Literal["accent", "warn", "muted", "red", "green", "blue"]
ENDS = np.array([(33, 92, 172), (247, 247, 247), (178, 24, 43)])
DIVERGING = np.concatenate([np.linspace(a, b, 128) for a, b in pairwise(ENDS)]).astype(np.uint8)
"""Colours (256, 3) of a field: blue, white, red."""
LED_ROLES: tuple[Role, ...] = ("red", "green", "blue")
DEPTHS_MM = np.geomspace(0.1, 1.5, 40)
"""Depths for which the uncertainty is predicted."""
SIZES_MM = (3.0, 7.0)
"""Smallest and largest object for which it is predicted: the size hardly matters."""
TEXT_SHARE = 0.3
"""Height of a line of text over that of a small chart; a plan is twice as high."""
MOST_NAMES = 20
"""Presses that are named in a picture. Chosen: names of more would overlap."""
AREA = "Grey: working area"
ELLIPSE_MM = 1.0
"""Length of the largest half axis of the drawn uncertainty of an LED. Its text is beside it."""


class Bars(NamedTuple):
    """Bars side by side, with the role of each."""

    names: tuple[str, ...]
    y: tuple[float, ...]
    roles: tuple[Role, ...]


class Line(NamedTuple):
    """A line through points."""

    x: Float64Array
    y: Float64Array
    role: Role


class Label(NamedTuple):
    """A text around a point, or above the end of a line."""

    x: float
    y: float
    text: str
    role: Role
    above_end: bool = False


class Level(NamedTuple):
    """A dashed horizontal line with its text in the middle or on the right (1)."""

    y: float
    text: str
    role: Role = "warn"
    place: float = 0.5


class Field(NamedTuple):
    """A map of values, from blue at `-reach` to red at `reach`; NaN where nothing is known.

    `edges` are left, right, top and bottom.
    """

    values: Float32Array
    edges: tuple[float, float, float, float]
    reach: float


Mark = Bars | Line | Label | Level | Field


@dataclass(frozen=True, slots=True, eq=False)
class ResultPicture:
    """A picture of the result.

    Attributes
    ----------
    key : str
        Its name in programs.
    title : str
        Above it.
    caption : str
        What it says, in one or two sentences.
    labels : (str, str)
        Of the axes; empty for a picture in mm from above, whose y points down.
    marks : tuple
        From the back to the front.
    """

    key: str
    title: str
    caption: str
    labels: tuple[str, str]
    marks: tuple[Mark, ...]


def result_pictures(c: Calibration, run: CalibrationRun | None) -> tuple[ResultPicture, ...]:
    """Return the pictures that show how good a calibration is, and where.

    Parameters
    ----------
    c : Calibration
        The calibration.
    run : CalibrationRun or None
        The results of its stages; without them, the pictures of single presses are left out.
    """
    return next(
        draw(c, run) for stage, draw in DRAWN.items() if stage in recipe_named(c.model).stages
    )


def _of_closed(c: Calibration, run: CalibrationRun | None) -> tuple[ResultPicture, ...]:
    data = c.data_of(ClosedSensor)
    names, grid = tuple(ball[0] for ball in data.balls), data.in_place.grid
    area = Line(grid.x_mm[[0, -1, -1, 0, 0]], grid.y_mm[[0, 0, -1, -1, 0]], "muted")
    rings = tuple((x, y, contact) for _, x, y, contact, _ in data.balls)
    plan = _plan(names, rings, (area,), f"{AREA}.")
    expected = _uncertainty(c, "ball")
    if run is None:
        return expected, plan
    found = run.results[CLOSED_BALLS]
    errors = np.array([press.held_out.cap_ratio - 1.0 for press in found.result.presses])
    odd, cut = {size.name for size in found.sizes if size.remedy}, "the edge of the image cuts them"
    return _bars(c, "held_out_cap_percent", names, errors, odd, cut), expected, plan


def _of_open(c: Calibration, run: CalibrationRun | None) -> tuple[ResultPicture, ...]:
    data = c.data_of(OpenSensor)
    joint: RefinementStageResult | None = None if run is None else run.results.get(JOINT)
    stated = () if data.length_errors is None else (_uncertainty(c, "cylinder"),)
    leds, factor = _leds(data)
    about = f"Ellipses: LEDs, two standard deviations, {factor:.0f} times as large."
    area = _ring(*data.surface.axis_mm, 0.5 * data.sensor.working_diameter_mm * np.eye(2), "muted")
    if run is None or joint is None or joint.checked is None:
        return (*stated, _plan((), (), (area, *leds), f"{AREA}. {about}"))
    balls, checked, names = joint.refined.balls, joint.checked, joint.refined.ball_names
    odd = {fit.name for fit in run.results[REFLECTANCE].table.agreements if fit.fault}
    odd |= {p.name for p in run.results[BALLS].presses if p.quality.verdict is not Verdict.PASS}
    why = "their tops are not solved"
    bars = _bars(c, "ball_height_error_percent", names, checked.height_errors, odd, why)
    rings = tuple(
        (*ball.centre_mm, math.sqrt(ball.depth_mm * (2.0 * ball.radius_mm - ball.depth_mm)))
        for ball in balls
    )
    marks = area, *_boards(run), *leds
    plan = _plan(names, rings, marks, f"{AREA}, boards on the top surface. {about}")
    return bars, *stated, plan, _left(data, checked.left, checked.step)


DRAWN = {REFLECTANCE: _of_open, CLOSED_BALLS: _of_closed}
"""The pictures of a recipe that has a stage."""


def _bars(
    c: Calibration, key: str, names: Sequence[str], errors: Float64Array, odd: set[str], why: str
) -> ResultPicture:
    """Return the relative errors of the presses, worst first, and their typical value as judged.

    The limit is that of the typical error. A press is marked as in its own step: those of `odd`.
    `why` some have no error is a clause.
    """
    typical = join_quality_tables(c.quality.values())[key]
    known = ((100.0 * abs(e), n) for n, e in zip(names, errors, strict=True) if math.isfinite(e))
    worst_first = sorted(known, reverse=True)
    roles: tuple[Role, ...] = tuple("warn" if n in odd else "accent" for _, n in worst_first)
    stems = tuple(PurePath(n).stem for _, n in worst_first)
    bars = Bars(stems, tuple(e for e, _ in worst_first), roles)
    role: Role = "muted" if typical.verdict is Verdict.PASS else "warn"
    marks: list[Mark] = [bars, Level(typical.value, "typical error", role, 1.0)]
    if typical.warn_limit is not None:
        marks.append(Level(typical.warn_limit, "limit of the typical error"))
    caption = f"{typical.verdict.word}: typical error {typical.value_text} ({typical.limit_text})."
    if "warn" in roles:
        caption += " Orange: not passed in Ball presses."
    if unknown := len(names) - len(worst_first):
        caption += f" {unknown} of {len(names)} presses have no height: {why}."
    title = "Height error of each ball press (%)"
    return ResultPicture("balls", title, caption, ("", "%"), tuple(marks))


def _uncertainty(c: Calibration, shape: str) -> ResultPicture:
    """Return what the uncertainty of measured objects will be, by their depth: the largest."""
    shares = []
    for size_mm, depth_mm in product(SIZES_MM, DEPTHS_MM.tolist()):
        sd = expected_sd(c, shape, size_mm, depth_mm)
        shares.append((sd["height_mm"] / depth_mm, sd["diameter_mm"] / size_mm))
    largest = np.reshape(shares, (len(SIZES_MM), -1, 2)).max(axis=0)
    height, across = 100.0 * COVERAGE * largest.T
    tolerance = PAPER_PERCENT["depth"]
    decides = DEPTHS_MM[height < tolerance]
    caption = f"No height can be judged by a tolerance of {tolerance:g} %"
    if decides.size:
        reach = f"{decides[0]:.2g} to {decides[-1]:.2g} mm deep"
        caption = f"Heights can be judged by a tolerance of {tolerance:g} % from {reach}"
    caption += (
        f"; diameters are known within {across.max():.2g} %. A poor fit of an object adds to it."
    )
    marks: list[Mark] = [Level(tolerance, f"tolerance {tolerance:g} %")]
    # The names are above all curves, which do not strike them through.
    line = TEXT_SHARE * max(height.max(), across.max(), tolerance)
    free = float(max(height[-1], across[-1]))
    roles: dict[str, Role] = {"height": "accent", "diameter": "green"}
    curves = zip(roles.items(), (height, across), strict=True)
    for (name, role), values in sorted(curves, key=lambda curve: float(curve[1][-1])):
        marks += Line(DEPTHS_MM, values, role), Label(DEPTHS_MM[-1], free, name, role, True)
        free += line
    title = "Expected uncertainty of {}s of {:g} to {:g} mm, k = 2 (%)".format(shape, *SIZES_MM)
    return ResultPicture("uncertainty", title, caption, ("depth (mm)", "%"), tuple(marks))


def _plan(
    names: Sequence[str],
    rings: Sequence[tuple[float, float, float]],
    more: Sequence[Mark] = (),
    about: str = "",
) -> ResultPicture:
    """Return the contacts from above, with what else is known of the sensor."""
    marks: list[Mark] = list(more)
    placed = [(mark.x, mark.y) for mark in marks if isinstance(mark, Label)]
    middles = [(x, y) for x, y, _ in rings]
    apart_mm = TEXT_SHARE * max((abs(y) for _, y in (*placed, *middles)), default=0.0)
    for name, (x, y, radius) in zip(names, rings, strict=True):
        ring = _ring(x, y, radius * np.eye(2), "accent")
        marks.append(ring)
        if len(rings) <= MOST_NAMES:
            # In the middle, or on the rim where another name is there.
            places = [(x, y), *zip(ring.x[::6].tolist(), ring.y[::6].tolist(), strict=True)]
            gaps = [min([apart_mm, *(math.dist(at, p) for p in placed)]) for at in places]
            placed.append(places[int(np.argmax(gaps))])
            marks.append(Label(*placed[-1], PurePath(name).stem.removeprefix("ball_"), "accent"))
    title, caption = "Where the sensor was measured (mm)", f"Circles: ball presses. {about}"
    return ResultPicture("plan", title, caption.rstrip(), ("", ""), tuple(marks))


def _ring(x: float, y: float, axes: Float64Array, role: Role) -> Line:
    """Return an ellipse by its half axes, the columns of a matrix (2, 2)."""
    angle = np.linspace(0.0, 2.0 * np.pi, 49)
    points = axes @ np.stack([np.cos(angle), np.sin(angle)])
    return Line(x + points[0], y + points[1], role)


def _leds(data: OpenSensor) -> tuple[tuple[Mark, ...], float]:
    """Return the LEDs with their uncertainty, and how many times larger this is drawn."""
    full = data.full
    if full is None:
        return (), 1.0
    sd_mm = COVERAGE * full.led_sd_mm[:, :2]
    factor = max(float(f"{ELLIPSE_MM / max(float(sd_mm.max()), 1e-9):.0e}"), 1.0)
    marks: list[Mark] = []
    places = full.led_positions_mm[:, :2].tolist()
    for (x, y), sd, role in zip(places, sd_mm, LED_ROLES, strict=True):
        marks.append(_ring(x, y, np.diag(factor * sd), role))
        text = f"\N{PLUS-MINUS SIGN}{1e3 * sd.max():.0f} \N{MICRO SIGN}m"
        marks.append(Label(x, y + math.copysign(2.5 * ELLIPSE_MM, y), text, role))
    return tuple(marks), factor


def _boards(run: CalibrationRun) -> Iterator[Line]:
    """Return the outline of the corners of each board on the top surface."""
    camera, top = run.results[LENS].camera, run.results[TOP_POSE].pose
    for view in top.views:
        if not view.used or view.board is None:
            continue
        columns = view.board.board.inner_corners[0]
        at = np.array([0, columns - 1, -1, -columns, 0])
        rays = camera.directions(view.board.corners_px[at])
        along = rays @ np.array(top.plane.normal_camera)
        points = rays * (top.plane.distance_mm / along)[:, None]
        x, y, _ = top.plane.to_sensor(points).T
        yield Line(x, y, "muted")


def _left(data: OpenSensor, left: Float32Array, step: int) -> ResultPicture:
    """Return the map of the light that no surface explains where balls were pressed."""
    grid, percent = data.table.grid, 100.0 * left
    seen = percent[np.isfinite(percent)]
    reach = max(float(np.percentile(np.abs(seen), 99.0)), 0.1) if seen.size else 1.0
    node_mm, half = step * grid.pitch_mm, 0.5 * grid.pitch_mm
    x, y = float(grid.x_mm[0]) - half, float(grid.y_mm[0]) - half
    edges = x, x + node_mm * percent.shape[1], y, y + node_mm * percent.shape[0]
    rms = float(np.sqrt(np.mean(seen**2))) if seen.size else 0.0
    caption = f"Of the untouched membrane's light, where balls were pressed; {rms:.2g} % (rms)."
    title = "Light that the model does not explain (%)"
    return ResultPicture("left", title, caption, ("", ""), (Field(percent, edges, reach),))
