"""The residuals minimised by the joint refinement: all ball presses, priors, and derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.light.membrane_brdf import CURVE_NODES
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.draped_ball import draped_ball

from .ball_pixels import BallPixels
from .refinement_kernel import model_press
from .refinement_parameters import CURVE_COSINES, Parameter, ParameterValues, unpacked

ModelSurfaces = tuple[Float64Array, Float64Array, NDArray[np.bool_]]
_STEP = 1e-4
STATED = ("radius", "layers", "square", "led_height", "coating", "membrane")
"""What is stated or taken for granted, and contradicts the presses if it is wrong: ball radii,
layers between camera and membrane, squares of the board on the top surface, height of the LEDs, a
coating that stays as it is where it is stretched, a membrane that is flat."""
RISE_SHARE = 0.1
"""Height of a cap over the field's width, for a factor of 2 on the flat membrane."""


LAMBERT = np.linspace(0.0, 1.0, CURVE_NODES)
"""The diffuse curve of Lambert's law."""


def _bumps() -> Float64Array:
    """Return the spline's terms at even cosines, (`CURVE_NODES`, nodes - 1)."""
    even = np.clip(LAMBERT, CURVE_COSINES[0], 1.0)
    spline = CubicSpline(CURVE_COSINES, np.eye(CURVE_COSINES.size), bc_type="natural")
    return np.asarray(spline(even)[:, :-1])


_BUMPS = _bumps()
_NO_CURVES = np.zeros((3, 0))


def with_spline_offsets(
    curves: Sequence[tuple[float, ...]] | Float64Array, heights: Float64Array
) -> tuple[tuple[float, ...], ...]:
    """Return a membrane's diffuse curves, times the spline of heights (3, M)."""
    bent = np.asarray(curves) * np.exp(heights @ _BUMPS.T)
    return tuple(tuple(np.maximum.accumulate(curve).tolist()) for curve in bent)


def with_shape_parameters(surface: MembraneShape, shape_mm: Float64Array) -> MembraneShape:
    """Return a membrane at rest with a rise and a shift of its axis (3,)."""
    rise, dx, dy = shape_mm.tolist()
    axis = surface.axis_mm[0] + dx, surface.axis_mm[1] + dy
    return replace(surface, rise_mm=surface.rise_mm + rise, axis_mm=axis)


@dataclass(frozen=True)
class JointProblem:
    """Residuals of all presses and priors, as a function of the parameters.

    The coating's reflectance is the cosine of the slope, which is the unstretched over the
    stretched area, to the power of `coating`.

    Attributes
    ----------
    presses : sequence of BallPixels
        Pixels of the presses.
    parameters : tuple of Parameter
        Parameters in the order of a vector (P,) of their values.
    coating : float
        Exponent.
    """

    presses: Sequence[BallPixels]
    parameters: tuple[Parameter, ...]
    coating: float = 0.0

    @cached_property
    def start(self) -> Float64Array:
        """Start values, (P,)."""
        return np.array([parameter.start for parameter in self.parameters])

    @cached_property
    def typical_change(self) -> Float64Array:
        """Changes of the parameters during a fit, (P,)."""
        return np.array([parameter.typical_change for parameter in self.parameters])

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Whether each parameter is fitted, (P,)."""
        return np.array([parameter.free for parameter in self.parameters])

    @cached_property
    def shared(self) -> NDArray[np.bool_]:
        """Whether all presses share a parameter, (P,)."""
        return np.array([parameter.press is None for parameter in self.parameters])

    @cached_property
    def limits(self) -> tuple[Float64Array, Float64Array]:
        """Smallest and largest values, (P,) each."""
        low, high = np.array([parameter.limits for parameter in self.parameters]).T
        return low, high

    def values(self, x: Float64Array) -> ParameterValues:
        """Return a vector of the parameters by their meaning."""
        return unpacked(x, len(self.presses))

    def judging(self, shared: Float64Array) -> JointProblem:
        """Return the problem of the balls alone, at given values of the shared parameters."""
        values = iter(shared.tolist())
        parameters = [p.fixed(next(values)) if p.press is None else p for p in self.parameters]
        return replace(self, parameters=tuple(parameters))

    def with_stated(self, key: str, value: float, bright_mm: Float64Array) -> JointProblem:
        """Return the problem with another value of one of `STATED`.

        Parameters
        ----------
        key, value
            A factor on a stated length, or 1 plus the coating's exponent, or 1 plus the height of a
            cap over `RISE_SHARE` of the field's width.
        bright_mm : (3, 2)
            Where the LEDs are seen in the mirror.
        """
        presses, start = self.presses, self.start.copy()
        leds = self.values(start).leds_mm
        if key == "coating":
            return replace(self, coating=value - 1.0)
        if key == "membrane":
            width_mm = float(np.ptp(presses[0].view_of_field.points_mm[:, 0]))
            rise_mm = (value - 1.0) * RISE_SHARE * width_mm
            cap = replace(presses[0].surface, diameter_mm=width_mm, rise_mm=rise_mm)
            return replace(self, presses=[p.on(cap) for p in presses])
        if key == "radius":
            presses = [replace(p, radius_mm=value * p.radius_mm) for p in presses]
        elif key == "led_height":
            leds += (value - 1.0) * (leds - np.pad(bright_mm, ((0, 0), (0, 1))))
        else:
            # All that is seen on the top surface; the board also places the LEDs.
            presses = [replace(p, points_mm=value * p.points_mm) for p in presses]
            leds[:, :2] += (value - 1.0) * bright_mm * (key == "square")
        pairs = zip(self.parameters, start.tolist(), strict=True)
        parameters = tuple(replace(parameter, start=value) for parameter, value in pairs)
        return replace(self, presses=presses, parameters=parameters)

    def residuals(
        self, x: Float64Array, surfaces: Sequence[ModelSurfaces] | None = None
    ) -> list[Float64Array]:
        """Return the weighted residuals of each press, (3 N,).

        Parameters
        ----------
        x : (P,)
            Values of all parameters.
        surfaces : sequence of ModelSurfaces, optional
            Surfaces of the presses, where they are known.
        """
        values = self.values(x)
        surfaces = self._surfaces(values) if surfaces is None else surfaces
        pairs = zip(self._pixels(values), surfaces, strict=True)
        return [self._press(values, pixels, surface).ravel() for pixels, surface in pairs]

    def _surfaces(self, values: ParameterValues) -> list[ModelSurfaces]:
        """Return points, normals (N, 3) and contact (N,) of each ball with its drape."""
        surfaces = []
        poses = ball_poses(values, self.presses)
        for pixels, pose in zip(self._pixels(values), poses, strict=True):
            points_mm, rays, surface = pixels.points_mm, pixels.ray_slope, pixels.surface
            drape = draped_ball(points_mm, rays, pose, decay_mm=values.decay_mm, surface=surface)
            surfaces.append(drape)
        return surfaces

    def _pixels(self, values: ParameterValues) -> Sequence[BallPixels]:
        """Return the presses on the membrane at rest that the parameters give."""
        if not values.shape_mm.any():
            return self.presses
        return [
            pixels.on(with_shape_parameters(pixels.surface, values.shape_mm))
            for pixels in self.presses
        ]

    def _press(
        self, values: ParameterValues, pixels: BallPixels, surface: ModelSurfaces
    ) -> Float64Array:
        """Return the weighted residuals of a press, (N, 3)."""
        result = np.empty(pixels.ratio.shape)
        grey = (-surface[1][:, 2:]) ** self.coating
        model_press(
            (
                pixels.surface.points(pixels.points_mm),
                pixels.surface.normals(pixels.points_mm),
                pixels.view,
                pixels.ratio / grey,
                pixels.weight * grey,
                pixels.around,
                pixels.around_flat,
            ),
            surface,
            values.leds_mm,
            values.lobes,
            values.curves,
            _BUMPS,
            _NO_CURVES,
            values.interreflection,
            result,
        )
        return result

    @cached_property
    def _prior_columns(self) -> tuple[NDArray[np.intp], Float64Array, Float64Array, Float64Array]:
        """Parameters with a prior, by its source, with strength, mean and standard deviation."""
        rows = [(i, p.prior, p.start) for i, p in enumerate(self.parameters) if p.prior is not None]
        rows.sort(key=lambda row: row[1].source)
        columns = np.array([i for i, _, _ in rows])
        mean = [start if prior.mean is None else prior.mean for _, prior, start in rows]
        strength, sd = np.array([(prior.strength, prior.sd) for _, prior, _ in rows]).T
        return columns, strength, np.array(mean), sd

    def priors(self, x: Float64Array) -> Float64Array:
        """Return the residuals of the prior knowledge, (M,)."""
        columns, strength, mean, sd = self._prior_columns
        return np.asarray(strength * (x[columns] - mean) / sd)

    def all(self, x: Float64Array) -> Float64Array:
        """Return residuals and priors as one vector."""
        return np.concatenate([*self.residuals(x), self.priors(x)])

    def jacobian(self, x: Float64Array) -> Float64Array:
        """Return the Jacobian by finite differences, with as few evaluations as possible.

        Parameters with the same key affect different residuals, and are moved at the same time.
        """
        surfaces = self._surfaces(self.values(x))
        base = self.residuals(x, surfaces)
        ends = np.cumsum([r.size for r in base])
        starts = ends - [r.size for r in base]
        prior = self.priors(x)
        result = np.zeros((ends[-1] + prior.size, x.size))
        columns_by_key: dict[str, list[int]] = {}
        for j in np.flatnonzero(self.free).tolist():
            columns_by_key.setdefault(self.parameters[j].key, []).append(j)
        for columns in columns_by_key.values():
            moved = x.copy()
            moved[columns] += _STEP
            same = None if self.parameters[columns[0]].moves_surface else surfaces
            for i, r in enumerate(self.residuals(moved, same)):
                slope = (r - base[i]) / _STEP
                for j in columns:
                    parameter = self.parameters[j]
                    if parameter.press in (None, i):
                        part = slice(
                            parameter.channel, None, None if parameter.channel is None else 3
                        )
                        result[starts[i] : ends[i], j][part] = slope[part]
        for j in np.flatnonzero(self.free).tolist():
            moved = x.copy()
            moved[j] += _STEP
            result[ends[-1] :, j] = (self.priors(moved) - prior) / _STEP
        return result


def ball_poses(values: ParameterValues, presses: Sequence[BallPixels]) -> tuple[BallPose, ...]:
    """Return the pose of each ball."""
    return tuple(
        BallPose((x_mm, y_mm), pixels.radius_mm, depth_mm)
        for (x_mm, y_mm, depth_mm), pixels in zip(values.balls_mm.tolist(), presses, strict=True)
    )
