"""Shared parts of the cases on whole images: one sensor, both models, and their notes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.design_check.known_sensor import (
    KnownPress,
    KnownSensor,
    known_sensor,
    matt_design,
)
from gelpolight_core.experiments.stability import ModeSeen, Seen
from gelpolight_core.lights.positions import direction_condition
from gelpolight_core.measurement.indenter_tools import mode_error
from gelpolight_core.measurement.score import TrueDepth, scored_radius_mm
from gelpolight_core.measurement.spread import BALL_SLOPE
from gelpolight_core.reconstruction.checks import accepted, free_boundary_note
from gelpolight_core.reconstruction.height_map import FLAG_NAMES, Flag, HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.sensor_calibration import MODELS, Calibration
from gelpolight_core.simulation.indenters import Ball
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
SCALE = 0.25
MOST_OWN_SHARE = 0.1
BALL = Ball(4.0, 1.0)
BALL_AT_MM = (1.2, -0.8)


@lru_cache(maxsize=1)
def standard_sensor() -> KnownSensor:
    """Return the sensor of all cases on images, at a quarter of the default's size."""
    return known_sensor(matt_design(SCALE))


@lru_cache(maxsize=1)
def standard_press() -> KnownPress:
    """Return a ball of 4 mm radius, 1 mm deep, in the standard sensor."""
    x_mm, y_mm = BALL_AT_MM
    return standard_sensor().pressed(BALL, x_mm=x_mm, y_mm=y_mm)


def maps_of(known: KnownSensor, frame: NDArray[Any]) -> dict[str, HeightMap]:
    """Return the height maps of a frame by both models."""
    return {m: Reconstructor(known.calibration, model=m).depth(frame) for m in MODELS}


def is_finite(found: HeightMap) -> bool:
    """Return whether depth and normals are all finite."""
    normals = found.normals
    return bool(
        np.isfinite(found.depth_mm).all() and (normals is None or np.isfinite(normals).all())
    )


def flag_shares(found: HeightMap) -> tuple[tuple[str, float], ...]:
    """Return the percentage of the visible nodes with each flag that occurs."""
    seen = (found.flags & int(Flag.OUTSIDE)) == 0
    count = max(int(seen.sum()), 1)
    shares = [
        (name, 100.0 * float(np.count_nonzero(seen & ((found.flags & bit) != 0))) / count)
        for name, bit in FLAG_NAMES.items()
        if bit != int(Flag.OUTSIDE)
    ]
    return tuple((name, share) for name, share in shares if share > 0.0)


def flagged(found: HeightMap, flag: Flag) -> NDArray[np.bool_]:
    """Return the nodes with a flag."""
    return np.asarray((found.flags & int(flag)) != 0)


def depth_error(
    found: HeightMap, truth: TrueDepth, *, radius_mm: float, spare: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """Return found minus true depth, mm, at the compared nodes inside a radius."""
    step = truth.x_mm[1] - truth.x_mm[0]
    column = np.asarray((found.x_mm - truth.x_mm[0]) / step, np.float32)
    row = np.asarray((found.y_mm - truth.y_mm[0]) / step, np.float32)
    true = cv2.remap(
        truth.depth_mm, *np.meshgrid(column, row), cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT
    )
    x, y = np.meshgrid(found.x_mm, found.y_mm)
    counts = np.hypot(x, y) < radius_mm
    counts &= ~flagged(found, Flag.OUTSIDE)
    if spare is not None:
        counts &= ~spare
    return np.asarray(found.depth_mm[counts] - true[counts], np.float64)


def rms_um(error_mm: NDArray[np.float64]) -> float:
    """Return the root mean square in um."""
    return float(1e3 * np.sqrt(np.mean(error_mm**2))) if error_mm.size else float("nan")


def condition_of(calibration: Calibration) -> float:
    """Return the largest condition number of the light directions on the seen membrane."""
    table = calibration.table
    points = table.grid.points_mm()[table.valid][::97]
    leds = calibration.led_positions_mm if calibration.full is None else None
    if calibration.full is not None:
        leds = calibration.full.led_positions_mm
    assert leds is not None
    return direction_condition(leds, points)


def rounds_of(reconstructor: Reconstructor, frame: NDArray[Any]) -> int:
    """Return how many near-light rounds a frame needed, the last one at full scale."""
    rounds = reconstructor.near_light.depth(accepted(frame, name=""), normals=False).rounds
    return 0 if rounds is None else len(rounds.changes_mm) + 1


def judged(
    known: KnownSensor,
    press: KnownPress,
    bound_um: float,
    *,
    frame: NDArray[Any] | None = None,
    spare: NDArray[np.bool_] | None = None,
    needs: Sequence[Flag] = (),
    models: Sequence[str] = MODELS,
    radius_mm: float | None = None,
) -> Seen:
    """Reconstruct by the models and compare with the truth.

    Parameters
    ----------
    known, press
        The sensor, and what is pressed into it.
    bound_um : float
        Largest accepted error of the full model (root mean square).
    frame : array, optional
        Image instead of that of the press.
    spare : (rows, columns) bool, optional
        Nodes that are not compared, because their depth cannot be known.
    needs : sequence of Flag, optional
        Flags that must be raised somewhere by every model.
    models : sequence of str, optional
        The full one is run at each effort. Efforts and the paper's model may exceed the bound by
        their own error (:func:`own_share`).
    radius_mm : float, optional
        Of the compared area; by default the working circle without its edge.
    """
    image = press.frame if frame is None else frame
    calibration = known.calibration
    radius = radius_mm or scored_radius_mm(calibration.sensor)
    by = {m: Reconstructor(calibration, model=m) for m in models}
    found = {m: reconstructor.depth(image) for m, reconstructor in by.items()}
    best = found["full"] if "full" in found else found[models[0]]
    maps = {"best" if m == "full" else m: h for m, h in found.items()}
    if "full" in found:
        others = [effort for effort in EFFORTS if effort != "best"]
        maps |= {effort: by["full"].at_effort(effort).depth(image) for effort in others}

    def error_of(heightmap: HeightMap) -> float:
        return rms_um(depth_error(heightmap, press.truth, radius_mm=radius, spare=spare))

    peak_um = 1e3 * float(press.truth.depth_mm.max())
    modes = tuple(
        ModeSeen(
            mode,
            error_of(heightmap),
            bound_um + (0.0 if mode == "best" else own_share(heightmap) * peak_um),
            "; ".join([*warnings_of(heightmap), *_raised(heightmap, needs)]),
        )
        for mode, heightmap in maps.items()
    )
    error = error_of(best)
    missing = [str(f.name) for f in needs for h in found.values() if not flagged(h, f).any()]
    summary = tr("{e:.1f} um RMS on a press of {h:.2f} mm").format(
        e=error, h=float(press.truth.depth_mm.max())
    )
    if missing:
        summary += "; " + tr("not flagged: {flags}").format(flags=", ".join(missing))
    return Seen(
        right=not missing,
        summary=summary,
        finite=all(is_finite(h) for h in maps.values()),
        error_um=error,
        bound_um=bound_um,
        flags=flag_shares(best),
        condition=condition_of(calibration),
        rounds=rounds_of(by["full"], image) if "full" in found else None,
        # A note counts only for the mode that gives it.
        warning="",
        modes=modes,
    )


def _raised(heightmap: HeightMap, needs: Sequence[Flag]) -> list[str]:
    """Return the flags of a damaged area, if a case requires them and all are set."""
    if not needs or not all(flagged(heightmap, flag).any() for flag in needs):
        return []
    return [tr("flagged: {flags}").format(flags=", ".join(str(flag.name) for flag in needs))]


def own_share(heightmap: HeightMap) -> float:
    """Return the additional error that a mode may have, as a share of the largest depth.

    Coarse nodes and the lights of the flat membrane cause errors even with an exact calibration.
    These are part of the stated standard deviation. Above `MOST_OWN_SHARE`, the map must have a
    note.
    """
    own = mode_error(heightmap)
    return min(math.hypot(own.depth, own.depth_per_slope * BALL_SLOPE), MOST_OWN_SHARE)


def warnings_of(found: HeightMap) -> tuple[str, ...]:
    """Return the notes of a map that report an unreliable depth."""
    harmless = {free_boundary_note().text}
    if found.health is not None:
        harmless |= {finding.line for finding in found.health.findings if finding.corrected}
    return tuple(note for note in found.notes if note not in harmless)
