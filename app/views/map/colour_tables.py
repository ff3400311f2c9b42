"""Tables of the colour maps, and the colour around images."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray

SURROUND = (21, 23, 26)
"""Around an image, in both themes: dark images can only be judged against a dark surround."""


@lru_cache(maxsize=16)
def colour_table(name: str) -> NDArray[np.uint8]:
    """Return a colour map as (256, 3) uint8, RGB."""
    table = pg.colormap.get(name).getLookupTable(nPts=256, mode="byte", alpha=False)
    return np.ascontiguousarray(table[:, :3], np.uint8)
