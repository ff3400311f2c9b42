"""First steps for a newcomer: press, measure or calibrate, or connect a sensor."""

from __future__ import annotations

from functools import partial

from PySide6.QtWidgets import QFrame

from app.widgets.actions import push_button, tool_button
from app.widgets.layout import hbox, vbox
from app.widgets.text_roles import heading
from app.widgets.widget_names import set_names

from .context import AppContext

STEPS = {
    "press": ("Press something else", "demo"),
    "measure": ("Measure a cylinder", "measure"),
    "practice": ("Calibrate this sensor yourself", "calibrate"),
    "source": ("Connect your own sensor", "sensors"),
}
"""What begins with a click: text and icon."""


class FirstSteps(QFrame):
    """Card with four first steps. Once closed, it stays closed.

    Parameters
    ----------
    context : AppContext
        Shared by all pages.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        set_names(self, "card", "Try the virtual sensor")
        self._settings = context.settings
        words = "Close, and do not show it again"
        shut = tool_button(
            "first_steps.close", "", self._close, icon_name="close", accessible=words, tip=words
        )
        head = hbox((heading("Try the virtual sensor"), 1), shut)
        column = vbox(head, of=self, margins=(8, 4, 8, 8), spacing=4)
        for key, (text, sign) in STEPS.items():
            begin = partial(context.requests.begin.emit, key)
            button = push_button(f"first_steps.{key}", text, begin, icon_name=sign)
            button.setStyleSheet("text-align: left")
            column.addWidget(button)

    def offer(self, fits: bool) -> bool:
        """Show the card where it fits, unless it was closed. Return whether it is shown."""
        visible = fits and self._settings.preferences.shows_first_steps
        self.setVisible(visible)
        return visible

    def _close(self) -> None:
        self._settings.prefer(shows_first_steps=False)
        self.hide()
