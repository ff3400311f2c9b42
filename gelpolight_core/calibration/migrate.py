"""Calibration files of earlier versions in today's form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.manifest import FIRST_NESTED

Arrays = dict[str, NDArray[Any]]

OLDER_NAME = "bounce"
"""Of the interreflection, in files of earlier programs."""
OLDER_INTERREFLECTION_SD = 0.03
"""Of the height, share. Older files hold the share of the neighbourhood's light that came back: it
is near the membrane's reflectance, but not equal to it."""

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


def migrate(manifest: dict[str, Any], arrays: Arrays) -> tuple[dict[str, Any], Arrays]:
    """Return the data of a file of any version, and its arrays by their paths of today.

    Parameters
    ----------
    manifest : dict
        As stored.
    arrays : dict
        By their names in the file.
    """
    if manifest["version"] >= FIRST_NESTED:
        return manifest["data"], arrays
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


def _open_data(manifest: dict[str, Any], arrays: Arrays) -> dict[str, Any]:
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


def _full(entry: dict[str, Any], arrays: Arrays) -> dict[str, Any]:
    full = {**entry, "membrane": dict(entry["membrane"])}
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
