"""What stands on the Sensors page while there is no sensor."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QHBoxLayout, QToolButton, QVBoxLayout, QWidget

from app.shell.icons import application_icon
from app.widgets.label import MarkupLabel, PlainLabel
from app.widgets.naming import named
from gelpolight_core.translation import tr

WIDTH = 480


class Welcome(QWidget):
    """Says what this is, and offers the ways to begin.

    Parameters
    ----------
    ways : tuple of QAction
        The first is the one for most people.
    """

    def __init__(self, ways: tuple[QAction, ...]) -> None:
        super().__init__()
        named(self, "sensors.welcome", tr("Welcome"))
        sign = PlainLabel(parent=self)
        sign.setPixmap(application_icon().pixmap(96, 96))
        title = MarkupLabel(f"<h1>{tr('No sensor yet')}</h1>", self)
        text = PlainLabel(
            tr(
                "A sensor appears here once it is calibrated. Begin with one of these, or drop a "
                "session folder or a calibration file onto this window."
            ),
            self,
        )
        text.setWordWrap(True)
        text.setAlignment(Qt.AlignmentFlag.AlignHCenter)
        middle = QWidget(self)
        middle.setFixedWidth(WIDTH)
        column = QVBoxLayout(middle)
        column.addStretch(2)
        column.addWidget(sign, 0, Qt.AlignmentFlag.AlignHCenter)
        column.addWidget(title, 0, Qt.AlignmentFlag.AlignHCenter)
        column.addWidget(text)
        column.addSpacing(16)
        for way in ways:
            column.addWidget(_button(way), 0, Qt.AlignmentFlag.AlignHCenter)
        column.addStretch(3)
        layout = QHBoxLayout(self)
        layout.addWidget(middle)


def _button(way: QAction) -> QToolButton:
    button = QToolButton()
    named(button, f"welcome.{way.objectName()}", way.text().replace("&", ""))
    button.setDefaultAction(way)
    button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
    button.setIconSize(QSize(24, 24))
    button.setMinimumSize(320, 44)
    button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    return button
