"""Common relative error of all depths of a calibrated sensor.

It has three independent parts. (1) A press is shaded by the calibrated sensor itself, with the
formulae of the joint refinement, and is reconstructed by sensors whose LEDs and membrane are moved
within the uncertainty of the refinement. (2) Errors that no choice of LEDs and membrane explains
appear when ball presses are reconstructed: their height should match their known radius. (3) The
lateral scale, since depth is slope times length.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.parallel import in_parallel, usable_cores
from gelpolight_core.geometry.membrane_shape import FLAT
from gelpolight_core.geometry.membrane_shape import MembraneShape as AtRest
from gelpolight_core.geometry.refraction import LayerStack
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.health.frame_health import LightGain
from gelpolight_core.light.facet_interreflection import (
    FacetSurface,
    LightReceivers,
    gather_interreflection,
)
from gelpolight_core.light.membrane_field import view_directions
from gelpolight_core.light.parameter import Parameter
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.integration.weighted import integrate_weighted
from gelpolight_core.reconstruction.modes import FULL
from gelpolight_core.reconstruction.near_light.kernel import solve_rows
from gelpolight_core.reconstruction.near_light.kernel_structures import (
    GaussNewtonOptions,
    RatioImage,
    slopes_like,
)
from gelpolight_core.reconstruction.near_light.membrane_interreflection import (
    surface_areas,
)
from gelpolight_core.reconstruction.near_light.sensor_maps import (
    LEAST_SHARE,
    membrane_numbers,
    node_kinds,
    sensor_scale,
)
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reconstruction.solver import DepthSolution, SolveRequest, stride_slices
from gelpolight_core.sensor.sensor_calibration import FullModel, OpenSensor
from gelpolight_core.stages.balls.ball_geometry import BallPose

from .ball_pixels import DRAPE_WIDTH_MM
from .ball_press_light import undo_light_change
from .refinement_parameters import ParameterValues

LEFT_STEP = 8
"""Nodes of the grid to one of the map of the light that no surface explains."""
# A typical press: 5 mm wide and 1 mm deep in a working circle of 26 mm.
PLATEAU_SHARE, HEIGHT_SHARE = 0.1, 0.04
# Enough nodes for the median of a plateau; more only cost time.
NODES = 160
ROUNDS = 2
# Walls and the light that they reflect depend on each other.
ROUNDS_WITH_AROUND, THROWN = 5, 3
LEVEL = 0.9986  # within 3 degrees, interreflected light is left out
# Of the reflectance: a change whose effect is seen well, and still a straight line.
DARKER = 0.98
# Small differences of depths are compared.
STEPS, SETTLED, TOLERANCE = 10, 1e-4, 1e-4
# Below this, half the difference of two depths is rounding error.
LEAST_STEP = 1e-6


@dataclass(frozen=True, slots=True)
class PressCheck:
    """Ball presses as the calibrated sensor reconstructs them.

    Attributes
    ----------
    height_errors : (presses,)
        Relative errors of their heights; NaN where the top of a ball is not solved.
    left : (rows, columns) float32
        Light that no surface explains, as a share of that of the untouched membrane: mean over the
        channels and over the presses that reach a node; NaN where none does.
    step : int
        Nodes of the grid to a node of `left`.
    """

    height_errors: Float64Array
    left: Float32Array
    step: int = LEFT_STEP

    @property
    def height_error(self) -> float:
        """Root mean square of `height_errors`; 0 without any."""
        errors = self.height_errors[np.isfinite(self.height_errors)]
        return float(np.sqrt(np.mean(errors**2))) if errors.size else 0.0


def check_presses(
    calibration: OpenSensor,
    images: Iterable[Float32Array],
    gains: Sequence[LightGain | None],
    balls: Sequence[BallPose],
) -> PressCheck:
    """Reconstruct ball presses, and compare them with their balls and their light.

    Parameters
    ----------
    calibration : OpenSensor
        With its full model.
    images : iterable of (height, width, 3) float32
        Raw images of ball presses, linear light.
    gains : sequence of LightGain or None
        Change of the light of each, which is corrected. What the correction leaves tilts the whole
        field a little: the height is then that above the surroundings of the ball.
    balls : sequence of BallPose
        Poses from the joint refinement.
    """
    assert calibration.full is not None
    solver = NearLightSolver(calibration, workers=usable_cores())
    grid, errors = calibration.table.grid, []
    points, at = grid.points_mm(), stride_slices(LEFT_STEP)
    total, count = (np.zeros(grid.shape, np.float32)[at] for _ in range(2))
    for rgb, gain, ball in zip(images, gains, balls, strict=True):
        # At full scale: coarser nodes would take the more of a ball's depth the smaller it is.
        light = undo_light_change(rgb, gain)
        depth_map = _as_height_map(solver.depth(light, SolveRequest(normals=False)), calibration)
        depth = depth_map.depth_mm
        left = solver.residual(light, depth_map, step=LEFT_STEP).mean(axis=2)
        pressed = np.isfinite(left) & (depth[at] > solver.visible_mm)
        total[pressed] += left[pressed]
        count[pressed] += 1.0
        error = np.nan
        distance_mm = np.linalg.norm(points - ball.centre_mm, axis=-1)
        # Further than 0.3 mm from the ball's top, the slope of the cap has too much weight.
        top = (distance_mm < 0.3) & (solver.maps.kind == 2)
        if top.any():
            middle_mm = ball.middle_mm(calibration.surface)[2]
            lower_mm = middle_mm - np.sqrt(ball.radius_mm**2 - distance_mm[top] ** 2)
            true = calibration.surface.height(points[top]) - lower_mm
            error_mm = float(np.median(depth[top] - true))
            if gain is not None:
                widths = (distance_mm - ball.radius_mm) / DRAPE_WIDTH_MM
                beside = (widths > 2.0) & (widths < 3.0) & (solver.maps.kind == 2)
                error_mm -= float(np.median(depth[beside])) if beside.any() else 0.0
            error = error_mm / ball.depth_mm
        errors.append(error)
    left = np.where(count > 0.0, total / np.maximum(count, 1.0), np.float32(np.nan))
    return PressCheck(np.array(errors), left)


def _as_height_map(solved: DepthSolution, calibration: OpenSensor) -> HeightMap:
    grid = calibration.table.grid
    return HeightMap(
        depth_mm=solved.depth_mm,
        x_mm=grid.x_mm,
        y_mm=grid.y_mm,
        pitch_mm=grid.pitch_mm,
        normals=None,
        flags=solved.flags,
        calibration_id="",
        model=FULL,
        source="",
        at_rest=calibration.table.surface,
    )


def lateral_scale_sd(stack: LayerStack, distance_sd_mm: float, focal_sd: float) -> float:
    """Return the relative standard deviation of lengths on the membrane.

    The board on the top surface ties distance and focal length together: a common error of both
    changes the lateral scale only as far as refraction shifts the surface.

    Parameters
    ----------
    stack : LayerStack
        Layers between camera and top surface.
    distance_sd_mm : float
        Standard deviation of the distance of the top surface, including the effect of the focal
        length.
    focal_sd : float
        Relative standard deviation of the focal length.
    """
    pairs = list(zip(stack.thicknesses_mm, stack.indices, strict=True))
    distance, apparent = sum(t for t, _ in pairs), sum(t / n for t, n in pairs)
    independent_sd_mm = np.sqrt(max(distance_sd_mm**2 - (distance * focal_sd) ** 2, 0.0))
    return float(np.hypot(independent_sd_mm, focal_sd * (distance - apparent)) / apparent)


def height_gradient(
    full: FullModel,
    table: ResamplingTable,
    shared: Sequence[Parameter],
    x: Float64Array,
    covariance: Float64Array,
) -> Float64Array:
    """Return the relative change of a typical height by each parameter of LEDs and membrane.

    Parameters
    ----------
    full : FullModel
        The calibrated LEDs and membrane.
    table : ResamplingTable
        Grid and rays.
    shared : sequence of Parameter
        The S parameters that all presses of the joint refinement share.
    x : (S,)
        Their fitted values.
    covariance : (S, S)
        Their covariance. Each of its directions is changed by one standard deviation.

    Returns
    -------
    (S,)
        Change for a unit of each parameter. 0 along directions without uncertainty.
    """
    field, depth, plateau = synthetic_press(full, table)
    height = np.median(depth[plateau])
    sizes, directions = np.linalg.eigh(covariance)
    steps = (np.sqrt(np.maximum(sizes, 0.0)) * directions).T
    steps = steps[np.abs(steps).max(axis=1) >= LEAST_STEP]
    low, high = np.array([parameter.limits for parameter in shared]).T

    def found_mm(step: Float64Array) -> float:
        values = ParameterValues.of(shared, np.clip(x + step, low, high))
        moved = replace(full, led_positions_mm=values.leds_mm, membrane=values.membrane)
        return float(np.median(reconstructed_depth(moved, field, depth)[plateau]))

    ends = np.reshape(list(in_parallel(found_mm, [*steps, *-steps])), (2, -1))
    changes = (ends[0] - ends[1]) / (2.0 * height)
    return np.asarray(changes / (steps**2).sum(axis=1) @ steps)


class SyntheticPress(NamedTuple):
    """Simulated view of a press by the calibrated sensor.

    Attributes
    ----------
    image : RatioImage
        Press over background.
    x_mm, y_mm : (columns,), (rows,)
        Nodes.
    ray_slope : (2, rows, columns)
        Slopes of the camera rays.
    usable : (rows, columns) bool
        Visible nodes.
    """

    image: RatioImage
    x_mm: Float64Array
    y_mm: Float64Array
    ray_slope: Float32Array
    usable: NDArray[np.bool_]


def synthetic_press(
    full: FullModel, table: ResamplingTable
) -> tuple[SyntheticPress, Float32Array, NDArray[np.bool_]]:
    """Shade a round plateau with its drape, as the calibrated sensor would see it.

    Returns
    -------
    field : SyntheticPress
        On a coarse grid.
    depth_mm : (rows, columns) float32
        True depth along the rays.
    plateau : (rows, columns) bool
        Nodes on the plateau.
    """
    stride = max(min(table.grid.shape) // NODES, 1)
    grid, cut = table.grid, np.s_[::stride, ::stride]
    x, y = grid.x_mm[::stride], grid.y_mm[::stride]
    ray_slope, usable = table.ray_slope[cut], table.valid[cut]
    width = min(np.ptp(x), np.ptp(y))
    radius, height = PLATEAU_SHARE * width, HEIGHT_SHARE * width
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    rays = ray_slope.reshape(-1, 2).astype(np.float64)
    centre = np.array([x.mean(), y.mean()])
    depth = np.zeros(len(points))
    for _ in range(12):  # damped: a ray's slope against the drape stays below 1
        r = np.linalg.norm(points + depth[:, None] * rays - centre, axis=1)
        depth = 0.5 * (depth + height * np.exp(-np.maximum(r - radius, 0.0) / full.decay_mm))
    position = points + depth[:, None] * rays
    offset_mm = position - centre
    r = np.linalg.norm(offset_mm, axis=1)
    steep = np.where(r > radius, -depth / full.decay_mm, 0.0) / np.maximum(r, 1e-9)
    normals = np.concatenate([-steep[:, None] * offset_mm, -np.ones((len(r), 1))], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    shape = usable.shape
    ratio, around = _shaded(
        full, (points, rays, position, depth, normals), usable, stride, grid.pitch_mm
    )
    planes = [np.ascontiguousarray(np.moveaxis(m, -1, 0)) for m in (ratio, around)]
    noise = np.full_like(planes[0], 0.003)
    image = RatioImage(planes[0], noise, planes[1], np.zeros(shape, np.uint8))
    field = SyntheticPress(image, x, y, np.moveaxis(ray_slope, -1, 0), usable)
    return field, depth.reshape(shape).astype(np.float32), (r < radius).reshape(shape) & usable


def _shaded(
    full: FullModel,
    seen: tuple[Float64Array, Float64Array, Float64Array, Float64Array, Float64Array],
    usable: NDArray[np.bool_],
    stride: int,
    pitch_mm: float,
) -> tuple[Float32Array, Float32Array]:
    """Return press over background, and the interreflected light in it."""
    points, rays, position, depth, normals = seen
    view, shape = view_directions(rays), usable.shape
    leds, place = full.led_positions_mm, np.concatenate([position, -depth[:, None]], axis=1)
    flat = direct_flat(full, points, view)
    direct = -full.membrane.direct(leds, place, normals, view) / flat
    factors = _to_camera(full, depth, rays, normals[:, 2])
    direct *= factors[0]
    flat, share, camera = (part.reshape(*shape, 3) for part in (flat, *factors))
    around, seen_as = np.zeros((*shape, 3)), np.zeros((*shape, 3))
    for _ in range(THROWN if full.membrane.interreflection > LEAST_SHARE else 1):
        # Reflected light is reflected again.
        seen_as = direct.reshape(*shape, 3) + around
        surface = FacetSurface(
            place.reshape(*shape, 3),
            normals.reshape(*shape, 3),
            view.reshape(*shape, 3),
            seen_as * flat / camera * usable[..., None],
        )
        constant, by_normal = _around(full, surface, flat, stride * pitch_mm)
        lit = constant + np.einsum("ijkl,ijl->ijk", by_normal, surface.normals)
        around = share * np.maximum(lit, 0.0)
    return np.where(usable[..., None], seen_as, 1.0).astype(np.float32), around.astype(np.float32)


def _to_camera(
    full: FullModel,
    depth_mm: NDArray[np.floating],
    ray_slope: NDArray[np.floating],
    down: NDArray[np.floating],
) -> tuple[Float64Array, Float64Array]:
    """Return the factors (..., 3) on all light to the camera, and of the path to it alone.

    Depths (...) are along rays with slopes (..., 2), `down` is z of the normals.
    """
    light = full.membrane.light
    nearer_mm = depth_mm * np.sqrt(1.0 + (np.asarray(ray_slope, np.float64) ** 2).sum(axis=-1))
    return light.seen(nearer_mm, down), light.to_camera(nearer_mm)


def direct_flat(
    full: FullModel, points_mm: Float64Array, view: Float64Array, at_rest: AtRest = FLAT
) -> Float64Array:
    """Return the brightness (N, 3) of points (N, 2) of the membrane at rest."""
    places, normals = at_rest.points(points_mm), at_rest.normals(points_mm)
    return -full.membrane.direct(full.led_positions_mm, places, normals, view)


def _around(
    full: FullModel, surface: FacetSurface, flat: Float64Array, pitch_mm: float
) -> tuple[Float64Array, Float64Array]:
    """Return interreflected light in units of the flat membrane's.

    It is a constant (rows, columns, 3), and its derivative (rows, columns, 3, 3) by the normal.
    """
    constant, by_normal = np.zeros_like(flat), np.zeros((*flat.shape, 3))
    if full.membrane.interreflection <= LEAST_SHARE:
        return constant, by_normal
    tilted = surface.normals[..., 2] > -LEVEL
    leds, receivers = full.led_positions_mm, LightReceivers.on(surface, tilted)
    received = gather_interreflection(surface, receivers, leds, full.membrane, pitch_mm)
    per_flat = full.membrane.interreflection / flat[tilted]
    by_normal[tilted] = received.by_normal * per_flat[..., None]
    own = np.einsum("ikl,il->ik", by_normal[tilted], receivers.normals)
    constant[tilted] = received.light * per_flat - own
    return constant, by_normal


def light_feedback(full: FullModel, table: ResamplingTable) -> float:
    """Return the share of an error of interreflected light that comes back at walls, 0..1.

    It is that of the typical press, from how far a smaller reflectance moves its height while walls
    keep their light, and while they receive the light of the walls that are found.

    Parameters
    ----------
    full : FullModel
        The calibrated LEDs and membrane.
    table : ResamplingTable
        Grid and rays.
    """
    if full.membrane.interreflection <= LEAST_SHARE:
        return 0.0
    field, depth, plateau = synthetic_press(full, table)
    darker = replace(full.membrane, interreflection=DARKER * full.membrane.interreflection)

    def moved_mm(*, frozen: bool) -> float:
        heights = [
            np.median(reconstructed_depth(model, field, depth, frozen=frozen)[plateau])
            for model in (replace(full, membrane=darker), full)
        ]
        return float(heights[0] - heights[1])

    all_of_it = moved_mm(frozen=False)
    return float(np.clip(1.0 - moved_mm(frozen=True) / all_of_it, 0.0, 1.0)) if all_of_it else 0.0


def reconstructed_depth(
    full: FullModel, field: SyntheticPress, depth_mm: Float32Array, *, frozen: bool = False
) -> Float32Array:
    """Return the depth that a sensor reconstructs, starting near the true one.

    Parameters
    ----------
    full : FullModel
        The reconstructing sensor.
    field : SyntheticPress
        The simulated view.
    depth_mm : (rows, columns) float32
        Start values.
    frozen : bool, optional
        Whether walls keep the interreflected light of the start, whatever depth is found.
    """
    kind = node_kinds(field.usable, field.usable, 1)
    scale = sensor_scale(full, (field.x_mm, field.y_mm), field.ray_slope, kind, factor=1)
    membrane, steps = membrane_numbers(full), GaussNewtonOptions(STEPS, SETTLED**2, False)
    rows = len(depth_mm)
    reflected = membrane.interreflection > 0.0
    view = view_directions(np.moveaxis(field.ray_slope, 0, -1).astype(np.float64))
    flat = -np.moveaxis(scale.flat, 0, -1).astype(np.float64)
    x, y = np.meshgrid(field.x_mm, field.y_mm)
    seen_mm = depth_mm
    for _ in range(ROUNDS_WITH_AROUND if reflected and not frozen else ROUNDS):
        image = field.image
        if reflected:
            areas = surface_areas(seen_mm, (0, 0), scale, lambda n, f, *on: f(0, n, *on))
            normals = np.moveaxis(areas / np.sqrt((areas**2).sum(axis=0)), 0, -1)
            ray_slope = field.ray_slope
            points = np.stack(
                [x + seen_mm * ray_slope[0], y + seen_mm * ray_slope[1], -seen_mm], -1
            )
            slopes_of_rays = np.moveaxis(ray_slope, 0, -1)
            seen, camera = _to_camera(full, seen_mm, slopes_of_rays, normals[..., 2])
            brightness = np.moveaxis(image.ratio, 0, -1) * flat / camera * field.usable[..., None]
            surface = FacetSurface(points, normals, view, brightness)
            constant, by_normal = _around(full, surface, flat, scale.pitch_mm)
            if frozen:
                constant += np.einsum("ijkl,ijl->ijk", by_normal, normals)
                by_normal[:] = 0.0
            derivative = (seen[..., None] * by_normal).reshape(*seen.shape[:2], 9)
            light = np.moveaxis(np.dstack([seen * constant, derivative]), -1, 0)
            image = image._replace(around=np.ascontiguousarray(light, np.float32))
        slopes = slopes_like(depth_mm)
        solve_rows(0, rows, image, depth_mm, scale, (0, 0), membrane, steps, slopes)
        depth_mm = integrate_weighted(
            slopes.slope_x,
            slopes.slope_y,
            slopes.weight,
            pitch_mm=scale.pitch_mm,
            start_mm=depth_mm,
            tolerance=TOLERANCE,
        ).depth_mm
        seen_mm = seen_mm if frozen else depth_mm
    return depth_mm
