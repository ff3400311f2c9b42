"""Measuring a pressed cylinder, cuboid or ball in a depth map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from scipy import ndimage

from gelpolight_core.arrays import Array, Mask
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.finding import Finding
from gelpolight_core.geometry.drape import TYPICAL_DECAY_MM
from gelpolight_core.measurement.fit import (
    EDGES_MM,
    EdgePrior,
    FitResult,
    WindowData,
    fit_indenter,
    near_wall,
)
from gelpolight_core.measurement.fit_checks import fit_problems, no_anchor
from gelpolight_core.measurement.indenter import MODELS, IndenterModel
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.segmentation import (
    SECONDARY_SHARE,
    PressedRegion,
    find_pressed_regions,
)
from gelpolight_core.measurement.spread import (
    ModeError,
    Spread,
    calibration_sd,
    combined,
    mode_sd,
    noise_of_fit,
)
from gelpolight_core.reconstruction.checks import MOST_PITCH
from gelpolight_core.reconstruction.height_map import Flag, HeightMap
from gelpolight_core.surface import FLAT, Surface

SHAPES = tuple(MODELS)
MARGIN_MM = 3.0
"""Width of the ground around the half-height outline that is fitted: four decay lengths of 0.7
mm."""
OTHER_REACH_MM = 2.5
"""How far the drape of another object reaches into the ground around this one."""
DRAPE_MM = 1.5
"""Where the drape falls to a tenth of the height, about two decay lengths."""
EDGE_RADIUS_MM = 0.08
"""Fillet of an object's edge if the map does not show it, known to half of itself: edges of printed
and machined indenters have 0.05 to 0.1 mm."""
STATED_SHARE, STATED_SD_MM = 0.1, 0.01
"""Standard deviation of a stated fillet, as a share of it and at least in mm: an edge that is
called sharp is broken by about 0.01 mm."""
SEED_REACH_MM = 1.0
"""How far beside an object's half-height outline a seed point may lie."""


def measure_object(
    heightmap: HeightMap,
    *,
    shape: str,
    seed_mm: tuple[float, float] | None = None,
    mode: ModeError | None = None,
    reach_mm: float = 0.0,
    edge_radius_mm: float | None = None,
    edge_radius_sd_mm: float | None = None,
    pressed: PressedMap | None = None,
) -> Measurement:
    """Measure the object that is pressed into the membrane; its drape is fitted, too.

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
        What the map's model and effort leave; part of the sd.
    reach_mm : float, optional
        Least correlation length of the map's errors. Errors of maps that were integrated from
        slopes are correlated over the drape; 0 if they can be white noise.
    edge_radius_mm : float, optional
        Stated fillet of the edge of a cylinder or cuboid; by default it is fitted.
    edge_radius_sd_mm : float, optional
        Its standard uncertainty; by default a tenth of it, at least 0.01 mm.
    pressed : PressedMap, optional
        Of the height map, if it is known.

    Raises
    ------
    InputError
        Unknown shape, an edge radius that cannot be, nothing pressed, several objects and no seed,
        no object at the seed, an object cut by the border.
    """
    if shape not in MODELS:
        raise InputError(
            f"unknown shape '{shape}'",
            "shape",
            Remedy.ONE_OF.format(names=", ".join(SHAPES)),
        )
    pressed = pressed or pressed_map(heightmap)
    window, region, prior = find_object(pressed, seed_mm, reach_mm=reach_mm, mode=mode)
    if shape == "ball" and mode is not None and mode.smoothed_mm2:
        window = replace(window, depth_mm=_sharpened(window, mode.smoothed_mm2))
    model = MODELS[shape]
    if edge_radius_mm is not None:
        prior = _stated(prior, model, edge_radius_mm, edge_radius_sd_mm)
    fit = fit_indenter(model, window, model.start(region), edge=prior)
    anchor = no_anchor(heightmap.flags, region)
    problems = (*fit_problems(shape, fit, window, region, prior), anchor)
    findings = tuple(finding for finding in problems if finding is not None)
    face = _face(shape, fit, window)
    noise = {} if heightmap.noise_mm is None else noise_of_fit(fit, window, face, heightmap)
    depth_sd, lateral_sd = heightmap.depth_scale_sd, heightmap.lateral_scale_sd
    scale = {}
    if depth_sd is not None and lateral_sd is not None:
        common = 0.0 if mode is None else mode.depth_by_lateral
        scale = calibration_sd(shape, fit.values, depth_sd, lateral_sd, common)
    of_mode = {} if mode is None else mode_sd(shape, fit, window, mode)
    parts = (noise, scale, of_mode)
    return _measurement(shape, fit, _plateau_shift_mm(fit, face), parts, findings)


def _stated(
    prior: EdgePrior, model: IndenterModel, edge_radius_mm: float, sd_mm: float | None
) -> EdgePrior:
    """Return what is known of an edge whose fillet was stated."""
    if "edge_radius_mm" not in model.names:
        raise InputError(
            "A ball has no edge radius",
            "edge radius",
            "Leave it out, or measure a cylinder or a cuboid",
        )
    if not 0.0 <= edge_radius_mm <= EDGES_MM[-1]:
        raise InputError(
            f"The edge radius {edge_radius_mm:g} mm is not between 0 and {EDGES_MM[-1]:g} mm",
            "edge radius",
            "Correct it, or leave it out: it is fitted then",
        )
    sd_mm = sd_mm or max(STATED_SHARE * edge_radius_mm, STATED_SD_MM)
    return replace(prior, edge_radius_mm=edge_radius_mm, edge_radius_sd_mm=sd_mm, stated=True)


def _sharpened(window: WindowData, smoothed_mm2: float) -> Array:
    """Return the depth without a smoothing, to the first order of its variance."""
    bend = cv2.Laplacian(window.depth_mm, cv2.CV_64F, ksize=1, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(window.depth_mm - 0.5 * smoothed_mm2 / window.pitch_mm**2 * bend)


class PressedMap(NamedTuple):
    """The usable part of a height map, with its pressed regions.

    Attributes
    ----------
    depth_mm, weight : (rows, columns)
        Depth, 0 where it is not usable, and its weight in [0, 1].
    x_mm, y_mm : (columns,), (rows,)
        The grid.
    regions : list of PressedRegion
        The bumps, tallest first.
    at_rest : Surface
        The undeformed membrane.
    """

    depth_mm: Array
    x_mm: Array
    y_mm: Array
    weight: Array
    regions: list[PressedRegion]
    at_rest: Surface = FLAT


def find_object(
    pressed: PressedMap,
    seed_mm: tuple[float, float] | None = None,
    *,
    reach_mm: float = 0.0,
    mode: ModeError | None = None,
) -> tuple[WindowData, PressedRegion, EdgePrior]:
    """Return the object with the ground around it, its segmented bump, and what its edge may be.

    Parameters
    ----------
    pressed : PressedMap
        The map.
    seed_mm, reach_mm, mode
        As for :func:`measure_object`.

    Raises
    ------
    InputError
        As :func:`measure_object`, but for the shape.
    """
    depth, x, y, weight, regions, at_rest = pressed
    if min(weight.shape) < 8 or not weight.any():
        raise InputError("no pixel is usable", "depth map", "Check the image and the working area")
    region = _chosen_region(regions, x, y, seed_mm)
    if region.cut:
        raise InputError(
            (
                f"the object at ({region.centre_mm[0]:.1f}, {region.centre_mm[1]:.1f}) "
                "mm is cut by the border of the map"
            ),
            "depth map",
            Remedy.PRESS_MIDDLE,
        )
    window = _window(depth, x, y, weight, region, regions)
    window = replace(window, reach_mm=reach_mm, at_rest=at_rest)
    # Where nothing is known of the squared blur, its standard deviation is (0.1 mm)^2.
    blur, known = (window.pitch_mm**2, 0.1**2), False
    if mode is not None and mode.blur_mm2 > 0.0:
        blur = mode.blur_mm2, mode.blur_sd_mm2
        # Nodes that do not resolve the drape have errors at walls that look like a fillet.
        known = mode.node_mm <= MOST_PITCH * TYPICAL_DECAY_MM
    edge = EdgePrior(EDGE_RADIUS_MM, 0.5 * EDGE_RADIUS_MM, *blur, blur_known=known)
    return window, region, edge


def pressed_map(heightmap: HeightMap) -> PressedMap:
    """Return the usable part of a height map, with its pressed regions."""
    x, y = (np.asarray(axis, np.float64) for axis in (heightmap.x_mm, heightmap.y_mm))
    outside = (heightmap.flags & np.uint8(Flag.OUTSIDE)) != 0
    # A flagged pixel has an error about three times that of its neighbours.
    weight = np.where(heightmap.flags != 0, 0.1, 1.0)
    weight[outside | ~np.isfinite(heightmap.depth_mm)] = 0.0
    depth = np.where(weight > 0.0, heightmap.depth_mm.astype(np.float64), 0.0)
    regions = find_pressed_regions(depth, x, y, weight > 0.0) if weight.any() else []
    return PressedMap(depth, x, y, weight, regions, heightmap.at_rest)


def _chosen_region(
    regions: list[PressedRegion], x_mm: Array, y_mm: Array, seed_mm: tuple[float, float] | None
) -> PressedRegion:
    """Return the object at the seed, or the only one."""
    if not regions:
        raise InputError("no object is pressed", "depth map", Remedy.PRESS_DEEPER)
    if seed_mm is not None:
        return _region_at(regions, x_mm, y_mm, seed_mm)
    tall = [r for r in regions if r.height_mm > SECONDARY_SHARE * regions[0].height_mm]
    if len(tall) > 1:
        places = ", ".join(f"({r.centre_mm[0]:.1f}, {r.centre_mm[1]:.1f})" for r in tall)
        raise InputError(
            f"{len(tall)} objects are pressed, at {places} mm",
            "depth map",
            Remedy.CHOOSE_OBJECT,
        )
    return tall[0]


def _region_at(
    regions: list[PressedRegion], x_mm: Array, y_mm: Array, seed_mm: tuple[float, float]
) -> PressedRegion:
    def distance(region: PressedRegion) -> float:
        rows, columns = np.nonzero(region.core)
        return float(np.hypot(x_mm[columns] - seed_mm[0], y_mm[rows] - seed_mm[1]).min())

    nearest = min(regions, key=distance)
    if not distance(nearest) <= SEED_REACH_MM:
        raise InputError(
            (
                f"no object lies at ({seed_mm[0]:g}, {seed_mm[1]:g}) mm; the nearest is at "
                f"({nearest.centre_mm[0]:.1f}, {nearest.centre_mm[1]:.1f}) mm"
            ),
            "seed",
            Remedy.CHOOSE_OBJECT,
        )
    return nearest


def _window(
    depth: Array,
    x: Array,
    y: Array,
    weight: Array,
    region: PressedRegion,
    regions: list[PressedRegion],
) -> WindowData:
    """Return the object with the ground around it, other objects left out."""
    pitch = float(np.sqrt(abs(x[1] - x[0]) * abs(y[1] - y[0])))
    margin = int(np.ceil(MARGIN_MM / pitch))
    rows, columns = np.nonzero(region.core)
    here = (
        slice(max(rows.min() - margin, 0), rows.max() + margin + 1),
        slice(max(columns.min() - margin, 0), columns.max() + margin + 1),
    )
    core, weight = region.core[here], weight[here]
    own = ndimage.distance_transform_edt(~core) * pitch
    seen = _seen_share(region.core, weight, own, pitch)
    weight = np.where(own <= MARGIN_MM, weight, 0.0)
    others = np.zeros(core.shape, dtype=bool)
    for other in regions:
        if other is not region:
            others |= other.core[here]
    if others.any():
        reach = ndimage.distance_transform_edt(~others) * pitch
        weight = np.where((reach < OTHER_REACH_MM) & (reach < own), 0.0, weight)
    grid_x, grid_y = np.meshgrid(x[here[1]], y[here[0]])
    return WindowData(grid_x, grid_y, depth[here], weight, near_wall(core, pitch), pitch, seen)


def _seen_share(core: Mask, weight: Array, own_mm: Array, pitch: float) -> float:
    """Return which share of the ground within 1.5 mm of the half-height outline is usable."""
    wide = int(np.ceil(DRAPE_MM / pitch)) + 1
    # With padding, so that ground beyond the map's edge counts as missing.
    rows, columns = np.nonzero(core)
    part = core[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    padded = ndimage.distance_transform_edt(~np.pad(part, wide)) * pitch
    there = (own_mm > 0.0) & (own_mm < DRAPE_MM) & (weight > 0.0)
    return float(there.sum() / max(int(((padded > 0.0) & (padded < DRAPE_MM)).sum()), 1))


def _face(shape: str, fit: FitResult, window: WindowData) -> Mask | None:
    """Return the pixels of the object's face; None for a ball, which has none."""
    if shape == "ball":
        return None
    sharp = {**fit.values, "blur_mm2": 0.0}
    model = MODELS[shape].depth(sharp, window.x_mm, window.y_mm)
    return np.asarray((model >= fit.values["height_mm"] - 1e-9) & (window.weight > 0.0))


def _plateau_shift_mm(fit: FitResult, face: Mask | None) -> float:
    """Return the median height of the plateau minus the fitted height.

    The fit uses the edge of the plateau, where a reconstruction is least accurate. The height of
    the object is that of its face.
    """
    if face is None or not face.any():
        return 0.0
    return float(np.median(fit.residual_mm[face]))


def _measurement(
    shape: str,
    fit: FitResult,
    shift_mm: float,
    parts: tuple[dict[str, float], dict[str, float], dict[str, float]],
    findings: tuple[Finding, ...],
) -> Measurement:
    values, (noise, scale, of_mode) = fit.values, parts
    # Edge and face differ by the shift: the height is not more accurate than half of it.
    fitted = {**fit.sd, "height_mm": math.hypot(fit.sd["height_mm"], 0.5 * shift_mm)}
    diameter, side, yaw = None, None, None
    if shape == "cuboid":
        side, yaw = _sides(values)
    else:
        diameter = values["diameter_mm"]
    return Measurement(
        shape=shape,
        diameter_mm=diameter,
        side_mm=side,
        height_mm=values["height_mm"] + shift_mm,
        centre_mm=(values["x_mm"], values["y_mm"]),
        yaw_deg=yaw,
        drape_decay_mm=values["drape_decay_mm"],
        sd=_spread(shape, values, combined(fitted, noise, scale, of_mode)),
        noise_sd=_spread(shape, values, noise) if noise else None,
        calibration_sd=_spread(shape, values, scale) if scale else None,
        mode_sd=_spread(shape, values, of_mode) if of_mode else None,
        edge_radius_mm=values.get("edge_radius_mm"),
        blur_mm=math.sqrt(values["blur_mm2"]) if "blur_mm2" in values else None,
        corner_rounding=values.get("corner_rounding"),
        baseline_mm=values["offset_mm"],
        residual_rms_mm=fit.residual_rms_mm,
        correlated_pixels=fit.correlated_pixels,
        outline_mm=MODELS[shape].outline(values),
        findings=findings,
    )


def _spread(shape: str, values: Mapping[str, float], sd: Mapping[str, float]) -> Spread:
    """Return standard deviations of the fit's parameters under the measurement's names."""
    spread: Spread = {
        "height_mm": sd["height_mm"],
        "centre_mm": (sd["x_mm"], sd["y_mm"]),
        "yaw_deg": None,
        "drape_decay_mm": sd["drape_decay_mm"],
    }
    if shape == "cuboid":
        first, second = _side_keys(values)
        # Neither calibration nor mode changes an angle.
        spread |= {
            "side_mm": (sd[first], sd[second]),
            "yaw_deg": float(np.degrees(sd.get("yaw", 0.0))),
        }
    else:
        spread["diameter_mm"] = sd["diameter_mm"]
    return spread


def _side_keys(values: Mapping[str, float]) -> tuple[str, str]:
    """Return which sides are along the first and the second axis, once yaw is -45..45 degrees."""
    even = round(values["yaw"] / (np.pi / 2.0)) % 2 == 0
    return ("side_a_mm", "side_b_mm") if even else ("side_b_mm", "side_a_mm")


def _sides(values: Mapping[str, float]) -> tuple[tuple[float, float], float]:
    """Return the sides and the yaw brought to -45..45 degrees."""
    turns = round(values["yaw"] / (np.pi / 2.0))
    first, second = _side_keys(values)
    yaw = float(np.degrees(values["yaw"] - turns * np.pi / 2.0))
    return (values[first], values[second]), yaw
