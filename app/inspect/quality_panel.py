"""Panels that show the quality of the depth, and the normals or the slope."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from PySide6.QtWidgets import QWidget

from app.live.frame_processor import FrameResult
from app.views.map.map_point import FLAG_WORDS
from app.views.map.map_view import MapView, extent_of
from app.views.map.quantities import FLAG_COLOURS, STEEPEST_DEG
from app.widgets.buttons import Slot
from app.widgets.inputs import ComboBox
from app.widgets.label import MarkupLabel, escaped
from app.widgets.layout import vbox
from app.widgets.widget_names import set_names
from gelpolight_core.reconstruction.height_map import Flag

TELL_EVERY = 10
"""Frames between two updates of the legend, so that it can be read."""


class SelectableMap(QWidget):
    """A map of one of several quantities, with a legend below it.

    Parameters
    ----------
    name, title : str
        The widget's name, and its text for screen readers.
    quantities : mapping of str to str
        Texts of the quantities that can be chosen, by their keys.
    on_chosen : callable
        Called when another quantity was chosen.
    """

    def __init__(
        self, name: str, title: str, quantities: Mapping[str, str], on_chosen: Slot
    ) -> None:
        super().__init__()
        set_names(self, name, title)
        self.map = MapView(f"{name}.map", title)
        self._on_chosen = on_chosen
        self._what = set_names(ComboBox(), f"{name}.what", "Quantity shown")
        for key, text in quantities.items():
            self._what.addItem(text, key)
        self._what.currentIndexChanged.connect(self._choose)
        self._legend = set_names(MarkupLabel(wrap=True), f"{name}.legend", "Legend")
        self._legend.setContentsMargins(6, 2, 6, 2)
        vbox(self._what, (self.map, 1), self._legend, of=self, margins=0, spacing=2)
        self.map.show_message("No depth yet.")

    @property
    def what(self) -> str:
        """The shown quantity."""
        return str(self._what.currentData())

    def show_message(self, text: str) -> None:
        """Show a text instead of the image and the legend."""
        self.map.show_message(text)
        self._legend.clear()

    def _choose(self) -> None:
        # The image, colours and legend of another quantity would be misread.
        if self.map.has_image:
            self.show_message("Please wait.")
        self._on_chosen()


class QualityPanel(SelectableMap):
    """Shows flags, how well the depth explains the image, or the uncertainty while paused."""

    def __init__(self, on_chosen: Slot) -> None:
        quantities = {
            "flags": "Flags",
            "misfit": "Misfit of the image",
            "uncertainty": "Uncertainty (when paused)",
        }
        super().__init__("inspect.quality", "Quality", quantities, on_chosen)
        self._count = 0

    def show_frame(self, result: FrameResult, *, still: bool) -> None:
        """Show the quality of a frame."""
        if result.heightmap is None:
            return
        if self.what == "misfit" and result.misfit is None:
            return  # the frame is older than the selection
        if result.quality is None:
            sentence = "Pause to see the uncertainty."
            if still and result.without_uncertainty:
                sentence = "This model gives no uncertainty. Calibrate with the full model."
            elif still:
                sentence = "Computing the uncertainty of this image…"
            self.show_message(sentence)
            return
        self.map.set_image(result.quality, extent_of(result.heightmap))
        if self.what == "uncertainty":
            self.map.show_colours("inferno", 0.0, 1e3 * result.quality_top, "um")
            self._legend.setText(
                "Standard deviation over repeated images; 1 % of the area is above the range."
            )
            return
        if result.misfit is not None:
            self.map.show_colours("inferno", 0.0, 100.0 * result.quality_top, "%")
        self._count += 1
        if still or self._count % TELL_EVERY == 1 or not self._legend.text():
            misfit = result.misfit
            text = legend(result.heightmap.flags) if misfit is None else misfit_text(misfit)
            self._legend.setText(text)


def misfit_text(misfit: np.ndarray) -> str:
    """Return the definition of the misfit with the median over all nodes, as markup."""
    values = misfit[np.isfinite(misfit)]
    percent = 100.0 * float(np.median(values)) if values.size else 0.0
    return escaped(
        "Measured brightness minus the brightness computed from the depth, relative "
        f"to the flat membrane. Median {percent:.1f} %."
    )


def legend(flags: np.ndarray) -> str:
    """Return the flags that are set, in their colours, with their share of the area, as markup."""
    subset = flags[::3, ::3]
    inside = subset[subset & Flag.OUTSIDE.value == 0]
    parts = []
    for flag, colour in FLAG_COLOURS.items():
        fraction = float(np.mean(inside & flag.value != 0)) if inside.size else 0.0
        if fraction > 0.0:
            block = f'<span style="color: rgb{colour}">■</span>'
            parts.append(f"{block} {FLAG_WORDS[flag]} {100.0 * fraction:.1f} %")
    return "&nbsp;&nbsp; ".join(parts) or "No flags: all pixels are measured normally."


class NormalsPanel(SelectableMap):
    """Shows the normals as colours, or the slope."""

    def __init__(self, on_chosen: Slot) -> None:
        quantities = {"normals": "Normals: x in red, y in green", "slope": "Slope"}
        super().__init__("inspect.normals", "Normals", quantities, on_chosen)
        self._legend.hide()

    def show_frame(self, result: FrameResult, *, still: bool) -> None:
        """Show a frame."""
        if result.normals is not None and result.heightmap is not None:
            self.map.set_image(result.normals, extent_of(result.heightmap))
            if self.what == "slope":
                self.map.show_colours("magma", 0.0, STEEPEST_DEG, "°")
