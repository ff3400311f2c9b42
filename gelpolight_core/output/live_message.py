"""A height map as a message for other programs: a header in JSON, then the arrays as bytes."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

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
