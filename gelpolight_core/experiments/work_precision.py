"""Error against run time: what each method costs and how true it is, at several picture sizes.

Errors are against a truth that no method knows: the virtual sensor's own surface, or a rendered
session's. All methods of a size take their turn within each round, so that a slow spell of the
machine meets all alike. A method that breaks off or refuses leaves a gap.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.pipeline import assemble, stages_of
from gelpolight_core.calibration.refinement import bare_calibration, refine_with
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.calibration.stages import run_stage
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.ablation import RIM_MM
from gelpolight_core.experiments.methods import Method, Scene, Slopes, Solve
from gelpolight_core.measurement.score import (
    DepthScore,
    TrueDepth,
    read_true_depth,
    score_depth,
)
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.optics.resampling import MembraneGrid
from gelpolight_core.session.session import Session, read_picture
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]
LEAST_REPEATS = 15
WARM_UP = 2
CALIBRATING = 0.4
TOUCHED_MM = 0.02
WORTH = 0.01


@dataclass(frozen=True, slots=True)
class Point:
    """One method at one picture size.

    Attributes
    ----------
    sensor, method, label, family : str
        What was measured.
    megapixels : float
        Of the picture.
    pitch_mm : float
        Of the grid.
    median_ms, p95_ms : float or None
        Of a frame, after warm-up; None for a gap.
    rms_um, normal_deg, height_percent, size_percent : float or None
        Mean absolute errors over the presses: depth (RMS), direction of the normal where the
        membrane is pressed (RMS), plateau height, size at half height.
    gap : str
        Why there is nothing; empty where there is something.
    """

    sensor: str
    method: str
    label: str
    family: str
    megapixels: float
    pitch_mm: float
    median_ms: float | None
    p95_ms: float | None
    rms_um: float | None
    normal_deg: float | None
    height_percent: float | None
    size_percent: float | None
    gap: str = ""


@dataclass(frozen=True, slots=True)
class _Press:
    frame: NDArray[Any]
    truth: TrueDepth
    height_mm: float


@dataclass(slots=True)
class _Run:
    """A method at work on one sensor."""

    method: Method
    solve: Solve | None
    gap: str = ""
    times_ms: list[float] = field(default_factory=list)
    scores: list[DepthScore] = field(default_factory=list)
    angles_deg: list[float] = field(default_factory=list)


def measure_session(
    session: Session,
    methods: Sequence[Method],
    *,
    repeats: int = LEAST_REPEATS,
    presses: Sequence[str] = (),
    progress: Progress | None = None,
) -> tuple[Point, ...]:
    """Calibrate a session, and measure every method on its presses.

    Parameters
    ----------
    session : Session
        With ``presses/truth.csv`` and ``truth/*.npz``.
    methods : sequence of Method
        From :func:`~gelpolight_core.experiments.methods.methods`.
    repeats : int, optional
        Timed rounds, after `WARM_UP` that are not counted.
    presses : sequence of str, optional
        Only these files.
    progress : callable, optional
        Told what is being done and the share done.

    Raises
    ------
    InputError
        If the session cannot be calibrated, or a press has no picture or no truth.
    """
    tell = progress or (lambda _what, _share: None)
    scene, linear = calibrated_scene(session, tell)
    return measure_scene(
        scene, linear, methods, repeats=repeats, presses=presses, progress=progress
    )


def measure_scene(
    scene: Scene,
    session: Session,
    methods: Sequence[Method],
    *,
    repeats: int = LEAST_REPEATS,
    presses: Sequence[str] = (),
    progress: Progress | None = None,
) -> tuple[Point, ...]:
    """Measure every method on the presses of a session that is calibrated.

    Parameters
    ----------
    scene : Scene
        The session's calibrations.
    session, methods, repeats, presses, progress
        As for :func:`measure_session`; what bends the camera's numbers is known to the session.

    Raises
    ------
    InputError
        If a press has no picture or no truth.
    """
    tell = progress or (lambda _what, _share: None)
    shown = _presses(session, presses)
    runs = [_ready(method, scene) for method in methods]
    grid = scene.full.table.grid
    radius_mm = 0.5 * session.sensor.working_diameter_mm - RIM_MM
    for run in runs:
        tell(run.method.label, CALIBRATING)
        _score_all(run, shown, grid, radius_mm)
    for round_ in range(WARM_UP + repeats):
        share = CALIBRATING + (1.0 - CALIBRATING) * round_ / (WARM_UP + repeats)
        tell(tr("round {n}").format(n=round_ + 1), share)
        for run in runs:
            taken = _timed(run, shown[0].frame)
            if taken is not None and round_ >= WARM_UP:
                run.times_ms.append(taken)
    tell("", 1.0)
    camera = scene.full.camera
    size = camera.width * camera.height / 1e6
    name = session.folder.resolve().name
    return tuple(_point(run, name, size, grid.pitch_mm) for run in runs)


def scene_of(calibration: Calibration) -> Scene:
    """Return a calibration as a scene; methods that need the stages' results are gaps in it."""
    return Scene(StageResults(), calibration, calibration)


def calibrated_scene(session: Session, tell: Progress) -> tuple[Scene, Session]:
    """Return a session's calibrations, and the session with what undoes the camera's response."""
    results, stages = StageResults(), stages_of("paper")
    for number, stage in enumerate(stages):
        tell(stage.value, CALIBRATING * number / (len(stages) + 2))
        results = run_stage(stage, session, results)
    tell(Stage.JOINT.value, CALIBRATING * len(stages) / (len(stages) + 2))
    paper = assemble(session, results, model="paper").calibration
    full = bare_calibration(session, refine_with(results))
    seen = results.response
    linear = session if seen is None else replace(session, response=seen.response)
    return Scene(results, paper, full), linear


def _presses(session: Session, names: Sequence[str]) -> list[_Press]:
    """Read the presses as the camera's own numbers where they are linear."""
    folder = session.folder / "presses"
    rows = read_truth(folder / "truth.csv").rows
    found = []
    for row in rows:
        if names and row.file not in names:
            continue
        truth = read_true_depth((session.folder / "truth" / row.file).with_suffix(".npz"))
        picture = read_picture(folder / row.file, response=session.response)
        frame = np.rint(255.0 * picture.rgb).astype(np.uint8)
        if not np.allclose(frame / np.float32(255.0), picture.rgb, atol=1e-4):
            frame = picture.rgb  # 16 bit, or bent: what is linear is kept as it is
        found.append(_Press(frame, truth, row.truth.height_mm))
    if not found:
        raise InputError(
            tr("none of the presses is there"),
            where=str(folder / "truth.csv"),
            advice=tr("Name presses of this file"),
        )
    return found


def _ready(method: Method, scene: Scene) -> _Run:
    try:
        return _Run(method, method.make(scene))
    except InputError as error:
        return _Run(method, None, str(error))


def _timed(run: _Run, frame: NDArray[Any]) -> float | None:
    if run.solve is None:
        return None
    begin = time.perf_counter()
    run.solve(frame)
    return 1e3 * (time.perf_counter() - begin)


def _score_all(run: _Run, presses: Sequence[_Press], grid: MembraneGrid, radius_mm: float) -> None:
    """Score a method on all presses; what it refuses makes it a gap."""
    for press in presses:
        if run.solve is None:
            return
        try:
            depth, slopes = run.solve(press.frame)
            score = score_depth(
                np.asarray(depth, np.float32),
                grid.x_mm,
                grid.y_mm,
                press.truth,
                height_mm=press.height_mm,
                radius_mm=radius_mm,
            )
        except (InputError, ValueError) as error:
            run.solve, run.gap = None, str(error)
            return
        run.scores.append(score)
        run.angles_deg.append(normal_error_deg(slopes, grid, press.truth, radius_mm))


def normal_error_deg(
    slopes: Slopes, grid: MembraneGrid, truth: TrueDepth, radius_mm: float
) -> float:
    """Return the root mean square angle between found and true normals, where pressed.

    Parameters
    ----------
    slopes : two (rows, columns)
        Found d(depth)/dx and d(depth)/dy on the grid.
    grid : MembraneGrid
        Their nodes.
    truth : TrueDepth
        What was pressed; only nodes deeper than `TOUCHED_MM` count.
    radius_mm : float
        Only nodes within it count.
    """
    pitch = float(truth.x_mm[1] - truth.x_mm[0])
    down, across = (np.asarray(g) for g in np.gradient(truth.depth_mm, pitch))
    x, y = np.meshgrid(grid.x_mm, grid.y_mm)
    column = ((x - truth.x_mm[0]) / pitch).astype(np.float32)
    row = ((y - truth.y_mm[0]) / pitch).astype(np.float32)
    true = np.stack([truth.depth_mm, across, down], axis=-1)
    seen = cv2.remap(true, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    depth, true_x, true_y = (np.asarray(seen[..., k], np.float64) for k in range(3))
    counts = (depth > TOUCHED_MM) & (np.hypot(x, y) < radius_mm)
    found_x, found_y = (np.asarray(s, np.float64)[counts] for s in slopes)
    tx, ty = true_x[counts], true_y[counts]
    cosine = (found_x * tx + found_y * ty + 1.0) / np.sqrt(
        (found_x**2 + found_y**2 + 1.0) * (tx**2 + ty**2 + 1.0)
    )
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return float(np.sqrt(np.mean(angle**2))) if angle.size else math.nan


def _point(run: _Run, sensor: str, megapixels: float, pitch_mm: float) -> Point:
    method = run.method
    common = (sensor, method.name, method.label, method.family, megapixels, pitch_mm)
    if run.solve is None:
        return Point(*common, None, None, None, None, None, None, run.gap)
    errors = np.abs([(s.rms_um, s.height_percent, s.size_percent) for s in run.scores])
    rms, height, size = errors.mean(axis=0).tolist()
    return Point(
        *common,
        float(np.median(run.times_ms)),
        float(np.percentile(run.times_ms, 95)),
        rms,
        float(np.mean(run.angles_deg)),
        height,
        size,
    )


def measured(point: Point) -> tuple[float, float]:
    """Return time (ms) and depth error (um) of a point that is no gap."""
    assert point.median_ms is not None and point.rms_um is not None
    return point.median_ms, point.rms_um


def pareto_front(points: Sequence[Point]) -> tuple[Point, ...]:
    """Return the points that nothing beats in both time and depth error, fastest first.

    A slower point has to be better by `WORTH`: smaller differences are the noise's.
    """
    known = sorted(
        (p for p in points if p.median_ms is not None and p.rms_um is not None),
        key=measured,
    )
    front: list[Point] = []
    for point in known:
        if not front or measured(point)[1] < (1.0 - WORTH) * measured(front[-1])[1]:
            front.append(point)
    return tuple(front)


def observed_order(points: Sequence[Point]) -> float | None:
    """Return how the depth's error falls with the pitch: the exponent of a line through log-log.

    None where a method has fewer than two sizes.
    """
    known = [p for p in points if p.rms_um is not None and p.rms_um > 0.0]
    if len({p.pitch_mm for p in known}) < 2:
        return None
    pitch = np.log([p.pitch_mm for p in known])
    return float(np.polyfit(pitch, np.log([p.rms_um or 0.0 for p in known]), 1)[0])


def session_folder_name(scale: float) -> str:
    """Return the folder of the virtual sensor's session at a picture scale."""
    return f"virtual-sensor-{scale:g}"


def is_session(folder: Path) -> bool:
    """Return whether a session was written whole in a folder."""
    return (folder / "truth.json").is_file() and (folder / "session.toml").is_file()
