"""The bar on top of every page: sensor, camera, calibration, frames per second."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QMenu, QSizePolicy, QToolBar, QToolButton, QWidget

from app.program.calibration_entries import CalibrationEntry
from app.program.calibration_status import put_into_use
from app.program.context import AppContext
from app.program.status import StatusModel
from app.source_ui.source_button import SourceButton
from app.widgets.actions import add_item
from app.widgets.icons import icon
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.text_roles import heading, make_bold, named_label, set_background_role
from app.widgets.widget_names import set_names

SIGNS = {"pass": "validated", "warn": "warn", "fail": "fail"}


class CalibrationButton(QToolButton):
    """Shows the calibration in use with its verdict. Its menu lists the library.

    Parameters
    ----------
    context : AppContext
        Holds the library and the status.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        self._context = context
        set_names(self, "state.calibration", "Calibration in use")
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
        """List the readable calibrations, newest first, with the sensor in use on top."""
        menu = self.menu()
        menu.clear()
        entries = self._context.toasts.read_list(self._context.workspace.entries)
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

    def _add(self, entry: CalibrationEntry) -> None:
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
        set_background_role(self, "warn" if status.task else status.calibration_role)
        self.setToolTip(plain_tip(status.calibration_advice))


TITLE_FROM = 1180
"""Width in pixels from which on there is space for the name of the program."""


class StateBar(QToolBar):
    """Shows what all pages work with, and lets the user change the camera and the calibration.

    Parameters
    ----------
    context : AppContext
        Holds the status.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__("State")
        set_names(self, "state", "State")
        self.setMovable(False)
        self.setIconSize(QSize(18, 18))
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        self._status = context.status
        self._title = self.addWidget(heading("GelPoLight Studio"))
        self._sensor = named_label("chip", "Sensor", wrap=False)
        self._sensor_shown = self.addWidget(self._sensor)
        self.camera = SourceButton(context=context)
        self.addWidget(self.camera)
        self.calibration = CalibrationButton(context=context)
        self.addWidget(self.calibration)
        space = QWidget()
        space.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.addWidget(space)
        self._rate = named_label(
            "state.rate", "Frames per second from the camera", wrap=False, role="muted"
        )
        self.addWidget(self._rate)
        self._status.changed.connect(self._show)
        self._show()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Leave the name of the program out where there is no space for it."""
        super().resizeEvent(event)
        self._title.setVisible(self.width() >= TITLE_FROM)

    def _show(self) -> None:
        status = self._status.value
        self._sensor.setText(f"Sensor {status.sensor}")
        self._sensor_shown.setVisible(bool(status.sensor))
        self._rate.setText(rate_text(status.rate_hz, status.lost))
        # Reserves the width of the longest text, so that its neighbours do not move.
        self._rate.setMinimumWidth(max(self._rate.minimumWidth(), self._rate.sizeHint().width()))


def rate_text(rate_hz: float | None, lost: int | None) -> str:
    """Return the frames per second and the number of lost frames. Empty if there is no camera."""
    return "" if rate_hz is None else f"{rate_hz:.0f} frames/s, {lost or 0} lost"


class FailedCalibrationBar(PlainLabel):
    """Warns above every page while the calibration in use is one that failed."""

    def __init__(self, model: StatusModel) -> None:
        super().__init__(wrap=True)
        self._model = model
        set_names(self, "main.failed", "Warning about the calibration in use")
        self.setProperty("ground", "fail")
        self.setContentsMargins(16, 8, 16, 8)
        make_bold(self)
        model.changed.connect(self._show)
        self._show()

    def _show(self) -> None:
        status = self._model.value
        self.setVisible(status.calibration_role == "fail")
        self.setText(status.calibration_advice)
