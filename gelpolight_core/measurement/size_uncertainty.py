"""Standard deviations of measured sizes: noise, calibration, mode, and residual of the fit.

``noise`` is the scatter of repeated images: the slopes of examples of the depth map's noise are
propagated through the last step of the fit. ``calibration`` is common to all measurements with one
calibration, ``mode`` to all in one mode (model and effort). The standard deviation of the fit
follows from the residual of the slopes: their scatter, and their mean along the wall, which is
what the model of the object or of the map does not explain. The total is the larger of it and the
noise, combined with calibration and mode.

A relative error of slopes changes the height as much, and leaves the edges where they are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from gelpolight_core.geometry.length_tolerances import HEIGHT_BY_LATERAL
from gelpolight_core.reconstruction.height_map import COARSE, HeightMap
from gelpolight_core.reconstruction.modes import FULL, IN_PLACE, PAPER, Mode
from gelpolight_core.reconstruction.near_light.contact_detection import MARGIN_DECAYS
from gelpolight_core.reconstruction.near_light.effort_parameters import SETTINGS
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.sensor.sensor_calibration import Calibration

from .indenter_fit import IndenterFit
from .map_slopes import are_solved, smoothing_of
from .measured_value import noise_at, noise_slopes_at
from .segmentation import FitWindow

SdByName = dict[str, Any]

BALL_SLOPE = 0.85
"""Steepest slope of the ball presses of a calibration, 40 degrees. On steeper walls, the errors of
the membrane model increase in proportion."""
LENGTHS = ("side_a_mm", "side_b_mm", "diameter_mm")


@dataclass(frozen=True, slots=True)
class ModeError:
    """Errors of a model and effort that remain even with an exact calibration.

    Attributes
    ----------
    depth : float
        Relative error of heights.
    depth_by_nodes : float
        The same, as a factor of `node_mm` over the drape's decay length and of the wall's slope: a
        node that holds the edge mixes face and wall.
    lateral_per_mm : float
        Relative error of lengths across, for each mm of depth.
    node_mm : float
        Distance between the solved nodes: a large distance rounds the upper end of walls.
    level_mm : float
        Standard deviation of heights by the drape beyond the solved region, which is left out.
    wall_blurs : float
        Error of sizes of objects with walls, as a factor of `blur_mm`, where balls alone showed how
        light follows from slope.
    blur_mm : float
        Smoothing of the images.
    depth_by_lateral : float
        Relative error of heights by that of lengths across: 2 where balls in the image alone gave
        the slopes, so that the diameter of a ball does not depend on the scale.
    """

    depth: float = 0.0
    depth_by_nodes: float = 0.0
    lateral_per_mm: float = 0.0
    node_mm: float = 0.0
    level_mm: float = 0.0
    wall_blurs: float = 0.0
    blur_mm: float = 0.0
    depth_by_lateral: float = 0.0

    def depth_share(self, wall_slope: float, decay_mm: float) -> float:
        """Return the relative error of the height over walls of a slope and decay length."""
        return math.hypot(self.depth, self.depth_by_nodes * self.node_mm / decay_mm * wall_slope)


DEPTH_NODES = 2.0
"""Standard deviation of sizes, in nodes, on maps of coarser efforts or without normals: they do not
show fillets of a node, and errors of sizes are up to four nodes."""
OLDER_SMOOTHING = 2.0
"""Nodes over which the images of a closed sensor were smoothed, in files that do not state it."""
WIDTH_BY_NODES = 0.7
"""Additional width by rounding, as a factor of `node_mm` squared over the drape's decay length. On
virtual and rendered sensors it is 26 to 52 um with nodes of 0.2 mm, 8 to 15 um with nodes of 0.1
mm."""
MODE_ERRORS: Mapping[Mode, ModeError] = MappingProxyType(
    {
        **{
            Mode(FULL, effort): ModeError(
                depth_by_nodes=0.02,
                node_mm=settings.factor,
                depth_by_lateral=HEIGHT_BY_LATERAL,
            )
            for effort, settings in SETTINGS.items()
        },
        **{
            Mode(IN_PLACE, effort): ModeError(
                depth_by_nodes=0.07,
                node_mm=1.0,
                wall_blurs=1.5,
                depth_by_lateral=2.0,
            )
            for effort in SETTINGS
        },
        **{Mode(PAPER, effort): ModeError(depth=0.03) for effort in SETTINGS},
    }
)
"""On a grid of pitch 1: `node_mm` in pitches. On three virtual sensors with exact calibrations (one
glossy and two matt at a quarter and half of the size, one matt at full size), `depth_by_nodes` is
0.008 to 0.027 (rms). That of a closed sensor is not measured: it is the former number for pixels of
0.063 mm; its sizes of 8 cylinders and cuboids each on two rendered sensors are wrong by 0.45 mm
(rms) with a smoothing of 0.2 mm, by 0.16 and 0.2 mm with 0.07 and 0.1 mm, and the residual of the
fit covers the larger part of it. The paper's model uses the lights of the undeformed surface, and
the point where a ray meets that surface."""


DECAY_MM = 0.65
"""Typical decay length of a membrane's drape, where the calibration does not state it."""


def expected_sd(c: Calibration, shape: str, size_mm: float, height_mm: float) -> dict[str, float]:
    """Return the standard deviations that an object pressed by `height_mm` will have.

    They are those of calibration and model, without those of noise and of the fit.

    Parameters
    ----------
    c : Calibration
        With errors of lengths.
    shape : str
        ``ball`` or ``cylinder``.
    size_mm : float
        Its diameter.
    height_mm : float
        Its depth.
    """
    errors = c.data.length_errors
    assert errors is not None, "the calibration states no errors of lengths"
    values = {"x_mm": 0.0, "y_mm": 0.0, "height_mm": height_mm, "diameter_mm": size_mm}
    values["drape_decay_mm"] = errors.decay_mm or DECAY_MM
    mode = MODE_ERRORS[Mode(c.model, EFFORTS[-1])]
    node_mm = errors.pitch_mm * mode.node_mm
    mode = replace(mode, node_mm=node_mm, level_mm=errors.floor_mm, blur_mm=errors.blur_mm)
    scales = errors.depth, errors.lateral
    by_calibration = calibration_sd(shape, values, *scales, mode.depth_by_lateral)
    by_mode = _mode_sd(shape, values, mode)
    return {name: math.hypot(sd, by_mode.get(name, 0.0)) for name, sd in by_calibration.items()}


def mode_error(heightmap: HeightMap) -> ModeError:
    """Return the remaining error of the model and effort of a height map.

    Parameters
    ----------
    heightmap : HeightMap
        If it does not state its effort, the fastest is assumed.
    """
    effort = "fast" if heightmap.trace is None else heightmap.trace.effort
    error = MODE_ERRORS[Mode(heightmap.model, effort)]
    node_mm = heightmap.pitch_mm * error.node_mm
    # Beyond its margin, the drape may have any depth up to what is left of the smallest visible
    # one; the ground around an object is fitted with it.
    hidden_mm = math.exp(-MARGIN_DECAYS) * (heightmap.visible_depth_mm or 0.0)
    return replace(
        error,
        lateral_per_mm=heightmap.lateral_per_mm,
        node_mm=node_mm,
        level_mm=hidden_mm / math.sqrt(12.0),
        blur_mm=heightmap.image_blur_mm or OLDER_SMOOTHING * heightmap.pitch_mm,
    )


@dataclass(frozen=True, slots=True)
class SdBySource:
    """Standard deviations of the fit's parameters, and their parts by source.

    Attributes
    ----------
    noise, calibration, mode : dict
        The parts; empty where the source is not known.
    total : dict
        The whole standard deviations.
    """

    noise: dict[str, float]
    calibration: dict[str, float]
    mode: dict[str, float]
    total: dict[str, float]


def sd_by_source(fit: IndenterFit, window: FitWindow, mode: ModeError | None) -> SdBySource:
    """Return the standard deviations of a fit.

    Parameters
    ----------
    fit : IndenterFit
        The fit.
    window : FitWindow
        What it was fitted to.
    mode : ModeError or None
        Errors of the map's model and effort, if they are known.
    """
    heightmap = window.heightmap
    noise = {} if heightmap.noise_mm is None else _noise_sd(fit, window)
    calibration = {}
    if heightmap.depth_scale_sd is not None and heightmap.lateral_scale_sd is not None:
        common = 0.0 if mode is None else mode.depth_by_lateral
        scales = heightmap.depth_scale_sd, heightmap.lateral_scale_sd
        calibration = calibration_sd(fit.shape, fit.values, *scales, common)
    by_mode = {} if mode is None else _mode_sd(fit.shape, fit.values, mode)
    node_mm = smoothing_of(heightmap).node_mm
    coarse = not are_solved(heightmap) or node_mm > 1.5 * heightmap.pitch_mm
    if coarse and fit.shape != "ball":
        for name in {*LENGTHS} & by_mode.keys():
            by_mode[name] = math.hypot(by_mode[name], DEPTH_NODES * node_mm)
    # Edge and face differ by the shift: the height is not more accurate than half of it.
    height_sd = math.hypot(fit.sd["height_mm"], 0.5 * fit.plateau_shift_mm)
    total = {
        name: math.hypot(
            max(sd, noise.get(name, 0.0)), calibration.get(name, 0.0), by_mode.get(name, 0.0)
        )
        for name, sd in {**fit.sd, "height_mm": height_sd}.items()
    }
    return SdBySource(noise, calibration, by_mode, total)


def _noise_sd(fit: IndenterFit, window: FitWindow) -> dict[str, float]:
    """Return the standard deviation of the fit's parameters from a map's noise."""
    slopes = noise_slopes_at(window.heightmap, fit.x_mm, fit.y_mm)
    changes = dict(zip(fit.names, np.tensordot(fit.gain, slopes, ((1, 2), (1, 2))), strict=True))
    if fit.face is not None:
        # Coarse examples do not hold the slopes of walls, but the depth that these leave.
        thin, ground = np.s_[::COARSE, ::COARSE], window.ground & (window.weight > 0.0)
        x_mm, y_mm = window.x_mm[thin], window.y_mm[thin]
        if fit.face[thin].any() and ground[thin].any():
            on_face, beside = (
                noise_at(window.heightmap, x_mm[part[thin]], y_mm[part[thin]]).mean(axis=1)
                for part in (fit.face, ground)
            )
            changes["height_mm"] = on_face - beside
    return {name: float(np.sqrt(np.mean(change**2))) for name, change in changes.items()}


def calibration_sd(
    shape: str, values: Mapping[str, float], depth: float, lateral: float, common: float = 0.0
) -> dict[str, float]:
    """Return the standard deviations of the fit's parameters by the calibration.

    Parameters
    ----------
    shape : str
        What was fitted.
    values : mapping
        The fit's parameters.
    depth, lateral : float
        Relative standard deviations of depths, on slopes that balls show, and of lengths across.
    common : float, optional
        `ModeError.depth_by_lateral`. An object whose depths and lengths across are all scaled by
        this keeps its place of the walls; only other errors of depths move them.
    """
    shared = min(common * lateral, depth)
    independent = math.sqrt(depth**2 - shared**2)
    if shape != "ball":
        independent *= max(_wall_slope(values) / BALL_SLOPE, 1.0)
    sd = _systematic(shape, values, independent, lateral)
    sd["height_mm"] = math.hypot(independent, shared) * abs(values["height_mm"])
    if shape == "ball":
        size_share = math.hypot(independent, (2.0 - common) * lateral)
        sd["diameter_mm"] = size_share * values["diameter_mm"]
    return sd


def _mode_sd(shape: str, values: Mapping[str, float], mode: ModeError) -> dict[str, float]:
    """Return the standard deviations of a fit's parameters by the mode."""
    share = mode.depth_share(_wall_slope(values), values["drape_decay_mm"])
    sd = _systematic(shape, values, share, mode.lateral_per_mm * abs(values["height_mm"]))
    sd["height_mm"] = math.hypot(sd["height_mm"], mode.level_mm)
    if shape != "ball":
        rounded_mm = WIDTH_BY_NODES * mode.node_mm**2 / values["drape_decay_mm"]
        for name in {*LENGTHS} & sd.keys():
            sd[name] = math.hypot(sd[name], rounded_mm, mode.wall_blurs * mode.blur_mm)
    return sd


def _wall_slope(values: Mapping[str, float]) -> float:
    return abs(values["height_mm"]) / values["drape_decay_mm"]


def _systematic(
    shape: str, values: Mapping[str, float], depth: float, lateral: float
) -> dict[str, float]:
    """Return standard deviations of the parameters from relative errors of depth and length."""
    decay = values["drape_decay_mm"]
    sd = {name: lateral * abs(values[name]) for name in ("x_mm", "y_mm")}
    sd["height_mm"] = depth * abs(values["height_mm"])
    sd["drape_decay_mm"] = math.hypot(lateral, depth) * decay
    if shape == "ball":
        # The radius of a ball is proportional to a width squared over a depth.
        sd["diameter_mm"] = math.hypot(2.0 * lateral, depth) * values["diameter_mm"]
        return sd
    return sd | {name: lateral * values[name] for name in LENGTHS if name in values}
