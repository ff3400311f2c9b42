"""Measuring a pressed cylinder, cuboid or ball in a depth map."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding
from gelpolight_core.reconstruction.height_map import HeightMap

from .fit_checks import fit_problems
from .indenter_fit import LARGEST_EDGE_MM, IndenterFit, Known, fit_object
from .indenter_models import MODELS
from .result import Measurement
from .segmentation import PressedMap, find_object, pressed_map
from .shape_detection import detect_shape
from .size_uncertainty import ModeError, SdByName, SdBySource, mode_error, sd_by_source

SHAPES = tuple(MODELS)
AUTO = "auto"
"""The value for automatic selection of the shape."""
STATED_SHARE, STATED_SD_MM = 0.1, 0.01
"""Standard deviation of a stated fillet, as a share of it and at least in mm: an edge that is
called sharp is broken by about 0.01 mm."""


def measure_heightmap(
    heightmap: HeightMap,
    *,
    shape: str,
    seed_mm: tuple[float, float] | None = None,
    edge_radius_mm: float | None = None,
    edge_radius_sd_mm: float | None = None,
) -> Measurement:
    """Measure the pressed object with all data of a height map.

    Parameters
    ----------
    heightmap : HeightMap
        Reconstructed with its uncertainty if the result is to contain noise and calibration.
    shape : {"auto", "ball", "cylinder", "cuboid"}
        What is pressed; ``auto`` fits all three.
    seed_mm : (float, float), optional
        A point (x, y) on the object; needed where several objects are pressed.
    edge_radius_mm : float, optional
        Stated fillet of the edge of a cylinder or cuboid; by default it is fitted.
    edge_radius_sd_mm : float, optional
        Its standard uncertainty.

    Raises
    ------
    InputError
        As :func:`measure_object`, or the shape is unclear. If the height map is doubtful, the
        reason comes first: it may be why nothing was found.
    """
    try:
        pressed: PressedMap | None = None
        if shape == AUTO:
            pressed = pressed_map(heightmap)
            shape = _detect_shape(heightmap, seed_mm, pressed)
        return measure_object(
            heightmap,
            shape=shape,
            seed_mm=seed_mm,
            mode=mode_error(heightmap),
            edge_radius_mm=edge_radius_mm,
            edge_radius_sd_mm=edge_radius_sd_mm,
            pressed=pressed,
        )
    except InputError as error:
        for doubt in heightmap.doubtful_findings:
            text = f"{doubt.text}; {error.found}"
            raise InputError(text, error.where, doubt.remedy or error.advice) from error
        raise


def _detect_shape(
    heightmap: HeightMap, seed_mm: tuple[float, float] | None, pressed: PressedMap
) -> str:
    """Return the shape that is pressed."""
    proposal = detect_shape(heightmap, seed_mm=seed_mm, pressed=pressed)
    if proposal is not None and len(proposal.candidates) == 1:
        return proposal.candidates[0]
    if proposal is None:
        text = "no ball, cylinder or cuboid is pressed"
    else:
        text = f"the object may be a {proposal.candidates[0]} or a {proposal.candidates[1]}"
    raise InputError(text, heightmap.source or "height map", Remedy.CHOOSE_SHAPE)


def measure_object(
    heightmap: HeightMap,
    *,
    shape: str,
    seed_mm: tuple[float, float] | None = None,
    mode: ModeError | None = None,
    edge_radius_mm: float | None = None,
    edge_radius_sd_mm: float | None = None,
    pressed: PressedMap | None = None,
) -> Measurement:
    """Measure an object of known shape: find, fit, judge, and state the uncertainty.

    Parameters
    ----------
    heightmap : HeightMap
        Depths that are not finite, or outside the working area, are left out; any other flag
        weights a depth down. With examples of its noise, the result contains the scatter of
        repeated measurements; with the scales' standard deviations, those of the calibration.
    shape : {"cylinder", "cuboid", "ball"}
        What was pressed.
    seed_mm : (float, float), optional
        A point on the object (x, y); needed where several objects are pressed.
    mode : ModeError, optional
        Errors of the map's model and effort; part of the sd.
    edge_radius_mm : float, optional
        Stated fillet of the edge of a cylinder or cuboid; by default it is fitted.
    edge_radius_sd_mm : float, optional
        Its standard uncertainty; by default a tenth of it, at least 0.01 mm.
    pressed : PressedMap, optional
        Usable part of the height map, if it is known.

    Raises
    ------
    InputError
        Unknown shape, an edge radius that cannot be, nothing pressed, several objects and no seed,
        no object at the seed, an object cut by the border.
    """
    if shape not in MODELS:
        text = f"unknown shape '{shape}'"
        raise InputError(text, "shape", Remedy.ONE_OF.format(names=", ".join(SHAPES)))
    window = find_object(heightmap, seed_mm, pressed=pressed)
    edge = None
    if edge_radius_mm is not None:
        edge = _stated(shape, edge_radius_mm, edge_radius_sd_mm)
    fit = fit_object(shape, window, edge)
    findings = fit_problems(fit, window, edge)
    return _measurement(fit, sd_by_source(fit, window, mode), findings)


def _stated(shape: str, edge_radius_mm: float, sd_mm: float | None) -> Known:
    """Return a stated fillet."""
    if "edge_radius_mm" not in MODELS[shape].names:
        text = "A ball has no edge radius"
        raise InputError(text, "edge radius", "Leave it out, or measure a cylinder or a cuboid")
    if not 0.0 <= edge_radius_mm <= LARGEST_EDGE_MM:
        text = f"The edge radius {edge_radius_mm:g} mm is not between 0 and {LARGEST_EDGE_MM:g} mm"
        raise InputError(text, "edge radius", "Correct it, or leave it out: it is fitted then")
    return Known(edge_radius_mm, sd_mm or max(STATED_SHARE * edge_radius_mm, STATED_SD_MM))


def _measurement(
    fit: IndenterFit, spread: SdBySource, findings: tuple[Finding, ...]
) -> Measurement:
    shape, values = fit.shape, fit.values
    diameter, side, yaw = None, None, None
    if shape == "cuboid":
        first, second, yaw = _sides(values)
        side = values[first], values[second]
    else:
        diameter = values["diameter_mm"]
    return Measurement(
        shape=shape,
        diameter_mm=diameter,
        side_mm=side,
        height_mm=values["height_mm"],
        centre_mm=(values["x_mm"], values["y_mm"]),
        yaw_deg=yaw,
        drape_decay_mm=values["drape_decay_mm"],
        sd=_spread(shape, values, spread.total),
        noise_sd=_spread(shape, values, spread.noise) if spread.noise else None,
        calibration_sd=_spread(shape, values, spread.calibration) if spread.calibration else None,
        mode_sd=_spread(shape, values, spread.mode) if spread.mode else None,
        edge_radius_mm=values.get("edge_radius_mm"),
        blur_mm=fit.blur_mm if "edge_radius_mm" in values else None,
        baseline_mm=values["offset_mm"],
        residual_rms_mm=fit.residual_rms_mm,
        outline_mm=MODELS[shape].outline(values),
        findings=findings,
    )


def _spread(shape: str, values: Mapping[str, float], sd: Mapping[str, float]) -> SdByName:
    """Return standard deviations of the fit's parameters under the measurement's names."""
    spread: SdByName = {
        "height_mm": sd["height_mm"],
        "centre_mm": (sd["x_mm"], sd["y_mm"]),
        "yaw_deg": None,
        "drape_decay_mm": sd["drape_decay_mm"],
    }
    if shape == "cuboid":
        first, second, _ = _sides(values)
        # Neither calibration nor mode changes an angle.
        spread |= {
            "side_mm": (sd[first], sd[second]),
            "yaw_deg": float(np.degrees(sd.get("yaw", 0.0))),
        }
    else:
        spread["diameter_mm"] = sd["diameter_mm"]
    return spread


def _sides(values: Mapping[str, float]) -> tuple[str, str, float]:
    """Return the first and the second side, and the yaw that they have in -45..45 degrees."""
    turns = round(values["yaw"] / (np.pi / 2.0))
    first, second = ("side_a_mm", "side_b_mm") if turns % 2 == 0 else ("side_b_mm", "side_a_mm")
    return first, second, float(np.degrees(values["yaw"] - turns * np.pi / 2.0))
