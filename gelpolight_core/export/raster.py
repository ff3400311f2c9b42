"""Files that hold the depth as a regular grid: NumPy, TIFF, PNG and Gwyddion Simple Field."""

from __future__ import annotations

import io
import json
import struct
import zlib
from typing import Any, BinaryIO

import cv2
import numpy as np

from gelpolight_core.reconstruction.heightmap import FLAG_NAMES, SD_MAPS, HeightMap

GREY_LEVELS = 65_535
"""Of 16 bits, without the one that stands for an unknown depth."""
LEAST_STEP_MM = 1e-6
"""Step of a map without any difference of depth."""


def flag_names() -> list[str]:
    """Return the flags as they stand in files, such as ``dark=4``."""
    return [f"{name}={value}" for name, value in FLAG_NAMES.items()]


def describe(heightmap: HeightMap) -> dict[str, str]:
    """Return where the height map comes from, for formats that keep texts beside the data."""
    return {
        "calibration_id": heightmap.calibration_id,
        "model": heightmap.model,
        "source": heightmap.source,
        "flag_names": ", ".join(flag_names()),
    }


def _about(heightmap: HeightMap) -> dict[str, str | float]:
    """Return unit, scale and origin of the depth, for formats that keep texts."""
    return {
        "quantity": "depth_mm",
        "unit": "mm",
        "pitch_mm": float(heightmap.pitch_mm),
        "x0_mm": float(heightmap.x_mm[0]),
        "y0_mm": float(heightmap.y_mm[0]),
        **describe(heightmap),
    }


def write_npz(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write what the height map holds; what it does not hold (None) is left out.

    The standard deviations are described in :class:`HeightMap`. The examples of noise stay in the
    program.

    Parameters
    ----------
    heightmap : HeightMap
        What is written.
    file : binary file
        Open for writing.
    """
    arrays: dict[str, Any] = {
        "depth_mm": heightmap.depth_mm.astype(np.float32, copy=False),
        "x_mm": np.asarray(heightmap.x_mm),
        "y_mm": np.asarray(heightmap.y_mm),
        "flags": heightmap.flags.astype(np.uint8, copy=False),
        "flag_names": np.array(flag_names()),
        "pitch_mm": np.float64(heightmap.pitch_mm),
        "calibration_id": np.array(heightmap.calibration_id),
        "model": np.array(heightmap.model),
        "source": np.array(heightmap.source),
    }
    if heightmap.normals is not None:
        arrays["normals"] = heightmap.normals.astype(np.float32, copy=False)
    for name in SD_MAPS:
        values = getattr(heightmap, name)
        if values is not None:
            arrays[name] = values.astype(np.float32, copy=False)
    for name in ("depth_scale_sd", "lateral_scale_sd"):
        if getattr(heightmap, name) is not None:
            arrays[name] = np.float64(getattr(heightmap, name))
    np.savez(file, **arrays)


def write_tiff(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write the depth in mm, one float32 channel.

    The pitch is in the resolution tags (pixels per centimetre), and, with the place of the first
    pixel and the calibration, in the description as JSON.

    Parameters
    ----------
    heightmap : HeightMap
        What is written.
    file : binary file
        Open for writing.
    """
    import tifffile

    per_centimetre = 10.0 / heightmap.pitch_mm
    # Not into the file: NumPy's own writing does not say when the disk is full.
    held = io.BytesIO()
    tifffile.imwrite(
        held,
        heightmap.depth_mm.astype(np.float32, copy=False),
        byteorder="<",
        photometric="minisblack",
        resolution=(per_centimetre, per_centimetre),
        resolutionunit="CENTIMETER",
        description=json.dumps(_about(heightmap)),
        metadata=None,
        software="GelPoLight Studio",
    )
    file.write(held.getbuffer())


def write_png16(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write the depth as a grey PNG of 16 bits, with its scale.

    ``depth = offset_mm + step_mm * value``, right to within half a step; the value 0 stands for a
    depth that is not known. The scale is in the picture's text (keyword ``GelPoLight``) as JSON,
    with what a TIFF says too; the pitch is in its resolution as well.

    Parameters
    ----------
    heightmap : HeightMap
        What is written.
    file : binary file
        Open for writing.

    References
    ----------
    PNG specification (third edition), chunks tEXt and pHYs.
    """
    depth = heightmap.depth_mm.astype(np.float64)
    known = np.isfinite(depth)
    low, high = (float(f(depth[known])) if known.any() else 0.0 for f in (np.min, np.max))
    step = (high - low) / (GREY_LEVELS - 1) or LEAST_STEP_MM
    value = np.zeros(depth.shape, np.uint16)
    value[known] = 1 + np.round((depth[known] - low) / step).astype(np.uint16)
    about = {**_about(heightmap), "offset_mm": low - step, "step_mm": step, "unknown": 0}
    data = cv2.imencode(".png", value)[1].tobytes()
    per_metre = round(1e3 / heightmap.pitch_mm)
    chunks = _chunk(b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1))
    chunks += _chunk(b"tEXt", b"GelPoLight\0" + json.dumps(about).encode("ascii"))
    # After the signature and the header (8 + 25 bytes), where the standard wants them.
    file.write(data[:33] + chunks + data[33:])


def _chunk(kind: bytes, data: bytes) -> bytes:
    """Return one chunk of a PNG file."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write_gsf(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write a Gwyddion Simple Field: the depth in metres, as its format asks for.

    Its lengths are those of the pixels' outline, half a pixel beyond the outermost centres.

    Parameters
    ----------
    heightmap : HeightMap
        What is written.
    file : binary file
        Open for writing.

    References
    ----------
    Gwyddion user guide, "Simple Field Files".
    """
    rows, columns = heightmap.depth_mm.shape
    pitch_m = heightmap.pitch_mm * 1e-3
    header = {
        "XRes": columns,
        "YRes": rows,
        "XReal": columns * pitch_m,
        "YReal": rows * pitch_m,
        "XOffset": float(heightmap.x_mm[0]) * 1e-3 - pitch_m / 2,
        "YOffset": float(heightmap.y_mm[0]) * 1e-3 - pitch_m / 2,
        "XYUnits": "m",
        "ZUnits": "m",
        "Title": _one_line(f"Depth {heightmap.source}"),
        "CalibrationId": _one_line(heightmap.calibration_id),
        "Model": _one_line(heightmap.model),
    }
    lines = ["Gwyddion Simple Field 1.0", *(f"{key} = {value}" for key, value in header.items())]
    text = "".join(f"{line}\n" for line in lines).encode()
    file.write(text + b"\0" * (4 - len(text) % 4))
    file.write((heightmap.depth_mm.astype(np.float64) * 1e-3).astype("<f4").tobytes())


def _one_line(text: str) -> str:
    return "".join(character if character.isprintable() else " " for character in text)
