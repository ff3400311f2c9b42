"""The residuals minimised by the joint refinement: all ball presses, priors, and derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.light.parameter import Parameter
from gelpolight_core.stages.balls.draped_ball import draped_ball

from .ball_pixels import BallPixels
from .board_light import BoardLight
from .refinement_kernel import model_press
from .refinement_parameters import BUMPS, LED_AXES, ParameterValues

ModelSurfaces = tuple[Float64Array, Float64Array, NDArray[np.bool_]]
_STEP = 1e-4
BLENDED = "contrast"
"""Of a camera that shows a share of an earlier frame, the untouched membrane, in its presses."""
STATED = ("radius", "layers", "square", "led_height", "membrane", "response", BLENDED)
"""What is stated or taken for granted, and contradicts the presses if it is wrong: ball radii,
layers between camera and membrane, squares of the board on the top surface, height of the LEDs, a
membrane that is flat, a camera whose values are proportional to light, and one that shows no share
of an earlier frame."""
LATERAL = ("layers", "square")
"""Those of them that all lateral lengths are proportional to."""
RISE_SHARE = 0.1
"""Height of a cap over the field's width, for a factor of 2 on the flat membrane."""


_NO_CURVES = np.zeros((3, 0))


@dataclass(frozen=True)
class JointProblem:
    """Residuals of all presses, of the white board and priors, as a function of the parameters.

    Attributes
    ----------
    presses : sequence of BallPixels
        Pixels of the presses.
    parameters : tuple of Parameter
        Parameters in the order of a vector (P,) of their values.
    board : BoardLight, optional
        The light of the LEDs on the white board.
    bright_mm : (3, 2), optional
        Where the LEDs are seen in the mirror, if the presses can show that a length is stated
        wrongly.
    """

    presses: Sequence[BallPixels]
    parameters: tuple[Parameter, ...]
    board: BoardLight | None = None
    bright_mm: Float64Array | None = None

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
        return ParameterValues.of(self.parameters, x)

    @property
    def stated(self) -> tuple[str, ...]:
        """Those of `STATED` that the presses can show."""
        if self.bright_mm is None or not self.presses:
            return ()
        # The height of a curved membrane is refined in any case.
        flat = self.presses[0].surface.flat
        return tuple(key for key in STATED if flat or key != "membrane")

    def by_stated(self, x: Float64Array) -> Float64Array:
        """Return the derivative of all residuals by the factor on each of `stated`, (M, K)."""
        slopes = [self.by_length(x, key) for key in self.stated]
        return np.stack(slopes, axis=1) if slopes else np.empty((self.robust.size, 0))

    def by_length(self, x: Float64Array, key: str, at: float = 1.0) -> Float64Array:
        """Return the derivative of all residuals by a factor on a stated length, (M,).

        Parameters
        ----------
        x : (P,)
            Parameters of the problem with that length.
        key, at
            The length, and the value of the factor.
        """
        here, more = (self.with_stated(key, value) for value in (at, at + _STEP))
        return np.asarray((more.all(x + more.start - here.start) - here.all(x)) / _STEP)

    def by_radius(self, x: Float64Array) -> Float64Array:
        """Return the derivative of all residuals by the factor on each radius, (M, balls)."""
        base, result = self.residuals(x), np.zeros((self.robust.size, len(self.presses)))
        larger = [replace(p, radius_mm=(1.0 + _STEP) * p.radius_mm) for p in self.presses]
        row = 0
        for k, residual in enumerate(replace(self, presses=larger).residuals(x)):
            part = slice(row, row := row + residual.size)
            result[part, k] = (residual - base[k]) / _STEP
        return result

    def with_stated(self, key: str, value: float) -> JointProblem:
        """Return the problem with another value of one of `STATED`.

        Parameters
        ----------
        key, value
            A factor on a stated length, or 1 plus the height of a cap over `RISE_SHARE` of the
            field's width, the exponent that makes values proportional to light, or the contrast of
            the presses against the background.
        """
        presses, board, moved = self.presses, self.board, np.zeros((3, 3))
        leds, bright_mm = self.values(self.start).leds_mm, self.bright_mm
        if bright_mm is None:
            raise TypeError("without the mirror, no stated length can be changed")
        if key == "membrane":
            width_mm = float(np.ptp(presses[0].view_of_field.points_mm[:, 0]))
            rise_mm = (value - 1.0) * RISE_SHARE * width_mm
            cap = replace(presses[0].surface, diameter_mm=width_mm, rise_mm=rise_mm)
            return replace(self, presses=[p.on(cap) for p in presses])
        if key == "radius":
            presses = [replace(p, radius_mm=value * p.radius_mm) for p in presses]
        elif key == "response":
            presses = [p.with_response(value) for p in presses]
            board = board and board.with_response(value)
        elif key == BLENDED:
            presses = [p.with_contrast(value) for p in presses]
        elif key == "led_height":
            moved = (value - 1.0) * (leds - np.pad(bright_mm, ((0, 0), (0, 1))))
        else:
            # All that is seen on the top surface; the board also places the LEDs.
            presses = [replace(p, points_mm=value * p.points_mm) for p in presses]
            moved[:, :2] = (value - 1.0) * bright_mm * (key == "square")
        shift_mm = dict(zip(product(CHANNEL_KEYS, LED_AXES), moved.ravel().tolist(), strict=True))
        shift_by_key = {f"{axis}_{channel}": v for (channel, axis), v in shift_mm.items()}
        parameters = tuple(
            replace(p, start=p.start + shift_by_key.get(p.full_key, 0.0)) for p in self.parameters
        )
        return replace(self, presses=presses, parameters=parameters, board=board)

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
        poses = values.poses(self.presses)
        for pixels, pose in zip(self._pixels(values), poses, strict=True):
            points_mm, rays, surface = pixels.points_mm, pixels.ray_slope, pixels.surface
            drape = draped_ball(points_mm, rays, pose, decay_mm=values.decay_mm, surface=surface)
            surfaces.append(drape)
        return surfaces

    def _pixels(self, values: ParameterValues) -> Sequence[BallPixels]:
        """Return the presses on the membrane at rest that the parameters give."""
        surface = self.presses[0].surface if self.presses else None
        if surface is None or values.on(surface) == surface:
            return self.presses
        return [pixels.on(values.on(pixels.surface)) for pixels in self.presses]

    def _press(
        self, values: ParameterValues, pixels: BallPixels, surface: ModelSurfaces
    ) -> Float64Array:
        """Return the weighted residuals of a press, (N, 3)."""
        result = np.empty(pixels.ratio.shape)
        rest, up = pixels.surface.points(pixels.points_mm), pixels.surface.normals(pixels.points_mm)
        ratio, weight, around = pixels.ratio, pixels.weight, pixels.around
        if values.terms:
            light = values.light
            lit = light.from_leds(values.leds_mm, surface[0])
            lit /= light.from_leds(values.leds_mm, rest)
            nearer_mm = np.linalg.norm(surface[0] - rest, axis=-1)
            # Light from other parts of the membrane does not come along the path from the LED.
            whole = lit * light.seen(nearer_mm, surface[1][:, 2], up[:, 2])
            ratio, weight, around = ratio / whole, weight * whole, around / lit
        model_press(
            (rest, up, pixels.view, ratio, weight, around, pixels.around_flat),
            surface,
            values.leds_mm,
            values.lobes,
            values.curves,
            BUMPS,
            _NO_CURVES,
            values.interreflection,
            result,
        )
        return result

    @cached_property
    def _prior_columns(self) -> tuple[NDArray[np.intp], Float64Array, Float64Array]:
        """Parameters with a prior, by its source, with its mean and standard deviation."""
        rows = [(i, p.prior, p.start) for i, p in enumerate(self.parameters) if p.prior is not None]
        rows.sort(key=lambda row: row[1].source)
        columns = np.array([i for i, _, _ in rows], int)
        mean = [start if prior.mean is None else prior.mean for _, prior, start in rows]
        return columns, np.array(mean), np.array([prior.sd for _, prior, _ in rows])

    def priors(self, x: Float64Array) -> Float64Array:
        """Return the residuals of the prior knowledge and of the white board, (M,)."""
        columns, mean, sd = self._prior_columns
        of_priors = np.asarray((x[columns] - mean) / sd)
        if self.board is None:
            return of_priors
        return np.concatenate([self.board.residuals(self.values(x)), of_priors])

    @cached_property
    def robust(self) -> NDArray[np.bool_]:
        """Which of all residuals count less where they are large: those of the presses."""
        pixels = sum(press.ratio.size for press in self.presses)
        return np.arange(pixels + self.priors(self.start).size) < pixels

    def all(self, x: Float64Array) -> Float64Array:
        """Return residuals and priors as one vector."""
        return np.concatenate([*self.residuals(x), self.priors(x)])

    def jacobian(self, x: Float64Array) -> Float64Array:
        """Return the Jacobian by finite differences, with as few evaluations as possible.

        Parameters with the same key affect different residuals, and are moved at the same time.
        """
        surfaces = self._surfaces(self.values(x))
        base = self.residuals(x, surfaces)
        sizes = [r.size for r in base]
        ends = np.cumsum(sizes, dtype=int)
        starts = ends - sizes
        prior = self.priors(x)
        result = np.zeros((sum(sizes) + prior.size, x.size))
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
        for j in np.flatnonzero(self.free & self.shared).tolist():
            moved = x.copy()
            moved[j] += _STEP
            result[sum(sizes) :, j] = (self.priors(moved) - prior) / _STEP
        return result
