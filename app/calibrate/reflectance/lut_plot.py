"""The plot of the editor: scatter as density, measured and extrapolated curve, draggable nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QBrush, QColor, QPen
from PySide6.QtWidgets import QGraphicsRectItem

from app.calibrate.reflectance.lut_model import Curve, CurveEdit, left_out_points
from app.theme import theme
from app.widgets.plots import without_menus
from gelpolight_core.calibration.scatter import ReflectanceScatter
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
# (light, dark): both contrast with the theme's base colour.
CHANNEL_COLOURS = (("#b3211d", "#ff8a80"), ("#1b6e3a", "#7fdc9a"), ("#1f4fbf", "#8ab4ff"))
BINS = 240
OUTLIER_SPREADS = 4.0
MAX_MARKS = 1500
GRAB_PX = 14
NODE_PX = 11


def channel_colour(channel: int) -> QColor:
    """Return the channel's colour in the present theme."""
    return QColor(CHANNEL_COLOURS[channel][theme.is_dark()])


class LassoViewBox(pg.ViewBox):
    """A view box in which a drag draws an outline while the lasso is on."""

    drawn = Signal(object)

    def __init__(self) -> None:
        super().__init__(enableMenu=False)
        self.lasso = False
        self._points: list[tuple[float, float]] = []
        self._line = pg.PlotCurveItem()
        self._line.setZValue(50)
        self.addItem(self._line, ignoreBounds=True)

    def mouseDragEvent(self, event: Any, axis: int | None = None) -> None:
        """Draw the outline, or pan."""
        if not self.lasso or event.button() != Qt.MouseButton.LeftButton:
            super().mouseDragEvent(event, axis)
            return
        event.accept()
        if event.isStart():
            self._points = [self._to_point(event.buttonDownPos())]
        self._points.append(self._to_point(event.pos()))
        if event.isFinish():
            self._line.setData([], [])
            self.drawn.emit(tuple(self._points))
            return
        x, y = zip(*self._points, self._points[0], strict=True)
        pen = pg.mkPen(theme.colour("accent"), width=2, style=Qt.PenStyle.DashLine)
        self._line.setData(list(x), list(y), pen=pen)

    def _to_point(self, position: Any) -> tuple[float, float]:
        point = self.mapToView(position)
        return float(point.x()), float(point.y())


class NodeItem(pg.ScatterPlotItem):
    """The nodes of one curve; a dragged node follows the pointer within the limits of `moved`."""

    def __init__(
        self,
        chosen: Callable[[int], None],
        moved: Callable[[int, float, float, bool], None],
    ) -> None:
        super().__init__(pxMode=True)
        self._chosen, self._moved = chosen, moved
        self._dragged: int | None = None
        self._nodes = np.zeros((0, 2))
        self.setZValue(40)
        self.setCursor(Qt.CursorShape.ArrowCursor)

    def show_nodes(self, curve: Curve, index: int | None, colour: QColor) -> None:
        """Show the nodes, the selected one filled and larger."""
        self._nodes = np.stack([curve.cosines, curve.values], axis=-1)
        base = theme.colour("base")
        spots = [
            {
                "pos": node,
                "size": NODE_PX + 5 if i == index else NODE_PX,
                "brush": pg.mkBrush(colour if i == index else base),
                "pen": pg.mkPen(colour, width=2),
                "symbol": "o",
            }
            for i, node in enumerate(self._nodes)
        ]
        self.setData(spots=spots)

    def nearest(self, position: QPointF) -> int | None:
        """Return the node that can be grabbed at a position of this item."""
        box = self.getViewBox()
        if box is None or not len(self._nodes):
            return None
        wide, high = box.viewPixelSize()
        off = (self._nodes - [position.x(), position.y()]) / [wide, high]
        away = np.hypot(off[:, 0], off[:, 1])
        index = int(away.argmin())
        return index if away[index] <= GRAB_PX else None

    def hoverEvent(self, event: Any) -> None:
        """Show a hand cursor where a node can be grabbed."""
        over = not event.isExit() and self.nearest(event.pos()) is not None
        if over:
            event.acceptDrags(Qt.MouseButton.LeftButton)
            event.acceptClicks(Qt.MouseButton.LeftButton)
        shape = Qt.CursorShape.OpenHandCursor if over else Qt.CursorShape.ArrowCursor
        self.setCursor(shape)

    def mouseClickEvent(self, event: Any) -> None:
        """Select the node under the pointer."""
        index = self.nearest(event.pos())
        if index is None or event.button() != Qt.MouseButton.LeftButton:
            event.ignore()
            return
        event.accept()
        self._chosen(index)

    def mouseDragEvent(self, event: Any) -> None:
        """Move the grabbed node."""
        if event.button() != Qt.MouseButton.LeftButton:
            event.ignore()
            return
        if event.isStart():
            self._dragged = self.nearest(event.buttonDownPos())
            if self._dragged is not None:
                self._chosen(self._dragged)
        if self._dragged is None:
            event.ignore()
            return
        event.accept()
        position = event.pos()
        self._moved(self._dragged, float(position.x()), float(position.y()), bool(event.isFinish()))


class CurvePlot(pg.PlotWidget):
    """One channel of a state, drawn over its scatter."""

    node_chosen = Signal(int)
    node_moved = Signal(int, float, float, bool)
    outlined = Signal(object)
    asked_for_node = Signal(float)

    def __init__(self, scatter: ReflectanceScatter) -> None:
        self.box = LassoViewBox()
        super().__init__(viewBox=self.box)
        without_menus(self)
        self.hideButtons()  # the tool that shows the whole curve has a name
        self._scatter = scatter
        self._density_of: tuple[object, ...] = ()
        self._image = pg.ImageItem()
        self._outliers = pg.ScatterPlotItem(symbol="x", size=6)
        self._gone = pg.ScatterPlotItem(symbol="x", size=7)
        self._shades = [QGraphicsRectItem(), QGraphicsRectItem()]
        self._words = [pg.TextItem(anchor=(0.5, 0.5), angle=90) for _ in self._shades]
        self._edges = [pg.InfiniteLine(angle=90) for _ in self._shades]
        self._previous, self._fit = pg.PlotCurveItem(), pg.PlotCurveItem()
        self._dashed, self._solid = pg.PlotCurveItem(), pg.PlotCurveItem()
        self.nodes = NodeItem(self.node_chosen.emit, self.node_moved.emit)
        layers = (
            self._image,
            *self._shades,
            *self._edges,
            *self._words,
            self._outliers,
            self._gone,
            self._previous,
            self._fit,
            self._dashed,
            self._solid,
            self.nodes,
        )
        for layer in layers:
            self.addItem(layer, ignoreBounds=True)
        self._legend = self.addLegend(offset=(-40, -12))
        self.box.drawn.connect(self.outlined)
        self.scene().sigMouseClicked.connect(self._on_click)
        self.setLabel("bottom", tr("cosine of the angle between normal and light"))
        self.getAxis("left").enableAutoSIPrefix(False)
        self.setLabel("left", tr("pixel value / light, I / (\N{GREEK SMALL LETTER RHO}|L|)"))

    def show_state(
        self, edit: CurveEdit, channel: int, *, chosen: int | None, previous: Curve | None
    ) -> None:
        """Show a channel of a state.

        Parameters
        ----------
        edit : CurveEdit
            State of the editor.
        channel : int
            Index of the channel.
        chosen : int or None
            Index of the selected node.
        previous : Curve or None
            An older curve to compare with.
        """
        colour = channel_colour(channel)
        self._show_scatter(edit, channel)
        self._show_coverage(edit, channel)
        cosine = np.linspace(0.0, 1.0, 500)
        curve = edit[channel].curve
        value = curve.at(cosine)
        low, high = edit[channel].coverage
        seen = (cosine >= low) & (cosine <= high)
        self._solid.setData(cosine[seen], value[seen], pen=pg.mkPen(colour, width=3))
        self._dashed.setData(
            cosine, value, pen=pg.mkPen(colour, width=2, style=Qt.PenStyle.DashLine)
        )
        dots = pg.mkPen(theme.colour("text"), width=1.5, style=Qt.PenStyle.DotLine)
        fit = edit[channel].fit
        self._fit.setData(cosine, fit.at(cosine), pen=dots)
        self._fit.setVisible(fit != curve)
        if previous is not None:
            pen = pg.mkPen(theme.colour("stale"), width=2, style=Qt.PenStyle.DashDotLine)
            self._previous.setData(cosine, previous.at(cosine), pen=pen)
        self._previous.setVisible(previous is not None)
        self.nodes.show_nodes(curve, chosen, colour)
        self._show_legend(fit != curve, previous is not None)

    def whole(self, edit: CurveEdit, channel: int) -> None:
        """Show the whole curve."""
        top = max(edit[channel].curve.values[-1], edit[channel].fit.values[-1])
        self.setRange(xRange=(-0.02, 1.02), yRange=(-0.02 * top, 1.12 * top), padding=0.0)

    def apply_theme(self) -> None:
        """Apply the colours of the present theme."""
        text = theme.colour("text")
        self.setBackground(theme.colour("base"))
        for side in ("bottom", "left"):
            axis = self.getAxis(side)
            axis.setPen(pg.mkPen(theme.colour("muted")))
            axis.setTextPen(pg.mkPen(text))
        self._legend.setLabelTextColor(text)
        panel = QColor(theme.colour("base"))
        panel.setAlpha(215)
        self._legend.setBrush(pg.mkBrush(panel))
        self._legend.setPen(pg.mkPen(theme.colour("line")))
        self._density_of = ()

    def _on_click(self, event: Any) -> None:
        if event.double() and event.button() == Qt.MouseButton.LeftButton:
            event.accept()
            self.asked_for_node.emit(float(self.box.mapSceneToView(event.scenePos()).x()))

    def _show_scatter(self, edit: CurveEdit, channel: int) -> None:
        """Show density and outliers; recomputed only if channel, fit or theme have changed."""
        state = (channel, edit[channel].left_out, edit[channel].fit, theme.is_dark())
        if state == self._density_of:
            return
        self._density_of = state
        x, y = self._scatter.cosines[channel], self._scatter.values[channel]
        out = left_out_points(edit[channel].left_out, self._scatter, channel)
        top = 1.12 * float(max(edit[channel].fit.values[-1], np.quantile(y, 0.9999)))
        counts, _, _ = np.histogram2d(x[~out], y[~out], BINS, ((0.0, 1.0), (0.0, top)))
        self._image.setImage(_density(counts), autoLevels=False)
        self._image.setRect(QRectF(0.0, 0.0, 1.0, top))
        off = y / np.maximum(edit[channel].fit.at(np.clip(x, 0.0, 1.0)), 1e-9) - 1.0
        spread = 1.4826 * float(np.median(np.abs(off[~out])))
        far = np.flatnonzero(~out & (np.abs(off) > OUTLIER_SPREADS * spread))
        warn, fail = theme.colour("warn"), theme.colour("fail")
        for item, which, hue in (
            (self._outliers, far, warn),
            (self._gone, np.flatnonzero(out), fail),
        ):
            which = which[:: max(which.size // MAX_MARKS, 1)]
            item.setData(x[which], y[which], pen=pg.mkPen(hue), brush=pg.mkBrush(hue))

    def _show_coverage(self, edit: CurveEdit, channel: int) -> None:
        low, high = edit[channel].coverage
        shade, muted = QColor(theme.colour("muted")), theme.colour("muted")
        shade.setAlpha(90)
        # Much higher than the curve, so that its end is not visible when zoomed out.
        for rectangle, word, edge, (start, stop) in zip(
            self._shades, self._words, self._edges, ((-1.0, low), (high, 2.0)), strict=True
        ):
            rectangle.setRect(QRectF(start, -10.0, stop - start, 30.0))
            brush = QBrush(shade, Qt.BrushStyle.BDiagPattern)
            rectangle.setBrush(brush)
            rectangle.setPen(QPen(Qt.PenStyle.NoPen))
            edge.setPen(pg.mkPen(muted, width=1, style=Qt.PenStyle.DashLine))
            edge.setPos(low if start < 0.0 else high)
            word.setText(tr("extrapolated: no ball data here"), color=theme.colour("text"))
            word.fill = pg.mkBrush(theme.colour("base"))
            middle = 0.5 * (max(start, 0.0) + min(stop, 1.0))
            word.setPos(middle, 0.62 * edit[channel].fit.values[-1])
            # A narrow strip has no room for text.
            word.setVisible(min(stop, 1.0) - max(start, 0.0) > 0.04)

    def _show_legend(self, fit: bool, previous: bool) -> None:
        self._legend.clear()
        self._legend.addItem(self._solid, tr("curve, measured"))
        self._legend.addItem(self._dashed, tr("curve, extrapolated"))
        if fit:
            self._legend.addItem(self._fit, tr("fit to the ball pixels"))
        if previous:
            self._legend.addItem(self._previous, tr("previous version"))
        if len(self._outliers.data):
            self._legend.addItem(self._outliers, tr("outliers"))
        if len(self._gone.data):
            self._legend.addItem(self._gone, tr("excluded"))


def _density(counts: Array) -> NDArray[np.uint8]:
    """Return counts as a fog in the text colour, logarithmic, (columns, rows, 4)."""
    share = np.log1p(counts) / max(float(np.log1p(counts.max())), 1e-9)
    colour = theme.colour("text")
    image = np.zeros((*counts.shape, 4), dtype=np.uint8)
    image[..., :3] = (colour.red(), colour.green(), colour.blue())
    image[..., 3] = np.where(counts > 0.0, 30.0 + 150.0 * share, 0.0).astype(np.uint8)
    return image
