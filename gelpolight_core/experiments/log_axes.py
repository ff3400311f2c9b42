"""Logarithmic axes with plain numbers as labels."""

from __future__ import annotations

import numpy as np
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

WIDE_DECADES = 2.5


def number_logarithmically(axis: Axis) -> None:
    """Write 1, 10, 100 along a logarithmic axis; a short axis also has 2 and 5."""
    low, high = axis.get_view_interval()
    wide = np.log10(high / low) > WIDE_DECADES
    axis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
