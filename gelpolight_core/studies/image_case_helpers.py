"""Shared parts of the cases on whole images: one sensor, every mode, and their notes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import BoolArray, Float64Array
from gelpolight_core.base.finding import Verdict
from gelpolight_core.geometry.drape import TYPICAL_DECAY_MM
from gelpolight_core.lab.depth_score import TrueDepth, scored_radius_mm
from gelpolight_core.light.directions import direction_condition
from gelpolight_core.measurement.size_uncertainty import BALL_SLOPE, mode_error
from gelpolight_core.reconstruction.height_map import FLAG_NAMES, Flag, HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.simulation.indenters import BallIndenter

from .exact_sensor import ExactPress, ExactSensor, known_sensor, matt_design
from .stability import MODES, CaseMeasurement, ModeResult

SCALE = 0.25
MOST_OWN_SHARE = 0.1
BALL = BallIndenter(4.0, 1.0)
BALL_AT_MM = (1.2, -0.8)


@lru_cache(maxsize=1)
def standard_sensor() -> ExactSensor:
    """Return the sensor of all cases on images, at a quarter of the default's size."""
    return known_sensor(matt_design(SCALE))


@lru_cache(maxsize=1)
def standard_press() -> ExactPress:
    """Return a ball of 4 mm radius, 1 mm deep, in the standard sensor."""
    return standard_sensor().pressed(BALL, x_mm=BALL_AT_MM[0], y_mm=BALL_AT_MM[1])


def solvers_of(calibration: Calibration) -> dict[str, Reconstructor]:
    """Return the reconstructor of each of `MODES` that a calibration has."""
    paper = {"paper": Reconstructor(calibration, model="paper")}
    if calibration.open_sensor.full is None:
        return paper
    full = Reconstructor(calibration, model="full")
    return {mode: full.at_effort(mode) for mode in MODES if mode not in paper} | paper


def is_finite(height_map: HeightMap) -> bool:
    """Return whether depth and normals are all finite."""
    assert height_map.normals is not None
    return bool(np.isfinite(height_map.depth_mm).all() and np.isfinite(height_map.normals).all())


def flag_shares(height_map: HeightMap) -> str:
    """Return the percentage of the visible nodes with each flag that occurs."""
    visible = height_map.flags[~flagged(height_map, Flag.OUTSIDE)]
    counts = {name: np.count_nonzero(visible & bit) for name, bit in FLAG_NAMES.items()}
    return ", ".join(f"{n} {100 * c / visible.size:.2g} %" for n, c in counts.items() if c)


def flagged(height_map: HeightMap, flag: Flag) -> BoolArray:
    """Return the nodes with a flag."""
    return np.asarray((height_map.flags & int(flag)) != 0)


def truth_at(truth: TrueDepth, height_map: HeightMap) -> Float64Array:
    """Return true depth, d(depth)/dx and d(depth)/dy (rows, columns, 3) at the nodes of a map."""
    pitch = float(truth.x_mm[1] - truth.x_mm[0])
    down, across = np.gradient(truth.depth_mm, pitch)
    column = ((height_map.x_mm - truth.x_mm[0]) / pitch).astype(np.float32)
    row = ((height_map.y_mm - truth.y_mm[0]) / pitch).astype(np.float32)
    maps = np.stack([truth.depth_mm, across, down], axis=-1)
    x, y = np.meshgrid(column, row)
    return np.asarray(cv2.remap(maps, x, y, cv2.INTER_LINEAR), np.float64)


def depth_error(
    result: HeightMap,
    truth: TrueDepth,
    *,
    radius_mm: float,
    spare: BoolArray | None = None,
) -> Float64Array:
    """Return found minus true depth, mm, at the compared nodes inside a radius."""
    compared = np.hypot(*np.meshgrid(result.x_mm, result.y_mm)) < radius_mm
    compared &= ~flagged(result, Flag.OUTSIDE)
    if spare is not None:
        compared &= ~spare
    return np.asarray((result.depth_mm - truth_at(truth, result)[..., 0])[compared], np.float64)


def rms_um(error_mm: Float64Array) -> float:
    """Return the root mean square in um."""
    return float(1e3 * np.sqrt(np.mean(error_mm**2))) if error_mm.size else float("nan")


def measure_all_modes(
    known: ExactSensor,
    press: ExactPress,
    bound_um: float,
    *,
    frame: NDArray[Any] | None = None,
    spare: BoolArray | None = None,
    needs: Sequence[Flag] = (),
    radius_mm: float | None = None,
) -> CaseMeasurement:
    """Reconstruct in every mode and compare with the truth.

    Parameters
    ----------
    known, press
        The sensor, and the object pressed into it.
    bound_um : float
        Largest accepted error of the best mode (root mean square). The others may exceed it by
        their own error (:func:`own_share`).
    frame : array, optional
        Image instead of that of the press.
    spare : (rows, columns) bool, optional
        Nodes that are not compared, because their depth cannot be known.
    needs : sequence of Flag, optional
        Flags that each mode must raise somewhere.
    radius_mm : float, optional
        Radius of the compared area; by default that of the working circle without its edge.
    """
    calibration = known.calibration
    radius = radius_mm or scored_radius_mm(calibration.open_sensor.sensor)
    peak_mm = float(press.truth.depth_mm.max())
    image = press.frame if frame is None else frame
    maps = {name: solver.depth(image) for name, solver in solvers_of(calibration).items()}
    modes = []
    for name, height_map in maps.items():
        error = rms_um(depth_error(height_map, press.truth, radius_mm=radius, spare=spare))
        bound = bound_um + (0.0 if name == "best" else 1e3 * peak_mm * own_share(height_map))
        missing = [str(flag.name) for flag in needs if not flagged(height_map, flag).any()]
        raised = [f"flagged: {', '.join(str(f.name) for f in needs)}"] if needs else []
        sound = is_finite(height_map) and not missing
        warning = "; ".join([*warnings_of(height_map), *raised]) if sound else ""
        modes.append(ModeResult(name, sound and error <= bound, error, bound, warning))
    summary = f"{modes[0].error_um:.1f} um RMS on a press of {peak_mm:.2f} mm"
    points = calibration.table.grid.points_mm()[calibration.table.valid][::97]
    assert calibration.open_sensor.full is not None
    condition = direction_condition(calibration.open_sensor.full.led_positions_mm, points)
    return CaseMeasurement(summary, tuple(modes), flag_shares(maps["best"]), condition)


def own_share(height_map: HeightMap) -> float:
    """Return the additional error that a mode may have, as a share of the largest depth.

    Coarse nodes and the lights of the flat membrane cause errors even with an exact calibration.
    These are part of the stated standard deviation. Above `MOST_OWN_SHARE`, the map must have a
    note.
    """
    share = mode_error(height_map).depth_share(BALL_SLOPE, TYPICAL_DECAY_MM)
    return min(share, MOST_OWN_SHARE)


def warnings_of(height_map: HeightMap) -> tuple[str, ...]:
    """Return the texts of the findings that report an unreliable depth."""
    corrected = () if height_map.health is None else height_map.health.findings
    return tuple(
        finding.text
        for finding in height_map.findings
        if finding.doubtful or (finding.verdict is not Verdict.PASS and finding not in corrected)
    )
