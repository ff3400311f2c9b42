"""Options and constants of the compiled loops over images."""

from __future__ import annotations

import numpy as np

from gelpolight_core.base import compiling

BLOCK = 64
"""Nodes that a compiled loop handles at a time, so that they stay in the nearest cache."""
single = np.float32
ZERO, HALF, ONE = single(0.0), single(0.5), single(1.0)

_flags = {"nsz", "arcp", "contract"}
whole, part = compiling.whole(fastmath=_flags), compiling.part(fastmath=_flags)
