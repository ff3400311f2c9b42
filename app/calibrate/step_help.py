"""The help of a step: a drawing of the assembled sensor, with a button to the guide."""

from __future__ import annotations

from PySide6.QtCore import QByteArray, QPoint, QSize, Qt
from PySide6.QtGui import QPixmap
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QFrame, QPushButton, QToolButton, QWidget

from app.widgets import theme
from app.widgets.icons import FOLDER, painted
from app.widgets.label import PlainLabel, escaped
from app.widgets.layout import vbox
from app.widgets.widget_names import set_names

from .page_state import StepDeclaration

DRAWING = FOLDER / "drawings" / "assembly.svg"
BOX = QSize(288, 150)

SENSOR = "housing", "leds", "slab", "camera", "membrane"
ASSEMBLIES: dict[str, tuple[str, tuple[str, ...]]] = {
    "camera": (
        "The camera alone, with a checkerboard held in front of it",
        ("camera", "held_board"),
    ),
    "board": (
        "Housing without elastomer, checkerboard on the top opening, pattern facing down",
        ("housing", "camera", "board"),
    ),
    "mirror": (
        "Housing without elastomer, LEDs on, mirror on the top opening",
        ("housing", "leds", "camera", "mirror"),
    ),
    "whiteboard": (
        "Elastomer without membrane, white board pressed onto it",
        ("housing", "leds", "slab", "camera", "whiteboard"),
    ),
    "membrane": ("Elastomer with membrane, nothing touching it", SENSOR),
    "ball": ("A ball pressed into the membrane", (*SENSOR, "ball")),
    "indenter": ("An indenter of known size pressed into the membrane", (*SENSOR, "indenter")),
    "complete": ("The complete sensor: camera, LEDs, elastomer, membrane", SENSOR),
}
"""What each drawing shows, for a screen reader, and its parts."""
PARTS = {
    "housing": "",
    "camera": "camera",
    "leds": "LEDs",
    "slab": "elastomer",
    "board": "board",
    "held_board": "board, tilted",
    "mirror": "mirror",
    "whiteboard": "white board",
    "membrane": "membrane",
    "ball": "ball",
    "indenter": "indenter",
}
"""All parts with their labels."""


def drawing_of(assembly: str, label: QWidget) -> QPixmap:
    """Return the drawing of an assembly in the colours of the theme and the font of a label."""
    visibility = dict.fromkeys(PARTS, "none") | dict.fromkeys(ASSEMBLIES[assembly][1], "inline")
    labels = {f"{part}_word": escaped(word) for part, word in PARTS.items()}
    colours = {name: theme.colour(name).name() for name in ("text", "button", "muted", "accent")}
    svg = DRAWING.read_text("utf-8").format(
        **visibility, **labels, **colours, font=label.font().family()
    )
    drawing = QSvgRenderer(QByteArray(svg.encode()))
    drawing.setAspectRatioMode(Qt.AspectRatioMode.KeepAspectRatio)
    ratio = label.devicePixelRatioF()
    pixmap = painted(BOX * ratio, drawing.render)
    pixmap.setDevicePixelRatio(ratio)
    return pixmap


WIDTH = 320


class StepHelp(QToolButton):
    """A button that shows the drawing of the set-up, with a button to the guide."""

    def __init__(self) -> None:
        super().__init__()
        set_names(self, "calibrate.help", "Help on this step", "How to set it up")
        self.setText("?")
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self._sheet = set_names(
            QFrame(self, Qt.WindowType.Popup), "calibrate.help.sheet", "Help on this step"
        )
        self._sheet.setFixedWidth(WIDTH)
        self._assembly = "complete"
        self._drawing = set_names(PlainLabel(), "calibrate.assembly", "Help on this step")
        self._words = PlainLabel(wrap=True)
        self.guide = set_names(
            QPushButton("Read the &guide"), "calibrate.help.guide", "Read about this step"
        )
        vbox(self._drawing, self._words, self.guide, of=self._sheet, margins=16)
        self.guide.clicked.connect(self._sheet.close)
        self.clicked.connect(self._open)

    def show_step(self, step: StepDeclaration) -> None:
        """Show the set-up of another step."""
        self._assembly = step.assembly
        self._words.setText(step.advice)
        self._words.setVisible(bool(step.advice))

    def _open(self) -> None:
        description = ASSEMBLIES[self._assembly][0]
        set_names(self._drawing, "calibrate.assembly", description, description)
        self._drawing.setPixmap(drawing_of(self._assembly, self._drawing))
        corner = self.mapToGlobal(self.rect().bottomRight())
        self._sheet.adjustSize()
        self._sheet.move(corner - QPoint(WIDTH, -4))
        self._sheet.show()
