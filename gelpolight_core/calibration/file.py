"""The calibration file (.gplcal): a zip of a manifest and plain arrays, checked whole.

``manifest.json`` holds every number that is not an array, with units in the key names, and the
SHA-256, shape and kind of every array; the arrays are NumPy files without pickle. The file is
written whole or not at all, and a damaged one is refused before anything of it is used.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import (
    MODELS,
    Calibration,
    FullModel,
    Provenance,
    ScaleSd,
)
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import write_atomically
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.quality import Figure, QualityTable, Verdict
from gelpolight_core.reflectance.membrane import Membrane
from gelpolight_core.reflectance.table import ReflectanceTable
from gelpolight_core.session.session import MAX_PIXELS, SensorData
from gelpolight_core.translation import tr

FORMAT = "gelpolight-calibration"
VERSION = 1
MANIFEST = "manifest.json"
MANIFEST_LIMIT = 4_000_000
NODES_LIMIT = 10_000
LEAST_BACKGROUND = -0.2
# A fixed time stamp: the same calibration gives the same bytes.
ZIP_TIME = (1980, 1, 1, 0, 0, 0)


def write_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration file, whole or not at all.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    arrays = _arrays_of(calibration)
    encoded = {name: _encode(array) for name, array in arrays.items()}
    manifest = _manifest_of(calibration)
    manifest["arrays"] = {
        name: {
            "shape": list(array.shape),
            "kind": array.dtype.str,
            "sha256": hashlib.sha256(encoded[name]).hexdigest(),
        }
        for name, array in arrays.items()
    }
    text = json.dumps(manifest, indent=1, allow_nan=False).encode()
    manifest_sum = hashlib.sha256(text).hexdigest().encode()

    def write(stream: BinaryIO) -> None:
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=3) as archive:
            for name, data in (
                (MANIFEST, text),
                (f"{MANIFEST}.sha256", manifest_sum),
                *((f"{n}.npy", d) for n, d in encoded.items()),
            ):
                archive.writestr(zipfile.ZipInfo(name, ZIP_TIME), data, zipfile.ZIP_DEFLATED)

    write_atomically(path, write)


def read_calibration(path: Path) -> Calibration:
    """Read a calibration file and check all of it.

    Raises
    ------
    InputError
        If the file is missing, damaged, truncated, of a newer version, or holds values that no
        calibration has.
    """
    if not path.is_file():
        raise InputError(
            tr("there is no such file"),
            where=str(path),
            advice=tr("Make one with gelpolight calibrate"),
        )
    try:
        with zipfile.ZipFile(path) as archive:
            manifest = _read_manifest(archive, path)
            arrays = {
                name: _read_array(archive, name, entry, path)
                for name, entry in manifest["arrays"].items()
            }
        return _build(manifest, arrays)
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        OSError,
        NotImplementedError,
        RuntimeError,
        RecursionError,
        KeyError,
        IndexError,
        TypeError,
        ValueError,
        AttributeError,
        ArithmeticError,
    ) as error:
        raise _damaged(path, error) from error


def _damaged(path: Path, error: Exception) -> InputError:
    return InputError(
        tr("the calibration is damaged or is not one ({error})").format(
            error=str(error).splitlines()[0] if str(error) else type(error).__name__
        ),
        where=str(path),
        advice=tr("Take a copy, or calibrate again from the session"),
    )


def _encode(array: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.ascontiguousarray(array), allow_pickle=False)
    return buffer.getvalue()


def _arrays_of(c: Calibration) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {
        "led_positions_mm": c.led_positions_mm,
        "led_covariance_mm2": c.led_covariance_mm2,
        "crosstalk": c.crosstalk,
        "noise": c.noise,
        "radiance": c.radiance,
        "factors": c.factors,
        "reflectance_coverage": c.reflectance.coverage,
    }
    for k in range(3):
        arrays[f"reflectance_cosines_{k}"] = c.reflectance.cosines[k]
        arrays[f"reflectance_values_{k}"] = c.reflectance.values[k]
    if c.full is not None:
        arrays["full_led_positions_mm"] = c.full.led_positions_mm
        arrays["full_led_sd_mm"] = c.full.led_sd_mm
        arrays["full_background"] = c.full.background
    return arrays


def _manifest_of(c: Calibration) -> dict[str, Any]:
    manifest: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "identity": c.identity,
        "model": c.model,
        "units": {"length": "mm", "picture": "linear light 0..1", "camera": "px"},
        "sensor": asdict(c.sensor),
        "camera": asdict(c.camera),
        "plane": asdict(c.plane),
        "grid": _grid_of(c),
        "quality": {stage: table.as_rows() for stage, table in c.quality.items()},
        "provenance": asdict(c.provenance),
    }
    if c.full is not None:
        manifest["full"] = {
            "membrane": asdict(c.full.membrane),
            "decay_mm": c.full.decay_mm,
            "misfit": c.full.misfit,
            "held_out": list(c.full.held_out),
            "kept": c.full.kept,
        }
        if c.full.scale_sd is not None:
            manifest["full"]["scale_sd"] = asdict(c.full.scale_sd)
    return manifest


def _grid_of(c: Calibration) -> dict[str, Any]:
    """Return where the maps' nodes lie; the grid is made anew on reading and must be the same."""
    grid = c.table.grid
    return {
        "rows": grid.shape[0],
        "columns": grid.shape[1],
        "x0_mm": float(grid.x_mm[0]),
        "y0_mm": float(grid.y_mm[0]),
        "pitch_mm": grid.pitch_mm,
    }


def _read_manifest(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    text = _read_member(archive, MANIFEST, MANIFEST_LIMIT)
    manifest = json.loads(text)
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise ValueError("no calibration manifest")
    version = manifest.get("version")
    if type(version) is int and version > VERSION:
        raise InputError(
            tr("the calibration has version {v} and this program knows version {k}").format(
                v=version, k=VERSION
            ),
            where=str(path),
            advice=tr("Use a newer version of GelPoLight Studio"),
        )
    if version != VERSION:
        raise ValueError(f"version {version!r}")
    stated = _read_member(archive, f"{MANIFEST}.sha256", 64)
    if hashlib.sha256(text).hexdigest().encode() != stated:
        raise ValueError("the manifest's checksum is wrong")
    return manifest


def _read_member(archive: zipfile.ZipFile, name: str, limit: int) -> bytes:
    """Read a member whose declared size is within its limit, before memory is taken."""
    info = archive.getinfo(name)
    if info.file_size > limit:
        raise ValueError(f"{name} declares {info.file_size} bytes")
    with archive.open(info) as stream:
        data = stream.read(limit + 1)
    if len(data) != info.file_size:
        raise ValueError(f"{name} is cut short")
    return data


def _read_array(
    archive: zipfile.ZipFile, name: str, entry: dict[str, Any], path: Path
) -> NDArray[Any]:
    shape = tuple(int(n) for n in entry["shape"])
    kind = np.dtype(entry["kind"])
    if kind.str not in ("<f4", "<f8") or min(shape) < 1:
        raise ValueError(f"{name} is {kind} {shape}")
    count = 1
    for n in shape:
        count *= n
    if count > 3 * MAX_PIXELS:
        raise ValueError(f"{name} declares {count} values")
    data = _read_member(archive, f"{name}.npy", count * kind.itemsize + 4096)
    if hashlib.sha256(data).hexdigest() != entry["sha256"]:
        raise ValueError(f"the checksum of {name} is wrong")
    array = np.load(io.BytesIO(data), allow_pickle=False)
    if array.shape != shape or array.dtype != kind:
        raise ValueError(f"{name} is {array.dtype} {array.shape}")
    return np.asarray(array)


def _build(manifest: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Calibration:
    model = manifest["model"]
    if model not in MODELS:
        raise ValueError(f"unknown model {model!r}")
    camera = dict(manifest["camera"])
    camera["distortion"] = tuple(float(k) for k in camera["distortion"])
    plane = manifest["plane"]
    normal = tuple(float(n) for n in plane["normal_camera"])
    if len(normal) != 3 or len(camera["distortion"]) != 5:
        raise ValueError("camera or plane is incomplete")
    calibration = Calibration(
        sensor=SensorData(**manifest["sensor"]),
        model=model,
        camera=Camera(**camera),
        plane=TopPlane((normal[0], normal[1], normal[2]), float(plane["distance_mm"])),
        led_positions_mm=arrays["led_positions_mm"],
        led_covariance_mm2=arrays["led_covariance_mm2"],
        crosstalk=arrays["crosstalk"],
        radiance=arrays["radiance"],
        factors=arrays["factors"],
        reflectance=_read_reflectance(arrays),
        noise=arrays["noise"],
        quality={stage: _read_quality(rows) for stage, rows in manifest["quality"].items()},
        provenance=Provenance(**manifest["provenance"]),
        full=_read_full(manifest["full"], arrays) if "full" in manifest else None,
    )
    _check(calibration)
    stated, made = manifest["grid"], _grid_of(calibration)
    if not np.allclose([float(stated[key]) for key in made], list(made.values()), atol=1e-6):
        raise ValueError("the maps lie on another grid than this program makes")
    return calibration


def _read_reflectance(arrays: dict[str, NDArray[Any]]) -> ReflectanceTable:
    cosines = tuple(arrays[f"reflectance_cosines_{k}"] for k in range(3))
    values = tuple(arrays[f"reflectance_values_{k}"] for k in range(3))
    for nodes in (*cosines, *values):
        if nodes.ndim != 1 or not 2 <= nodes.size <= NODES_LIMIT or not (np.diff(nodes) > 0).all():
            raise ValueError("the reflectance table is not monotone")
    if any(c.size != v.size for c, v in zip(cosines, values, strict=True)):
        raise ValueError("the reflectance table's columns differ in length")
    return ReflectanceTable(
        (cosines[0], cosines[1], cosines[2]),
        (values[0], values[1], values[2]),
        arrays["reflectance_coverage"],
    )


def _read_full(entry: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> FullModel:
    membrane = Membrane(**{name: float(value) for name, value in entry["membrane"].items()})
    numbers = np.array([*asdict(membrane).values(), entry["decay_mm"], entry["misfit"]], float)
    if not np.isfinite(numbers).all() or not 0.0 <= membrane.gloss < 1.0:
        raise ValueError("the membrane is not possible")
    if membrane.exponent <= 0.0 or not 0.0 < membrane.roughness <= 1.0:
        raise ValueError("the membrane is not possible")
    if membrane.bounce < 0.0 or membrane.bounce_reach_mm <= 0.0:
        raise ValueError("the membrane is not possible")
    before, after = (float(value) for value in entry["held_out"])
    lengths = np.array([entry["decay_mm"], entry["misfit"], before, after], float)
    if not np.isfinite(lengths).all() or lengths.min() < 0.0 or lengths[0] == 0.0:
        raise ValueError("the joint refinement's figures are not possible")
    if entry["kept"] not in ("refined", "mirror"):
        raise ValueError(f"unknown LEDs {entry['kept']!r}")
    return FullModel(
        led_positions_mm=arrays["full_led_positions_mm"],
        led_sd_mm=arrays["full_led_sd_mm"],
        membrane=membrane,
        background=arrays["full_background"],
        decay_mm=float(entry["decay_mm"]),
        misfit=float(entry["misfit"]),
        held_out=(before, after),
        kept=str(entry["kept"]),
        scale_sd=_read_scale(entry["scale_sd"]) if "scale_sd" in entry else None,
    )


def _read_scale(entry: dict[str, Any]) -> ScaleSd:
    scale = ScaleSd(**{name: float(value) for name, value in entry.items()})
    numbers = np.array([scale.depth, scale.lateral])
    if not np.isfinite(numbers).all() or numbers.min() < 0.0:
        raise ValueError("the uncertainty of lengths is not possible")
    return scale


def _read_quality(rows: list[dict[str, Any]]) -> QualityTable:
    return QualityTable(
        tuple(Figure(**{**row, "verdict": Verdict(row["verdict"])}) for row in rows)
    )


def _check(calibration: Calibration) -> None:
    """Refuse values that no calibration has, whatever the checksums say."""
    c = calibration
    lengths = [c.camera.width, c.camera.height, c.camera.fx, c.camera.fy, c.plane.distance_mm]
    numbers = np.array(
        [*lengths, c.camera.cx, c.camera.cy, *c.camera.distortion, *c.plane.normal_camera], float
    )
    if not np.isfinite(numbers).all() or min(lengths) <= 0:
        raise ValueError("camera or plane is not possible")
    if type(c.camera.width) is not int or type(c.camera.height) is not int:
        raise ValueError("the picture size is not whole")
    if c.camera.width * c.camera.height > MAX_PIXELS:
        raise ValueError("the picture size is too large")
    if abs(float(np.linalg.norm(c.plane.normal_camera)) - 1.0) > 1e-6:
        raise ValueError("the plane's normal is not of length 1")
    expected = {
        "led_positions_mm": ((3, 3), c.led_positions_mm),
        "led_covariance_mm2": ((3, 3, 3), c.led_covariance_mm2),
        "crosstalk": ((3, 3), c.crosstalk),
        "noise": ((3,), c.noise),
        "reflectance_coverage": ((3, 2), c.reflectance.coverage),
    }
    maps = {"radiance": c.radiance, "factors": c.factors}
    if c.full is not None:
        expected["full_led_positions_mm"] = ((3, 3), c.full.led_positions_mm)
        expected["full_led_sd_mm"] = ((3, 3), c.full.led_sd_mm)
        maps["full_background"] = c.full.background
    if c.model == "full" and c.full is None:
        raise ValueError("the full model is missing")
    for name, (shape, array) in expected.items():
        if array.shape != shape or not np.isfinite(array).all():
            raise ValueError(f"{name} is not possible")
    rows_columns = c.table.grid.shape
    for name, map_ in maps.items():
        if map_.shape != (*rows_columns, 3) or map_.dtype != np.float32:
            raise ValueError(f"{name} does not fit the optics")
        # Crosstalk is taken off the background, which leaves noise about zero where it is dark.
        least = LEAST_BACKGROUND if name == "full_background" else 0.0
        if not np.isfinite(map_).all() or float(map_.min()) < least:
            raise ValueError(f"{name} is not possible")
