"""The calibration file (.gplcal): a zip archive of a manifest and plain arrays, checked completely.

``manifest.json`` contains every number that is not an array, with units in the key names, and the
SHA-256, shape and type of every array; the arrays are NumPy files without pickle. The file is
written completely or not at all, and a damaged one is refused before any part of it is used.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.bad_pixels import BadPixels
from gelpolight_core.calibration.file_full import full_arrays, full_entry, read_full
from gelpolight_core.calibration.manifest import (
    FORMAT,
    HEAD_LIMIT,
    MANIFEST,
    REMARKS,
    VERSION,
    check_arrays,
    declared_bytes,
    opened,
    quality_rows,
    read_manifest,
    read_quality,
)
from gelpolight_core.image.file import MAX_PIXELS
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.io.npy import array_of
from gelpolight_core.io.reading import brief, plain_text, read_member, written_text
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.optics.resampling import MembraneGrid, visible_grid
from gelpolight_core.reconstruction.in_place.calibration import (
    MODEL,
    AnyCalibration,
    InPlaceCalibration,
    in_place_arrays,
    in_place_entry,
    read_in_place,
    require_open,
)
from gelpolight_core.reflectance.table import ReflectanceTable
from gelpolight_core.sensor_calibration import MODELS, Calibration, HandEdit, Provenance
from gelpolight_core.session.session import SENSOR_RANGES, SensorData

NODES_LIMIT = 10_000
BAD_PIXELS = "bad_pixels"
LEAST_BACKGROUND = -0.2
MOST_CROSSTALK = 100.0
MOST_BLUR_PX = 100.0
# A fixed time stamp: the same calibration gives the same bytes.
ZIP_TIME = (1980, 1, 1, 0, 0, 0)


def write_calibration(
    calibration: AnyCalibration, path: str | PathLike[str], *, new: bool = False
) -> None:
    """Write a calibration file, completely or not at all.

    Parameters
    ----------
    calibration : Calibration or InPlaceCalibration
        To be written.
    path : path
        The file, usually ``*.gplcal``.
    new : bool, optional
        Refuse to replace an existing file.

    Raises
    ------
    NameTakenError
        If `new` is set and the file exists.
    InputError
        If the file cannot be written.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> calibration = gp.read_calibration("sensor.gplcal")
    >>> gp.write_calibration(calibration, "copy.gplcal")
    """
    arrays = arrays_of(calibration)
    encoded = {name: _encode(array) for name, array in arrays.items()}
    manifest = manifest_of(calibration)
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

    write_atomically(Path(path), write, new=new)


def read_calibration(path: str | PathLike[str]) -> AnyCalibration:
    """Read a calibration file and check all of it.

    Raises
    ------
    InputError
        If the file is missing, damaged, truncated or of a newer version, or holds impossible
        values.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> calibration = gp.read_calibration("sensor.gplcal")
    >>> calibration.model
    'full'
    """
    path = Path(path)
    with opened(path) as archive:
        manifest = read_manifest(archive, path)
        check_arrays(manifest["arrays"], archive)
        arrays = {
            name: _read_array(archive, name, entry) for name, entry in manifest["arrays"].items()
        }
        calibration = _build(manifest, arrays)
        # Records and validations know the name in the file. Other versions of the program may give
        # another name to the same numbers; a changed copy computes its own.
        vars(calibration)["identity"] = written_text(manifest["identity"])
    return calibration


def read_open_calibration(path: Path) -> Calibration:
    """Read the calibration of an open sensor, for work that needs its optics and lights.

    Raises
    ------
    InputError
        As :func:`read_calibration`; or if the calibration is of a closed sensor.
    """
    return require_open(read_calibration(path), where=str(path))


def _encode(array: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.ascontiguousarray(array), allow_pickle=False)
    return buffer.getvalue()


def arrays_of(c: AnyCalibration) -> dict[str, NDArray[Any]]:
    """Return the arrays of a calibration by their names in the file."""
    if isinstance(c, InPlaceCalibration):
        return in_place_arrays(c)
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
        arrays |= full_arrays(c.full)
    if c.response is not None:
        arrays["camera_response"] = c.response.curves
    if c.bad is not None:
        # Older versions of the program also read this file and support arrays of floats only.
        arrays[BAD_PIXELS] = c.bad.pixels.astype(np.float32)
    return arrays


def manifest_of(c: AnyCalibration) -> dict[str, Any]:
    """Return the manifest of a calibration file, without its arrays."""
    provenance = asdict(c.provenance)
    remarks = {key: text for key in REMARKS if (text := provenance.pop(key))}
    manifest = {
        "format": FORMAT,
        "version": VERSION,
        "identity": c.identity,
        "model": c.model,
        "units": {"length": "mm", "picture": "linear light 0..1", "camera": "px"},
        "grid": _grid_entry(c.table.grid),
        "quality": {stage: quality_rows(table) for stage, table in c.quality.items()},
        "provenance": provenance,
        **remarks,
    }
    if isinstance(c, InPlaceCalibration):
        return manifest | in_place_entry(c)
    manifest |= {
        "sensor": asdict(c.sensor),
        "camera": asdict(c.camera),
        "plane": asdict(c.plane),
    }
    if c.full is not None:
        manifest["full"] = full_entry(c.full)
    if c.lens_blur_px is not None:
        manifest["lens_blur_px"] = c.lens_blur_px
    return manifest


def _grid_entry(grid: MembraneGrid) -> dict[str, Any]:
    """Return the position of the maps' nodes; the grid is recomputed on reading and must match."""
    return {
        "rows": grid.shape[0],
        "columns": grid.shape[1],
        "x0_mm": float(grid.x_mm[0]),
        "y0_mm": float(grid.y_mm[0]),
        "pitch_mm": grid.pitch_mm,
    }


def _read_array(archive: zipfile.ZipFile, name: str, entry: dict[str, Any]) -> NDArray[Any]:
    data = read_member(archive, f"{name}.npy", declared_bytes(name, entry) + HEAD_LIMIT)
    if hashlib.sha256(data).hexdigest() != entry["sha256"]:
        raise ValueError(f"the checksum of {name} is wrong")
    array = array_of(data)
    if list(array.shape) != entry["shape"] or array.dtype.str != entry["kind"]:
        raise ValueError(f"{name} has the type {array.dtype} and the shape {array.shape}")
    return array.copy()


def _build(manifest: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> AnyCalibration:
    model = manifest["model"]
    if model == MODEL:
        plain_text(manifest["sensor"]["serial"])
        quality = {stage: read_quality(rows) for stage, rows in manifest["quality"].items()}
        return read_in_place(manifest, arrays, quality, _read_provenance(manifest))
    if model not in MODELS:
        raise ValueError(f"unknown model {model!r}")
    camera = dict(manifest["camera"])
    camera["distortion"] = tuple(float(k) for k in camera["distortion"])
    plane = manifest["plane"]
    normal = tuple(float(n) for n in plane["normal_camera"])
    if len(normal) != 3 or len(camera["distortion"]) != 5:
        raise ValueError("camera or plane is incomplete")
    calibration = Calibration(
        sensor=_read_sensor(manifest["sensor"]),
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
        quality={stage: read_quality(rows) for stage, rows in manifest["quality"].items()},
        provenance=_read_provenance(manifest),
        full=read_full(manifest["full"], arrays) if "full" in manifest else None,
        response=CameraResponse(arrays["camera_response"].astype(np.float64))
        if "camera_response" in arrays
        else None,
        bad=_read_bad_pixels(arrays.get(BAD_PIXELS), camera["height"], camera["width"]),
        lens_blur_px=_read_blur(manifest.get("lens_blur_px")),
    )
    _check(calibration)
    _check_grid(calibration, manifest["grid"])
    _check_maps(calibration)
    return calibration


def _read_sensor(entry: dict[str, Any]) -> SensorData:
    """Return the stated sensor data, checked against the ranges of a session."""
    sensor = SensorData(**entry)
    plain_text(sensor.serial)
    for name, (low, high) in SENSOR_RANGES.items():
        value = getattr(sensor, name)
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not low <= value <= high
        ):
            raise ValueError(f"{name} has the invalid value {brief(value)}")
    return sensor


def _check_grid(calibration: Calibration, stated: dict[str, Any]) -> None:
    """Compare the grid given by the optics with the stored one, before it is used."""
    c = calibration
    grid = visible_grid(c.camera, c.plane, c.stack, diameter_mm=c.sensor.working_diameter_mm)
    made = _grid_entry(grid)
    if not np.allclose([float(stated[key]) for key in made], list(made.values()), atol=1e-6):
        raise ValueError("the grid of the maps differs from the grid of this program")
    if c.radiance.shape != (*grid.shape, 3):
        raise ValueError("radiance does not fit the optics")


def _read_reflectance(arrays: dict[str, NDArray[Any]]) -> ReflectanceTable:
    cosines = tuple(arrays[f"reflectance_cosines_{k}"] for k in range(3))
    values = tuple(arrays[f"reflectance_values_{k}"] for k in range(3))
    for nodes in (*cosines, *values):
        sized = nodes.ndim == 1 and 2 <= nodes.size <= NODES_LIMIT and np.isfinite(nodes).all()
        if not sized or not (np.diff(nodes) > 0).all():
            raise ValueError("the reflectance table is not monotone")
    if any(c.size != v.size for c, v in zip(cosines, values, strict=True)):
        raise ValueError("the columns of the reflectance table differ in length")
    return ReflectanceTable(
        (cosines[0], cosines[1], cosines[2]),
        (values[0], values[1], values[2]),
        arrays["reflectance_coverage"],
    )


def _read_blur(stated: Any) -> float | None:
    """Return the blur of lens and pixel; None in files without, which older programs wrote."""
    if stated is None:
        return None
    blur_px = float(stated)
    if not 0.0 < blur_px < MOST_BLUR_PX:
        raise ValueError(f"the blur of the lens is {brief(stated)} pixels")
    return blur_px


def _read_bad_pixels(pixels: NDArray[Any] | None, height: int, width: int) -> BadPixels | None:
    """Return the bad pixels; None in files without, which older programs wrote."""
    if pixels is None:
        return None
    if not np.isfinite(pixels).all() or (pixels != np.rint(pixels)).any():
        raise ValueError("bad pixels are not whole numbers")
    return BadPixels(pixels.astype(np.int32), height, width)


def _read_provenance(manifest: dict[str, Any]) -> Provenance:
    entry = manifest["provenance"]
    edits = tuple(_read_edit(edit) for edit in entry.get("edits", ()))
    remarks = {key: written_text(manifest.get(key, "")) for key in REMARKS}
    provenance = Provenance(**{**entry, "edits": edits, **remarks})
    for name in ("created", "operator", "program_version", "session"):
        written_text(getattr(provenance, name))
    for table in (provenance.sources, provenance.camera_settings):
        for key, value in table.items():
            written_text(key)
            if isinstance(value, str):
                written_text(value)
    return provenance


def _read_edit(entry: dict[str, Any]) -> HandEdit:
    channels = tuple(written_text(name) for name in entry["channels"])
    texts = {key: written_text(value) for key, value in entry.items() if key != "channels"}
    return HandEdit(**texts, channels=channels)


def _check(calibration: Calibration) -> None:
    """Refuse impossible values, even if the checksums are correct."""
    c = calibration
    lengths = [c.camera.width, c.camera.height, c.camera.fx, c.camera.fy, c.plane.distance_mm]
    numbers = np.array(
        [*lengths, c.camera.cx, c.camera.cy, *c.camera.distortion, *c.plane.normal_camera], float
    )
    if not np.isfinite(numbers).all() or min(lengths) <= 0:
        raise ValueError("camera or plane have impossible values")
    if type(c.camera.width) is not int or type(c.camera.height) is not int:
        raise ValueError("the image size is not a whole number")
    if c.camera.width * c.camera.height > MAX_PIXELS:
        raise ValueError("the image size is too large")
    if abs(float(np.linalg.norm(c.plane.normal_camera)) - 1.0) > 1e-6:
        raise ValueError("the normal of the plane does not have length 1")
    expected = {
        "led_positions_mm": ((3, 3), c.led_positions_mm),
        "led_covariance_mm2": ((3, 3, 3), c.led_covariance_mm2),
        "crosstalk": ((3, 3), c.crosstalk),
        "noise": ((3,), c.noise),
        "reflectance_coverage": ((3, 2), c.reflectance.coverage),
    }
    if c.full is not None:
        expected["full_led_positions_mm"] = ((3, 3), c.full.led_positions_mm)
        expected["full_led_sd_mm"] = ((3, 3), c.full.led_sd_mm)
    if c.model == "full" and c.full is None:
        raise ValueError("the full model is missing")
    for name, (shape, array) in expected.items():
        if array.shape != shape or not np.isfinite(array).all():
            raise ValueError(f"{name} has impossible values")
    if not np.linalg.cond(c.crosstalk) < MOST_CROSSTALK:
        raise ValueError("the crosstalk matrix cannot be inverted")


def _check_maps(calibration: Calibration) -> None:
    c = calibration
    maps = {"radiance": c.radiance, "factors": c.factors}
    if c.full is not None:
        maps["full_background"] = c.full.background
    rows_columns = c.radiance.shape[:2]
    for name, map_ in maps.items():
        if map_.shape != (*rows_columns, 3) or map_.dtype != np.float32:
            raise ValueError(f"{name} does not fit the optics")
        # Crosstalk is subtracted from the background, which leaves noise around zero where it is
        # dark.
        least = LEAST_BACKGROUND if name == "full_background" else 0.0
        if not np.isfinite(map_).all() or float(map_.min()) < least:
            raise ValueError(f"{name} has impossible values")
