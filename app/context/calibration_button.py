"""The button that shows the calibration in use and lets the user select another one."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMenu, QToolButton

from app.context.calibration_status import put_into_use
from app.context.context import AppContext
from app.theme.icons import icon
from app.widgets.actions import add_item
from app.widgets.label import plain_tip
from app.widgets.meaning import show_ground
from app.widgets.naming import named
from app.workspace.entries import Entry

SIGNS = {"pass": "validated", "warn": "warn", "fail": "fail"}


class CalibrationButton(QToolButton):
    """Shows the calibration in use with its verdict. Its menu offers those of the library.

    Parameters
    ----------
    context : AppContext
        Holds the library and the status.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        self._context = context
        named(self, "state.calibration", "Calibration in use")
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(self)
        menu.setObjectName("state.calibration.menu")
        menu.setToolTipsVisible(True)
        menu.aboutToShow.connect(self.list_calibrations)
        self.setMenu(menu)
        context.status.changed.connect(self._show)
        self._show()

    def list_calibrations(self) -> None:
        """Offer the calibrations that can be read, newest first, those of this sensor on top."""
        menu = self.menu()
        menu.clear()
        entries: tuple[Entry, ...] = ()
        with self._context.toasts.errors():
            entries = self._context.workspace.entries()
        readable = [entry for entry in entries if entry.summary is not None]
        sensor = self._context.status.value.sensor
        serials = dict.fromkeys(entry.serial for entry in readable)
        for serial in sorted(serials, key=lambda one: one != sensor):
            menu.addSection(f"Sensor {serial}")
            for entry in readable:
                if entry.serial == serial:
                    self._add(entry)
        menu.addSeparator()
        add_item(menu, "state.calibration.none", "No calibration", lambda: self.use(None))
        others = partial(self._context.requests.page.emit, "sensors")
        add_item(menu, "state.calibration.sensors", "All sensors and calibrations", others)

    def _add(self, entry: Entry) -> None:
        assert entry.summary is not None
        word, role = entry.state
        text = f"{entry.name}  ({word})".replace("&", "&&")
        name, use = f"state.calibration.{entry.name}", partial(self.use, entry.path)
        action = add_item(self.menu(), name, text, use, checkable=True)
        action.setIcon(icon(SIGNS[role], role))
        size = "x".join(map(str, entry.summary.image_size))
        action.setToolTip(plain_tip(f"{entry.serial}, {entry.summary.identity}, {size}"))
        action.setChecked(entry.in_use)

    def use(self, path: Path | None) -> None:
        """Put a calibration into use, or none."""
        put_into_use(path, self, context=self._context)

    def _show(self) -> None:
        status = self._context.status.value
        self.setText(status.task or status.calibration or "No calibration in use")
        show_ground(self, "warn" if status.task else status.calibration_role)
        self.setToolTip(plain_tip(status.calibration_advice))
