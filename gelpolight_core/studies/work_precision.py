"""Error against run time of each mode, on presses with a known truth.

Errors are differences from the true depth, which no mode uses. The virtual sensor's presses are
drawn by the seed, so that no mode was tuned on them. Every press is reconstructed by all modes in
turn, so that a slow phase of the machine affects all. Curves change one parameter of the most
accurate mode, such as its number of rounds.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import pairwise, starmap
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.special import stdtrit

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.atomic_write import write_files
from gelpolight_core.base.csv_table import csv_from_dicts
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.version import __version__
from gelpolight_core.calibration.project import run_calibration
from gelpolight_core.lab.depth_score import (
    EDGE_MM,
    TrueDepth,
    read_true_depth,
    score_depth,
    scored_radius_mm,
)
from gelpolight_core.lab.reference_press import read_truth
from gelpolight_core.output.drawing_thread import Figure
from gelpolight_core.output.report.drawing_tools import png
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.modes import Mode
from gelpolight_core.reconstruction.near_light.effort_parameters import SETTINGS
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.session import read_session
from gelpolight_core.session.session_images import read_raw_image
from gelpolight_core.simulation.design_parts import PressDesign
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import simulate_session

from .image_case_helpers import solvers_of, truth_at

StageProgressCallback = Callable[[str, float], None]
WIDTHS = (320, 640, 1280)
"""Widths of the virtual sensor's images in pixels."""
REPEATS = 2
PRESSES = 8
SIZES, DEPTHS = (0.25, 0.6), (0.03, 0.11)
"""Ranges of new presses, over the radius of the compared area: gentle to steep walls."""
CURVES: dict[str, tuple[float, ...]] = {
    "most_rounds": (1, 2, 3, 4, 6),
    "steps": (1, 2, 4, 8),
    "tolerance": (1e-1, 1e-2, 1e-3, 1e-4),
}
"""Values of each parameter of `Settings` that has a curve."""
CONFIDENCE = 0.95
FLAT_TOPPED = ("cylinder", "cuboid")
ERRORS = ("rms_um", "normal_deg", "height_percent", "size_percent")
TOUCHED_MM = 0.02
"""Normals count where the membrane is deeper than this."""
WORTH = 0.01
"""A slower mode must be better by this share to be on the front: smaller differences are noise."""


@dataclass(frozen=True, slots=True)
class WorkPrecisionPoint:
    """Time and errors of one mode at one image width.

    Attributes
    ----------
    sensor, mode, label : str
        Serial, name of the mode, and the mode for people.
    width : int
        Width of the image in pixels.
    pitch_mm : float
        Pitch of the grid.
    presses : int
        Number of presses.
    median_ms, p95_ms : float
        Time of a frame: median and 95th percentile over all presses.
    rms_um, normal_deg, height_percent, size_percent : float
        Mean absolute errors over the presses: depth (RMS), direction of the normal where the
        membrane is pressed (RMS), plateau height, size at half height.
    within : tuple of 4 floats
        Half widths of the intervals that hold these means with a confidence of 95 %, by Student's t
        over the presses; NaN for a single press.
    curve : str
        The parameter that is changed, for a point on a curve; empty for a mode.
    version : str
        Version of the program.
    """

    sensor: str
    mode: str
    label: str
    width: int
    pitch_mm: float
    presses: int
    median_ms: float
    p95_ms: float
    rms_um: float
    normal_deg: float
    height_percent: float
    size_percent: float
    within: tuple[float, ...] = (np.nan,) * 4
    curve: str = ""
    version: str = __version__


def new_presses(design: SensorDesign, seed: int, count: int = PRESSES) -> tuple[PressDesign, ...]:
    """Return cylinders and cuboids in turn, drawn by a seed, inside the compared area."""
    random = np.random.default_rng([41, seed])
    radius_mm = 0.5 * design.membrane.working_diameter_mm - EDGE_MM
    presses = []
    for shape in (FLAT_TOPPED * count)[:count]:
        size, depth = (radius_mm * random.uniform(*limits) for limits in (SIZES, DEPTHS))
        # The corners of a cuboid and the drape stay inside, too.
        reach, yaw = radius_mm - size / np.sqrt(2.0) - 2.0 * depth, random.uniform(-45.0, 45.0)
        place = np.sqrt(random.uniform()) * reach * np.exp(2j * np.pi * random.uniform())
        presses.append(PressDesign(shape, size, depth, float(place.real), float(place.imag), yaw))
    return tuple(presses)


def measure_virtual(
    design: SensorDesign,
    calibration: Calibration | None = None,
    *,
    widths: Sequence[int] = WIDTHS,
    repeats: int = REPEATS,
    seed: int = 0,
    curves: bool = False,
    progress: StageProgressCallback = lambda _what, _share: None,
) -> tuple[WorkPrecisionPoint, ...]:
    """Measure the modes on `new_presses` of the virtual sensor.

    Parameters
    ----------
    design : SensorDesign
        The sensor; its own presses are not used.
    calibration : Calibration, optional
        Calibration of the virtual sensor, at any image size; by default from a rendered
        session, at each of `widths`.
    widths : sequence of int, optional
        Widths of the images in pixels; with a calibration, its own.
    repeats, seed : int, optional
        How often each press is timed; seed of the presses and of the virtual sensor.
    curves : bool, optional
        Whether `CURVES` are measured, too.
    progress : callable, optional
        Called with the present task and the share done; its exceptions stop the work.

    Raises
    ------
    InputError
        If the calibration is of another sensor.
    """
    if calibration is not None:
        _refuse_other(design.serial, calibration, "virtual sensor")
        widths = (calibration.camera.width,)
    design = replace(design, presses=new_presses(design, seed))
    points: list[WorkPrecisionPoint] = []
    for number, width in enumerate(widths):
        ends = [(number + share) / len(widths) for share in (0.0, 0.3, 0.6, 1.0)]
        rendering, calibrating, measuring = starmap(partial(_phase, progress), pairwise(ends))
        with TemporaryDirectory(prefix="gelpolight-") as temporary:
            folder, scale = Path(temporary) / "session", width / design.camera.width_px
            simulate_session(
                design,
                folder,
                seed=seed,
                scale=scale,
                presses_only=calibration is not None,
                progress=rendering,
            )
            fitted = calibration
            if fitted is None:
                fitted = run_calibration(read_session(folder), progress=calibrating).calibration
            points += measure_session(
                folder, fitted, repeats=repeats, curves=curves, progress=measuring
            )
    return tuple(points)


def _phase(progress: StageProgressCallback, begin: float, end: float) -> StageProgressCallback:
    """Return the progress of a part of the work."""
    return lambda what, share: progress(what, begin + (end - begin) * share)


def measure_session(
    folder: Path,
    calibration: Calibration,
    *,
    repeats: int = REPEATS,
    curves: bool = False,
    progress: StageProgressCallback = lambda _what, _share: None,
) -> tuple[WorkPrecisionPoint, ...]:
    """Measure the modes with a calibration on the presses of a session folder with truth.

    Parameters
    ----------
    folder : Path
        With ``presses/truth.csv`` and ``truth/*.npz``; cylinders and cuboids count.
    calibration : Calibration
        Calibration of the session's sensor.
    repeats : int, optional
        How often each press is timed, after a first run for the error.
    curves : bool, optional
        Whether `CURVES` are measured, too.
    progress : callable, optional
        Called with the present task and the share done; its exceptions stop the work.

    Raises
    ------
    InputError
        If the session is of another sensor, or its presses have no image or no truth.
    """
    _refuse_other(read_session(folder).sensor.serial, calibration, str(folder))
    rows = [row for row in read_truth(folder / "presses").rows if row.truth.shape in FLAT_TOPPED]
    if not rows:
        text = "No press of a cylinder or cuboid was found"
        raise InputError(text, folder / "presses" / "truth.csv", Remedy.CHOOSE_SESSION)
    solvers = dict(reversed(solvers_of(calibration).items()))
    labels = {name: (Mode(s.model, s.effort).label, "") for name, s in solvers.items()}
    if curves and EFFORTS[-1] in solvers:
        for curve, name, solver in curve_solvers(solvers[EFFORTS[-1]]):
            solvers[name], labels[name] = solver, (name, curve)
    radius_mm = scored_radius_mm(calibration.open_sensor.sensor)
    times_ms: dict[str, list[float]] = {name: [] for name in solvers}
    errors: dict[str, list[tuple[float, ...]]] = {name: [] for name in solvers}
    for number, row in enumerate(rows):
        progress(row.file, number / len(rows))
        frame = read_raw_image(folder / "presses" / row.file).rgb
        truth = read_true_depth((folder / "truth" / row.file).with_suffix(".npz"))
        for repeat in range(1 + repeats):
            for name, solver in solvers.items():
                begin = time.perf_counter()
                height_map = solver.depth(frame, name=row.file)
                if repeat:
                    times_ms[name].append(1e3 * (time.perf_counter() - begin))
                else:
                    errors[name].append(_errors(height_map, truth, row.truth.height_mm, radius_mm))
    progress("", 1.0)
    points = []
    common = calibration.camera.width, calibration.table.grid.pitch_mm, len(rows)
    for name, (label, curve) in labels.items():
        times = np.percentile(times_ms[name], [50.0, 95.0]).tolist()
        means, within = mean_within(np.abs(errors[name]))
        point = WorkPrecisionPoint(calibration.serial, name, label, *common, *times, *means)
        points.append(replace(point, within=within, curve=curve))
    return tuple(points)


def curve_solvers(best: Reconstructor) -> Iterator[tuple[str, str, Reconstructor]]:
    """Yield a parameter, the name of a point on its curve, and the reconstructor, of `CURVES`."""
    assert isinstance(best.solver, NearLightSolver)
    for parameter, values in CURVES.items():
        for value in values:
            changed = replace(SETTINGS[best.effort], **{parameter: value})  # type: ignore[arg-type]
            reconstructor = copy.copy(best)
            reconstructor.solver = best.solver.with_settings({**SETTINGS, best.effort: changed})
            yield parameter, f"{parameter} = {value:g}", reconstructor


def mean_within(errors: Float64Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return means (columns,) over rows, and the half widths of their intervals of `CONFIDENCE`."""
    count = len(errors)
    factor = stdtrit(count - 1, 0.5 + 0.5 * CONFIDENCE) / np.sqrt(count) if count > 1 else np.nan
    within = factor * errors.std(axis=0, ddof=min(count - 1, 1))
    return tuple(errors.mean(axis=0).tolist()), tuple(within.tolist())


def _refuse_other(serial: str, calibration: Calibration, where: str) -> None:
    if serial != calibration.serial:
        text = f"The presses are of {serial}, the calibration is of {calibration.serial}"
        raise InputError(text, where, Remedy.SAME_SENSOR)


def _errors(
    height_map: HeightMap, truth: TrueDepth, height_mm: float, radius_mm: float
) -> tuple[float, ...]:
    """Return `ERRORS` of a depth map."""
    depth_mm, x_mm, y_mm = height_map.depth_mm, height_map.x_mm, height_map.y_mm
    score = score_depth(depth_mm, x_mm, y_mm, truth, height_mm=height_mm, radius_mm=radius_mm)
    angle = normal_error_deg(height_map, truth, radius_mm)
    return score.rms_um, angle, score.height_percent, score.size_percent


def normal_error_deg(height_map: HeightMap, truth: TrueDepth, radius_mm: float) -> float:
    """Return the root mean square angle between found and true normals, where pressed.

    Parameters
    ----------
    height_map : HeightMap
        With normals.
    truth : TrueDepth
        What was pressed; only nodes deeper than `TOUCHED_MM` count.
    radius_mm : float
        Only nodes within this radius count.
    """
    assert height_map.normals is not None
    depth, across, down = np.moveaxis(truth_at(truth, height_map), -1, 0)
    distance_mm = np.hypot(*np.meshgrid(height_map.x_mm, height_map.y_mm))
    compared = (depth > TOUCHED_MM) & (distance_mm < radius_mm)
    normals = -np.stack([across, down, np.ones_like(depth)], axis=-1)[compared]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cosine = np.clip((normals * height_map.normals[compared]).sum(axis=1), -1.0, 1.0)
    return float(np.degrees(np.sqrt(np.mean(np.arccos(cosine) ** 2))))


def pareto_front(points: Sequence[WorkPrecisionPoint]) -> tuple[WorkPrecisionPoint, ...]:
    """Return the modes of each width that no other exceeds in both time and depth error.

    The fastest comes first. A slower one must be better by `WORTH`.
    """
    front: list[WorkPrecisionPoint] = []
    modes = [point for point in points if not point.curve]
    for point in sorted(modes, key=lambda p: (p.width, p.median_ms, p.rms_um)):
        previous = front[-1] if front and front[-1].width == point.width else None
        if previous is None or point.rms_um < (1.0 - WORTH) * previous.rms_um:
            front.append(point)
    return tuple(front)


def point_table(points: Sequence[WorkPrecisionPoint]) -> str:
    """Return the points as lines of text with a star for the front."""
    front, heads = pareto_front(points), ("RMS um", "deg", "height %", "size %")
    first = f"  {'mode':<24}{'width':>6}{'ms':>10}{'p95':>10}"
    title = f"GelPoLight Studio {__version__}; means with intervals of {CONFIDENCE:.0%}"
    lines = [title, first + "".join(f"{head:>17}" for head in heads)]
    for p in points:
        means = zip((getattr(p, name) for name in ERRORS), p.within, strict=True)
        cells = "".join(f"{mean:9.2f} ±{within:6.2f}" for mean, within in means)
        start = f"{'*' if p in front else ' '} {p.label:<24}{p.width:6d}"
        lines.append(f"{start}{p.median_ms:10.2f}{p.p95_ms:10.2f}{cells}")
    return "\n".join(lines)


def write_work_precision(points: Sequence[WorkPrecisionPoint], folder: Path) -> tuple[Path, ...]:
    """Write ``work-precision.csv`` and ``work-precision.png`` into a folder.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    front = pareto_front(points)
    keys = [f"{name}_within" for name in ERRORS]
    rows = [
        {**asdict(p), **dict(zip(keys, p.within, strict=True)), "on_front": p in front}
        for p in points
    ]
    image = png(lambda figure: _paint(figure, points), 9.0, 4.0)
    table = csv_from_dicts(rows).encode()
    return write_files(folder, {"work-precision.csv": table, "work-precision.png": image})


def _paint(figure: Figure, points: Sequence[WorkPrecisionPoint]) -> None:
    depth, height = figure.subplots(1, 2)
    for line in dict.fromkeys(point.curve or point.label for point in points):
        of_line = [point for point in points if line in (point.curve, point.label)]
        times = [point.median_ms for point in of_line]
        to_p95 = [[0.0] * len(of_line), [point.p95_ms - point.median_ms for point in of_line]]
        for axes, name in ((depth, "rms_um"), (height, "height_percent")):
            values = [getattr(point, name) for point in of_line]
            within = [point.within[ERRORS.index(name)] for point in of_line]
            bars = {} if of_line[0].curve else {"yerr": within, "xerr": to_p95, "marker": "o"}
            axes.errorbar(times, values, **{"marker": ".", **bars}, label=line)
    for width in dict.fromkeys(point.width for point in points):
        front = [(p.median_ms, p.rms_um) for p in pareto_front(points) if p.width == width]
        depth.step(*zip(*front, strict=True), "k:", where="post")
        depth.annotate(f"{width} px", front[0])
    for axes, label in ((depth, "depth, RMS (um)"), (height, "height of the plateau (%)")):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.grid(which="both", color="0.92")
        axes.set_xlabel("time of a frame (ms); to the 95th percentile")
        axes.set_ylabel(label)
    height.legend(title="dotted: the front of each width")
