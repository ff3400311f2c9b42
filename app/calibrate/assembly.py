"""A drawn cross-section that shows how the sensor is assembled in each step."""

from __future__ import annotations

from PySide6.QtCore import QByteArray, QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.theme import theme
from app.theme.icons import FOLDER
from app.widgets.label import escaped, plain_tip
from app.widgets.naming import named
from gelpolight_core.translation import tr

DRAWING = FOLDER / "drawings" / "assembly.svg"
BOX = QSize(300, 150)

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
        """Draw the parts of the assembly, in the colours of the theme."""
        del event
        shown = {part: "none" for parts in PARTS.values() for part in parts}
        shown |= dict.fromkeys(PARTS[self._name], "inline")
        words = {f"{part}_word": escaped(word) for part, word in _words().items()}
        roles = ("text", "button", "muted", "accent")
        colours = {name: theme.colour(name).name() for name in roles}
        drawn = DRAWING.read_text("utf-8").format(
            **shown, **words, **colours, font=self.font().family()
        )
        drawing = QSvgRenderer(QByteArray(drawn.encode()))
        drawing.setAspectRatioMode(Qt.AspectRatioMode.KeepAspectRatio)
        painter = QPainter(self)
        drawing.render(painter, QRectF(self.rect()))
        painter.end()


def _words() -> dict[str, str]:
    return {
        "camera": tr("camera"),
        "leds": tr("LEDs"),
        "slab": tr("elastomer"),
        "board": tr("board"),
        "held_board": tr("board, tilted"),
        "mirror": tr("mirror"),
        "whiteboard": tr("white board"),
        "membrane": tr("membrane"),
        "ball": tr("ball"),
        "indenter": tr("indenter"),
    }
