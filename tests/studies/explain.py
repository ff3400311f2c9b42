"""Where the errors of the full model come from: light predicted for the true surface, and the real.

    python -m tests.studies.explain CALIBRATION SESSION

Two tables. *Which step causes the height error?* The slopes found are replaced by the true ones,
everywhere or in part, and integrated with the same weights. *Which light is not explained?* At the
true surface, press over background is compared with the direct light of the LEDs, with the
interreflection of the model, and with one reflection gathered over the true surface. Last, the
reflectance that would explain the rest, and that of the membrane.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates

from gelpolight_core.calibration.board_reflectance import BesideBoard
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.lights.positions import light_directions
from gelpolight_core.measurement.score import TrueDepth, scored_radius_mm
from gelpolight_core.reconstruction.integration.weighted import integrate_weighted
from gelpolight_core.reconstruction.near_light.maps import SensorMaps
from gelpolight_core.reconstruction.near_light.region_solver import SolvedRegion
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reconstruction.solver import Wanted
from gelpolight_core.reflectance.gathered_light import Receivers, Surface, gathered, ratio_reflected
from gelpolight_core.reflectance.surroundings import view_directions
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.session import read_session
from tests.studies.presses import TruePress, folder_named, show, true_presses

BANDS = (3.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 75.0)
"""Limits of the bands of slope, degrees."""
SIDES = ("towards", "away", "dark")
"""Side of a point for a channel: towards its LED, away from it, or not reached by it."""
ALL_COUNT = 0.9
"""Least weight of a node that uses all three channels."""
LEAST_NODES = 20
PLATEAU = 0.98
STEEP_DEG = 30.0
LEVELS, HALVINGS, SHADOW_STEPS = 60, 16, 50
CLEAR_MM = 0.004
"""A surface that rises less above a light ray casts no shadow: the truth is interpolated."""


class TrueView(NamedTuple):
    """The true surface at the rays of a grid: depth, points, unit normals, where it is known."""

    depth_mm: np.ndarray
    points_mm: np.ndarray
    normals: np.ndarray
    known: np.ndarray


def true_view(truth: TrueDepth, x: np.ndarray, y: np.ndarray, ray_slope: np.ndarray) -> TrueView:
    """Return where rays, from (x, y) on the flat membrane, meet a true surface first.

    `ray_slope` (rows, columns, 2) is their lateral displacement per mm of depth.
    """
    x, y = np.meshgrid(x, y)

    def above(depth: np.ndarray) -> np.ndarray:
        """Return whether the surface reaches the rays at a depth."""
        px, py = x + depth * ray_slope[..., 0], y + depth * ray_slope[..., 1]
        return _at(truth, truth.depth_mm, px, py) >= depth

    step = 1.02 * float(truth.depth_mm.max()) / LEVELS
    low, met = np.zeros(x.shape), np.zeros(x.shape, bool)
    for level in range(LEVELS, -1, -1):
        new = above(np.full(x.shape, level * step)) & ~met
        low[new] = level * step
        met |= new
    high = low + step
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        reached = above(middle)
        low, high = np.where(reached, middle, low), np.where(reached, high, middle)
    px, py = x + low * ray_slope[..., 0], y + low * ray_slope[..., 1]
    pitch = float(truth.x_mm[1] - truth.x_mm[0])
    down, across = (_at(truth, slope, px, py) for slope in np.gradient(truth.depth_mm, pitch))
    normals = np.stack([-across, -down, -np.ones_like(px)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    known = (px > truth.x_mm[0]) & (px < truth.x_mm[-1])
    known &= (py > truth.y_mm[0]) & (py < truth.y_mm[-1])
    return TrueView(low, np.stack([px, py, -low], axis=-1), normals, known)


def lit_by(truth: TrueDepth, view: TrueView, leds_mm: np.ndarray) -> np.ndarray:
    """Return which LEDs (rows, columns, 3) light each point: it faces them without an obstacle."""
    deepest = 1.001 * float(truth.depth_mm.max())
    lit = np.empty(view.points_mm.shape, bool)
    for k in range(3):
        to_led = leds_mm[k] - view.points_mm
        lit[..., k] = np.einsum("ijc,ijc->ij", to_led, view.normals) > 0.0
        # The ray is clear when it is deeper than the deepest point of the surface.
        share = np.maximum(deepest - view.depth_mm, 0.0) / -to_led[..., 2]
        for i in range(1, SHADOW_STEPS + 1):
            at = (share * (i / SHADOW_STEPS) ** 1.5)[..., None] * to_led + view.points_mm
            surface = _at(truth, truth.depth_mm, at[..., 0], at[..., 1])
            lit[..., k] &= surface <= -at[..., 2] + CLEAR_MM
    return lit


def _at(truth: TrueDepth, values: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return values of the truth's grid at positions, 0 outside it."""
    pitch = float(truth.x_mm[1] - truth.x_mm[0])
    index = [(y - truth.y_mm[0]) / pitch, (x - truth.x_mm[0]) / pitch]
    return map_coordinates(values, index, order=1, mode="constant")


def explain(
    calibration: Calibration, presses: list[TruePress]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]], float, float]:
    """Return height errors by press, light by side and slope, and both reflectances."""
    full = calibration.data.full
    assert full is not None
    solver = NearLightSolver(calibration.data, workers=2)
    losses, parts = [], []
    for press in presses:
        solved = solver.solved(press.frame, Wanted("fast"))
        assert solved is not None
        losses.append(_loss(press, solved, scored_radius_mm(calibration.data.sensor)))
        # Walls mirror even distant membrane: light is gathered from the whole field.
        whole = solver.solved(press.frame, Wanted("fast", everywhere=True))
        assert whole is not None
        parts.append(_light_at(solver.maps, press.truth, whole))
    values = np.concatenate(parts)
    steep = values[values[:, 1] >= STEEP_DEG]
    rest, reflected = steep[:, 2] - steep[:, 3], steep[:, 5]
    usable = calibration.table.valid & (calibration.data.factors > 0.0).all(axis=-1)
    light = (
        full.background,
        calibration.data.radiance,
        calibration.data.crosstalk,
        full.led_positions_mm,
    )
    board = BesideBoard.of(calibration.table, usable, *light)
    return (
        losses,
        list(_in_bands(values)),
        float(rest @ reflected) / float(reflected @ reflected),
        board.reflectance(full.led_positions_mm, full.membrane),
    )


def _view(solved: SolvedRegion, truth: TrueDepth) -> tuple[TrueView, np.ndarray]:
    """Return the true surface at a region's rays, and their slopes (rows, columns, 2)."""
    scale, (top, left) = solved.scale, solved.region.corner
    rows, columns = solved.depth_mm.shape
    at = np.s_[top : top + rows, left : left + columns]
    ray_slope = np.moveaxis(scale.rays[:2], 0, -1)[at].astype(np.float64)
    x = scale.x_mm + scale.pitch_mm * (left + np.arange(columns))
    y = scale.y_mm + scale.pitch_mm * (top + np.arange(rows))
    return true_view(truth, x, y, ray_slope), ray_slope


def _loss(press: TruePress, solved: SolvedRegion, radius_mm: float) -> dict[str, Any]:
    """Return the height error with the slopes found, with true ones, and with some of each."""
    view, _ = _view(solved, press.truth)
    found = solved.slopes.slope_x, solved.slopes.slope_y
    # The true depth along the rays has the true slopes along the rays.
    pitch = solved.scale.pitch_mm
    true = [np.gradient(view.depth_mm, pitch, axis=k).astype(np.float32) for k in (1, 0)]
    dark = solved.weight < ALL_COUNT
    top = view.known & (view.depth_mm > PLATEAU * press.height_mm)
    top &= np.hypot(view.points_mm[..., 0], view.points_mm[..., 1]) < radius_mm

    def percent(where: np.ndarray) -> float:
        slopes = [
            np.where(where, t, f).astype(np.float32) for t, f in zip(true, found, strict=True)
        ]
        options = {"pitch_mm": pitch, "hold": solved.hold}
        depth = integrate_weighted(*slopes, solved.weight, **options).depth_mm
        return 100.0 * (float(np.median(depth[top]) / np.median(view.depth_mm[top])) - 1.0)

    return {
        "press": press.file,
        "height %": percent(np.zeros_like(dark)),
        "all slopes true": percent(np.ones_like(dark)),
        "true where dark": percent(dark),
        "true where lit": percent(~dark),
    }


def _light_at(maps: SensorMaps, truth: TrueDepth, solved: SolvedRegion) -> np.ndarray:
    """Return side, slope, image, direct light, the model's addition and the gathered one (N, 6).

    Every second node along both axes, if it is tilted.
    """
    view, ray_slope = _view(solved, truth)
    image, scale, full = solved.compared.coarse, solved.scale, maps.full
    leds = full.led_positions_mm
    slope = np.degrees(np.arccos(np.clip(-view.normals[..., 2], 0.0, 1.0)))
    usable = scale.kind == 2
    ratio = np.moveaxis(image.ratio, 0, -1).astype(np.float64)
    around = np.moveaxis(np.broadcast_to(solved.compared.fine.around, image.ratio.shape), 0, -1)
    flat = -np.moveaxis(scale.flat, 0, -1).astype(np.float64)
    sent = ratio_reflected(ratio, usable[..., None], maps.reflecting[maps.field.seen]) * flat
    facets = Surface(view.points_mm, view.normals, view_directions(ray_slope), sent)
    thinned = np.zeros_like(usable)
    thinned[::2, ::2] = (usable & view.known & (slope >= BANDS[0]))[::2, ::2]
    at = Receivers.on(facets, thinned)
    options = {"slab": maps.slab}
    reflected = gathered(facets, at, leds, full.membrane, scale.pitch_mm, **options) / flat[thinned]
    points, normals = view.points_mm[thinned], view.normals[thinned]
    lit = lit_by(truth, view, leds)[thinned]
    view_to = view_directions(ray_slope[thinned])
    direct = -full.membrane.direct(full.led_positions_mm, points, normals, view_to) / flat[thinned]
    light, _ = light_directions(leds, points)
    tilted = np.einsum("nkc,nc->nk", light, normals) > -light[..., 2]
    side = np.where(lit, np.where(tilted, 0, 1), 2)
    steep = np.broadcast_to(slope[thinned][:, None], lit.shape)
    parts = (side, steep, ratio[thinned], np.where(lit, direct, 0.0), around[thinned], reflected)
    return np.stack([part.ravel() for part in parts], axis=1)


def _in_bands(values: np.ndarray) -> Iterator[dict[str, Any]]:
    """Yield medians by side and slope."""
    for number, side in enumerate(SIDES):
        for low, high in pairwise(BANDS):
            part = values[(values[:, 0] == number) & (values[:, 1] >= low) & (values[:, 1] < high)]
            if len(part) >= LEAST_NODES:
                names = ("image", "direct", "model", "gathered")
                medians = dict(zip(names, np.median(part[:, 2:], axis=0).tolist(), strict=True))
                yield {"side": side, "slope deg": f"{low:g}-{high:g}", **medians, "n": len(part)}


if __name__ == "__main__":
    calibrated = read_calibration(folder_named(1))
    heights, lights, needed, measured = explain(
        calibrated, true_presses(read_session(folder_named(2)))
    )
    show(heights)
    show(lights)
    print(f"reflectance that explains the rest: {needed:.2f}; of the membrane: {measured:.2f}")
