"""A height map as a message for other programs: a header in JSON, then the arrays as bytes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError
from gelpolight_core.health.frame_health import as_dict
from gelpolight_core.reconstruction.height_map import FLAG_NAMES, HeightMap

TOPIC = b"depth"
FORMAT, VERSION = "gelpolight-live", 1
_TYPES = {"depth_mm": "<f4", "normals": "<f4", "flags": "|u1"}


def encode_message(heightmap: HeightMap, *, frame: int, time_s: float, serial: str) -> list[bytes]:
    """Return the parts of a message: topic, header, and the bytes of each array.

    Parameters
    ----------
    heightmap : HeightMap
        As reconstructed. Normals are sent if it has them.
    frame : int
        Number of the frame. Gaps are frames that were not sent.
    time_s : float
        When it was captured, in s of a clock that never goes back.
    serial : str
        Serial number of the sensor.
    """
    arrays = {name: getattr(heightmap, name) for name in _TYPES}
    sent = {
        name: np.ascontiguousarray(values, _TYPES[name])
        for name, values in arrays.items()
        if values is not None
    }
    header = {
        "format": FORMAT,
        "version": VERSION,
        "frame": frame,
        "time_s": time_s,
        "serial": serial,
        "calibration_id": heightmap.calibration_id,
        "model": heightmap.model,
        "pitch_mm": float(heightmap.pitch_mm),
        "x0_mm": float(heightmap.x_mm[0]),
        "y0_mm": float(heightmap.y_mm[0]),
        "flag_names": dict(FLAG_NAMES),
        "notes": [finding.line for finding in heightmap.findings],
        "health": _health(heightmap),
        "parts": [
            {"name": name, "dtype": _TYPES[name], "shape": list(values.shape)}
            for name, values in sent.items()
        ],
    }
    text = json.dumps(header, allow_nan=False).encode()
    return [TOPIC, text, *(values.tobytes() for values in sent.values())]


def decode_message(parts: Sequence[bytes]) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the header and the arrays of a message.

    Raises
    ------
    InputError
        If it is no message of a height map, or one of a newer program.
    """
    try:
        header = json.loads(parts[1])
        if (header["format"], header["version"]) != (FORMAT, VERSION):
            raise ValueError("another format or version")
        arrays = {
            part["name"]: np.frombuffer(data, part["dtype"]).reshape(part["shape"])
            for part, data in zip(header["parts"], parts[2:], strict=True)
        }
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise InputError(
            "it is not a height map message that this program can read",
            "stream",
            "Subscribe to a stream of the same version of the program",
        ) from error
    return header, arrays


def _health(heightmap: HeightMap) -> dict[str, Any]:
    health = heightmap.health
    if health is None:
        return {"checked": False, "findings": [], "unknown": [], "untouched": None}
    return {
        "checked": True,
        "findings": [as_dict(finding) for finding in health.findings],
        "unknown": list(health.unknown),
        "untouched": float(health.untouched),
    }
