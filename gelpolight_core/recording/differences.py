"""The compiled loop that restores pixels from differences between neighbours."""

from __future__ import annotations

from gelpolight_core.compiling import whole


@whole()
def add_up(differences, rgb):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Undo the differences to the left neighbour, modulo the range of the values."""
    for row in range(rgb.shape[0]):
        red, green, blue = differences[row, 0]
        for column in range(rgb.shape[1]):
            if column > 0:
                red += differences[row, column, 0]
                green += differences[row, column, 1]
                blue += differences[row, column, 2]
            rgb[row, column, 0], rgb[row, column, 1], rgb[row, column, 2] = red, green, blue
