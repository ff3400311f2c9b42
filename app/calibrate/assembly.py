"""A drawn cross-section that shows how the sensor is assembled in each step."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.theme import theme
from app.widgets.label import plain_tip
from app.widgets.naming import named
from gelpolight_core.translation import tr

# Drawn in a box of 300 x 150; the top surface is at y = 44.
BOX = QSize(300, 150)
TOP = 44.0
LEFT, RIGHT = 62.0, 238.0
LED_Y = 104.0

PARTS: dict[str, tuple[str, ...]] = {
    "camera": ("camera", "held_board"),
    "board": ("housing", "camera", "board"),
    "mirror": ("housing", "leds", "camera", "mirror"),
    "whiteboard": ("housing", "leds", "slab", "camera", "whiteboard"),
    "membrane": ("housing", "leds", "slab", "camera", "membrane"),
    "ball": ("housing", "leds", "slab", "camera", "membrane", "ball"),
    "indenter": ("housing", "leds", "slab", "camera", "membrane", "indenter"),
    "complete": ("housing", "leds", "slab", "camera", "membrane"),
}


def assembly_words(name: str) -> str:
    """Return a description of a drawing, for a screen reader."""
    return {
        "camera": tr("The camera alone, with a checkerboard held in front of it"),
        "board": tr(
            "Housing without elastomer, checkerboard on the top opening, pattern facing down"
        ),
        "mirror": tr("Housing without elastomer, LEDs on, mirror on the top opening"),
        "whiteboard": tr("Elastomer without membrane, white board pressed onto it"),
        "membrane": tr("Elastomer with membrane, nothing touching it"),
        "ball": tr("A ball pressed into the membrane"),
        "indenter": tr("An indenter of known size pressed into the membrane"),
        "complete": tr("The complete sensor: camera, LEDs, elastomer, membrane"),
    }[name]


class AssemblyDrawing(QWidget):
    """Shows one cross-section."""

    def __init__(self) -> None:
        super().__init__()
        self._name = "complete"
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setFixedHeight(BOX.height())
        named(self, "calibrate.assembly", assembly_words(self._name))

    def show_assembly(self, name: str) -> None:
        """Show another cross-section."""
        self._name = name
        self.setAccessibleName(assembly_words(name))
        self.setToolTip(plain_tip(assembly_words(name)))
        self.update()

    def sizeHint(self) -> QSize:
        """Return the size that shows the whole drawing."""
        return QSize(240, BOX.height())

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw the parts from back to front."""
        del event
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        scale = min(self.width() / BOX.width(), self.height() / BOX.height())
        painter.translate((self.width() - scale * BOX.width()) / 2.0, 0.0)
        painter.scale(scale, scale)
        painter.setFont(self.font())
        for part in PARTS[self._name]:
            _DRAW[part](painter)
        painter.end()


def _pen(colour: QColor, width: float = 1.4) -> QPen:
    return QPen(colour, width)


def _label(painter: QPainter, x: float, y: float, text: str, *, right: bool = False) -> None:
    painter.setPen(theme.colour("muted"))
    font = painter.font()
    font.setPixelSize(10)
    painter.setFont(font)
    box = QRectF(x - 90.0, y - 8.0, 88.0, 16.0) if right else QRectF(x, y - 8.0, 90.0, 16.0)
    side = Qt.AlignmentFlag.AlignRight if right else Qt.AlignmentFlag.AlignLeft
    painter.drawText(box, side | Qt.AlignmentFlag.AlignVCenter, text)


def _camera(painter: QPainter) -> None:
    painter.setPen(_pen(theme.colour("text")))
    painter.setBrush(theme.colour("button"))
    painter.drawRect(QRectF(130, 126, 40, 20))
    painter.drawRect(QRectF(140, 118, 20, 8))
    painter.setPen(QPen(theme.colour("muted"), 0.8, Qt.PenStyle.DashLine))
    painter.drawLine(QPointF(150, 118), QPointF(84, TOP + 2))
    painter.drawLine(QPointF(150, 118), QPointF(216, TOP + 2))
    _label(painter, 176, 138, tr("camera"))


def _housing(painter: QPainter) -> None:
    painter.setPen(_pen(theme.colour("text")))
    painter.setBrush(theme.colour("button"))
    painter.drawRect(QRectF(LEFT - 10, TOP, 8, 92))
    painter.drawRect(QRectF(RIGHT + 2, TOP, 8, 92))


def _leds(painter: QPainter) -> None:
    for x, colour in ((LEFT + 8, "#d84040"), (150.0 + 34, "#2fa84f"), (RIGHT - 8, "#3d73e0")):
        painter.setPen(Qt.PenStyle.NoPen)
        glow = QColor(colour)
        glow.setAlpha(70)
        painter.setBrush(glow)
        painter.drawEllipse(QPointF(x, LED_Y), 9, 9)
        painter.setBrush(QColor(colour))
        painter.drawEllipse(QPointF(x, LED_Y), 3.6, 3.6)
    _label(painter, LEFT - 14, LED_Y, tr("LEDs"), right=True)


def _slab(painter: QPainter) -> None:
    clear = theme.colour("accent")
    clear.setAlpha(45)
    painter.setBrush(clear)
    painter.setPen(_pen(theme.colour("accent"), 0.9))
    painter.drawRect(QRectF(LEFT, TOP, RIGHT - LEFT, 42))
    _label(painter, RIGHT + 14, TOP + 22, tr("elastomer"))


def _over(painter: QPainter, colour: QColor, text: str, height: float = 7.0) -> None:
    painter.setPen(_pen(theme.colour("text"), 1.0))
    painter.setBrush(colour)
    painter.drawRect(QRectF(LEFT, TOP - height, RIGHT - LEFT, height))
    _label(painter, RIGHT + 14, TOP - height / 2, text)


def _checks(painter: QPainter, left: float, top: float, width: float, slant: float) -> None:
    count = 12
    for i in range(count):
        painter.setBrush(QColor("black" if i % 2 else "white"))
        x0, x1 = left + width * i / count, left + width * (i + 1) / count
        y0, y1 = top + slant * i / count, top + slant * (i + 1) / count
        painter.drawPolygon(
            QPolygonF([QPointF(x0, y0), QPointF(x1, y1), QPointF(x1, y1 + 6), QPointF(x0, y0 + 6)])
        )


def _board(painter: QPainter) -> None:
    painter.setPen(_pen(theme.colour("text"), 0.8))
    _checks(painter, LEFT, TOP - 6, RIGHT - LEFT, 0.0)
    _label(painter, RIGHT + 14, TOP - 4, tr("board"))


def _held_board(painter: QPainter) -> None:
    painter.setPen(_pen(theme.colour("text"), 0.8))
    _checks(painter, 92, 22, 116, 26.0)
    _label(painter, 214, 48, tr("board, tilted"))


def _mirror(painter: QPainter) -> None:
    _over(painter, QColor("#b9c6d3"), tr("mirror"))
    painter.setPen(QPen(QColor("#d84040"), 0.9, Qt.PenStyle.DashLine))
    painter.drawLine(QPointF(LEFT + 8, LED_Y), QPointF(112, TOP))
    painter.drawLine(QPointF(112, TOP), QPointF(150, 118))


def _whiteboard(painter: QPainter) -> None:
    _over(painter, QColor("white"), tr("white board"), 10.0)


def _membrane(painter: QPainter) -> None:
    painter.setPen(_pen(theme.colour("text"), 3.0))
    painter.drawLine(QPointF(LEFT, TOP), QPointF(RIGHT, TOP))
    _label(painter, RIGHT + 14, TOP - 4, tr("membrane"))


def _ball(painter: QPainter) -> None:
    painter.setPen(_pen(theme.colour("text"), 1.2))
    painter.setBrush(theme.colour("button"))
    painter.drawEllipse(QPointF(150, TOP - 12), 22, 22)
    _label(painter, 178, TOP - 26, tr("ball"))


def _indenter(painter: QPainter) -> None:
    painter.setPen(_pen(theme.colour("text"), 1.2))
    painter.setBrush(theme.colour("button"))
    painter.drawRect(QRectF(130, 8, 40, TOP + 2))
    _label(painter, 178, 18, tr("indenter"))


_DRAW = {
    "camera": _camera,
    "housing": _housing,
    "leds": _leds,
    "slab": _slab,
    "board": _board,
    "held_board": _held_board,
    "mirror": _mirror,
    "whiteboard": _whiteboard,
    "membrane": _membrane,
    "ball": _ball,
    "indenter": _indenter,
}
