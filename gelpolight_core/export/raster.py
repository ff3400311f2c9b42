"""Files that hold the depth as a regular grid: NumPy, TIFF and Gwyddion Simple Field."""

from __future__ import annotations

import json
from typing import Any, BinaryIO

import numpy as np

from gelpolight_core.reconstruction.heightmap import FLAG_NAMES, SD_MAPS, HeightMap


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


def write_npz(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write what the height map holds; what it does not hold (None) is left out.

    The standard deviations are described in :class:`HeightMap`. The examples of noise stay in the
    program.
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
    """
    import tifffile

    about = {
        "quantity": "depth_mm",
        "unit": "mm",
        "pitch_mm": float(heightmap.pitch_mm),
        "x0_mm": float(heightmap.x_mm[0]),
        "y0_mm": float(heightmap.y_mm[0]),
        **describe(heightmap),
    }
    per_centimetre = 10.0 / heightmap.pitch_mm
    tifffile.imwrite(
        file,
        heightmap.depth_mm.astype(np.float32, copy=False),
        byteorder="<",
        photometric="minisblack",
        resolution=(per_centimetre, per_centimetre),
        resolutionunit="CENTIMETER",
        description=json.dumps(about),
        metadata=None,
        software="GelPoLight Studio",
    )


def write_gsf(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write a Gwyddion Simple Field: the depth in metres, as its format asks for.

    Its lengths are those of the pixels' outline, half a pixel beyond the outermost centres.

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
