"""The row of image tools, each with its own key."""

from __future__ import annotations

import math

from PySide6.QtCore import QSize, Signal
from PySide6.QtWidgets import QToolButton, QWidget

from app.theme.icons import icon
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox
from app.widgets.naming import named
from app.widgets.tool_key import add_tool_key
from gelpolight_core.translation import tr

# name: (label, key, stays pressed, icon)
TOOLS = {
    "fit": (tr("Fit to view"), "F", False, "fit"),
    "full_size": (tr("Full size, 100 %"), "1", False, "full-size"),
    "freeze": (tr("Freeze"), "Space", True, "pause"),
    "snapshot": (tr("Save snapshot"), "P", False, "picture"),
    "zebra": (tr("Mark saturated pixels"), "Z", True, "zebra"),
    "histogram": (tr("Histogram"), "H", True, "histogram"),
    "overlay": (tr("Show marks"), "O", True, "marks"),
}


class ImageTools(QWidget):
    """Flat buttons; their keys work while the focus is inside `owner`.

    Signals
    -------
    pressed(str)
        A tool that does not stay pressed was used.
    switched(str, bool)
        A tool that stays pressed was switched.
    """

    pressed = Signal(str)
    switched = Signal(str, bool)

    def __init__(self, owner: QWidget) -> None:
        super().__init__()
        named(self, "live.tools", tr("Image tools"))
        self._buttons: dict[str, QToolButton] = {}
        self._zoom = named(PlainLabel(), "live.zoom", tr("Magnification"))
        self._zoom.setFixedWidth(self._zoom.fontMetrics().horizontalAdvance("0000 %"))
        row = hbox(of=self, margins=(4, 2, 8, 2), spacing=2)
        for name in TOOLS:
            row.addWidget(self._make_button(name, owner))
        row.addWidget(self._zoom)
        self._buttons["overlay"].setChecked(True)

    def _make_button(self, name: str, owner: QWidget) -> QToolButton:
        text, key, stays, sign = TOOLS[name]
        button = named(QToolButton(autoRaise=True), f"live.{name}", text, text, key)
        button.setIconSize(QSize(20, 20))
        button.setIcon(icon(sign))
        button.setCheckable(stays)
        if stays:
            button.toggled.connect(lambda on: self.switched.emit(name, on))
        else:
            button.clicked.connect(lambda: self.pressed.emit(name))
        add_tool_key(owner, key, button.click, name=f"live.key.{name}", purpose=text)
        self._buttons[name] = button
        return button

    def is_on(self, name: str) -> bool:
        """Return whether a tool is pressed."""
        return self._buttons[name].isChecked()

    def switch(self, name: str, on: bool) -> None:
        """Press or release a tool."""
        self._buttons[name].setChecked(on)

    def show_zoom(self, scale: float) -> None:
        """Show the magnification, 1 for full size; NaN if there is no image."""
        self._zoom.setText("" if math.isnan(scale) else f"{100.0 * scale:.0f} %")
