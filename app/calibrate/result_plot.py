"""A picture of a calibration's result in the colours of the theme."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QRectF, Qt, Signal
from PySide6.QtWidgets import QFrame

from app.widgets import theme
from app.widgets.label import PlainLabel
from app.widgets.layout import vbox
from app.widgets.plots import CHANNEL_COLOURS, apply_theme, bare_plot
from app.widgets.text_roles import make_bold, set_text_role
from app.widgets.widget_names import set_names
from gelpolight_core.output.report.result_pictures import (
    DIVERGING,
    LED_ROLES,
    MOST_NAMES,
    Bars,
    Field,
    Label,
    Level,
    Line,
    Mark,
    ResultPicture,
    Role,
)

HEIGHTS = {True: 260, False: 156}
"""Of pictures from above, and of charts."""


class ResultPlot(QFrame):
    """A card with the title, the marks and the caption of a picture.

    Parameters
    ----------
    picture : ResultPicture
        What it shows.
    """

    chosen = Signal(str)
    """The name of the bar that was clicked."""

    def __init__(self, picture: ResultPicture) -> None:
        super().__init__()
        self.setObjectName("card")
        self.picture = picture
        from_above = not any(picture.labels)
        tip = " Click a bar to open its press." if self.bar_at(0.0) else ""
        title = PlainLabel(picture.title, wrap=True)
        caption = PlainLabel(picture.caption + tip, wrap=True)
        make_bold(title)
        set_text_role(caption, "muted")
        self._bar: pg.ColorBarItem | None = None
        self.plot = bare_plot()
        set_names(self.plot, f"result.picture.{picture.key}", picture.title)
        self.plot.setFixedHeight(HEIGHTS[from_above])
        self.plot.setMouseEnabled(False, False)
        self.plot.setLabel("bottom", "x (mm)" if from_above else picture.labels[0])
        self.plot.setLabel("left", "y (mm)" if from_above else picture.labels[1])
        if from_above:
            self.plot.setAspectLocked(True)
            self.plot.invertY(True)
        self.plot.scene().sigMouseClicked.connect(self._click)
        vbox(title, self.plot, caption, None, of=self, margins=(12, 8, 12, 8), spacing=4)
        self._draw()

    def changeEvent(self, event: QEvent) -> None:
        """Apply the colours of a new theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "plot"):
            self._draw()

    def bar_at(self, x: float) -> str:
        """Return the name of the bar at a place along the axis, empty beside all bars."""
        names = next((m.names for m in self.picture.marks if isinstance(m, Bars)), ())
        at = round(x)
        return names[at] if 0 <= at < len(names) else ""

    def _click(self, event: pg.GraphicsScene.mouseEvents.MouseClickEvent) -> None:
        name = self.bar_at(self.plot.getViewBox().mapSceneToView(event.scenePos()).x())
        if name:
            self.chosen.emit(name)

    def _draw(self) -> None:
        self.plot.clear()
        apply_theme(self.plot)
        self.plot.setBackground(theme.colour("alternate"))
        if any(isinstance(mark, Line) and mark.name for mark in self.picture.marks):
            self.plot.addLegend(offset=(-8, 8), labelTextColor=theme.colour("text"))
        for mark in self.picture.marks:
            self._add(mark)
        self.plot.autoRange(padding=0.08)
        if any(self.picture.labels):
            self.plot.setYRange(0.0, 1.3 * self._highest(), padding=0.0)

    def _highest(self) -> float:
        """Return the largest value that a chart shows."""
        values = [0.0]
        for mark in self.picture.marks:
            match mark:
                case Bars(_, heights, _):
                    values += heights
                case Line(_, y, _, _):
                    values.append(float(np.max(y)))
                case Level(value, _):
                    values.append(value)
        return max(values)

    def _add(self, mark: Mark) -> None:
        match mark:
            case Bars(names, values, roles):
                brushes = [pg.mkBrush(_colour(role)) for role in roles]
                at = np.arange(len(names))
                bars = pg.BarGraphItem(x=at, height=values, width=0.7, brushes=brushes, pen=None)
                self.plot.addItem(bars)
                # Names of many bars would overlap.
                named = zip(at, names, roles, strict=True)
                texts = [
                    (place, name.removeprefix("ball_"))
                    for place, name, role in named
                    if len(names) <= MOST_NAMES or role == "warn"
                ]
                self.plot.getAxis("bottom").setTicks([texts])
            case Line(x, y, role, name):
                self.plot.plot(x, y, pen=pg.mkPen(_colour(role), width=2), name=name or None)
            case Label(x, y, text, role):
                item = pg.TextItem(text, _colour(role), anchor=(0.5, 0.5))
                item.setPos(x, y)
                self.plot.addItem(item)
            case Level(value, text):
                pen = pg.mkPen(_colour("warn"), style=Qt.PenStyle.DashLine)
                opts = {"position": 0.02, "anchors": [(0, 1), (0, 1)], "color": _colour("warn")}
                self.plot.addItem(
                    pg.InfiniteLine(value, angle=0, pen=pen, label=text, labelOpts=opts)
                )
            case Field(values, (left, right, top, bottom), reach):
                image = pg.ImageItem(values, axisOrder="row-major", levels=(-reach, reach))
                colours = pg.ColorMap(None, DIVERGING)
                image.setColorMap(colours)
                image.setRect(QRectF(left, top, right - left, bottom - top))
                self.plot.addItem(image)
                if self._bar is None:
                    limits = -reach, reach
                    self._bar = pg.ColorBarItem(limits, 12, colours, interactive=False)
                    self._bar.setImageItem(image, insert_in=self.plot.getPlotItem())


def _colour(role: Role) -> str:
    """Return the colour of a role in the present theme."""
    if role in LED_ROLES:
        return CHANNEL_COLOURS[LED_ROLES.index(role)][theme.is_dark()]
    return theme.colour(role).name()
