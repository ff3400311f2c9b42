"""The bar below the image: pixel under the pointer, focus, exposure, frame rate."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QGridLayout, QProgressBar, QSizePolicy, QWidget

from app.live.image_checks import Exposure
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.naming import named
from gelpolight_core.quality import Verdict
from gelpolight_core.translation import tr

# Below this width the advice and the focus bar do not fit side by side.
NARROW = 620

SIGNS = {Verdict.PASS: "\u2713", Verdict.WARN: "!", Verdict.FAIL: "\u2715"}


class FocusBar(QProgressBar):
    """Sharpness of the image relative to the recent best; full means as sharp as the best."""

    def __init__(self) -> None:
        super().__init__()
        named(
            self,
            "live.focus",
            tr("Focus"),
            tr("Turn the lens until the bar is full and drops in both directions"),
        )
        self.setRange(0, 1000)
        self.setFixedSize(170, 18)
        policy = self.sizePolicy()
        # Still images have no focus to adjust; the image above must not jump because of that.
        policy.setRetainSizeWhenHidden(True)
        self.setSizePolicy(policy)
        self.show_share(0.0)

    def show_share(self, share: float) -> None:
        """Show the focus as a share of the best, 0..1."""
        self.share = share
        # The last third of the range takes two thirds of the bar, because fine adjustment happens
        # there.
        self.setValue(round(1000.0 * share**3))
        self.setFormat(tr("Focus {p:.0f} % of best").format(p=100.0 * share))
        self.setAccessibleDescription(self.text())


class ChecksBar(QWidget):
    """Texts and figures about the image above: two lines, or four below a narrow one.

    The number of lines depends only on the width, so that nothing jumps when a text changes.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "live.checks", tr("Image checks"))
        self.focus = FocusBar()
        self._exposure = named(PlainLabel(), "live.exposure", tr("Exposure"))
        self._pixel = named(PlainLabel(), "live.pixel", tr("Pixel under the pointer"))
        self._rate = named(PlainLabel(), "live.rate", tr("Frame rate"))
        self._rate.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        # Long texts are cut off instead of widening the window.
        self._exposure.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._pixel.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(6, 3, 6, 3)
        self._grid.setVerticalSpacing(2)
        self._grid.setColumnStretch(0, 1)
        self._narrow: bool | None = None
        self._arrange(narrow=False)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Give long advice a second line if one is too short."""
        super().resizeEvent(event)
        self._arrange(narrow=event.size().width() < NARROW)

    def _arrange(self, *, narrow: bool) -> None:
        if narrow == self._narrow:
            return
        self._narrow = narrow
        cells = {
            self._exposure: (0, 0, 1, 2) if narrow else (0, 0, 1, 1),
            self.focus: (2, 0, 1, 1) if narrow else (0, 1, 1, 1),
            self._pixel: (1, 0, 1, 2) if narrow else (1, 0, 1, 1),
            self._rate: (2, 1, 1, 1) if narrow else (1, 1, 1, 1),
        }
        for widget, cell in cells.items():
            self._grid.removeWidget(widget)
            self._grid.addWidget(widget, *cell)
        self._exposure.setWordWrap(narrow)
        lines = 2 if narrow else 1
        self._exposure.setFixedHeight(lines * self.fontMetrics().lineSpacing() + 2)

    def show_exposure(self, exposure: Exposure | None) -> None:
        """Show the advice about the exposure; None for no text."""
        text = f"{SIGNS[exposure.verdict]} {exposure.advice}" if exposure else ""
        if text != self._exposure.text():
            self._exposure.setText(text)
            self._exposure.setToolTip(plain_tip(text))

    def show_pixel(self, text: str) -> None:
        """Show the value under the pointer."""
        if text != self._pixel.text():
            self._pixel.setText(text)

    def show_rate(self, text: str) -> None:
        """Show the frame rate and the number of dropped frames."""
        if text != self._rate.text():
            self._rate.setText(text)
            self._rate.setToolTip(plain_tip(text))
