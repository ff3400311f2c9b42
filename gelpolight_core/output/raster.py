"""Files that hold the depth as a regular grid: NumPy, TIFF, PNG and CSV."""

from __future__ import annotations

import hashlib
import io
import json
import math
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.codec import pack, unpack
from gelpolight_core.base.file_texts import text_of_file
from gelpolight_core.base.finding import Finding, HeightReliability, Verdict
from gelpolight_core.base.npy import read_arrays
from gelpolight_core.base.safe_reading import check_version, invalid_file_guard, multiline_text
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.reconstruction.height_map import (
    FLAG_NAMES,
    SD_MAPS,
    SENSOR_NUMBERS,
    HeightMap,
    surface_slopes,
)

GREY_LEVELS = 65_535
"""Largest 16-bit value, as one value is reserved for unknown depths."""
NPZ_MAPS = ("depth_mm", "normals", *SD_MAPS)
NPZ_NUMBERS = ("pitch_mm", "lateral_per_mm", *SENSOR_NUMBERS)
NPZ_ORIGIN = ("calibration_id", "model", "source")
NPZ_TEXTS = (*NPZ_ORIGIN, "notes", "faults", "doubts", "flag_names")
CURVED = ("height_mm", "membrane")
"""Of a curved membrane: the surface itself, and the membrane at rest as JSON."""
NPZ_NAMES = (*NPZ_MAPS, *NPZ_NUMBERS, *NPZ_TEXTS, "x_mm", "y_mm", "flags", *CURVED)
HEAD = ("format", "version", "sha256")
FORMAT, VERSION = "gelpolight-height-map", 1
UNIT_FACTOR = math.sqrt(10.0)
"""Slopes of depths and of normals differ by less, and units of length by at least its square."""
LEAST_STEP_MM = 1e-6
"""Step for a map with constant depth."""


def flag_names() -> list[str]:
    """Return the flags as written to files, such as ``dark=4``."""
    return [f"{name}={value}" for name, value in FLAG_NAMES.items()]


def _about(heightmap: HeightMap) -> dict[str, str | float]:
    """Return unit, scale and origin of the depth, for formats with text metadata."""
    return {
        "quantity": "depth_mm",
        "unit": "mm",
        "pitch_mm": float(heightmap.pitch_mm),
        "x0_mm": float(heightmap.x_mm[0]),
        "y0_mm": float(heightmap.y_mm[0]),
        "calibration_id": heightmap.calibration_id,
        "model": heightmap.model,
        "source": heightmap.source,
        "flag_names": ", ".join(flag_names()),
    }


def write_npz(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write all parts of the height map that it has.

    The standard deviations are described in :class:`HeightMap`. The noise samples, the trace and
    the details of the health check are not written.

    Parameters
    ----------
    heightmap : HeightMap
        The height map.
    file : binary file
        Open for writing.
    """
    arrays: dict[str, Any] = {
        name: np.asarray(values, kind)
        for names, kind in ((NPZ_MAPS, np.float32), (NPZ_NUMBERS, np.float64))
        for name in names
        if (values := getattr(heightmap, name)) is not None
    }
    arrays |= {name: np.array(getattr(heightmap, name)) for name in (*NPZ_ORIGIN, "x_mm", "y_mm")}
    arrays["flags"] = heightmap.flags.astype(np.uint8, copy=False)
    arrays["flag_names"] = np.array(flag_names())
    arrays["notes"] = np.array(list(map(_note, heightmap.findings)), dtype=np.str_)
    if not heightmap.at_rest.flat:
        arrays["height_mm"] = heightmap.height_mm
        arrays["membrane"] = np.array(json.dumps(pack(heightmap.at_rest, {}, "membrane")))
    doubts = [doubtful.text for doubtful in heightmap.doubtful_findings]
    arrays["faults"] = np.array(doubts, dtype=np.str_)
    np.savez(file, **arrays, format=FORMAT, version=VERSION, sha256=_checksum(arrays))


def _checksum(arrays: Mapping[str, Any]) -> str:
    """Return the SHA-256 of arrays with their names, types and shapes."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {np.shape(arrays[name])}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def read_npz(path: Path) -> HeightMap:
    """Return the height map of a file that :func:`write_npz` wrote.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    InputError
        If it cannot be read, or is not a height map.
    """
    message = "The file is not a height map in npz format, or is damaged ({error})"
    with invalid_file_guard(message, path):
        stored = read_arrays(path, (*NPZ_NAMES, *HEAD))
        head = {key: stored.pop(key).item() for key in HEAD if key in stored}
        if head:  # files of earlier programs have none
            check_version(head, FORMAT, VERSION, path)
            if head["sha256"] != _checksum(stored):
                raise ValueError("the checksum is wrong")
        texts = {name: stored[name].tolist() for name in NPZ_TEXTS if name in stored}
        for name in NPZ_ORIGIN:
            multiline_text(texts[name])
        # Files of one earlier state of the program have the faults under another name.
        faults = [*texts.pop("faults", ()), *texts.pop("doubts", ())]
        findings = _findings(texts.pop("notes", []), faults)
        if not {*texts.pop("flag_names", ())} <= {*flag_names()}:
            raise ValueError("flag_names")
        values: dict[str, Any] = {"normals": None}
        if "membrane" in stored:
            at_rest = unpack(MembraneShape, json.loads(stored["membrane"].item()), {}, "membrane")
            at_rest.check()
            values["at_rest"] = at_rest
        values |= {name: stored[name].astype(np.float32) for name in NPZ_MAPS if name in stored}
        values |= {name: float(stored[name]) for name in NPZ_NUMBERS if name in stored}
        heightmap = HeightMap(
            x_mm=stored["x_mm"].astype(np.float64),
            y_mm=stored["y_mm"].astype(np.float64),
            flags=stored["flags"].astype(np.uint8, casting="safe"),
            findings=findings,
            **values,
            **texts,
        )
        _refuse_contradictions(heightmap)
    return heightmap


def _note(finding: Finding) -> str:
    return finding.line if finding.remedy else finding.text


def _findings(notes: list[str], faults: list[str]) -> tuple[Finding, ...]:
    """Return the findings of a file, which holds their texts."""
    return tuple(
        Finding(
            "note",
            text_of_file(text),
            verdict=Verdict.WARN if text in faults else Verdict.PASS,
            heights=HeightReliability.DOUBTFUL if text in faults else HeightReliability.STATED,
        )
        for text in dict.fromkeys((*notes, *faults))
    )


def _refuse_contradictions(heightmap: HeightMap) -> None:
    """Raise ValueError where the numbers of a file cannot all be true."""
    for name in ("x_mm", "y_mm"):
        places = getattr(heightmap, name)
        expected = places[0] + heightmap.pitch_mm * np.arange(places.size)
        # Written in float64: a hundredth of the pitch is far more than rounding.
        if not np.abs(places - expected).max() <= 0.01 * heightmap.pitch_mm:
            raise ValueError(f"{name} contradicts pitch_mm")
    valid_mask, depth_mm = heightmap.known, heightmap.depth_mm
    if np.isinf(depth_mm).any() or np.isnan(depth_mm[heightmap.stated]).any():
        raise ValueError("depth_mm is not finite where flags states a depth")
    width_mm = heightmap.pitch_mm * max(depth_mm.shape)
    if np.abs(depth_mm[valid_mask]).max(initial=0.0) > width_mm:
        raise ValueError("depth_mm is larger than the sensor: another unit?")
    for name in SD_MAPS:
        values = getattr(heightmap, name)
        if values is not None and np.any(values < 0.0):
            raise ValueError(f"{name} is negative")
    for name in (*SENSOR_NUMBERS, "lateral_per_mm"):
        number = getattr(heightmap, name)
        if number is not None and not 0.0 <= number < math.inf:
            raise ValueError(f"{name} is {number}")
    if heightmap.normals is not None and valid_mask.any() and min(valid_mask.shape) > 1:
        _refuse_other_slopes(heightmap, heightmap.normals[valid_mask].astype(np.float64))


def _refuse_other_slopes(heightmap: HeightMap, normals: NDArray[np.float64]) -> None:
    """Raise ValueError where the normals of the known points contradict the depths."""
    # Far more than float32 rounds the length of a unit normal.
    if not np.all(np.abs(np.linalg.norm(normals, axis=1) - 1.0) < 1e-3):
        raise ValueError("normals are not unit vectors")
    if not np.all(normals[:, 2] < 0.0):
        raise ValueError("normals point away from the camera")
    slopes = np.stack(surface_slopes(-heightmap.height_mm, heightmap.pitch_mm), axis=-1)
    slopes = slopes[heightmap.known].astype(np.float64)
    finite = np.isfinite(slopes).all(axis=1)
    normal_slopes = normals[finite, :2] / normals[finite, 2:]
    of_depth, of_normals = (float(np.sqrt(np.sum(s**2))) for s in (slopes[finite], normal_slopes))
    if not of_normals / UNIT_FACTOR <= of_depth <= UNIT_FACTOR * of_normals:
        raise ValueError("depth_mm contradicts normals: another unit?")


def write_tiff(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write the depth in mm, one float32 channel.

    The pitch is in the resolution tags (pixels per centimetre), and, with the position of the first
    pixel and the calibration, in the description as JSON.

    Parameters
    ----------
    heightmap : HeightMap
        The height map.
    file : binary file
        Open for writing.
    """
    import tifffile

    per_centimetre = 10.0 / heightmap.pitch_mm
    # Not directly into the file: NumPy's own writing does not report a full disk.
    buffer = io.BytesIO()
    tifffile.imwrite(
        buffer,
        heightmap.depth_mm.astype(np.float32, copy=False),
        byteorder="<",
        photometric="minisblack",
        resolution=(per_centimetre, per_centimetre),
        resolutionunit="CENTIMETER",
        description=json.dumps(_about(heightmap)),
        metadata=None,
        software="GelPoLight Studio",
    )
    file.write(buffer.getbuffer())


def write_png16(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write the depth as a 16-bit grey PNG, with its scale.

    ``depth = offset_mm + step_mm * value``, with an error of at most half a step; the value 0 means
    an unknown depth. The scale is in the text metadata of the image (keyword ``GelPoLight``) as
    JSON, with the same data as in a TIFF; the pitch is also in its resolution.

    Parameters
    ----------
    heightmap : HeightMap
        The height map.
    file : binary file
        Open for writing.

    References
    ----------
    PNG specification (third edition), chunks tEXt and pHYs.
    """
    depth = heightmap.depth_mm.astype(np.float64)
    valid_mask = np.isfinite(depth)
    low, high = (float(f(depth[valid_mask])) if valid_mask.any() else 0.0 for f in (np.min, np.max))
    step = (high - low) / (GREY_LEVELS - 1) or LEAST_STEP_MM
    value = np.zeros(depth.shape, np.uint16)
    value[valid_mask] = 1 + np.round((depth[valid_mask] - low) / step).astype(np.uint16)
    about = {**_about(heightmap), "offset_mm": low - step, "step_mm": step, "unknown": 0}
    data = cv2.imencode(".png", value)[1].tobytes()
    per_metre = round(1e3 / heightmap.pitch_mm)
    chunks = _chunk(b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1))
    chunks += _chunk(b"tEXt", b"GelPoLight\0" + json.dumps(about).encode("ascii"))
    # After the signature and the header (8 + 25 bytes), as required by the standard.
    file.write(data[:33] + chunks + data[33:])


def _chunk(kind: bytes, data: bytes) -> bytes:
    """Return one chunk of a PNG file."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write_csv(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write the depth as a table: x in mm in the first row, y in mm in the first column.

    Places without depth are empty.
    """
    header = ",".join(["depth_mm", *(f"{x:.6g}" for x in heightmap.x_mm)])
    file.write(f"{header}\n".encode())
    valid_mask = heightmap.known
    for y, depths, is_valid in zip(heightmap.y_mm, heightmap.depth_mm, valid_mask, strict=True):
        cells = (f"{d:.6g}" if k else "" for d, k in zip(depths, is_valid, strict=True))
        file.write(f"{y:.6g},{','.join(cells)}\n".encode())
