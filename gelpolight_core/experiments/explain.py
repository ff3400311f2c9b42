"""Causes of the full model's errors: images predicted for the true surface, and the real ones.

For each press with a true depth there are two questions. *Which step causes the height error?* The
computed slopes are replaced by the true ones, everywhere or in part, and integrated with the same
weights. *Which light is not explained?* At the true surface, press over background is compared with
the direct light of the LEDs, with the interreflection of the model, and with one reflection
gathered over the true surface.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.board_reflectance import BesideBoard
from gelpolight_core.experiments.ablation import TruePress, read_presses
from gelpolight_core.experiments.true_view import TrueView, lit_by, true_view
from gelpolight_core.lights.positions import light_directions
from gelpolight_core.measurement.score import TrueDepth, scored_radius_mm
from gelpolight_core.reconstruction.integration.weighted import integrate_weighted
from gelpolight_core.reconstruction.misfit import direct_light
from gelpolight_core.reconstruction.near_light.maps import SensorMaps
from gelpolight_core.reconstruction.near_light.region_solver import Solved
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reflectance.gathered_light import Receivers, Surface, gathered, ratio_reflected
from gelpolight_core.reflectance.surroundings import view_directions
from gelpolight_core.sensor_calibration import Calibration, FullModel
from gelpolight_core.session.session import Session

Array = NDArray[np.float64]
Map = NDArray[np.float32]
BANDS = (3.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 75.0)
"""Limits of the bands of slope, degrees."""
SIDES = ("towards", "away", "dark")
"""Side of a point for a channel: towards its LED, away from it, or not reached by it."""
ALL_COUNT = 0.9
"""Least weight of a node that uses all three channels."""
LEAST_NODES = 20
PLATEAU = 0.98
STEEP_DEG = 30.0


@dataclass(frozen=True, slots=True)
class Loss:
    """Height error of a press, with parts of the solution replaced by the truth, percent.

    Attributes
    ----------
    file : str
        The press.
    found : float
        As reconstructed.
    true_slopes : float
        True slopes with the weights of the solution: the error of integration and weights.
    true_where_dark : float
        True slopes where a channel is left out, computed slopes elsewhere.
    true_where_lit : float
        True slopes where all channels are used, computed slopes elsewhere.
    """

    file: str
    found: float
    true_slopes: float
    true_where_dark: float
    true_where_lit: float


@dataclass(frozen=True, slots=True)
class Light:
    """Press over background in a band of slope, medians over all presses and channels.

    Attributes
    ----------
    side : str
        One of :data:`SIDES`.
    low_deg, high_deg : float
        Slope.
    seen, direct, model, gathered : float
        The image; the direct light of the LED; the interreflection of the model; and one reflection
        gathered over the true surface, from a membrane that absorbs nothing.
    nodes : int
        Number of values.
    """

    side: str
    low_deg: float
    high_deg: float
    seen: float
    direct: float
    model: float
    gathered: float
    nodes: int

    @property
    def left(self) -> float:
        """Light that the LED's direct light does not explain."""
        return self.seen - self.direct


@dataclass(frozen=True, slots=True)
class Explanation:
    """Causes of the errors of a session's presses.

    Attributes
    ----------
    sensor : str
        The session folder's name.
    losses : tuple of Loss
        For each press.
    light : tuple of Light
        By side and slope.
    reflectance_needed : float
        The share of the gathered light that best explains the light beyond direct light, on slopes
        above `STEEP_DEG`; NaN without such slopes.
    reflectance_seen : float
        Reflectance of the membrane, in units of the white board's: background over white board.
    """

    sensor: str
    losses: tuple[Loss, ...]
    light: tuple[Light, ...]
    reflectance_needed: float
    reflectance_seen: float


def explain(
    calibration: Calibration,
    session: Session,
    *,
    progress: Callable[[str, float], None] | None = None,
) -> Explanation:
    """Compare a sensor's presses with the prediction of the calibration at the true surface.

    Parameters
    ----------
    calibration : Calibration
        With a full model.
    session : Session
        With ``presses/truth.csv`` and ``truth/*.npz``.
    progress : callable, optional
        Called with the present task and the share done, 0..1.

    Raises
    ------
    InputError
        If a press has no image or no truth.
    """
    full = calibration.full
    assert full is not None
    progress = progress or (lambda _what, _share: None)
    radius_mm = scored_radius_mm(session.sensor)
    presses = read_presses(replace(session, response=calibration.response), radius_mm)
    solver = NearLightSolver(calibration, full, workers=2)
    losses, parts = [], []
    for number, press in enumerate(presses):
        progress(press.row.file, number / len(presses))
        solved = solver.solved(press.rgb, effort="fast")
        if solved is None:
            continue
        losses.append(_loss(press, solved, _view(solved, press.truth)[0], radius_mm))
        # Walls mirror even distant membrane: light is gathered from the whole field.
        whole = solver.solved(press.rgb, effort="fast", everywhere=True)
        assert whole is not None
        parts.append(_light_at(solver.maps, press.truth, whole))
    progress("", 1.0)
    values = np.concatenate(parts) if parts else np.empty((0, 6))
    return Explanation(
        session.folder.resolve().name,
        tuple(losses),
        _in_bands(values),
        _needed(values),
        membrane_reflectance(calibration, full),
    )


def membrane_reflectance(calibration: Calibration, full: FullModel) -> float:
    """Return the membrane's reflectance in units of the white board's, by their brightness."""
    table, leds = calibration.table, full.led_positions_mm
    usable = table.valid & (calibration.factors > 0.0).all(axis=-1)
    both = BesideBoard.of(
        table, usable, full.background, calibration.radiance, calibration.crosstalk, leds
    )
    return both.reflectance(leds, full.membrane)


def _needed(values: Array) -> float:
    """Return `Explanation.reflectance_needed`."""
    steep = values[values[:, 1] >= STEEP_DEG]
    left, reflected = steep[:, 2] - steep[:, 3], steep[:, 5]
    size = float(reflected @ reflected)
    return float(left @ reflected) / size if size > 0.0 else float("nan")


def _view(solved: Solved, truth: TrueDepth) -> tuple[TrueView, Array]:
    """Return the true surface at a region's rays, and their slopes (rows, columns, 2)."""
    scale, (top, left) = solved.scale, solved.region.corner
    rows, columns = solved.depth_mm.shape
    at = np.s_[top : top + rows, left : left + columns]
    ray_slope = np.moveaxis(scale.rays[:2], 0, -1)[at].astype(np.float64)
    x = scale.x_mm + scale.pitch_mm * (left + np.arange(columns, dtype=np.float64))
    y = scale.y_mm + scale.pitch_mm * (top + np.arange(rows, dtype=np.float64))
    return true_view(truth, x, y, ray_slope), ray_slope


def _loss(press: TruePress, solved: Solved, view: TrueView, radius_mm: float) -> Loss:
    """Integrate computed and true slopes."""
    own = solved.slopes.slope_x, solved.slopes.slope_y
    # The true depth along the rays has the true slopes along the rays.
    pitch = solved.scale.pitch_mm
    true = tuple(np.asarray(np.gradient(view.depth_mm, pitch, axis=k), np.float32) for k in (1, 0))
    dark = solved.weight < ALL_COUNT
    top = view.known & (view.depth_mm > PLATEAU * press.row.truth.height_mm)
    top &= np.hypot(view.points_mm[..., 0], view.points_mm[..., 1]) < radius_mm

    def error(slopes: Sequence[Map]) -> float:
        across, down = slopes
        found = integrate_weighted(across, down, solved.weight, pitch_mm=pitch, hold=solved.hold)
        depth = found.depth_mm
        return 100.0 * (float(np.median(depth[top]) / np.median(view.depth_mm[top])) - 1.0)

    def mixed(where: NDArray[np.bool_]) -> list[Map]:
        return [np.where(where, t, o).astype("f4") for t, o in zip(true, own, strict=True)]

    return Loss(press.row.file, error(own), error(true), error(mixed(dark)), error(mixed(~dark)))


def _light_at(maps: SensorMaps, truth: TrueDepth, solved: Solved) -> Array:
    """Return side, slope, image, direct light, the model's addition and the gathered one (N, 6).

    Every second node along both axes, if it is tilted.
    """
    view, ray_slope = _view(solved, truth)
    image, scale, full = solved.compared.coarse, solved.scale, maps.full
    leds = full.led_positions_mm
    slope = np.degrees(np.arccos(np.clip(-view.normals[..., 2], 0.0, 1.0)))
    usable = scale.kind == 2
    seen = np.moveaxis(image.ratio, 0, -1).astype(np.float64)
    around = np.moveaxis(np.broadcast_to(solved.compared.fine.around, image.ratio.shape), 0, -1)
    flat = -np.moveaxis(scale.flat, 0, -1).astype(np.float64)
    towards_camera = view_directions(ray_slope)
    sent = ratio_reflected(seen, usable[..., None], maps.reflecting) * flat
    facets = Surface(view.points_mm, view.normals, towards_camera, sent)
    where = usable & view.known & (slope >= BANDS[0])
    thinned = np.zeros_like(where)
    thinned[::2, ::2] = where[::2, ::2]
    at = Receivers.on(facets, thinned)
    reflected = (
        gathered(facets, at, leds, full.membrane, scale.pitch_mm, slab=maps.slab) / flat[thinned]
    )
    points, normals = view.points_mm[thinned], view.normals[thinned]
    lit = lit_by(truth, view, leds)[thinned]
    direct = direct_light(full, points[:, :2], -points[:, 2], normals, ray_slope[thinned])
    direct *= 1.0 - np.moveaxis(maps.returned, 0, -1)[thinned]
    light, _ = light_directions(leds, points)
    tilted = np.einsum("nkc,nc->nk", light, normals) > -light[..., 2]
    side = np.where(lit, np.where(tilted, 0, 1), 2)
    steep = np.broadcast_to(slope[thinned][:, None], lit.shape)
    parts = (side, steep, seen[thinned], np.where(lit, direct, 0.0), around[thinned], reflected)
    return np.stack([part.ravel() for part in parts], axis=1)


def _in_bands(values: Array) -> tuple[Light, ...]:
    """Return medians by side and slope."""
    found = []
    for number, side in enumerate(SIDES):
        for low, high in pairwise(BANDS):
            part = values[(values[:, 0] == number) & (values[:, 1] >= low) & (values[:, 1] < high)]
            if len(part) >= LEAST_NODES:
                seen, direct, model, reflected = np.median(part[:, 2:], axis=0).tolist()
                found.append(Light(side, low, high, seen, direct, model, reflected, len(part)))
    return tuple(found)
