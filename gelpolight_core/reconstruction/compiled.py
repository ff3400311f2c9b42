"""How loops over images are compiled, and what all of them use."""

from __future__ import annotations

import numba
import numpy as np

from gelpolight_core.compiled_part import PART

BLOCK = 64
"""Nodes that a compiled loop handles at a time, so that they stay in the nearest cache."""
single = np.float32
ZERO, HALF, ONE = single(0.0), single(0.5), single(1.0)

whole = numba.njit(nogil=True, fastmath={"nsz", "arcp", "contract"}, cache=True)
part = numba.njit(fastmath={"nsz", "arcp", "contract"}, **PART)
