"""A picture of a calibration's result in the colours of the theme."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QObject, QRectF, Qt, Signal
from PySide6.QtWidgets import QFrame, QSizePolicy

from app.widgets import theme
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.plots import CHANNEL_COLOURS, apply_theme, bare_plot
from app.widgets.text_roles import make_bold, set_text_role
from app.widgets.widget_names import set_names
from gelpolight_core.output.report.result_pictures import (
    DIVERGING,
    LED_ROLES,
    MOST_NAMES,
    TEXT_SHARE,
    Bars,
    Field,
    Label,
    Level,
    Line,
    Mark,
    ResultPicture,
    Role,
)

SMALL = 0.8
"""Size of the letters in a picture, over the usual one."""
LEAST_HEIGHTS = {True: 150, False: 100}
"""Of pictures from above, and of charts. Their text has its own height."""


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
        self.from_above = not any(picture.labels)
        tip = " Click a bar to open its press." if self.bar_at(0.0) else ""
        title = PlainLabel(picture.title, wrap=True)
        caption = PlainLabel(picture.caption + tip, wrap=True)
        make_bold(title)
        set_text_role(caption, "muted")
        self._bar: pg.ColorBarItem | None = None
        self.plot = bare_plot()
        set_names(self.plot, f"result.picture.{picture.key}", picture.title)
        # As high as there is room.
        self.plot.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        self.plot.viewport().installEventFilter(self)
        self.plot.setMouseEnabled(False, False)
        self.plot.getPlotItem().setContentsMargins(0.0, 6.0, 0.0, 0.0)  # the highest number
        self.plot.setLabels(**dict(zip(("bottom", "left"), picture.labels, strict=True)))
        if self.from_above:
            self.plot.setAspectLocked(True)
            self.plot.invertY(True)
        self.plot.scene().sigMouseClicked.connect(self._click)
        beside = () if self.from_above else ((caption, 1, Qt.AlignmentFlag.AlignTop),)
        row = hbox((self.plot, 3), *beside, spacing=12)
        row.addStrut(LEAST_HEIGHTS[self.from_above])
        parts = (title, caption) if self.from_above else (title,)
        vbox(*parts, (row, 1), of=self, margins=(12, 8, 12, 8), spacing=4)
        self._draw()

    def changeEvent(self, event: QEvent) -> None:
        """Apply the colours of a new theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "plot"):
            self._draw()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Leave the wheel to the page."""
        is_wheel = event.type() == QEvent.Type.Wheel
        event.setAccepted(event.isAccepted() and not is_wheel)
        return is_wheel or super().eventFilter(watched, event)

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
        # A text lies on no line.
        marks = sorted(self.picture.marks, key=lambda mark: isinstance(mark, Label | Level))
        for mark in marks:
            self._add(mark)
        self.plot.autoRange(padding=0.08)
        if not self.from_above:
            tops = [np.max(m.y, initial=0.0) for m in marks if not isinstance(m, Field)]
            self.plot.setYRange(0.0, max(tops) / (1.0 - TEXT_SHARE), padding=0.0)

    def _add(self, mark: Mark) -> None:
        match mark:
            case Bars(names, values, roles):
                brushes = [pg.mkBrush(_colour(role)) for role in roles]
                at = np.arange(len(names))
                bars = pg.BarGraphItem(x=at, height=values, width=0.7, brushes=brushes, pen=None)
                self.plot.addItem(bars)
                # Names of many bars would overlap: the worst is named.
                shown = names if len(names) <= MOST_NAMES else names[:1]
                texts = [(k, name.removeprefix("ball_")) for k, name in enumerate(shown)]
                self.plot.getAxis("bottom").setTicks([texts])
            case Line(x, y, role):
                self.plot.plot(x, y, pen=pg.mkPen(_colour(role), width=2 - self.from_above))
            case Label(x, y, text, role, above_end):
                anchor, fill = (1, 1) if above_end else (0.5, 0.5), theme.colour("alternate")
                item = pg.TextItem(text, _colour(role), anchor=anchor, fill=fill)
                item.textItem.document().setDocumentMargin(0.0)
                item.textItem.setScale(SMALL)
                item.setPos(x, y)
                self.plot.addItem(item)
            case Level(value, text, role, place):
                pen = pg.mkPen(_colour(role), style=Qt.PenStyle.DashLine)
                opts = {"position": place, "anchors": [(place, 1)] * 2, "color": _colour(role)}
                opts["fill"] = theme.colour("alternate")
                self.plot.addItem(pg.InfiniteLine(value, 0, pen, label=text, labelOpts=opts))
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
