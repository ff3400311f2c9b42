"""Where the depth is to be trusted less, and why."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QVBoxLayout, QWidget

from app.inspect.colour_bar import ColourBar
from app.inspect.height_panel import extent_of
from app.inspect.map_view import MapView
from app.inspect.place import flag_words
from app.inspect.products import QUALITY_COLOURS, Shown
from app.widgets.label import MarkupLabel, escaped
from app.widgets.naming import named
from gelpolight_core.reconstruction.efforts import PAPER
from gelpolight_core.reconstruction.heightmap import Flag
from gelpolight_core.reconstruction.misfit import Misfit
from gelpolight_core.translation import tr

# Words are told less often than pictures are shown: they could not be read.
TELL_EVERY = 10


class QualityPanel(QWidget):
    """Shows flags, how well the depth explains the picture, or a standing one's uncertainty.

    Signals
    -------
    chosen()
        Another figure is to be shown.
    """

    chosen = Signal()

    def __init__(self) -> None:
        super().__init__()
        named(self, "inspect.quality", tr("Quality"))
        self.map = MapView("inspect.quality.map", tr("Quality of the depth"))
        self.bar = ColourBar("inspect.quality.bar", tr("Colours of the uncertainty"))
        self.bar.hide()
        self._what = named(QComboBox(), "inspect.quality.what", tr("What is shown"))
        self._what.addItem(tr("Flags"), "flags")
        self._what.addItem(tr("Misfit of the picture (| |n| - 1 |)"), "misfit")
        self._what.addItem(tr("Uncertainty (when paused)"), "uncertainty")
        self._what.currentIndexChanged.connect(self._on_chosen)
        self._legend = named(MarkupLabel(), "inspect.quality.legend", tr("What the colours mean"))
        self._legend.setWordWrap(True)
        self._legend.setContentsMargins(6, 2, 6, 2)
        row = QHBoxLayout()
        row.setSpacing(0)
        row.addWidget(self.map, 1)
        row.addWidget(self.bar)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addWidget(self._what)
        column.addLayout(row, 1)
        column.addWidget(self._legend)
        self.map.say(tr("No depth yet."))
        self._count = 0

    @property
    def what(self) -> str:
        """What is shown: ``flags``, ``misfit`` or ``uncertainty``."""
        return str(self._what.currentData())

    def show_frame(self, shown: Shown, *, still: bool) -> None:
        """Show the quality of a frame."""
        if shown.heightmap is None:
            return
        if self.what == "misfit" and shown.misfit is None:
            return  # of a frame that was made before it was asked for
        if shown.quality is None:
            sentence = tr("Pause to see the uncertainty.")
            if still and shown.heightmap.model == PAPER:
                sentence = tr("This model states no uncertainty; calibrate for the full model.")
            elif still:
                sentence = tr("The uncertainty of this picture is being found out.")
            self.map.say(sentence)
            self._legend.clear()
            return
        self.map.show_picture(shown.quality, extent_of(shown.heightmap))
        if self.what == "uncertainty":
            self.bar.show_range("inferno", 0.0, 1e3 * shown.quality_top, tr("um"))
            self.bar.show()
            self._legend.setText(
                tr("Standard deviation of repeats of this picture; one in a hundred is above.")
            )
            return
        if shown.misfit is not None:
            self.bar.show_range("inferno", 0.0, 100.0 * shown.quality_top, "%")
            self.bar.show()
        self._count += 1
        if still or self._count % TELL_EVERY == 1:
            misfit = shown.misfit
            text = legend(shown.heightmap.flags) if misfit is None else misfit_text(misfit)
            self._legend.setText(text)

    def say(self, text: str) -> None:
        """Show words in the place of a picture and of what its colours mean."""
        self._forget_colours()
        self.map.say(text)

    def _forget_colours(self) -> None:
        self.bar.hide()
        self._legend.clear()
        self._count = 0

    def _on_chosen(self) -> None:
        # What is shown is of another figure: neither its colours nor its words stay for this one.
        self._forget_colours()
        if self.map.has_picture:
            self.map.say(tr("One moment."))
        self.chosen.emit()


def misfit_text(misfit: Misfit) -> str:
    """Return what the misfit is, and how large in the middle of all nodes, as markup."""
    if misfit.model == "paper":
        text = tr("| |n| - 1 |: length of the solved normal less 1; median {m:.1f} %.")
    else:
        text = tr(
            "Brightness seen less explained by the depth, of the flat membrane's; median {m:.1f} %."
        )
    known = misfit.values[np.isfinite(misfit.values)]
    return escaped(text.format(m=100.0 * float(np.median(known)) if known.size else 0.0))


def legend(flags: np.ndarray) -> str:
    """Return the flags that are set, in their colours, with the share of the area, as markup."""
    some = flags[::3, ::3]
    inside = some[some & Flag.OUTSIDE.value == 0]
    words, parts = flag_words(), []
    for flag, colour in QUALITY_COLOURS.items():
        share = float(np.mean(inside & flag.value != 0)) if inside.size else 0.0
        if share > 0.0:
            block = f'<span style="color: rgb{colour}">■</span>'
            parts.append(f"{block} {words[flag]} {100.0 * share:.1f} %")
    return "&nbsp;&nbsp; ".join(parts) or tr("No flags: every pixel is measured as it should be.")
