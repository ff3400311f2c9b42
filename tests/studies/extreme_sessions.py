"""Calibrations from sessions with too little, damaged or wrong data.

    python -m tests.studies.extreme_sessions

Each case changes a session of the virtual sensor, calibrates from it, and measures a press whose
size is known, in every mode. It passes if height and size are within three stated standard
deviations; otherwise the calibration or the measurement must report that it is not reliable.
"""

import json
import re
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.project import run_calibration
from gelpolight_core.measurement.map_reliability import with_map_findings
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.session.session import read_session
from gelpolight_core.session.session_images import read_raw_image
from gelpolight_core.simulation.design_parts import PressDesign
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import simulate_session
from gelpolight_core.studies.image_case_helpers import solvers_of
from gelpolight_core.studies.stability import Case, CaseMeasurement, ModeResult, cases_of, run_case
from gelpolight_core.studies.stability_cases import light_terms

Image = NDArray[np.uint8]
Change = Callable[[Path], None]
ImageChange = Callable[[Image], NDArray[Any]]
PRESS = PressDesign("cylinder", 5.0, 1.0, 0.5, -0.5, 0.0)
SCALE = 0.5
SIGMAS = 3.0
LIT = ("mirror", "whiteboard", "background", "balls", "presses")
"""Stages with LED light."""
ALL = ("checkerboard", "top_pose", *LIT)
LENGTHS = {
    "led_height": r"(led_height_mm = )([\d.]+)",
    "thickness": r"(elastomer_thickness_mm = )([\d.]+)",
    "index": r"(elastomer_refractive_index = )([\d.]+)",
    "diameter": r"(working_diameter_mm = )([\d.]+)",
    "square": r"(\[checkerboard\](?s:.*?)square_mm = )([\d.]+)",
    "top_square": r"(\[top_pose\](?s:.*?)square_mm = )([\d.]+)",
    "ball_radius": r'("?[\w.]+"? = )([\d.]+)(?=[^\[]*\Z)',
}
"""Each length or index of ``session.toml`` with its lines; the number is the last group."""


def session_cases() -> tuple[Case, ...]:
    """Return the cases on calibration sessions."""
    changes: dict[str, Change] = {
        "unchanged": lambda _: None,
        **{f"balls_{n}": partial(_keep, "balls", n) for n in (1, 3, 5)},
        "balls_one_side": _balls_on_one_side,
        **{f"views_{n}": partial(_keep, "checkerboard", n) for n in (2, 4, 8)},
        **{f"noise_{db}_db": _each(partial(_noisy, db)) for db in (35, 25)},
        **{
            f"blur_{px}_px": _each(partial(cv2.GaussianBlur, ksize=(0, 0), sigmaX=px))
            for px in (1, 2, 4)
        },
        **{f"jpeg_{quality}": _each(partial(_jpeg, quality)) for quality in (90, 60)},
        "mirror_spots_of_a_pixel": _each(_small_spots, "mirror"),
        "mirror_spots_saturated": _each(lambda image: 6.0 * image, "mirror"),
        "first_led_at_a_fifth": _each(lambda image: image * np.array([0.2, 1.0, 1.0]), *LIT),
        "whiteboard_uneven": _each(partial(_uneven, 0.2), "whiteboard"),
        "background_uneven": _each(partial(_uneven, 0.05), "background"),
        **{
            f"{key}_{percent:+g}_percent": partial(state_wrongly, key, percent)
            for key in LENGTHS
            for percent in (-5.0, 1.0, 5.0)
        },
    }
    runs = {f"session_{name}": partial(_measured, change) for name, change in changes.items()}
    for scale in (0.25, 0.125):
        runs[f"session_scale_{scale:g}"] = partial(_measured, changes["unchanged"], scale=scale)
    for name, design in light_terms(SensorDesign()).items():
        runs[f"session_light_{name}"] = partial(_measured, changes["unchanged"], design)
    required = "correct within three stated sd in every mode, or flagged, or refused"
    return cases_of({("sessions", required): runs})


def state_wrongly(key: str, percent: float, folder: Path) -> None:
    """State one of `LENGTHS` wrongly in the ``session.toml`` of a folder."""
    path = folder / "session.toml"
    text, count = re.subn(
        LENGTHS[key],
        lambda m: f"{m[1]}{float(m[2]) * (1.0 + 0.01 * percent):.5f}",
        path.read_text(),
    )
    if not count:
        raise ValueError(f"{key} is not in session.toml")
    path.write_text(text)


@lru_cache(maxsize=4)
def _base(design: SensorDesign, scale: float) -> tempfile.TemporaryDirectory[str]:
    """Make a session of the virtual sensor once; its folder is deleted with the program."""
    holder = tempfile.TemporaryDirectory(prefix="gelpolight-stability-")
    pressed = replace(design, presses=(PRESS,))
    simulate_session(pressed, Path(holder.name) / "session", scale=scale)
    return holder


def _measured(
    change: Change, design: SensorDesign | None = None, scale: float = SCALE
) -> CaseMeasurement:
    """Calibrate from a changed session, and measure the press in every mode."""
    with tempfile.TemporaryDirectory(prefix="gelpolight-stability-") as temporary:
        folder = Path(temporary) / "session"
        base = _base(SensorDesign() if design is None else design, scale)
        shutil.copytree(Path(base.name) / "session", folder)
        change(folder)
        run = run_calibration(read_session(folder))
        image = next((folder / "presses").glob("*.png"))
        frame = read_raw_image(image).rgb
    tables = run.calibration.quality.values()
    warning = "; ".join(advice for table in tables for advice in table.remedies)
    modes, texts = [], []
    for name, solver in solvers_of(run.calibration).items():
        found = solver.depth(frame, uncertainty=True)
        mode, text = _mode(name, found, warning)
        modes.append(mode)
        texts.append(f"{name}: {text}")
    return CaseMeasurement("; ".join(texts), tuple(modes))


def _mode(name: str, found: HeightMap, warning: str) -> tuple[ModeResult, str]:
    """Measure the press; `warning` is the advice of the calibration itself."""
    try:
        size = with_map_findings(measure_heightmap(found, shape="cylinder"), found)
    except InputError as error:
        return ModeResult(name, False, warning=str(error)), str(error)
    height_sd, size_sd = size.sd["height_mm"], size.sd["diameter_mm"]
    height, width = size.height_mm - PRESS.depth_mm, size.size_mm - PRESS.size_mm
    worst = max(abs(height) / height_sd, abs(width) / size_sd)
    # The worse of the two in units of its sd, as an error of the height.
    error_um, bound_um = 1e3 * worst * height_sd, SIGMAS * 1e3 * height_sd
    warnings = "; ".join(filter(None, (warning, size.reason)))
    text = f"height {1e3 * height:+.1f} ({1e3 * height_sd:.1f}) um, "
    text += f"size {1e3 * width:+.0f} ({1e3 * size_sd:.0f}) um"
    return ModeResult(name, worst <= SIGMAS, error_um, bound_um, warnings), text


def _keep(stage: str, count: int, folder: Path) -> None:
    for path in sorted((folder / stage).glob("*.png"))[count:]:
        path.unlink()


def _balls_on_one_side(folder: Path) -> None:
    for ball in json.loads((folder / "truth.json").read_text())["balls"]:
        if ball["centre_sensor_xy_mm"][0] > 0.0:
            (folder / "balls" / ball["file"]).unlink()


def _each(change: ImageChange, *stages: str) -> Change:
    """Return a change of each image of some stages; of all, where none is named."""

    def change_all(folder: Path) -> None:
        for path in (p for stage in stages or ALL for p in sorted((folder / stage).glob("*.png"))):
            image = np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), np.uint8)
            cv2.imwrite(str(path), np.clip(np.rint(change(image)), 0, 255).astype(np.uint8))

    return change_all


def _noisy(db: float, image: Image) -> NDArray[Any]:
    # Another seed for each image, so that noise does not repeat.
    random = np.random.default_rng(int(image.sum(dtype=np.int64)))
    sd = 255.0 * 10.0 ** (-db / 20.0)
    return np.asarray(image + sd * random.standard_normal(image.shape))


def _jpeg(quality: int, image: Image) -> Image:
    _done, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_UNCHANGED), np.uint8)


def _small_spots(image: Image) -> Image:
    peak = image == cv2.dilate(image, np.ones((31, 31), np.uint8))
    return np.where(peak & (image > 60), image, np.minimum(image, 4)).astype(np.uint8)


def _uneven(share: float, image: Image) -> NDArray[Any]:
    ramp = 1.0 + share * (np.linspace(0.0, 1.0, image.shape[1]) - 0.5)
    return np.asarray(image * ramp[:, None])


if __name__ == "__main__":
    for extreme in session_cases():
        print(run_case(extreme).line, flush=True)
