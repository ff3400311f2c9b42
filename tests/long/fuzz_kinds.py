"""The kinds of files that strangers bring: small good ones, and what the program does with them."""

import io
import json
import sqlite3
import tempfile
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import fuzz_mutations as spoil
import numpy as np
import tifffile

from app.program.indenters import first_indenters, read_indenters, write_indenters
from app.program.session_entries import read_session_entry
from app.program.settings import AppSettings
from app.program.workspace import Workspace
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.finding import QualityTable, judge
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.closed_sensor.imported_folders import read_foreign
from gelpolight_core.calibration.closed_sensor.session_import import ImportOptions, import_session
from gelpolight_core.calibration.manifest import read_summary, refuse_damaged_arrays
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.resampling import build_resampling_table
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.image.response import gamma_response
from gelpolight_core.lab.depth_score import read_true_depth
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import open_records, write_csv
from gelpolight_core.lab.reference_press import read_truth
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.light.reflectance_table import cosine_table
from gelpolight_core.output.heightmap_files import write_heightmap
from gelpolight_core.output.raster import read_npz
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_reader import Recording, is_recording
from gelpolight_core.output.recording.recording_writer import RecordingWriter
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.sensor.sensor_calibration import (
    Calibration,
    FullModel,
    ManualEdit,
    OpenSensor,
    Provenance,
    sensor_stack,
)
from gelpolight_core.session.decisions import (
    Decisions,
    PlacedCircle,
    read_decisions,
    write_decisions,
)
from gelpolight_core.session.session import SensorData, read_session
from gelpolight_core.session.session_images import read_linear_image
from gelpolight_core.session.validation import FORMAT, VERSION, Validation, validation_in
from gelpolight_core.simulation.sensor_design import SensorDesign, read_design
from gelpolight_core.simulation.simulated_session import session_toml


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes
    ----------
    name : str
        What it is called.
    file : str
        Name of the file in a folder of its own.
    seeds : tuple of bytes
        Good files.
    use : callable
        Reads the file of this place as the program does.
    spoilt : tuple of callables
        Ways to spoil a good file.
    """

    name: str
    file: str
    seeds: tuple[bytes, ...]
    use: Callable[[Path], object]
    spoilt: tuple[spoil.Mutation, ...]


BYTES = (spoil.flipped, spoil.cut, spoil.numbered)
VERSION_2 = Path(__file__).resolve().parents[1] / "lab" / "version_2.sql"
TEXT = (*BYTES, *(spoil.retold,) * 6)


def all_kinds(folder: Path) -> tuple[Kind, ...]:
    """Return every kind; the good files are made in `folder`."""
    texts = _texts(folder)
    return (
        Kind("calibration", "c.gplcal", _calibrations(folder), _use_calibration,
             (*BYTES, *(spoil.forged_archive,) * 6)),
        Kind("recording", "r.gplrec", _recordings(folder), _use_recording,
             (*BYTES, *(spoil.forged_recording,) * 4)),
        Kind("PNG image", "p.png", _pngs(), read_linear_image, (*BYTES, *(spoil.forged_png,) * 4)),
        Kind("TIFF image", "p.tif", _tiffs(), read_linear_image, (*BYTES, *(spoil.numbered,) * 3)),
        *(
            Kind(
                f"{end} image", f"p.{end}", _encoded(end), read_linear_image,
                (*BYTES, spoil.numbered),
            )
            for end in ("jpg", "bmp", "webp")
        ),
        Kind("records", "records.sqlite", _records(folder), _use_records, BYTES),
        Kind("true depth", "t.npz", (_true_depth(),), read_true_depth,
             (*BYTES, *(spoil.forged_archive,) * 3)),
        Kind("height map", "map.npz", (_height_map(folder),), read_npz,
             (*BYTES, *(spoil.forged_archive,) * 5)),
        Kind("label", "label.npz", (_label(),), _use_foreign,
             (*BYTES, *(spoil.forged_archive,) * 5)),
        *(Kind(name, file, (data,), use, TEXT) for name, file, data, use in texts),
    )  # fmt: skip


def _calibrations(folder: Path) -> tuple[bytes, ...]:
    camera = CameraModel(48, 40, 52.0, 52.0, 24.3, 19.2, (-0.05, 0.01, 0.0005, -0.0003, 0.0))
    plane, sensor = (
        TopPlane((0.0, 0.0, 1.0), 39.0),
        SensorData("T", 13.7, 14.0, 1.41, 0.0, 1.49, 40.0),
    )
    grid = build_resampling_table(
        camera, plane, sensor_stack(sensor, plane), working_diameter_mm=40.0
    ).grid
    light = np.full((*grid.shape, 3), 0.5, np.float32)
    leds = np.array([[0.5, 11.8, -13.7], [-10.4, -5.6, -13.7], [10.1, -6.3, -13.7]])
    full = FullModel(
        leds, np.full((3, 3), 0.1), MembraneBrdf(terms={"stretch_loss": 0.1}), light, 1.0, 0.01,
        "refined", worth={"stretch": 0.01},
    )  # fmt: skip
    edit = ManualEdit("reflectance", ("red",), "2026-01-02T03:04:05+00:00", "someone")
    quality = {"lens": QualityTable((judge("rms", "Error", 0.05, "px", warn=0.3),))}
    origin = Provenance("2026-01-02T03:04:05+00:00", "me", "0.1", "s", {"a": "b"}, {"fps": "30"},
                        (edit,))  # fmt: skip
    files = []
    for model, more in (("paper", None), ("full", full)):
        data = OpenSensor(
            sensor, camera, plane, leds, np.tile(0.01 * np.eye(3), (3, 1, 1)), np.eye(3),
            light, light, cosine_table(), np.full(3, 0.002), more,
            None if more is None else gamma_response(2.2),
        )  # fmt: skip
        calibration = Calibration(model, data, quality, origin)
        write_calibration(calibration, folder / "seed.gplcal")
        files.append((folder / "seed.gplcal").read_bytes())
    return tuple(files)


def _use_calibration(path: Path) -> None:
    try:
        read_summary(path)
        refuse_damaged_arrays(path)
    finally:
        _ = read_calibration(path).identity


def _recordings(folder: Path) -> tuple[bytes, ...]:
    files = []
    for kind in (np.uint8, np.uint16):
        path = folder / f"seed-{kind.__name__}.gplrec"
        header = RecordingHeader("A", "c", "camera", "virtual", {"exposure_ms": 2.0, "mode": "x"})
        with RecordingWriter(path, header) as writer:
            for number in range(3):
                light = np.random.default_rng(number).integers(0, 255, (8, 10, 3)).astype(kind)
                writer.append(light, number, number / 30.0)
        files.append(path.read_bytes())
    return tuple(files)


def _use_recording(path: Path) -> None:
    is_recording(path)
    with Recording.open(path) as recording:
        _ = recording.duration_s, recording.lost, str(recording.header).encode()
        for index in range(len(recording)):
            recording.frame(index)


def _pngs() -> tuple[bytes, ...]:
    light = np.random.default_rng(0).integers(0, 255, (10, 12, 4))
    images = (light[..., :3], light[..., :3] * 257, light, light[..., 0])
    kinds = (np.uint8, np.uint16, np.uint8, np.uint16)
    return tuple(
        cv2.imencode(".png", p.astype(k))[1].tobytes() for p, k in zip(images, kinds, strict=True)
    )


def _encoded(end: str) -> tuple[bytes, ...]:
    light = np.random.default_rng(2).uniform(0, 255, (24, 32, 3)).astype(np.uint8)
    ways: tuple[list[int], ...] = ([], [cv2.IMWRITE_WEBP_QUALITY, 60]) if end == "webp" else ([],)
    return tuple(cv2.imencode(f".{end}", light, way)[1].tobytes() for way in ways)


def _tiffs() -> tuple[bytes, ...]:
    light = np.random.default_rng(0).integers(0, 255, (10, 12, 3))
    found = [
        cv2.imencode(".tif", light.astype(kind), [cv2.IMWRITE_TIFF_COMPRESSION, way])[1].tobytes()
        for kind in (np.uint8, np.uint16, np.float32)
        for way in (1, 5, 8)
    ]
    for options in ({"byteorder": ">"}, {"tile": (16, 16), "compression": "zlib"}):
        file = io.BytesIO()
        planes = np.moveaxis(light, 2, 0).astype(np.uint16)
        tifffile.imwrite(file, planes, photometric="rgb", planarconfig="separate", **options)
        found.append(file.getvalue())
    return tuple(found)


def _records(folder: Path) -> tuple[bytes, ...]:
    path = folder / "seed.sqlite"
    with open_records(path) as records:
        for k in range(3):
            value = Quantity("diameter_mm", 3.0 + k / 100, 0.01, 3.0, 5.0)
            records.add(MeasurementRecord("A", "c", "ball", (value,), settings={"model": "full"}))
        records.remove(2)
    earlier = folder / "earlier.sqlite"
    with closing(sqlite3.connect(earlier)) as made:
        made.executescript(VERSION_2.read_text("utf-8"))
    return path.read_bytes(), earlier.read_bytes()


def _use_records(path: Path) -> None:
    with open_records(path) as records:
        kept = records.all(MeasurementRecord)
        for record in kept:
            records.all(MeasurementRecord, serial=record.serial)
            records.change(replace(record, note="seen"))
        write_csv(kept, path.with_name("out.csv"))


def _true_depth() -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(
        stream, depth_mm=np.ones((4, 5), np.float32), x0_mm=-1.0, y0_mm=-1.0, pitch_mm=0.5
    )
    return stream.getvalue()


def _height_map(folder: Path) -> bytes:
    nodes = 0.1 * np.arange(30.0)
    depth = np.full((30, 30), 0.5, np.float32)
    normals = np.broadcast_to(np.array([0.0, 0.0, -1.0], np.float32), (30, 30, 3))
    flags = np.zeros((30, 30), np.uint8)
    height_map = HeightMap(depth, nodes, nodes, 0.1, normals, flags, "c", "full", "p.png",
                           slope_sd=0.1 * depth, depth_scale_sd=0.01)  # fmt: skip
    (path,) = write_heightmap(height_map, folder, formats=("npz",))
    return path.read_bytes()


def _label() -> bytes:
    stream = io.BytesIO()
    np.savez(stream, center=np.array([6.0, 5.0]), radius=np.array(2.5))
    return stream.getvalue()


def _use_foreign(path: Path) -> None:
    """Import the folder of another program in which this is one file, beside good ones."""
    folder = path.parent
    for name in ("gelsight.png", "background.png", "a.png"):
        (folder / name).write_bytes(_pngs()[0])
    if path.suffix == ".npz":
        (folder / "catalog.csv").write_text(_CATALOG)
    import_session(read_foreign(folder), ImportOptions("A", 0.05, 3.0), folder / "session")


_CATALOG = 'experiment_reldir,diameter(mm)\n".",4.0\n"./",6.35\n'
_SIZES = (
    "[camera]\nwidth_px = 640\nheight_px = 480\ndistortion = [-0.08, 0.03, 0.0008, -0.0006]\n"
    'bit_depth = 16\nresponse = "srgb"\n[layers]\ntilt_deg = 1.5\n'
    "[[leds]]\nx_mm = 5.3\n[[leds]]\nx_mm = -12.0\n[[leds]]\ny_mm = -10.2\n"
    '[[presses]]\nshape = "coin"\nsize_mm = 8.0\n'
)
_TRUTH = (
    "file,shape,diameter_mm,side_mm,height_mm,region,repeat\na.png,cylinder,5.0,,1.0,1,1\n"
    'b.png,cuboid,,4.0,0.5,2,1\n"c.png",coin,,,1,3,2\n'
)


def _texts(folder: Path) -> list[tuple[str, str, bytes, Callable[[Path], object]]]:
    circles, curves = {"a.png": PlacedCircle(1.0, 2.0, 3.0)}, {1: ((0.0, 0.0), (1.0, 1.0))}
    decided = Decisions(frozenset({"balls/a.png"}), {0: (3.0, 4.0)}, circles, curves)
    write_decisions(decided, folder)
    write_indenters(first_indenters()[:3], folder)
    trial = Validation(
        "c", "2026-01-02", "me", "ball", (Quantity("height", 1.0, truth=1.0, limit_percent=8.0),)
    )
    content = {"format": FORMAT, "version": VERSION, **trial.as_json()}
    (folder / "c.validation.json").write_text(json.dumps(content))

    def held(name: str) -> bytes:
        return (folder / name).read_bytes()

    session = session_toml(SensorDesign()) + '\n[camera]\nresponse = "srgb"\n'
    settings = (
        "[General]\ntheme=dark\nworkspace=/tmp/x\n[limits]\nage_days=90\n"
        "[layout]\na=@ByteArray(x)\n"
    )
    return [
        ("session", "session.toml", session.encode(), _use_session),
        ("decisions", "decisions.toml", held("decisions.toml"), lambda p: read_decisions(p.parent)),
        ("design", "d.toml", _SIZES.encode(), read_design),
        ("truth", "truth.csv", _TRUTH.encode(), read_truth),
        ("indenters", "indenters.json", held("indenters.json"), lambda p: read_indenters(p.parent)),
        ("validation", "c.validation.json", held("c.validation.json"),
         lambda p: validation_in({"identity": "c"}, p.with_name("c.gplcal"))),
        ("workspace", "workspace.json", json.dumps({"in_use": "sensors/A/c.gplcal"}).encode(),
         lambda p: Workspace(p.parent).in_use),
        ("catalog", "catalog.csv", _CATALOG.encode(), _use_foreign),
        ("annotations", "annotate.csv", b'image,x,y,radius\n"a.png",6,5,2.5\n/home/b/a.png,5,5,2\n',
         _use_foreign),
        ("settings", "desktop.ini", settings.encode(), _use_settings),
    ]  # fmt: skip


def _use_session(path: Path) -> None:
    read_session_entry(path.parent)
    session = read_session(path.parent)
    for stage in ("balls", "mirror"):
        session.found(stage)
    session.ball_radius_mm("ball_00.png")


def _use_settings(path: Path) -> None:
    # Qt keeps what it has read of a place: a new name each time.
    other = Path(tempfile.mkdtemp(dir=path.parent)) / path.name
    path.rename(other)
    settings = AppSettings(other)
    _ = settings.preferences, settings.workspace_folder, settings.folder("session"), settings.limits
    _ = settings.recent("sessions"), settings.window_state(), settings.display("a")
