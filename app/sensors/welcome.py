"""Content of the Sensors page while there is no sensor."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QToolButton, QWidget

from app.theme.icons import application_icon
from app.widgets.label import MarkupLabel, PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from gelpolight_core.translation import tr

WIDTH = 480


class Welcome(QWidget):
    """Shows a short introduction and the first actions.

    Parameters
    ----------
    actions : tuple of QAction
        The first one is the most common.
    """

    def __init__(self, actions: tuple[QAction, ...]) -> None:
        super().__init__()
        named(self, "sensors.welcome", tr("Welcome"))
        sign = PlainLabel(parent=self)
        sign.setPixmap(application_icon().pixmap(96, 96))
        heading = tr("No sensor yet")
        title = MarkupLabel(f"<h1>{heading}</h1>", self)
        text = PlainLabel(
            tr(
                "Sensors are listed here after calibration. Start with one of these "
                "actions, or drop a session folder or a calibration file onto this window."
            ),
            self,
            wrap=True,
        )
        text.setAlignment(Qt.AlignmentFlag.AlignHCenter)
        middle = QWidget(self)
        middle.setFixedWidth(WIDTH)
        centre = Qt.AlignmentFlag.AlignHCenter
        buttons = [(_button(action), 0, centre) for action in actions]
        head = (sign, 0, centre), (title, 0, centre)
        vbox((None, 2), *head, text, 16, *buttons, (None, 3), of=middle)
        hbox(middle, of=self)


def _button(action: QAction) -> QToolButton:
    button = QToolButton()
    named(button, f"welcome.{action.objectName()}", action.text().replace("&", ""))
    button.setDefaultAction(action)
    button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
    button.setIconSize(QSize(24, 24))
    button.setMinimumSize(320, 44)
    button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    return button
