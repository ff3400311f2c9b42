"""Drawing of the crosstalk: the share of each LED's light seen by the other channels."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gelpolight_core.channels import channel_name
from gelpolight_core.report.document import Drawing
from gelpolight_core.report.drawing import FULL_MM, draw
from gelpolight_core.translation import tr

HEIGHT_MM = 52.0
COLOURS = ("#c0392b", "#2e8b57", "#2c6fbb")


def draw_crosstalk(crosstalk: NDArray[np.float64]) -> Drawing:
    """Show the share of each LED's light seen by the other channels.

    Parameters
    ----------
    crosstalk : (3, 3)
        ``I_raw = crosstalk @ I_true``; column k is LED k.
    """

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        for channel in range(3):
            shares = 100.0 * crosstalk[channel]
            bars = np.arange(3) + 0.25 * (channel - 1)
            others = np.arange(3) != channel
            axes.bar(
                bars[others],
                shares[others],
                width=0.22,
                color=COLOURS[channel],
                label=tr("seen by the {name} channel").format(name=channel_name(channel)),
            )
        axes.set_xticks(range(3), [tr("{name} LED").format(name=channel_name(k)) for k in range(3)])
        axes.set_ylabel(tr("share of its light (%)"))
        axes.legend(loc="upper right")

    caption = tr("Share of each LED's light that the other two channels see")
    return draw(caption, HEIGHT_MM, paint, width_mm=0.6 * FULL_MM)
