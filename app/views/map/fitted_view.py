"""An image in a pyqtgraph view that fits the view until the user moves it."""

from __future__ import annotations

import math
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QResizeEvent

from app.widgets.label import placeholder

from .colour_tables import SURROUND


class FittedView(pg.GraphicsView):  # type: ignore[misc]
    """Shows an image in a view box, or words instead of it.

    Parameters
    ----------
    box : pyqtgraph.ViewBox
        Holds the image and what is drawn over it.

    Signals
    -------
    pointed(float, float)
        Position under the pointer; NaN where there is none.
    """

    pointed = Signal(float, float)
    padding = 0.0
    """Around the whole image, as a share of it."""

    def __init__(self, box: pg.ViewBox) -> None:
        super().__init__(background=SURROUND)
        # Keys belong to the view that holds this one.
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._extent = QRectF()
        self._fitted = True
        self.box = box
        box.disableAutoRange()
        self._image = pg.ImageItem(axisOrder="row-major")
        box.addItem(self._image, ignoreBounds=True)
        box.sigRangeChangedManually.connect(self._on_moved_by_hand)
        self.scene().sigMouseMoved.connect(self._on_pointer)
        self.scene().sigMouseClicked.connect(self._on_click)
        self._words = placeholder(self)

    @property
    def has_image(self) -> bool:
        """Whether an image is shown, not a text."""
        return not self._extent.isNull()

    def fit(self) -> None:
        """Show the whole extent, also after the view's size changes."""
        self._fitted = True
        if not self._extent.isEmpty():
            self.box.setRange(self._extent, padding=self.padding)

    def _show_extent(self, extent: QRectF, *, beyond: float, least: float) -> None:
        """Show the image over another extent, and let the user zoom and pan so far."""
        self._extent = extent
        reach = extent.adjusted(-beyond, -beyond, beyond, beyond)
        self.box.setLimits(
            minXRange=least,
            xMin=reach.left(),
            xMax=reach.right(),
            yMin=reach.top(),
            yMax=reach.bottom(),
        )
        self.fit()

    def resizeEvent(self, event: QResizeEvent | None) -> None:  # noqa: D102
        super().resizeEvent(event)
        # The base class resizes itself during its construction and after closing.
        if hasattr(self, "_words") and not self.closed:
            self._words.setGeometry(self.rect().adjusted(16, 16, -16, -16))
            self._on_resized()

    def leaveEvent(self, event: QEvent) -> None:  # noqa: D102
        super().leaveEvent(event)
        self.pointed.emit(math.nan, math.nan)

    def _on_moved_by_hand(self, *_: Any) -> None:
        self._fitted = False

    # Of the two kinds of view

    def _on_resized(self) -> None: ...

    def _on_pointer(self, at: QPointF) -> None: ...

    def _on_click(self, event: Any) -> None: ...
