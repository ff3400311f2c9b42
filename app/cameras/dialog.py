"""The window of a camera: format, settings, and lock, next to the page that shows its image."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QGroupBox, QSizePolicy, QWidget

from app.cameras.control_rows import ControlRows
from app.cameras.format_rows import FormatRows
from app.cameras.manager import CameraManager
from app.sources.camera.applying import is_locked, lock_quality
from app.sources.camera.camera import Camera
from app.sources.camera.camera_source import CameraSource
from app.sources.stream import Stream
from app.widgets.buttons import push_button
from app.widgets.dialog import Dialog, Kinds
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.meaning import heading, show_meaning
from app.widgets.naming import named
from app.widgets.pixmaps import pixmap_of
from app.widgets.quality_table import QualityTableWidget
from app.widgets.timers import timer


class CameraDialog(Dialog):
    """Shows a camera and changes its settings; keeps it open while shown.

    Parameters
    ----------
    manager : CameraManager
        Manages the cameras and their settings.
    camera : Camera
        The camera to show.
    """

    def __init__(
        self, manager: CameraManager, camera: Camera, parent: QWidget | None = None
    ) -> None:
        title = f"Camera settings: {camera.device.name}"
        super().__init__(parent, "camera", title, once=True)
        self._manager, self.camera = manager, camera
        self._stream: Stream | None = None
        self._tick = timer(self, 200, self._update)
        self.formats, self.controls = FormatRows(), ControlRows()
        close = "Close the camera settings"
        named(self.buttons.button(Kinds.Close), "camera.close", close)
        inside = named(QWidget(), "camera.panel", "Camera settings")
        hbox((self._build_settings(), 1), (self._build_verdicts(), 1), of=inside)
        self.fill((inside, 1))
        self.resize(860, 690)
        self.formats.chosen.connect(lambda chosen: manager.choose_format(camera, chosen))
        self.controls.changed.connect(lambda key, value: manager.set(camera, {key: value}))
        self._show_camera()

    def _build_settings(self) -> QWidget:
        formats, controls = QGroupBox("Image"), QGroupBox("Settings")
        vbox(self.formats, of=formats)
        vbox(self.controls, of=controls)
        inside = QWidget()
        vbox(formats, controls, None, of=inside)
        return named(scroll_area(inside), "camera.settings", "Format and settings")

    def _build_verdicts(self) -> QWidget:
        self.state = named(PlainLabel(wrap=True), "camera.state", "State of the camera")
        self.state.setMinimumHeight(3 * self.state.fontMetrics().height())
        self.state.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.image = named(PlainLabel(), "camera.image", "Camera image")
        self.image.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.image.setFixedHeight(180)
        self.image.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.restore = push_button(
            "camera.restore",
            "&Restore",
            lambda: self._manager.restore(self.camera),
            accessible="Restore the settings of the calibration or session",
        )
        self.lock = push_button(
            "camera.lock",
            "&Lock",
            self.camera.lock,
            accessible="Lock the settings",
            tip="Fix everything that the camera sets automatically, at its present value",
        )
        buttons = self.lock, self.restore
        for button in buttons:
            button.setAutoDefault(False)  # Enter in a field applies its value and nothing else
        self.locks = QualityTableWidget("camera.lock.quality", "Results of the lock", narrow=True)
        tables = QWidget()
        vbox(heading("Lock"), self.locks, None, of=tables, margins=0)
        area = named(scroll_area(tables), "camera.verdicts", "Lock")
        side = QWidget()
        vbox(self.image, self.state, hbox(*buttons), (area, 1), of=side)
        return side

    # Camera access

    def showEvent(self, event: QShowEvent) -> None:
        """Open the camera."""
        super().showEvent(event)
        if self._stream is None:
            self._manager.changed.connect(self._show_camera)
            self._stream = Stream(CameraSource(self.camera))
            self._stream.start()
            self._tick.start()

    def hideEvent(self, event: QHideEvent) -> None:
        """Release the camera."""
        if self._stream is not None:
            self._manager.changed.disconnect(self._show_camera)
            self._tick.stop()
            self._stream.stop()
            self._stream = None
        super().hideEvent(event)

    def _update(self) -> None:
        if self._stream is None:
            return
        frame = self._stream.newest.take()
        if frame is not None:
            height, smooth = self.image.height(), Qt.TransformationMode.SmoothTransformation
            step = max(1, frame.rgb.shape[0] // height)
            image = pixmap_of(frame.rgb[::step, ::step])
            self.image.setPixmap(image.scaledToHeight(height, smooth))
        self._show_state()

    # Display

    def _show_camera(self) -> None:
        state = self.camera.state
        live = state.phase == "live"
        self.formats.show_format(state.format if live else None, state.offered)
        self.controls.show_controls(state.controls)
        self.controls.setEnabled(live)
        self.lock.setEnabled(live and bool(state.controls))
        self.locks.set_table(lock_quality(state.applied, state.controls))
        differs = bool(self._manager.differs(self.camera)[1])
        self.restore.setEnabled(live and differs and self._manager.can_restore(self.camera))
        self._show_state()

    def _show_state(self) -> None:
        text, role = self._state_text()
        self.state.setText(text)
        show_meaning(self.state, role)

    def _state_text(self) -> tuple[str, str]:
        """Return the state of the camera with the next action, and the colour for it."""
        state = self.camera.state
        if why := self.camera.trouble():
            return why, "fail"
        if state.phase != "live":
            return "Opening the camera. Some cameras take ten seconds.", "text"
        what, clauses = self._manager.differs(self.camera)
        if clauses:
            return f"The settings differ from those for {what}: {'; '.join(clauses)}.", "warn"
        if not state.controls:
            return (
                "This camera cannot be set by other programs. Set and lock it in its "
                "manufacturer's program."
            ), "warn"
        if not is_locked(state.controls):
            return (
                "Some settings of the camera are still automatic. Switch the LEDs on, remove "
                "everything from the sensor, wait until the image is right, then lock."
            ), "warn"
        return "Locked. Close this window and calibrate.", "pass"


def show_camera_dialog(manager: CameraManager, camera: Camera, parent: QWidget) -> CameraDialog:
    """Show the window of a camera as a non-modal window; return it."""
    for other in parent.window().findChildren(CameraDialog):
        if other.camera is camera and other.isVisible():
            other.raise_()
            other.activateWindow()
            return other
    dialog = CameraDialog(manager, camera, parent.window())
    dialog.show()
    return dialog
