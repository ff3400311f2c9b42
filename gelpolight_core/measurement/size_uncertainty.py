"""Standard deviations of measured sizes: noise, calibration, mode, and residual of the fit.

``noise`` is the scatter of repeated images: examples of the depth map's noise are propagated
through the last step of the fit. This does not contain that the weights of the fit change with the
noise, too. If the shape does not fit exactly, as at a cuboid's corners, widths scatter two to three
times as much, in the worst case about as much as the total standard deviation. ``calibration`` is
common to all measurements with one calibration, ``mode`` to all in one mode (model and effort). The
standard deviation of the fit contains the noise and everything that the shape does not explain
(drape, edges, waves of the ground), with correlated pixels counted once. The total is the larger of
it and the noise, combined with calibration and mode.

A relative depth error s at the walls also changes the size: the outer drape is still correct, but
its upper end is cut off at (1 - s) of the height, where ``h exp(-x / decay)`` has decreased by s.
The wall seems to be s * decay farther out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float64Array
from gelpolight_core.geometry.length_tolerances import HEIGHT_BY_LATERAL
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.modes import FULL, IN_PLACE, PAPER, Mode
from gelpolight_core.reconstruction.near_light.contact_detection import MARGIN_DECAYS
from gelpolight_core.reconstruction.near_light.effort_parameters import SETTINGS
from gelpolight_core.sensor.closed_sensor.colour_change import SMOOTHING_NODES

from .indenter_fit import IndenterFit
from .indenter_models import MODELS
from .measured_value import noise_at
from .segmentation import FitWindow

SdByName = dict[str, Any]

BALL_SLOPE = 0.85
"""Steepest slope of the ball presses of a calibration, 40 degrees. On steeper walls, the errors of
the membrane model increase in proportion."""
PIXEL = 1.0 / 12.0
"""Variance of a pixel's own width, which the blur of the board's edges contains in part."""
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
    blur_mm2 : float
        Variance of the map's blur by these nodes and by the camera; 0 if it is not known.
    blur_sd_mm2 : float
        Standard deviation of this variance.
    level_mm : float
        Standard deviation of heights by the drape beyond the solved region, which is left out.
    smoothed_mm2 : float
        Variance of the smoothing of the image that the map shows; it is undone for a ball.
    depth_by_lateral : float
        Relative error of heights by that of lengths across: 2 where balls in the image alone gave
        the slopes, so that the diameter of a ball does not depend on the scale.
    """

    depth: float = 0.0
    depth_by_nodes: float = 0.0
    lateral_per_mm: float = 0.0
    node_mm: float = 0.0
    blur_mm2: float = 0.0
    blur_sd_mm2: float = 0.0
    level_mm: float = 0.0
    smoothed_mm2: float = 0.0
    depth_by_lateral: float = 0.0

    def depth_share(self, wall_slope: float, decay_mm: float) -> float:
        """Return the relative error of the height over walls of a slope and decay length."""
        return math.hypot(self.depth, self.depth_by_nodes * self.node_mm / decay_mm * wall_slope)


WIDTH_BY_NODES = 0.7
"""Additional width by rounding, as a factor of `node_mm` squared over the drape's decay length. On
virtual and rendered sensors it is 26 to 52 um with nodes of 0.2 mm, 8 to 15 um with nodes of 0.1
mm."""
MODE_ERRORS: Mapping[Mode, ModeError] = MappingProxyType(
    {
        **{
            # The mean over a node's pixels, and linear interpolation between nodes.
            Mode(FULL, effort): ModeError(
                depth_by_nodes=0.02,
                node_mm=settings.factor,
                blur_mm2=1.0,
                depth_by_lateral=HEIGHT_BY_LATERAL,
            )
            for effort, settings in SETTINGS.items()
        },
        **{
            Mode(IN_PLACE, effort): ModeError(
                depth_by_nodes=0.07,
                node_mm=1.0,
                smoothed_mm2=SMOOTHING_NODES**2,
                depth_by_lateral=2.0,
            )
            for effort in SETTINGS
        },
        **{Mode(PAPER, effort): ModeError(depth=0.03) for effort in SETTINGS},
    }
)
"""On a grid of pitch 1: `node_mm` in pitches, `blur_mm2` over a third of its square. On three
virtual sensors with exact calibrations (one glossy and two matt at a quarter and half of the size,
one matt at full size), `depth_by_nodes` is 0.008 to 0.027 (rms). That of a closed sensor is not
measured: it is the former number for pixels of 0.063 mm. The paper's model uses the lights of the
undeformed surface, and the point where a ray meets that surface."""


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
    blur_mm2, blur_sd = node_mm**2 / 3.0, 1.0
    if heightmap.image_blur_mm is not None:
        blur_mm2 += heightmap.image_blur_mm**2
        # An image's blur may differ from the board's by 0.1 px, by 0.03 on sensors of known blur.
        blur_sd = math.hypot(PIXEL, 0.2 * heightmap.image_blur_mm / heightmap.pitch_mm)
    # Beyond its margin, the drape may have any depth up to what is left of the smallest visible
    # one; the ground around an object is fitted with it.
    hidden_mm = math.exp(-MARGIN_DECAYS) * (heightmap.visible_depth_mm or 0.0)
    return replace(
        error,
        lateral_per_mm=heightmap.lateral_per_mm,
        node_mm=node_mm,
        blur_mm2=error.blur_mm2 * blur_mm2,
        blur_sd_mm2=error.blur_mm2 * blur_sd * heightmap.pitch_mm**2,
        smoothed_mm2=error.smoothed_mm2 * node_mm**2,
        level_mm=hidden_mm / math.sqrt(12.0),
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
    by_mode = {} if mode is None else _mode_sd(fit, window, mode)
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

    def at(pixels: BoolArray) -> Float64Array:
        """Return each example's values at pixels of the window."""
        return noise_at(window.heightmap, window.x_mm[pixels], window.y_mm[pixels])

    changes = dict(zip(fit.values, (at(fit.chosen) @ fit.gain.T).T, strict=True))
    if fit.face is not None and fit.face.any():
        # If errors are correlated over the whole face, a median scatters like the mean.
        changes["height_mm"] = at(fit.face).mean(axis=1) - changes["offset_mm"]
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


def _mode_sd(fit: IndenterFit, window: FitWindow, mode: ModeError) -> dict[str, float]:
    """Return the standard deviations of the fit's parameters by the mode."""
    values = fit.values
    share = mode.depth_share(_wall_slope(values), values["drape_decay_mm"])
    sd = _systematic(fit.shape, values, share, mode.lateral_per_mm * abs(values["height_mm"]))
    sd["height_mm"] = math.hypot(sd["height_mm"], mode.level_mm)
    if fit.shape == "ball":
        blurred = _blurred_away(fit, window, mode)
    else:
        rounded_mm = WIDTH_BY_NODES * mode.node_mm**2 / values["drape_decay_mm"]
        blurred = {name: rounded_mm for name in LENGTHS if name in sd}
    return sd | {name: math.hypot(sd.get(name, 0.0), by_blur) for name, by_blur in blurred.items()}


def _blurred_away(fit: IndenterFit, window: FitWindow, mode: ModeError) -> dict[str, float]:
    """Return how far the map's blur, which the shape of a ball leaves out, moves each parameter.

    A blur changes the depth by half its variance times the Laplacian, here over one node.
    """
    if mode.blur_mm2 == 0.0:
        return {}
    x, y = window.x_mm[fit.chosen], window.y_mm[fit.chosen]
    steps = ((mode.node_mm, 0.0), (-mode.node_mm, 0.0), (0.0, mode.node_mm), (0.0, -mode.node_mm))
    ball = MODELS["ball"].depth
    bend = sum(ball(fit.values, x + dx, y + dy) - ball(fit.values, x, y) for dx, dy in steps)
    changes = fit.gain @ (0.5 * mode.blur_mm2 / mode.node_mm**2 * bend)
    return {name: abs(float(change)) for name, change in zip(fit.values, changes, strict=True)}


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
    for name in LENGTHS:
        if name in values:
            sd[name] = math.hypot(lateral * values[name], 2.0 * depth * decay)
    return sd
