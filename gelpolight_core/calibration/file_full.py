"""The part of the calibration file for the full model."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reflectance.membrane import CURVE_NODES, MEMBRANES, Membrane
from gelpolight_core.sensor_calibration import FullModel, ScaleSd

CURVES = "full_membrane_diffuse"
OLDER_NAME = "bounce"
"""Of the interreflection, in files of earlier programs."""
OLDER_INTERREFLECTION_SD = 0.03
"""Of the height, share. Older files hold the share of the neighbourhood's light that came back: it
is near the membrane's reflectance, but not equal to it."""


def full_entry(full: FullModel) -> dict[str, Any]:
    """Return the part of a full model that goes into the manifest."""
    membrane = asdict(full.membrane)
    del membrane["diffuse"]
    scale = {} if full.scale_sd is None else {"scale_sd": asdict(full.scale_sd)}
    return {
        **scale,
        "membrane": membrane,
        "membrane_sd": dict(full.membrane_sd),
        "membrane_held_out": list(full.membrane_held_out),
        "membrane_kept": full.membrane_kept,
        "decay_mm": full.decay_mm,
        "misfit": full.misfit,
        "held_out": list(full.held_out),
        "kept": full.kept,
    }


def full_arrays(full: FullModel) -> dict[str, NDArray[Any]]:
    """Return the arrays of a full model by their names in the file."""
    arrays: dict[str, NDArray[Any]] = {
        "full_led_positions_mm": full.led_positions_mm,
        "full_led_sd_mm": full.led_sd_mm,
        "full_background": full.background,
    }
    if full.membrane.diffuse:
        arrays[CURVES] = full.membrane.curves
    return arrays


def read_full(entry: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> FullModel:
    """Return the full model of a file, with its plain values checked.

    Raises
    ------
    ValueError
        If a value is missing or impossible.
    """
    before, after = (float(value) for value in entry["held_out"])
    lengths = np.array([entry["decay_mm"], entry["misfit"], before, after], float)
    if not np.isfinite(lengths).all() or lengths.min() < 0.0 or lengths[0] == 0.0:
        raise ValueError("the figures of the joint refinement are impossible")
    if entry["kept"] not in ("refined", "mirror"):
        raise ValueError(f"unknown LED choice {entry['kept']!r}")
    # Files of version 1 do not have the following entries.
    kept = entry.get("membrane_kept", MEMBRANES[0])
    if kept not in MEMBRANES:
        raise ValueError(f"unknown membrane {kept!r}")
    two_lobe, one_dimensional = (float(v) for v in entry.get("membrane_held_out", (0.0, 0.0)))
    sd = {str(name): float(value) for name, value in entry.get("membrane_sd", {}).items()}
    membrane = dict(entry["membrane"])
    for named in (sd, membrane):
        if OLDER_NAME in named:
            named["interreflection"] = named.pop(OLDER_NAME)
    figures = np.array([two_lobe, one_dimensional, *sd.values()], float)
    if not np.isfinite(figures).all() or figures.min() < 0.0:
        raise ValueError("the figures of the membrane are impossible")
    reach_mm = float(membrane.pop("bounce_reach_mm", np.inf))
    if not reach_mm > 0.0:
        raise ValueError("the membrane has impossible values")
    scale_sd = _read_scale(entry["scale_sd"]) if "scale_sd" in entry else None
    if reach_mm < np.inf and scale_sd is not None and float(membrane["interreflection"]) > 0.0:
        scale_sd = replace(
            scale_sd, depth=float(np.hypot(scale_sd.depth, OLDER_INTERREFLECTION_SD))
        )
    return FullModel(
        led_positions_mm=arrays["full_led_positions_mm"],
        led_sd_mm=arrays["full_led_sd_mm"],
        membrane=_read_membrane(membrane, arrays.get(CURVES)),
        background=arrays["full_background"],
        decay_mm=float(entry["decay_mm"]),
        misfit=float(entry["misfit"]),
        held_out=(before, after),
        kept=str(entry["kept"]),
        membrane_sd=sd,
        membrane_held_out=(two_lobe, one_dimensional),
        membrane_kept=str(kept),
        scale_sd=scale_sd,
    )


def _read_scale(entry: dict[str, Any]) -> ScaleSd:
    scale = ScaleSd(**{name: float(value) for name, value in entry.items()})
    numbers = np.array([scale.depth, scale.lateral, scale.balls])
    if not np.isfinite(numbers).all() or numbers.min() < 0.0:
        raise ValueError("the uncertainty of lengths is impossible")
    return scale


def _read_membrane(entry: dict[str, Any], curves: NDArray[Any] | None) -> Membrane:
    values = {name: float(value) for name, value in entry.items()}
    diffuse: tuple[tuple[float, ...], ...] = ()
    if curves is not None:
        if curves.shape != (3, CURVE_NODES) or not np.isfinite(curves).all():
            raise ValueError("the membrane curves have impossible values")
        if curves.min() < 0.0 or (np.diff(curves, axis=1) < 0.0).any():
            raise ValueError("the membrane curves are not monotone")
        if not (curves[:, -1] > 0.0).all():
            raise ValueError("the membrane curves are dark")
        diffuse = tuple(tuple(curve) for curve in curves.astype(np.float64).tolist())
    membrane = Membrane(**values, diffuse=diffuse)
    if not np.isfinite(list(values.values())).all() or not 0.0 <= membrane.gloss < 1.0:
        raise ValueError("the membrane has impossible values")
    if membrane.exponent <= 0.0 or not 0.0 < membrane.roughness <= 1.0:
        raise ValueError("the membrane has impossible values")
    if membrane.interreflection < 0.0:
        raise ValueError("the membrane has impossible values")
    return membrane
