"""Reflectance of the membrane and light of each LED, from the white board.

Board and membrane lie in the same place, in the same light. The brightness of one over the other
is the membrane's reflectance in units of the board's. The board alone shows how the light of each
LED falls off: by distance, by the LED's lobe, and by absorption in the gel. What the three channels
have in common at a place, such as vignetting or a stain, is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.membrane_masks import LEAST_LIGHT
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.light.directions import light_directions
from gelpolight_core.light.facet_interreflection import Slab
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.light.membrane_field import view_directions
from gelpolight_core.light.parameter import Prior, PriorSource
from gelpolight_core.stages.leds.crosstalk import unmix

from .ball_pixels import CoarseRayGrid
from .refinement_parameters import ParameterValues

THIN = 24
"""Nodes between those at which membrane and white board are compared."""
BOARD_REFLECTANCE, BOARD_SD = 0.92, 0.03
"""Of matt white boards, papers and paints, where session.toml does not state it."""
GATHERED_SHARE = 0.03
"""Relative error of the light between parts that is computed from finite facets, for a reflectance
that is right."""
RETURNED_SHARE = 0.3
"""Relative error of light that comes back: walls and the board beyond the field are unknown."""
CROSSTALK_SD = 0.001
"""Error of a channel's crosstalk, as a share of the brightest channel."""
PATTERN_SD, PATTERN_MM = 0.005, 5.0
"""Deviation of a matt board from Lambert's law between directions of the LEDs, and the distance
over which it is alike."""


@dataclass(frozen=True)
class BoardLight:
    """The untouched membrane and the white board at some nodes.

    Attributes
    ----------
    points_mm, view : (N, 3)
        Positions in the sensor frame, and unit directions to the camera.
    share : (N, 3)
        Membrane over board.
    light : (N, 3)
        The board, without light that came back from it.
    returned : (N, 3)
        Light that comes back to the board from itself, by the layers' lower face, over the direct
        light of the LEDs.
    depth_mm : float
        Thickness of the gel, which light to the camera passes.
    reflectance, reflectance_sd : float
        Reflectance of the board, with its standard deviation.
    separated : bool
        Whether the crosstalk is known, so that each channel shows one LED.
    """

    points_mm: Float64Array
    view: Float64Array
    share: Float64Array
    light: Float64Array
    returned: Float64Array
    depth_mm: float
    reflectance: float = BOARD_REFLECTANCE
    reflectance_sd: float = BOARD_SD
    separated: bool = True

    @classmethod
    def from_images(
        cls,
        table: ResamplingTable,
        usable: NDArray[np.bool_],
        background: NDArray[np.floating],
        radiance: NDArray[np.floating],
        crosstalk: Float64Array,
        leds_mm: Float64Array,
        view_of_field: CoarseRayGrid,
        slab: Slab,
        depth_mm: float,
        reflectance: Sequence[float] | None = None,
    ) -> BoardLight:
        """Compare membrane and board at the nodes of a calibration.

        Parameters
        ----------
        table : ResamplingTable
            The grid and its rays.
        usable : (rows, columns) bool
            Nodes with light and membrane.
        background, radiance : (rows, columns, 3)
            Light of the membrane without crosstalk, and radiance of the lights with it (Eq. 5).
        crosstalk : (3, 3)
            Crosstalk of the camera's channels.
        leds_mm : (3, 3)
            LED positions in the sensor frame.
        view_of_field : CoarseRayGrid
            Coarse view of that grid.
        slab : Slab
            What is below the board.
        depth_mm : float
            Thickness of the gel.
        reflectance : sequence of float, optional
            Stated reflectance of the board for each channel.
        """
        thin = np.s_[::THIN, ::THIN]
        x, y = np.meshgrid(table.grid.x_mm[::THIN], table.grid.y_mm[::THIN])
        points = np.stack([x, y, np.zeros_like(x)], axis=-1)[usable[thin]]
        cosine = -light_directions(leds_mm, points)[0][..., 2]
        raw = np.asarray(radiance[thin][usable[thin]] * cosine, np.float32)
        board = unmix(raw, crosstalk)
        lit = (board > LEAST_LIGHT).all(axis=-1)
        view = view_directions(table.ray_slope[thin][usable[thin]].astype(np.float64))
        points, view, board = points[lit], view[lit], board[lit].astype(np.float64)
        of_board = BOARD_REFLECTANCE if reflectance is None else float(np.mean(reflectance))
        direct, back = view_of_field.light_at_rest(
            leds_mm, MembraneBrdf(interreflection=of_board), slab
        )
        returned = view_of_field.at(back / direct, points[:, :2])
        membrane = background[thin][usable[thin]][lit]
        # Light comes back to the membrane, too, as much as it reflects.
        alone = board / (1.0 + of_board * returned)
        level = of_board * float(np.median(membrane / board))
        share = membrane / (1.0 + level * returned) / alone
        return cls(points, view, share, alone, of_board * returned, depth_mm, of_board)

    def with_response(self, exponent: float) -> BoardLight:
        """Return it if a power of the camera's values is proportional to light."""
        return replace(self, share=self.share**exponent, light=self.light**exponent)

    def membrane_ratio(self, leds_mm: Float64Array, membrane: MembraneBrdf) -> float:
        """Return the membrane's reflectance in units of the board's, or NaN without light.

        The board is Lambertian (Eq. 5), the membrane is as given.

        Parameters
        ----------
        leds_mm : (3, 3)
            LED positions in the sensor frame.
        membrane : MembraneBrdf
            Its lobe.
        """
        if not len(self.points_mm):
            return float("nan")
        light, _ = light_directions(leds_mm, self.points_mm)
        up = np.broadcast_to([0.0, 0.0, -1.0], self.view.shape)
        bright = np.pi * membrane.response(light, up, self.view)
        return float(np.median(self.share * -light[..., 2] / bright))

    def membrane_reflectance(self, leds_mm: Float64Array, membrane: MembraneBrdf) -> Prior | None:
        """Return the membrane's reflectance for interreflected light, or None without light.

        Parameters
        ----------
        leds_mm, membrane
            As in :meth:`membrane_ratio`.
        """
        if not len(self.points_mm):
            return None
        expected = self.reflectance * self.membrane_ratio(leds_mm, membrane)
        share = np.hypot(self.reflectance_sd / self.reflectance, GATHERED_SHARE)
        return Prior(expected, float(share * expected), PriorSource.WHITE_BOARD)

    @property
    def size(self) -> int:
        """Number of residuals."""
        return self.light.size if self.separated else 0

    @cached_property
    def _scale(self) -> Float64Array:
        """One over the standard deviation of each residual (N, 1): nodes nearby err alike."""
        nodes = len(self.points_mm)
        area_mm2 = np.pi / 4.0 * float(np.ptp(self.points_mm[:, 0]) * np.ptp(self.points_mm[:, 1]))
        alike = max(nodes * PATTERN_MM**2 / max(area_mm2, PATTERN_MM**2), 1.0)
        of_returned = RETURNED_SHARE * self.returned.max(axis=1)
        of_crosstalk = CROSSTALK_SD * self.light.max(axis=1) / self.light.min(axis=1)
        sd = np.sqrt(PATTERN_SD**2 + of_returned**2 + of_crosstalk**2)
        return np.asarray(1.0 / (sd[:, None] * np.sqrt(alike)))

    def residuals(self, values: ParameterValues) -> Float64Array:
        """Return the residuals of the board's light, (3 N,), or none if channels are mixed.

        Parameters
        ----------
        values : ParameterValues
            LEDs and terms of the light.
        """
        if not self.separated:
            return np.zeros(0)
        light, distance_mm = light_directions(values.leds_mm, self.points_mm)
        law = (light[..., 2] / distance_mm) ** 2
        law *= values.light.from_leds(values.leds_mm, self.points_mm)
        law *= values.light.to_camera(self.depth_mm / self.view[:, 2])
        with np.errstate(divide="ignore", invalid="ignore"):
            deviation = np.log(self.light / np.maximum(law, np.finfo(float).tiny))
        deviation -= deviation.mean(axis=0)
        deviation -= deviation.mean(axis=1, keepdims=True)
        return np.asarray((self._scale * deviation).ravel())
