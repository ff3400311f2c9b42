"""Extreme calibrations: sessions with too little, damaged or wrong data.

Each case changes a session of the virtual sensor, calibrates from it, and measures a press whose
size is known, in every mode. It passes if height and size are within three stated standard
deviations; otherwise the calibration or the measurement must report that it is not reliable.
"""

from __future__ import annotations

import json
import re
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.pipeline import CalibrationRun, calibrate_session
from gelpolight_core.design.parts import Press
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.stability import Case, ModeSeen, Progress, Seen
from gelpolight_core.measurement.indenter_tools import measure_heightmap
from gelpolight_core.measurement.trust import judged
from gelpolight_core.quality import Verdict
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.session.images import read_image
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.session import simulate_session
from gelpolight_core.translation import tr

Image = NDArray[np.uint8]
Change = Callable[[Path], None]
ImageChange = Callable[[Image, np.random.Generator], Image]
Named = tuple[str, str, Change]
SUBJECT = "sessions"
PRESS = Press("cylinder", 5.0, 1.0, 0.5, -0.5, 0.0)
SCALE = 0.5
SIGMAS = 3.0
LIT = ("mirror", "whiteboard", "background", "balls", "presses")
"""Stages with LED light."""


@dataclass(frozen=True, slots=True)
class Length:
    """A length or index that the user states in ``session.toml``.

    Attributes
    ----------
    key, label : str
        For files and for people.
    pattern : str
        Regular expression of the lines that state it; the number is its last group.
    """

    key: str
    label: str
    pattern: str


@dataclass(frozen=True, slots=True)
class LengthCost:
    """Effect of an error of 1 % in one stated length.

    Attributes
    ----------
    length : Length
        The wrong length.
    height_percent, size_percent : float
        Change of a measured cylinder's height and diameter; NaN without a measurement.
    verdict : str
        The calibration's, or ``refused``.
    """

    length: Length
    height_percent: float
    size_percent: float
    verdict: str


LENGTHS = (
    Length("led_height", tr("height of the LEDs"), r"(led_height_mm = )([\d.]+)"),
    Length("thickness", tr("thickness of the elastomer"), r"(elastomer_thickness_mm = )([\d.]+)"),
    Length("index", tr("index of the elastomer"), r"(elastomer_refractive_index = )([\d.]+)"),
    Length("diameter", tr("working diameter"), r"(working_diameter_mm = )([\d.]+)"),
    Length(
        "square", tr("squares of the lens board"), r"(\[checkerboard\](?s:.*?)square_mm = )([\d.]+)"
    ),
    Length(
        "top_square",
        tr("squares of the board on top"),
        r"(\[top_pose\](?s:.*?)square_mm = )([\d.]+)",
    ),
    Length("ball_radius", tr("radius of all balls"), r'("?[\w.]+"? = )([\d.]+)(?=[^\[]*\Z)'),
)


def session_cases() -> tuple[Case, ...]:
    """Return the cases on calibration sessions."""
    required = tr("correct within three stated sd in every mode, or flagged, or refused")
    spoilt = [*_counts(), *_spoilt_images(), *_spoilt_light()]
    cases = [
        Case(f"session_{name}", SUBJECT, label, required, partial(_measured, change), quick=False)
        for name, label, change in spoilt
    ]
    for length in LENGTHS:
        for percent in (-5.0, 1.0, 5.0):
            name = f"session_{length.key}_{percent:+g}_percent"
            label = tr("{length} wrong by {percent:+g} %").format(
                length=length.label, percent=percent
            )
            run = partial(_measured, partial(state_wrongly, length, percent))
            cases.append(Case(name, SUBJECT, label, required, run, quick=False))
    for scale in (0.25, 0.125):
        label = tr("images of {w} pixels").format(w=round(1280 * scale))
        run = partial(_measured, lambda _: None, scale)
        cases.append(Case(f"session_scale_{scale:g}", SUBJECT, label, required, run, quick=False))
    return tuple(cases)


def _counts() -> list[Named]:
    """Return the cases with too few captures, or captures at one position only."""
    balls = [
        (f"balls_{n}", tr("{n} balls").format(n=n), partial(_keep, "balls", n)) for n in (1, 3, 5)
    ]
    views = [
        (f"views_{n}", tr("{n} board views").format(n=n), partial(_keep, "checkerboard", n))
        for n in (2, 4, 8)
    ]
    side: Named = ("balls_one_side", tr("balls on one half only"), _balls_on_one_side)
    plain: Named = ("plain", tr("unchanged session"), lambda _: None)
    return [plain, *balls, side, *views]


def _spoilt_images() -> list[Named]:
    """Return the cases with noise, blur and compression in every image."""

    def each(change: ImageChange) -> Change:
        return partial(_each_image, change)

    noise = [
        (f"noise_{db}_db", tr("noise of {db} dB").format(db=db), each(partial(_noisy, db)))
        for db in (35, 25)
    ]
    blur = [
        (f"blur_{px:g}_px", tr("blur of {px:g} pixels").format(px=px), each(partial(_blurred, px)))
        for px in (1.0, 2.0, 4.0)
    ]
    jpeg = [
        (f"jpeg_{q}", tr("JPEG of quality {q}").format(q=q), each(partial(_jpeg, q)))
        for q in (90, 60)
    ]
    return [*noise, *blur, *jpeg]


def _spoilt_light() -> list[Named]:
    """Return the cases with wrong light in single stages, or in all stages with LED light."""
    entries: list[tuple[str, str, ImageChange, tuple[str, ...]]] = [
        ("spots_small", tr("mirror spots of one pixel"), _small_spots, ("mirror",)),
        ("spots_saturated", tr("mirror spots saturated"), partial(_brighter, 6.0), ("mirror",)),
        ("led_weak", tr("blue LED at a fifth"), _weak_led, LIT),
        ("whiteboard_uneven", tr("whiteboard uneven by 20 %"), _uneven, ("whiteboard",)),
        (
            "background_uneven",
            tr("background uneven by 5 %"),
            partial(_uneven, share=0.05),
            ("background",),
        ),
    ]
    return [
        (name, label, partial(_each_image, change, stages=stages))
        for name, label, change, stages in entries
    ]


def length_costs(*, progress: Progress | None = None) -> tuple[LengthCost, ...]:
    """Return the effect of 1 % of each stated length, by calibrating with it.

    Parameters
    ----------
    progress : callable, optional
        Called with the length and the share done.
    """
    progress = progress or (lambda _name, _share: None)
    with _changed(lambda _: None, SCALE) as folder:
        base = _best_size(_calibrated(folder), folder)
    costs = []
    for n, length in enumerate(LENGTHS):
        progress(length.label, n / len(LENGTHS))
        try:
            with _changed(partial(state_wrongly, length, 1.0), SCALE) as folder:
                run = _calibrated(folder)
                height, size = _best_size(run, folder)
        except InputError:
            costs.append(LengthCost(length, float("nan"), float("nan"), "refused"))
            continue
        changes = (100.0 * (height / base[0] - 1.0), 100.0 * (size / base[1] - 1.0))
        costs.append(LengthCost(length, *changes, _verdict(run).value))
    progress("", 1.0)
    return tuple(costs)


@lru_cache(maxsize=4)
def _base(scale: float) -> tempfile.TemporaryDirectory[str]:
    """Make a session of the virtual sensor once; its folder is deleted with the program."""
    holder = tempfile.TemporaryDirectory(prefix="gelpolight-stability-")
    design = replace(SensorDesign(), presses=(PRESS,))
    simulate_session(design, Path(holder.name) / "session", scale=scale)
    return holder


class _changed:
    """A copy of the session with a change; it is deleted at the end."""

    def __init__(self, change: Change, scale: float) -> None:
        self._holder = tempfile.TemporaryDirectory(prefix="gelpolight-stability-")
        self._change, self._scale = change, scale

    def __enter__(self) -> Path:
        folder = Path(self._holder.name) / "session"
        shutil.copytree(Path(_base(self._scale).name) / "session", folder)
        self._change(folder)
        return folder

    def __exit__(self, *_: object) -> None:
        self._holder.cleanup()


def _calibrated(folder: Path) -> CalibrationRun:
    try:
        return calibrate_session(read_session(folder))
    except InputError as error:  # without a folder that is gone when it is read
        where = error.where.replace(str(folder) + "/", "")
        raise InputError(error.found, where=where, advice=error.advice) from error


def _measured(change: Change, scale: float = SCALE) -> Seen:
    """Calibrate from a changed session, and measure the press in every mode."""
    with _changed(change, scale) as folder:
        run = _calibrated(folder)
        frame = _press_frame(run, folder)
    modes = tuple(
        _mode_seen(run, frame, model, effort)
        for model, effort in (
            *(("full", effort) for effort in reversed(EFFORTS)),
            ("paper", "best"),
        )
    )
    summary = "; ".join(f"{mode.mode}: {mode.summary}" for mode in modes)
    verdict = _verdict(run)
    return Seen(
        right=True,
        summary=summary,
        error_um=modes[0].error_um,
        bound_um=modes[0].bound_um,
        condition=_joint_condition(run),
        warning="" if verdict is Verdict.PASS else _judged_figures(run),
        modes=modes,
    )


def _mode_seen(
    run: CalibrationRun, frame: NDArray[np.float32], model: str, effort: str
) -> ModeSeen:
    name = "paper" if model == "paper" else effort
    reconstructor = Reconstructor(run.calibration, model=model, effort=effort)
    found = reconstructor.depth(
        frame, normals=False, uncertainty=(model, effort) == ("full", "best")
    )
    try:
        size = judged(measure_heightmap(found, shape="cylinder"), found)
    except InputError as error:
        return ModeSeen(name, None, None, str(error), str(error))
    height_sd, size_sd = size.sd["height_mm"], size.sd["diameter_mm"]
    height, width = size.height_mm - PRESS.depth_mm, size.size_mm - PRESS.size_mm
    worst = max(abs(height) / height_sd, abs(width) / size_sd)
    summary = tr("height {h:+.1f} ({hs:.1f}) um, size {w:+.0f} ({ws:.0f}) um").format(
        h=1e3 * height, hs=1e3 * height_sd, w=1e3 * width, ws=1e3 * size_sd
    )
    # The worse of the two in units of its sd, as an error of the height.
    error_um = 1e3 * worst * height_sd
    return ModeSeen(name, error_um, SIGMAS * 1e3 * height_sd, size.reason, summary)


def _press_frame(run: CalibrationRun, folder: Path) -> NDArray[np.float32]:
    """Return the image of the press as linear light."""
    path = next((folder / "presses").glob("*.png"))
    return read_image(path, response=run.calibration.response).rgb


def _best_size(run: CalibrationRun, folder: Path) -> tuple[float, float]:
    """Return measured height and diameter of the press, mm."""
    found = Reconstructor(run.calibration).depth(_press_frame(run, folder), normals=False)
    size = measure_heightmap(found, shape="cylinder")
    return size.height_mm, size.size_mm


def _verdict(run: CalibrationRun) -> Verdict:
    verdicts = [table.verdict for table in run.calibration.quality.values()]
    return next((v for v in (Verdict.FAIL, Verdict.WARN) if v in verdicts), Verdict.PASS)


def _judged_figures(run: CalibrationRun) -> str:
    """Return the figures of a calibration that are beyond a limit."""
    beyond = [
        f"{figure.label}: {figure.value:.3g} {figure.unit}".rstrip()
        for table in run.calibration.quality.values()
        for figure in table.figures
        if figure.verdict in (Verdict.FAIL, Verdict.WARN)
    ]
    return tr("the calibration says: {figures}").format(figures=", ".join(beyond))


def _joint_condition(run: CalibrationRun) -> float | None:
    """Return the condition number of the joint fit's correlations."""
    if run.joint is None:
        return None
    sd = np.sqrt(np.diag(run.joint.covariance))
    fitted = sd > 0.0
    if not fitted.any():
        return None
    correlation = run.joint.covariance[np.ix_(fitted, fitted)] / np.outer(sd[fitted], sd[fitted])
    return float(np.linalg.cond(correlation))


def _keep(stage: str, count: int, folder: Path) -> None:
    for path in sorted((folder / stage).glob("*.png"))[count:]:
        path.unlink()


def _balls_on_one_side(folder: Path) -> None:
    for ball in json.loads((folder / "truth.json").read_text())["balls"]:
        if ball["centre_sensor_xy_mm"][0] > 0.0:
            (folder / "balls" / ball["file"]).unlink()


def state_wrongly(length: Length, percent: float, folder: Path) -> None:
    """State a length wrongly."""
    path = folder / "session.toml"
    text, count = re.subn(
        length.pattern,
        lambda m: f"{m[1]}{float(m[2]) * (1.0 + 0.01 * percent):.5f}",
        path.read_text(),
    )
    if not count:
        raise ValueError(f"{length.key} is not in session.toml")
    path.write_text(text)


def _each_image(
    change: ImageChange,
    folder: Path,
    *,
    stages: tuple[str, ...] = ("checkerboard", "top_pose", *LIT),
) -> None:
    random = np.random.default_rng(0)
    for stage in stages:
        for path in sorted((folder / stage).glob("*.png")):
            image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
            assert image is not None
            cv2.imwrite(str(path), change(np.asarray(image, np.uint8), random))


def _whole(image: NDArray[np.floating]) -> Image:
    return np.asarray(np.clip(np.rint(image), 0, 255), np.uint8)


def _noisy(db: float, image: Image, random: np.random.Generator) -> Image:
    sd = 255.0 * 10.0 ** (-db / 20.0)
    return _whole(image + sd * random.standard_normal(image.shape))


def _blurred(sigma_px: float, image: Image, _: np.random.Generator) -> Image:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px), np.uint8)


def _jpeg(quality: int, image: Image, _: np.random.Generator) -> Image:
    _done, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_UNCHANGED), np.uint8)


def _small_spots(image: Image, _: np.random.Generator) -> Image:
    peak = image == cv2.dilate(image, np.ones((31, 31), np.uint8))
    return np.where(peak & (image > 60), image, np.minimum(image, 4)).astype(np.uint8)


def _brighter(factor: float, image: Image, _: np.random.Generator) -> Image:
    return _whole(factor * image.astype(np.float64))


def _weak_led(image: Image, _: np.random.Generator) -> Image:
    weak = image.copy()
    weak[..., 0] = image[..., 0] // 5  # OpenCV's order: blue first
    return weak


def _uneven(image: Image, _: np.random.Generator, *, share: float = 0.2) -> Image:
    ramp = 1.0 + share * (np.linspace(0.0, 1.0, image.shape[1]) - 0.5)
    return _whole(image * ramp[:, None])
