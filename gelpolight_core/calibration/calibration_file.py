"""The calibration file (.gplcal): a zip archive of a manifest and plain arrays, checked completely.

``manifest.json`` contains every number that is not an array, with units in the key names, and the
SHA-256, shape and type of every array; the arrays are NumPy files without pickle. The file is
written completely or not at all, and a damaged one is refused before any part of it is used.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import zipfile
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.atomic_write import write_atomically
from gelpolight_core.base.codec import pack, unpack
from gelpolight_core.base.npy import array_of
from gelpolight_core.base.safe_reading import plain_text, read_member
from gelpolight_core.geometry.resampling import MembraneGrid
from gelpolight_core.sensor.closed_sensor.closed_sensor_data import MODEL, ClosedSensor
from gelpolight_core.sensor.sensor_calibration import (
    MODELS,
    ROUNDING,
    Calibration,
    OpenSensor,
    Provenance,
    SensorModel,
)
from gelpolight_core.session.validation import validation_in

from .manifest import (
    FIRST_NESTED,
    FORMAT,
    HEAD_LIMIT,
    MANIFEST,
    VERSION,
    check_arrays,
    declared_bytes,
    open_archive,
    read_manifest,
    read_quality,
)

ArraysByName = dict[str, NDArray[Any]]

OLDER_NAME = "bounce"
"""Of the interreflection, in files of earlier programs."""
OLDER_INTERREFLECTION_SD = 0.03
"""Of the height, share. Older files hold the share of the neighbourhood's light that came back: it
is near the membrane's reflectance, but not equal to it."""

OLDER_CHOICES = {"held_out", "membrane_held_out", "membrane_kept", "evidence"}
"""What held-out presses said of LEDs, membrane and terms, in files of earlier programs."""

IN_PLACE_ARRAYS = {
    "background": "in_place.background",
    "slope_coefficients": "in_place.coefficients",
    "seen_colours": "in_place.seen_colours",
    "error_slopes": "in_place.errors.slopes",
    "error_slope_sd": "in_place.errors.slope_sd",
}
OTHER_ARRAYS = {
    "reflectance_coverage": "reflectance.coverage",
    "camera_response": "response.curves",
    "bad_pixels": "bad.pixels",
}


def migrate(manifest: dict[str, Any], arrays: ArraysByName) -> tuple[dict[str, Any], ArraysByName]:
    """Return data and arrays of a file of any version, laid out as today.

    Parameters
    ----------
    manifest : dict
        As stored.
    arrays : dict
        By their names in the file.
    """
    if manifest["version"] >= FIRST_NESTED:
        data = dict(manifest["data"])
        if data.get("full") is not None:
            data["full"] = {k: v for k, v in data["full"].items() if k not in OLDER_CHOICES}
        return data, arrays
    if "in_place" in manifest:
        names = IN_PLACE_ARRAYS
        data = _closed_data(manifest)
    else:
        names = {}
        data = _open_data(manifest, arrays)
    data["response"] = {} if "camera_response" in arrays else None
    return data, {f"data.{names.get(name) or _path(name)}": array for name, array in arrays.items()}


def _path(name: str) -> str:
    """Return today's path of an array of an open sensor."""
    for part in ("reflectance_cosines_", "reflectance_values_"):
        if name.startswith(part):
            return part.replace("_", ".") + name.removeprefix(part)
    return OTHER_ARRAYS.get(name, name.replace("full_", "full.", 1))


def _closed_data(manifest: dict[str, Any]) -> dict[str, Any]:
    entry = manifest["in_place"]
    size = {key: manifest["camera"][key] for key in ("width", "height")}
    return {
        "serial": manifest["sensor"]["serial"],
        "in_place": {
            "grid": {"image": size, "mm_per_px": entry["mm_per_px"]},
            "steepest": entry["steepest_slope"],
            "errors": {
                "depth_share": entry["depth_share_sd"],
                "depth_floor_mm": entry["depth_floor_mm"],
            },
            "follow_gain": entry["follow_gain"],
            "scale_sd": entry["scale_sd"],
        },
        "balls": entry["balls"],
    }


def _open_data(manifest: dict[str, Any], arrays: ArraysByName) -> dict[str, Any]:
    camera = manifest["camera"]
    data = {key: manifest[key] for key in ("sensor", "camera", "plane")}
    data["reflectance"] = {"cosines": [None] * 3, "values": [None] * 3}
    data["lens_blur_px"] = manifest.get("lens_blur_px")
    if "bad_pixels" in arrays:
        pixels = arrays["bad_pixels"]
        if not np.isfinite(pixels).all() or (pixels != np.rint(pixels)).any():
            raise ValueError("bad pixels are not whole numbers")
        arrays["bad_pixels"] = pixels.astype(np.int32)
        data["bad"] = {key: camera[key] for key in ("width", "height")}
    if "full" in manifest:
        data["full"] = _full(manifest["full"], arrays)
    return data


def _full(entry: dict[str, Any], arrays: ArraysByName) -> dict[str, Any]:
    full = {key: value for key, value in entry.items() if key not in OLDER_CHOICES}
    full["membrane"] = dict(entry["membrane"])
    full["membrane_sd"] = dict(entry.get("membrane_sd", {}))
    for named in (full["membrane_sd"], full["membrane"]):
        if OLDER_NAME in named:
            named["interreflection"] = named.pop(OLDER_NAME)
    reach_mm = full["membrane"].pop("bounce_reach_mm", None)
    if reach_mm is not None:
        full["older_reach_mm"] = reach_mm
        scale = full.get("scale_sd")
        if scale is not None and full["membrane"]["interreflection"] > 0.0:
            depth = math.hypot(scale["depth"], OLDER_INTERREFLECTION_SD)
            full["scale_sd"] = {**scale, "depth": depth}
    if "full_membrane_diffuse" in arrays:
        full["membrane"]["diffuse"] = arrays.pop("full_membrane_diffuse").astype(float).tolist()
    return full


# A fixed time stamp: the same calibration gives the same bytes.
ZIP_TIME = (1980, 1, 1, 0, 0, 0)
KINDS: dict[str, type[SensorModel]] = {**dict.fromkeys(MODELS, OpenSensor), MODEL: ClosedSensor}
"""What is calibrated for each model."""


def write_calibration(
    calibration: Calibration, path: str | PathLike[str], *, new: bool = False
) -> None:
    """Write a calibration file, completely or not at all.

    Parameters
    ----------
    calibration : Calibration
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
    manifest, arrays = contents_of(calibration)
    encoded = {name: _encode(array) for name, array in arrays.items()}
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
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for name, data in (
                (MANIFEST, text),
                (f"{MANIFEST}.sha256", manifest_sum),
                *((f"{n}.npy", d) for n, d in encoded.items()),
            ):
                archive.writestr(zipfile.ZipInfo(name, ZIP_TIME), data, zipfile.ZIP_DEFLATED)

    write_atomically(Path(path), write, new=new)


def read_calibration(path: str | PathLike[str]) -> Calibration:
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
    with open_archive(path) as archive:
        manifest = read_manifest(archive, path)
        check_arrays(manifest["arrays"], archive)
        arrays = {
            name: _read_array(archive, name, entry) for name, entry in manifest["arrays"].items()
        }
        calibration = _build(manifest, arrays, path)
        # Files of the first programs may state a name that this program cannot compute.
        is_nested = manifest["version"] >= FIRST_NESTED
        if is_nested and calibration.identity != manifest["identity"]:
            raise ValueError("its identity does not follow from its numbers")
    return calibration


def _encode(array: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.ascontiguousarray(array), allow_pickle=False)
    return buffer.getvalue()


def contents_of(c: Calibration) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the manifest of a calibration file, and the arrays beside it by their names."""
    arrays: dict[str, NDArray[Any]] = {}
    manifest: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "identity": c.identity,
        "serial": c.serial,
        "model": c.model,
        "image_size": [c.camera.width, c.camera.height],
        "units": {"length": "mm", "image": "linear light 0..1", "camera": "px"},
        "grid": _grid_entry(c.table.grid),
        "data": pack(c.data, arrays, "data"),
        "quality": {stage: table.as_rows() for stage, table in c.quality.items()},
        "provenance": pack(c.provenance, arrays, "provenance"),
    }
    # The validation of a calibration is none of the same calibration with other numbers.
    if c.validation is not None and c.validation.identity == c.identity:
        manifest["validation"] = c.validation.as_json()
    return manifest, arrays


def _grid_entry(grid: MembraneGrid) -> dict[str, Any]:
    """Return the position of the maps' nodes. The grid is recomputed on reading and must match."""
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


def _build(manifest: dict[str, Any], arrays: dict[str, NDArray[Any]], path: Path) -> Calibration:
    model = manifest["model"]
    if model not in KINDS:
        raise ValueError(f"unknown model {model!r}")
    stored, arrays = migrate(manifest, arrays)
    data = unpack(KINDS[model], stored, arrays, "data")
    plain_text(data.serial)
    data.check()
    calibration = Calibration(
        model,
        data,
        quality={stage: read_quality(rows) for stage, rows in manifest["quality"].items()},
        provenance=unpack(Provenance, manifest["provenance"], {}, "provenance"),
        validation=validation_in(manifest, path),
    )
    grid = _grid_entry(calibration.table.grid)
    stored_grid = [float(manifest["grid"][key]) for key in grid]
    if not np.allclose(stored_grid, list(grid.values()), atol=ROUNDING):
        raise ValueError("the grid of the maps differs from the grid of this program")
    if model == MODELS[-1] and calibration.open_sensor.full is None:
        raise ValueError("the full model is missing")
    return calibration
