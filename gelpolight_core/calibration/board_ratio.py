"""The membrane's reflectance, from its brightness relative to the white board."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.membrane_masks import LEAST_LIGHT
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.light.directions import light_directions
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.light.membrane_field import view_directions
from gelpolight_core.stages.leds.crosstalk import unmix

THIN = 8
"""Nodes between those at which membrane and white board are compared."""
BOARD_REFLECTANCE, BOARD_SD = 0.92, 0.05
"""Of matt white boards, papers and paints, which reflect 0.85 to 0.99 of the light."""
AGREEING_SDS = 3.0
"""An expected reflectance that differs by more standard deviations from that of the balls is left
out: board and membrane had different exposures, or the board is not white."""


class MembraneBoardRatio(NamedTuple):
    """The untouched membrane compared with the white board, at some nodes.

    Attributes
    ----------
    points_mm, view : (N, 3)
        Positions in the sensor frame, and unit directions to the camera.
    share : (N, 3)
        Membrane over board.
    """

    points_mm: Float64Array
    view: Float64Array
    share: Float64Array

    @classmethod
    def from_images(
        cls,
        table: ResamplingTable,
        usable: NDArray[np.bool_],
        background: NDArray[np.floating],
        radiance: NDArray[np.floating],
        crosstalk: Float64Array,
        leds_mm: Float64Array,
    ) -> MembraneBoardRatio:
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
        """
        thin = np.s_[::THIN, ::THIN]
        x, y = np.meshgrid(table.grid.x_mm[::THIN], table.grid.y_mm[::THIN])
        points = np.stack([x, y, np.zeros_like(x)], axis=-1)[usable[thin]]
        cosine = -light_directions(leds_mm, points)[0][..., 2]
        raw = np.asarray(radiance[thin][usable[thin]] * cosine, np.float32)
        board = unmix(raw, crosstalk)
        lit = (board > LEAST_LIGHT).all(axis=-1)
        view = view_directions(table.ray_slope[thin][usable[thin]].astype(np.float64))
        share = np.asarray(background[thin][usable[thin]] / board, np.float64)
        return cls(points[lit], view[lit], share[lit])

    def reflectance(self, leds_mm: Float64Array, membrane: MembraneBrdf) -> float:
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

    def expected(
        self, leds_mm: Float64Array, membrane: MembraneBrdf, measured: tuple[float, float]
    ) -> tuple[float, float] | None:
        """Return the reflectance expected with a common white board, with its standard deviation.

        None if it does not agree with the values from the balls.

        Parameters
        ----------
        leds_mm, membrane
            As in :meth:`reflectance`.
        measured : (float, float)
            Reflectance and standard deviation by the light between parts of the membrane.
        """
        board_ratio = self.reflectance(leds_mm, membrane)
        expected, sd = BOARD_REFLECTANCE * board_ratio, BOARD_SD * board_ratio
        agrees = abs(expected - measured[0]) <= AGREEING_SDS * float(np.hypot(sd, measured[1]))
        return (expected, sd) if agrees else None
