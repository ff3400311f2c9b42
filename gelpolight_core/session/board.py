"""Description of the printed checkerboard."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.codec import place
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.limits import Span

Corners = Annotated[int, Span(3, 100)]


@dataclass(frozen=True, slots=True)
class BoardSpec:
    """The printed checkerboard.

    Attributes
    ----------
    inner_corners : (columns, rows)
        Number of points where four squares meet; one less than the squares in each direction.
    square_mm : float
        Side of a square.
    """

    inner_corners: tuple[Corners, Corners] = place(default=(9, 6), needed=True)
    square_mm: Annotated[float, Span(0.05, 500.0)] = place(default=3.0, needed=True)

    def __post_init__(self) -> None:
        """Refuse an impossible board.

        Raises
        ------
        InputError
            If there are fewer than 3 corners in a direction or the square size is not positive.
        """
        if min(self.inner_corners) < 3:
            text = (
                f"The board has {self.inner_corners[0]} x {self.inner_corners[1]} "
                "inner corners, fewer than 3 x 3"
            )
            raise InputError(text, "checkerboard", Remedy.BOARD_SIZE)
        if not (math.isfinite(self.square_mm) and self.square_mm > 0.0):
            text = f"The side of the squares is {self.square_mm} mm, not greater than zero"
            raise InputError(text, "checkerboard", Remedy.BOARD_SIZE)

    @property
    def points_mm(self) -> Float64Array:
        """Corners on the board, (N, 3), row by row with z = 0."""
        columns, rows = self.inner_corners
        x, y = np.meshgrid(np.arange(columns), np.arange(rows))
        flat = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
        return flat * np.float64(self.square_mm)
