"""The part of the Poisson solver without a transform: tridiagonal equations along columns.

After a sine transform along the rows, each wave has one tridiagonal system along the columns. It is
solved directly, many waves at a time, with one pass down and one up. This takes a sixth of the work
of transforms along the columns, for any number of rows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.compiled import BLOCK, whole

# In decay lengths: the rest, exp(-2 * 12), is below the rounding of single precision.
_SETTLED = 12.0


def settled_rows(waves: NDArray[np.float64], rows: int) -> NDArray[np.int64]:
    """Return the rows after which the elimination of each block of waves no longer changes.

    Parameters
    ----------
    waves : (columns,)
        Eigenvalues along the rows, above or equal to 0, rising.
    rows : int
        Rows of the grid.
    """
    lowest = waves[::BLOCK]
    # 2 + wave = 2 cosh(decay); the elimination settles as exp(-2 decay row).
    decay = 2.0 * np.arcsinh(0.5 * np.sqrt(lowest))
    reach = np.full(lowest.size, float(rows))
    np.divide(_SETTLED, decay, out=reach, where=decay > _SETTLED / rows)
    return np.asarray(np.ceil(reach), np.int64)


@whole
def solve_columns(first, last, field, waves, settled, scale):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Solve ``-x[i-1] + (2 + wave) x[i] - x[i+1] = scale * field[i]`` in place, block by block.

    Half a pixel outside the first and the last row, x is 0: there the middle term is 3 + wave. The
    elimination stores the difference of its factor from 1, which is accurate for long waves. Sums
    are in double precision for any type of the field.
    """
    rows, columns = field.shape
    factors = np.empty((rows, BLOCK), np.float64)
    carry, wave, short = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    for block in range(first, last):
        begin = block * BLOCK
        count = min(BLOCK, columns - begin)
        wave[:] = 0.0
        for j in range(count):
            wave[j] = waves[begin + j]
        carry[:] = 0.0
        short[:] = 1.0
        stop = settled[block]
        for i in range(rows):
            edge = 1.0 if i == 0 else 0.0
            if i == rows - 1:
                edge += 1.0
            if i < stop or i == rows - 1:
                for j in range(BLOCK):
                    up = wave[j] + edge + short[j]
                    short[j] = up / (1.0 + up)
                for j in range(BLOCK):
                    factors[i, j] = short[j]
            for j in range(count):
                value = carry[j] + scale * field[i, begin + j]
                value -= short[j] * value
                carry[j] = value
                field[i, begin + j] = value
        for i in range(rows - 2, -1, -1):
            at = min(i, stop - 1)
            for j in range(count):
                value = carry[j] - factors[at, j] * carry[j] + field[i, begin + j]
                carry[j] = value
                field[i, begin + j] = value
