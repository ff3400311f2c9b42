"""Images that fit their view, and a map among them: axes in mm, colour bar, shared cursor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QFont, QPainter, QResizeEvent

from app.widgets import theme
from app.widgets.label import placeholder
from app.widgets.plots import own_plot_menus
from app.widgets.units import length_text, round_length_mm
from app.widgets.widget_names import set_names
from gelpolight_core.base.compared_quantity import unit_behind
from gelpolight_core.geometry.resampling import MembraneGrid
from gelpolight_core.reconstruction.height_map import HeightMap

from .colour_bar import TEXT_FILL, ColourBar
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


CURSOR = "#ffffff"
ROOMY_PX = 180
"""Smaller views have no axes, only the scale bar: the map needs the space."""
SCALE_SHARE = 0.25
"""Longest scale bar, of the view's width."""


Extent = tuple[float, float, float, float]
"""Outer edges of an image: (left, top, right, bottom)."""


def extent_of(grid: HeightMap | MembraneGrid) -> Extent:
    """Return (left, top, right, bottom) of the outer edges of the grid's cells, mm."""
    half = 0.5 * grid.pitch_mm
    return (
        float(grid.x_mm[0]) - half,
        float(grid.y_mm[0]) - half,
        float(grid.x_mm[-1]) + half,
        float(grid.y_mm[-1]) + half,
    )


class MapView(FittedView):
    """Shows an image over an extent, x right and y down, in mm of the sensor frame or in pixels.

    Parameters
    ----------
    name, accessible : str
        The widget's name, and its text for screen readers.
    limits : (low, high), optional
        The user can drag the ends of the colour bar within these.

    Attributes
    ----------
    box : pyqtgraph.ViewBox
        Holds the image and what is drawn over it, in mm.
    bar : ColourBar
        Next to the map. Hidden until its range is shown.

    Signals
    -------
    bar_double_clicked()
        The colour bar was double-clicked.
    """

    bar_double_clicked = Signal()
    padding = 0.01

    def __init__(
        self, name: str, accessible: str, *, limits: tuple[float, float] | None = None
    ) -> None:
        super().__init__(pg.ViewBox(lockAspect=1.0, invertY=True, enableMenu=False))
        set_names(self, name, accessible)
        self.setMinimumSize(120, 60)
        self.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, True)
        self.box.setBackgroundColor(SURROUND)
        self._plot = pg.PlotItem(viewBox=self.box)
        self.bar = ColourBar(limits)
        for item in (self._plot, self.bar):
            own_plot_menus(item, self)
        self._lines = self._make_cursor()
        self._scale = _RoundScaleBar(self.box)
        self._outline = pg.PlotCurveItem(pen=pg.mkPen(CURSOR, width=2))
        self.box.addItem(self._outline, ignoreBounds=True)
        self._in_mm = True
        self._unit = pg.LabelItem()
        self._lay_out()
        self.shown_images = 0
        self._apply_theme()
        self.box.sigRangeChanged.connect(self._scale.follow)
        self.box.sigResized.connect(self._on_box_resized)
        self._show_scales(False)

    def _make_cursor(self) -> list[pg.InfiniteLine]:
        pen = pg.mkPen(CURSOR, width=1, style=Qt.PenStyle.DashLine)
        lines = [pg.InfiniteLine(angle=angle, pen=pen) for angle in (90, 0)]
        for line in lines:
            line.setVisible(False)
            line.setZValue(20)
            self.box.addItem(line, ignoreBounds=True)
        return lines

    def _lay_out(self) -> None:
        plot = self._plot
        plot.hideButtons()
        plot.layout.setContentsMargins(0, 0, 0, 0)
        for side in ("left", "bottom"):
            plot.getAxis(side).enableAutoSIPrefix(False)
            plot.getAxis(side).setStyle(
                maxTickLevel=1,
                maxTextLevel=1,
                hideOverlappingLabels=True,
                tickTextWidth=20,
                tickTextHeight=14,
                tickTextOffset=3,
                textFillLimits=TEXT_FILL,
            )
        plot.layout.addItem(self.bar, 2, 5)  # where ColorBarItem.setImageItem puts it
        # Corner where the axes meet.
        self._unit.setParentItem(plot)
        self._unit.anchor(itemPos=(0, 1), parentPos=(0, 1))
        self.setCentralItem(plot)

    def set_image(self, rgb: NDArray[np.uint8], extent: Extent, *, in_mm: bool = True) -> None:
        """Show an image over an extent in mm, or in pixels of the camera image."""
        left, top, right, bottom = extent
        if in_mm != self._in_mm:
            self._in_mm = in_mm
            self._apply_theme()
            self._show_scales(self.has_image)
        area = QRectF(left, top, right - left, bottom - top)
        self._image.setImage(rgb, autoLevels=False)
        self.shown_images += 1
        if self._image.boundingRect().size() != area.size() or area != self._extent:
            self._image.setRect(area)
        if area != self._extent:
            self._words.hide()
            self._show_scales(True)
            beyond = 40.0 + max(area.width(), area.height())
            self._show_extent(area, beyond=beyond, least=0.2)

    def show_outline(self, outline: NDArray[np.float64] | None) -> None:
        """Draw a closed line (N, 2) over the image. None: no line."""
        if outline is None:
            self._outline.clear()
        else:
            self._outline.setData(*np.vstack([outline, outline[:1]]).T)

    def show_colours(
        self, colours: str, low: float, high: float, unit: str, *, factor: float = 1.0
    ) -> None:
        """Show the colour bar with a range, its numbers times a factor."""
        self.bar.show_range(colours, low, high, unit, factor=factor)
        words = f"{low * factor:.3g} … {high * factor:.3g}{unit_behind(unit)}"
        if words != self.accessibleDescription():
            self.setAccessibleDescription(words)

    def show_message(self, text: str) -> None:
        """Show a text instead of the image, without axes and colour bar."""
        self._image.clear()
        self._extent = QRectF()
        self._show_scales(False)
        self.bar.setVisible(False)
        self._words.setText(text)
        self._words.show()

    def show_cursor(self, x_mm: float, y_mm: float) -> None:
        """Mark a position. NaN: none."""
        is_valid = math.isfinite(x_mm) and math.isfinite(y_mm)
        for line, value in zip(self._lines, (x_mm, y_mm), strict=True):
            line.setVisible(is_valid)
            if is_valid:
                line.setValue(value)

    def _on_resized(self) -> None:
        self._show_scales(self.has_image)

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "shown_images"):
            self._apply_theme()

    def _apply_theme(self) -> None:
        self.setBackground(theme.colour("window"))
        font = QFont(self.font())
        font.setPointSize(max(font.pointSize() - 1, 7))
        for side in ("left", "bottom"):
            axis = self._plot.getAxis(side)
            axis.setPen(theme.colour("muted"))
            axis.setTextPen(theme.colour("text"))
            axis.setStyle(tickFont=font)
        unit = "mm" if self._in_mm else "px"
        self._unit.setText(unit, color=theme.colour("text"), size=f"{font.pointSize()}pt")
        self.bar.apply_theme(font)

    def _show_scales(self, on: bool) -> None:
        self._scale.setVisible(on and self._in_mm)
        roomy = min(self.width(), self.height()) >= ROOMY_PX
        for side in ("left", "bottom"):
            self._plot.showAxis(side, on and roomy)
        self._unit.setVisible(on and roomy)

    def _on_box_resized(self, *_: Any) -> None:
        if self._fitted:
            self.fit()
        self._scale.follow()

    def _on_pointer(self, at: QPointF) -> None:
        position = self.box.mapSceneToView(at)
        inside = self._is_on(self.box, at) and self._extent.contains(position.x(), position.y())
        self.pointed.emit(*((position.x(), position.y()) if inside else (math.nan, math.nan)))

    def _on_click(self, event: Any) -> None:
        if event.button() != Qt.MouseButton.LeftButton or not event.double():
            return
        if self._is_on(self.bar, event.scenePos()):
            self.bar_double_clicked.emit()
        elif self._is_on(self.box, event.scenePos()):
            self.fit()

    @staticmethod
    def _is_on(item: pg.GraphicsWidget, at: QPointF) -> bool:
        return bool(item.isVisible() and item.sceneBoundingRect().contains(at))


class _RoundScaleBar(pg.ScaleBar):  # type: ignore[misc]
    """pyqtgraph's scale bar in the lower right corner, always with a round length."""

    def __init__(self, box: pg.ViewBox) -> None:
        super().__init__(1.0, width=3, brush="#ebeef2", pen="#0a0c0f", offset=(-12, -10))
        self._box, self.size = box, 1.0
        self.text.setText(length_text(self.size))
        self.text.setColor("#ebeef2")
        self.text.fill = pg.mkBrush(QColor(10, 12, 15, 120))
        self.setParentItem(box)

    def follow(self, *_: Any) -> None:
        """Follow the zoom and the size of the view."""
        length = round_length_mm(SCALE_SHARE * self._box.viewRect().width())
        if length > 0.0 and length != self.size:
            self.size = length
            self.text.setText(length_text(length))
            self.updateBar()
