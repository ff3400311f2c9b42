"""From an image to the divergence of its slopes without writing the slopes down.

A node's divergence needs five lines of slopes. They stay in the nearest cache in two rings, beside
the loops that make them and the loops that add them up.
"""

from __future__ import annotations

import numpy as np

from gelpolight_core.compiling import whole
from gelpolight_core.reconstruction.integration.stencils import add_along_row, add_down
from gelpolight_core.reconstruction.paper.kernel import solve_row, work_arrays


@whole(fastmath={"nsz", "arcp", "contract"}, error_model="numpy")
def paper_divergence_rows(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    first, last, image, sensor, edges, top, left, keep, slope_x, slope_y, flags, field
):
    """Write lines `first` to `last` of the divergence on the padded grid, and their flags.

    `image` and `sensor` as for `solve_row`; `edges` are the first nodes and weights along x and
    along y. Slopes (rows, columns) are written where `keep`. They are finite and within their
    limit by the way they are made.
    """
    start_x, weight_x, start_y, weight_y = edges
    work = work_arrays()
    rows, columns = flags.shape
    ring_x, ring_y = np.zeros((5, columns), np.float32), np.zeros((5, columns), np.float32)
    others = np.zeros(columns, np.uint8)
    loaded = -1
    for line in range(first, last):
        field[line] = 0
        if not (top - 1 <= line <= top + rows):
            continue
        begin = start_y[line]
        if loaded < 0:
            loaded = begin
        while loaded < min(begin + 5, rows):
            at = loaded % 5
            # What two threads need is made by both and written by one.
            own = first <= loaded + top < last
            marks = flags[loaded] if own else others
            solve_row(loaded, image, sensor, work, ring_x[at], ring_y[at], marks)
            if keep and own:
                for column in range(columns):
                    slope_x[loaded, column] = ring_x[at, column]
                    slope_y[loaded, column] = ring_y[at, column]
            loaded += 1
        add_down(ring_y, begin, weight_y[line], field[line][left : left + columns])
        if top <= line < top + rows:
            row = (line - top) % 5
            add_along_row(ring_x[row], start_x, weight_x, left, field[line])
