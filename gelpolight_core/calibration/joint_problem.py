"""The residuals minimised by the joint refinement: all ball presses, priors, and derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from gelpolight_core.arrays import Array
from gelpolight_core.calibration.ball_pixels import BallPixels
from gelpolight_core.calibration.joint_kernel import model_press
from gelpolight_core.lights.positions import LED_HEIGHT_SD_MM
from gelpolight_core.reflectance.ball import BallPose
from gelpolight_core.reflectance.draped_ball import draped_ball
from gelpolight_core.reflectance.membrane import CURVE_NODES
from gelpolight_core.surface import Surface

Seen = tuple[Array, Array, NDArray[np.bool_]]
LED_LATERAL_SD_MM = 0.05
SHAPE_SD_MM = np.array([0.03, 0.05, 0.05])
"""Tolerance of a mould's height, and of its axis by the circle in the background."""
PRIOR_STRENGTH = 3.0
# LEDs (9), exponent, gloss, roughness, reflectance for interreflected light, decay length; rise and
# shift of the axis (x, y) of a curved membrane.
COMMON, DECAY, SHAPE = 17, 13, slice(14, 17)
# The one-dimensional membrane: cos times the exponential of a spline through these cosines; it is 0
# at the last. Below the first, which balls hardly reach, it continues with Lambert's law.
CURVE_COSINES = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
CURVE_SIZE = 3 * (CURVE_COSINES.size - 1)
CURVE_SD = 0.1
_STEP = 1e-4
STATED = ("radius", "layers", "square", "led_height", "coating", "membrane")
"""What is stated or taken for granted, and contradicts the presses if it is wrong: ball radii,
layers between camera and membrane, squares of the board on the top surface, height of the LEDs, a
coating that stays as it is where it is stretched, a membrane that is flat."""
RISE_SHARE = 0.1
"""Height of a cap over the field's width, for a factor of 2 on the flat membrane."""


def _bumps() -> Array:
    """Return the spline's terms at even cosines, (`CURVE_NODES`, nodes - 1)."""
    even = np.clip(np.linspace(0.0, 1.0, CURVE_NODES), CURVE_COSINES[0], 1.0)
    spline = CubicSpline(CURVE_COSINES, np.eye(CURVE_COSINES.size), bc_type="natural")
    return np.asarray(spline(even)[:, :-1])


_BUMPS = _bumps()
_NO_CURVES = np.zeros((3, 0))


def diffuse_curves(heights: Array) -> tuple[tuple[float, ...], ...]:
    """Return a membrane's diffuse curves from the spline's heights (`CURVE_SIZE`,)."""
    even = np.linspace(0.0, 1.0, CURVE_NODES)
    curves = even * np.exp(heights.reshape(3, -1) @ _BUMPS.T)
    return tuple(tuple(np.maximum.accumulate(curve).tolist()) for curve in curves)


def bent_curves(
    curves: tuple[tuple[float, ...], ...], heights: Array
) -> tuple[tuple[float, ...], ...]:
    """Return a membrane's diffuse curves with the spline's heights (`CURVE_SIZE`,) raised."""
    bent = np.asarray(curves) * np.exp(heights.reshape(3, -1) @ _BUMPS.T)
    return tuple(tuple(np.maximum.accumulate(curve).tolist()) for curve in bent)


def shaped(surface: Surface, x: Array) -> Surface:
    """Return a membrane at rest with the rise and the shift of its axis in the parameters."""
    rise, dx, dy = x[SHAPE].tolist()
    axis = surface.axis_mm[0] + dx, surface.axis_mm[1] + dy
    return replace(surface, rise_mm=surface.rise_mm + rise, axis_mm=axis)


@dataclass(frozen=True, slots=True)
class Problem:
    """Residuals of all presses, with priors.

    The parameters are the common ones, then x, y and depth of each ball and, if the membrane is
    one-dimensional, the heights of its curves; only those that are `free` are solved for. The
    reflectance for interreflected light may be expected, with a standard deviation. The coating's
    reflectance is the cosine of the slope, which is the unstretched over the stretched area, to the
    power of `coating`.
    """

    presses: Sequence[BallPixels]
    start: Array
    free: NDArray[np.bool_]
    reflectance: tuple[float, float] | None = None
    coating: float = 0.0

    @property
    def balls_end(self) -> int:
        """Index after the last ball parameter."""
        return COMMON + 3 * len(self.presses)

    def with_stated(self, key: str, value: float, bright_mm: Array) -> Problem:
        """Return the problem with another value of one of `STATED`.

        Parameters
        ----------
        key, value
            A factor on a stated length, or 1 plus the coating's exponent, or 1 plus the height of a
            cap over `RISE_SHARE` of the field's width.
        bright_mm : (3, 2)
            Where the LEDs are seen in the mirror.
        """
        presses, leds = self.presses, self.start[:9].reshape(3, 3).copy()
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
        start = np.concatenate([leds.ravel(), self.start[9:]])
        return replace(self, presses=presses, start=start)

    def residuals(self, x: Array, surfaces: Sequence[Seen] | None = None) -> list[Array]:
        """Return the weighted residuals of each press, (3 N,); on known surfaces if given."""
        seen = self._surfaces(x) if surfaces is None else surfaces
        pairs = zip(self._pixels(x), seen, strict=True)
        return [self._press(x, pixels, surface).ravel() for pixels, surface in pairs]

    def _surfaces(self, x: Array) -> list[Seen]:
        """Return the visible points and normals (N, 3) of each ball, and where it is in contact."""
        seen, decay_mm = [], float(x[DECAY])
        balls = x[COMMON : self.balls_end].reshape(-1, 3)
        for pixels, ball in zip(self._pixels(x), balls, strict=True):
            pose = BallPose((float(ball[0]), float(ball[1])), pixels.radius_mm, float(ball[2]))
            at, rays, surface = pixels.points_mm, pixels.ray_slope, pixels.surface
            seen.append(draped_ball(at, rays, pose, decay_mm=decay_mm, surface=surface))
        return seen

    def _pixels(self, x: Array) -> Sequence[BallPixels]:
        """Return the presses on the membrane at rest that the parameters give."""
        if not x[SHAPE].any():
            return self.presses
        return [pixels.on(shaped(pixels.surface, x)) for pixels in self.presses]

    def _press(self, x: Array, pixels: BallPixels, seen: Seen) -> Array:
        """Return the weighted residuals of a press, (N, 3)."""
        result = np.empty(pixels.ratio.shape)
        grey = (-seen[1][:, 2:]) ** self.coating
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
            seen,
            x[:9].reshape(3, 3),
            (float(x[9]), float(x[10]), float(x[11])),
            x[self.balls_end :].reshape(3, -1),
            _BUMPS,
            _NO_CURVES,
            float(x[12]),
            result,
        )
        return result

    def priors(self, x: Array) -> Array:
        """Return the residuals of the prior knowledge."""
        moved = (x[:9] - self.start[:9]).reshape(3, 3)
        expected = self.reflectance
        return np.concatenate(
            [
                PRIOR_STRENGTH * moved[:, :2].ravel() / LED_LATERAL_SD_MM,
                PRIOR_STRENGTH * moved[:, 2] / LED_HEIGHT_SD_MM,
                # Exponent and gloss trade off; the data must clearly show a diffuse share that
                # deviates from Lambert's law (the loss allows large deviations), or an unseen lobe.
                [PRIOR_STRENGTH * (x[9] - 1.0) / 0.01, (x[11] - 0.5) / 0.3],
                [] if expected is None else [(x[12] - expected[0]) / expected[1]],
                x[self.balls_end :] / CURVE_SD,
                PRIOR_STRENGTH * x[SHAPE] / SHAPE_SD_MM if self.free[SHAPE].any() else [],
            ]
        )

    def all(self, x: Array) -> Array:
        """Return residuals and priors as one vector."""
        return np.concatenate([*self.residuals(x), self.priors(x)])

    def jacobian(self, x: Array) -> Array:
        """Return the Jacobian by finite differences, with as few evaluations as possible.

        A light or a curve affects only its own channel, and a ball's parameters only its own press,
        so one coordinate of all lights, curves, or balls is moved at the same time.
        """
        surfaces = self._surfaces(x)
        base = self.residuals(x, surfaces)
        ends = np.cumsum([r.size for r in base])
        starts = ends - [r.size for r in base]
        prior = self.priors(x)
        result = np.zeros((ends[-1] + prior.size, x.size))

        def slopes(
            columns: slice | list[int], surfaces: Sequence[Seen] | None
        ) -> Iterator[tuple[int, slice, Array]]:
            """Yield each press, its rows, and its derivatives when all `columns` are moved."""
            moved = x.copy()
            moved[columns] += _STEP
            for i, r in enumerate(self.residuals(moved, surfaces)):
                yield i, slice(starts[i], ends[i]), (r - base[i]) / _STEP

        for axis in range(3):
            if self.free[axis:9:3].any():
                for _, rows, slope in slopes(slice(axis, 9, 3), surfaces):
                    for k in np.flatnonzero(self.free[axis:9:3]):
                        result[rows, 3 * k + axis][k::3] = slope[k::3]
            for i, rows, slope in slopes(slice(COMMON + axis, self.balls_end, 3), None):
                result[rows, COMMON + 3 * i + axis] = slope
        for alone in (9 + np.flatnonzero(self.free[9:COMMON])).tolist():
            for _, rows, slope in slopes([alone], None if alone >= DECAY else surfaces):
                result[rows, alone] = slope
        for j in np.flatnonzero(self.free):
            moved = x.copy()
            moved[j] += _STEP
            result[ends[-1] :, j] = (self.priors(moved) - prior) / _STEP
        terms = CURVE_SIZE // 3
        for term in range(terms if self.free[self.balls_end :].any() else 0):
            of_light = self.balls_end + term + terms * np.arange(3)
            for _, rows, slope in slopes(of_light.tolist(), surfaces):
                for channel, at in enumerate(of_light):
                    result[rows, at][channel::3] = slope[channel::3]
        return result
