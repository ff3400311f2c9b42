"""Make one folder of files with this state of the program; README.md says how."""

import argparse
import re
import shutil
import tempfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
from PySide6.QtCore import QByteArray

from app.cli.main import main as gelpolight
from app.program.indenters import write_indenters
from app.program.preferences import WarningLimits
from app.program.settings import AppSettings
from app.program.workspace import Workspace
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.calibration.annotations import write_validation
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.lab.measurement_record import MeasurementRecord, verdict_of
from gelpolight_core.lab.measurement_store import open_records
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.measurement.result import compare_with_truth
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_writer import RecordingWriter
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.decisions import Decisions, PlacedCircle, write_decisions
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.validation import Validation

DESIGN = Path(__file__).with_name("small_sensor.toml")
PRESS = "cylinder_s5_d100"
TRUTH = ReferenceObject("cylinder", 5.0, height_mm=1.0)


def run(*words: object) -> None:
    """Run a command of the program."""
    if status := gelpolight([str(word) for word in words]):
        raise SystemExit(status)


def rgb_of(path: Path) -> Any:
    """Return a colour image as (rows, columns, 3)."""
    return cv2.imread(str(path))[..., ::-1].copy()


def make_session(folder: Path, *, closed: bool) -> None:
    """Simulate a session whose calibration is small: a working circle of 16 mm."""
    run("simulate", folder, "--design", DESIGN, *(["--closed"] if closed else []))
    toml = folder / "session.toml"
    toml.write_text(re.sub(r"working_diameter_mm = .*", "working_diameter_mm = 16.0",
                           toml.read_text()))  # fmt: skip


def keep_session(session: Path, target: Path, files: list[str]) -> None:
    """Copy some files of a session; without --large only session.toml."""
    for name in files if options.large else files[:1]:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(session / name, target / name)


def decide(session: Path, **decided: Any) -> None:
    """Write decisions about the images of a session."""
    write_decisions(Decisions(**decided), session)


def write_recording(session: Path, path: Path, calibration_id: str) -> None:
    """Record the background and the press, with a lost frame between them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    header = RecordingHeader(
        serial="small-1", calibration_id=calibration_id, source="virtual sensor", kind="virtual",
        settings={"exposure_us": 8000.0}, note="untouched, then pressed",
    )  # fmt: skip
    with RecordingWriter(path, header) as recording:
        images = ("background/background.png", f"presses/{PRESS}.png")
        for number, name in zip((4, 6), images, strict=True):
            recording.append(rgb_of(session / name), number, number / 30.0)


def write_records(workspace: Path, calibration: Any, session: Path) -> Any:
    """Measure the press, store it twice, remove the second; return the measurement."""
    image = rgb_of(session / f"presses/{PRESS}.png")
    measurement = measure_heightmap(Reconstructor(calibration).depth(image), shape="cylinder")
    quantities = compare_with_truth(measurement, TRUTH, (5.0, 8.0))
    record = MeasurementRecord(
        serial="small-1", calibration_id=calibration.identity, shape=measurement.shape,
        quantities=quantities, verdict=verdict_of(quantities, doubtful=False),
        details=measurement.as_json(TRUTH), settings={"model": calibration.model},
        operator="A. Tester", picture=f"{PRESS}.png",
        note="first press",
    )  # fmt: skip
    with open_records(workspace / "records.sqlite") as book:
        book.add(record)
        book.remove(book.add(replace(record, note="by mistake", time=datetime.now(UTC))))
    return measurement


def write_lab_files(workspace: Path, calibration: Any, measurement: Any, path: Path) -> None:
    """Write the lab's indenters, the validation of the calibration and the one in use."""
    pin = ReferenceObject("cylinder", 5.0, height_mm=1.0, name="Pin A")
    block = ReferenceObject("cuboid", 4.0, second_mm=6.0, name="Block")
    write_indenters([pin, block], workspace)
    lengths = (
        Quantity("diameter", measurement.size_mm, None, 5.0, 5.0),
        Quantity("height", measurement.height_mm, None, 1.0, 8.0),
    )
    now = datetime.now(UTC).isoformat(timespec="seconds")
    write_validation(Validation(calibration.identity, now, "A. Tester", "Pin A", lengths), path)
    Workspace(workspace).use(path)


def write_settings(path: Path) -> None:
    """Write the settings of the window."""
    settings = AppSettings(path)
    settings.prefer(theme="dark", reconstruction="full/best")
    settings.limits = WarningLimits(age_days=30.0, height_percent=6.0, size_percent=3.0)
    settings.keep_camera("usb-1", {"gain": "2.5"})
    settings.keep_window_state(QByteArray(b"geometry"), QByteArray(b"state"))
    settings.add_recent("sessions", Path("/lab/session"))
    settings.save()


def make_open(out: Path, scratch: Path) -> None:
    """Make the files of an open sensor."""
    session, workspace = scratch / "session", out / "workspace"
    path = workspace / "sensors/small-1/first.gplcal"
    path.parent.mkdir(parents=True)
    make_session(session, closed=False)
    run("calibrate", session, "-o", path)
    calibration = read_calibration(path)
    unfinished = ["session.toml", "background/background.png", "mirror/mirror.png",
                  "balls/ball_00.png", "checkerboard/view_00.png"]  # fmt: skip
    keep_session(session, path.parent / "sessions/unfinished", unfinished)
    excluded = frozenset({"balls/ball_00.png", "checkerboard/view_03.png"})
    decide(
        path.parent / "sessions/unfinished",
        excluded=excluded,
        spots_px={1: (40.5, 60.25)},
        curves={2: ((0.2, 0.15), (0.6, 0.55), (1.0, 1.0))},
    )
    write_recording(session, path.parent / "recordings/press.gplrec", calibration.identity)
    measurement = write_records(workspace, calibration, session)
    write_lab_files(workspace, calibration, measurement, path)
    image = session / f"presses/{PRESS}.png"
    if options.large:
        run("reconstruct", path, image, "-o", out / "height_map")
    write_settings(out / "desktop.ini")


def make_closed(out: Path, scratch: Path) -> None:
    """Make the files of a closed sensor."""
    session = scratch / "closed"
    make_session(session, closed=True)
    sensor = out / "workspace/sensors/small-1"
    kept = [
        "session.toml",
        "background/background.png",
        *(f"balls/ball_{n:02d}.png" for n in range(3)),
    ]
    keep_session(session, sensor / "sessions/closed", kept)
    circle = PlacedCircle(96.5, 80.25, 14.0)
    decide(
        sensor / "sessions/closed",
        excluded=frozenset({"balls/ball_02.png"}),
        balls={"ball_01.png": circle},
    )
    run("calibrate", session, "-o", sensor / "closed.gplcal")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("kinds", nargs="+", choices=["open", "closed"])
    parser.add_argument(
        "--large", action="store_true", help="also keep images of the sessions and an npz file"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        for kind in options.kinds:
            {"open": make_open, "closed": make_closed}[kind](options.out, Path(scratch))
