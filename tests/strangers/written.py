"""Every kind of file that the program writes: how an older and a newer one of it are written."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import scene
from recorded import noisy

from app.program.indenters import first_indenters, write_indenters
from app.program.workspace import Workspace
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.calibration.annotations import write_validation
from gelpolight_core.calibration.calibration_file import write_calibration
from gelpolight_core.lab.batch.batch_table import (
    COLUMNS,
    FrameRow,
    add_row,
    read_table,
    write_table,
)
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import write_csv
from gelpolight_core.lab.press_folder import add_presses
from gelpolight_core.measurement.profile import take_profile
from gelpolight_core.output.formats import HEIGHT_MAP_FORMATS
from gelpolight_core.output.heightmap_files import write_heightmap, write_profile
from gelpolight_core.output.report.calibration_report import calibration_report
from gelpolight_core.output.report.document import Report
from gelpolight_core.output.report.report_pdf_file import write_report
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.decisions import Decisions, write_decisions
from gelpolight_core.session.description import write_description
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.session import Session, read_session
from gelpolight_core.session.session_images import write_image
from gelpolight_core.session.validation import Validation
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import session_toml

RECORD = MeasurementRecord("A", "c", "ball", (Quantity("diameter_mm", 3.0, 0.1, 3.0),))
TRIAL = Validation(
    "c", "2026-01-02", "me", "ball", (Quantity("height", 1.0, truth=1.0, limit_percent=8.0),)
)


@dataclass(frozen=True)
class Written:
    """A kind of file.

    Attributes
    ----------
    name : str
        What it is called.
    write : callable
        Writes the file into a folder: the older one (0) or the newer one (1), which is another.
    """

    name: str
    write: Callable[[Path, int], object]


def _workspace(folder: Path, which: int) -> None:
    workspace = Workspace(folder)
    path = workspace.sensor_folder("T-1") / "c.gplcal"
    if not path.exists():
        path.parent.mkdir(parents=True)
        write_calibration(calibration(), path)
    workspace.use(path if which else None)


def _validation(folder: Path, which: int) -> None:
    path = folder / "c.gplcal"
    if not path.exists():
        write_calibration(calibration(), path)
    identity = calibration().identity
    write_validation(replace(TRIAL, identity=identity, indenter=f"ball {which}"), path)


def _import(folder: Path, which: int) -> None:
    source = folder / "elsewhere" / f"{which}.gplcal"
    for k in (0, 1):
        path = folder / "elsewhere" / f"{k}.gplcal"
        if not path.exists():
            path.parent.mkdir(exist_ok=True)
            sensor = replace(calibration().data.sensor, serial=f"S-{k}")
            write_calibration(calibration().changed(sensor=sensor), path)
    (folder / "library" / "sensors" / "S-1").mkdir(parents=True, exist_ok=True)
    Workspace(folder / "library").import_calibration(source)


def _session(folder: Path) -> Session:
    if not (folder / "session.toml").exists():
        (folder / "session.toml").write_text(session_toml(SensorDesign()))
    return read_session(folder)


def _description(folder: Path, which: int) -> None:
    session = _session(folder)
    write_description(replace(session, ball_radii_mm={f"ball_{k}.png": 2.0 for k in range(which)}))


def _decisions(folder: Path, which: int) -> None:
    write_decisions(Decisions(frozenset({f"balls/{which}.png"})), folder)


def _capture(folder: Path, which: int) -> None:
    write_image(noisy(which), folder / "balls" / f"ball_{which}.png", new=True, inside=folder)


def _heights(name: str, folder: Path, which: int) -> None:
    write_heightmap(heightmap(0.5 + which), folder, formats=[name])


def _profile(folder: Path, which: int) -> None:
    profile = take_profile(heightmap(0.5 + which), (-1.0, 0.0), (1.0, 0.0))
    write_profile(profile, folder / "p.csv")


def _table(folder: Path, which: int) -> None:
    write_csv([replace(RECORD, note=f"note {which}")] * 3, folder / "records.csv")


def _report(folder: Path, which: int) -> None:
    write_report(replace(report(), title=f"Report {which}"), folder / "report.pdf")


def _row(folder: Path, which: int) -> None:
    if not which:
        write_table({}, folder)
    add_row(FrameRow(f"a{which}", "a.png", "c", "s"), folder)


def _batch(folder: Path, which: int) -> None:
    for k in range(3 * (1 - which)):
        add_row(FrameRow(f"a{k}", "a.png", "c", "s"), folder)
    table = {f"b{which}": dict.fromkeys(COLUMNS, "x")}
    write_table(read_table(folder) | table, folder)


@cache
def calibration() -> Calibration:
    """Return a calibration of a small sensor."""
    return scene.calibration()


@cache
def report() -> Report:
    """Return its report, of the first page only."""
    return replace(calibration_report(calibration()), sections=())


def heightmap(depth_mm: float) -> HeightMap:
    """Return a small dent."""
    x_mm = np.linspace(-1.5, 1.5, 25)
    x, y = np.meshgrid(x_mm, x_mm)
    normals = np.zeros((*x.shape, 3), np.float32)
    normals[..., 2] = -1.0
    depth = (depth_mm * np.exp(-(x**2) - y**2)).astype(np.float32)
    return HeightMap(
        depth_mm=depth, x_mm=x_mm, y_mm=x_mm, pitch_mm=0.125, normals=normals,
        flags=np.zeros(x.shape, np.uint8), calibration_id="c", model="full", source="press.png",
    )  # fmt: skip


KINDS = (
    Written("calibration", lambda f, k: write_calibration(
        calibration().changed(noise=np.full(3, 1e-3 * (k + 1))), f / "c.gplcal")),
    Written("library", _import),
    Written("calibration in use", _workspace),
    Written("validation", _validation),
    Written("indenters", lambda f, k: write_indenters(first_indenters()[k:], f)),
    Written("session", _description),
    Written("decisions", _decisions),
    Written("capture", _capture),
    *(Written(f"heights as {name}", partial(_heights, name)) for name in HEIGHT_MAP_FORMATS),
    Written("profile", _profile),
    Written("table of records", _table),
    Written("report", _report),
    Written("list of presses", lambda f, k: add_presses(f, ReferenceObject("ball", 3.0 + k), 2)),
    Written("frames of a batch", _row),
    Written("table of a batch", _batch),
)  # fmt: skip
