"""The window of a camera: format, settings, and lock, next to the page that shows its image."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QSizePolicy,
    QWidget,
)

from app.program.camera_manager import CameraManager
from app.sources.camera_drivers.camera_source import CameraSource
from app.sources.camera_drivers.camera_state import is_locked, lock_quality
from app.sources.camera_drivers.driver import CameraFormat, compression_warning
from app.sources.camera_drivers.shared_camera import SharedCamera
from app.sources.source import SourceSetting
from app.sources.stream import Stream
from app.widgets.actions import push_button
from app.widgets.dialog import Dialog, Kinds
from app.widgets.icons import pixmap_of
from app.widgets.inputs import ComboBox, NumberField
from app.widgets.label import plain_tip
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.quality_table import QualityTableWidget
from app.widgets.text_roles import heading, named_label, set_text_role
from app.widgets.timers import timer
from app.widgets.widget_names import set_names
from gelpolight_core.session.camera_controls import CONTROLS

MAINS_HZ = (0.0, 50.0, 60.0)


class ControlRows(QWidget):
    """The settings of a camera, in the order in which they are applied.

    Signals
    -------
    changed(str, float)
        The user chose a value for a setting.
    """

    changed = Signal(str, float)

    def __init__(self) -> None:
        super().__init__()
        set_names(self, "camera.controls", "Camera settings")
        self._form = QFormLayout(self)
        self._form.setContentsMargins(0, 0, 0, 0)
        self._keys: tuple[str, ...] = ()
        self._show: dict[str, Callable[[SourceSetting], None]] = {}

    def show_controls(self, controls: Sequence[SourceSetting]) -> None:
        """Show the settings that a camera reports, except in a field that the user is editing."""
        keys = tuple(control.key for control in controls)
        if keys != self._keys:
            self._keys = keys
            self._build(controls)
        for control in controls:
            self._show[control.key](control)

    def _build(self, controls: Sequence[SourceSetting]) -> None:
        while self._form.rowCount():
            self._form.removeRow(0)
        self._show.clear()
        by_key = {control.key: control for control in controls}
        switches = {CONTROLS[key].automatic for key in by_key} & set(by_key)
        for key, control in by_key.items():
            if key in switches:
                continue
            row = QHBoxLayout()
            row.addWidget(self._field(control), 1)
            automatic = CONTROLS[key].automatic
            if automatic in by_key:
                row.addWidget(self._switch(automatic, by_key[automatic].label, "Automatic"))
            label = "" if CONTROLS[key].switch else control.label
            self._form.addRow(label, row)

    def _field(self, control: SourceSetting) -> QWidget:
        if CONTROLS[control.key].switch:
            return self._switch(control.key, control.label, control.label)
        if control.key == "power_line_hz":
            return self._mains(control)
        return self._number(control)

    def _switch(self, key: str, accessible: str, text: str) -> QCheckBox:
        box = set_names(QCheckBox(text), f"camera.{key}", accessible)
        box.clicked.connect(lambda on: self.changed.emit(key, float(on)))

        def show(control: SourceSetting) -> None:
            box.setChecked(bool(control.value))
            box.setEnabled(control.writable)

        self._show[key] = show
        return box

    def _mains(self, control: SourceSetting) -> QComboBox:
        box = set_names(ComboBox(), "camera.power_line_hz", control.label)
        box.offer((f"{hz:g} Hz" if hz else "Off", hz) for hz in MAINS_HZ)
        box.activated.connect(lambda _: self.changed.emit("power_line_hz", box.currentData()))
        self._show["power_line_hz"] = lambda c: box.setCurrentIndex(
            MAINS_HZ.index(c.value) if c.value in MAINS_HZ else 0
        )
        return box

    def _number(self, control: SourceSetting) -> NumberField:
        step = control.step or 0.1
        box = NumberField(decimals=0 if step == round(step) else 1)
        set_names(box, f"camera.{control.key}", control.label)
        box.setSingleStep(step)
        box.setRange(control.low, control.high)
        box.setSuffix(f" {control.unit}" if control.unit else "")
        tip = f"From {control.low:g} to {control.high:g} {control.unit}"
        box.setToolTip(plain_tip(tip.rstrip()))
        box.valueChanged.connect(lambda value: self.changed.emit(control.key, value))

        def show(now: SourceSetting) -> None:
            box.setEnabled(now.writable)
            with QSignalBlocker(box):
                box.setValue(now.value)

        self._show[control.key] = show
        return box


class FormatRows(QWidget):
    """Choice of format, size and rate. Each list offers what the ones before it allow.

    Signals
    -------
    chosen(object)
        The user chose a Format.
    """

    chosen = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        set_names(self, "camera.formats", "Image format")
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        self._offered: tuple[CameraFormat, ...] = ()
        self._code = set_names(ComboBox(), "camera.format", "Format")
        self._size = set_names(ComboBox(), "camera.size", "Image size")
        self._rate = set_names(ComboBox(), "camera.rate", "Images per second")
        for label, box in (
            ("Format", self._code),
            ("Size", self._size),
            ("Rate", self._rate),
        ):
            form.addRow(label, box)
            box.activated.connect(lambda _, box=box: self._on_chosen(box))
        self.warning = named_label(
            "camera.compressed", "Drawback of the format", wrap=False, role="warn"
        )
        self.warning.setWordWrap(True)
        form.addRow(self.warning)
        self.show_format(None, ())

    def show_format(self, got: CameraFormat | None, offered: tuple[CameraFormat, ...]) -> None:
        """Show the present format among those that the camera lists."""
        self._offered = offered or (() if got is None else (got,))
        self.setEnabled(got is not None)
        if got is not None:
            self._fill(got)
        warning = "" if got is None else compression_warning(got, offered)
        if got is not None and not offered:
            warning = f"The system does not report the formats of this camera. {warning}"
        self.warning.setText(warning.strip())
        self.warning.setVisible(bool(warning))

    def _fill(self, got: CameraFormat) -> None:
        codes = dict.fromkeys(f.code for f in (*self._offered, got))
        sizes = sorted(
            {(f.width, f.height) for f in self._of(got.code)} | {(got.width, got.height)}
        )
        rates = sorted({f.rate_hz for f in self._of(got.code, got.width)} | {got.rate_hz})
        kinds = {code: CameraFormat(code, 0, 0, 0.0).compressed for code in codes}
        words = {True: "compressed", False: "uncompressed"}
        _fill(self._code, {f"{c} ({words[kinds[c]]})": c for c in codes}, got.code)
        _fill(
            self._size,
            {f"{w} x {h} pixels": (w, h) for w, h in sizes},
            (got.width, got.height),
        )
        _fill(self._rate, {f"{hz:g} images/s": hz for hz in rates}, got.rate_hz)

    def _of(self, code: str, width: int = 0) -> list[CameraFormat]:
        return [f for f in self._offered if f.code == code and width in (0, f.width)]

    def _on_chosen(self, box: QComboBox) -> None:
        """Choose the format nearest to the three selections, above all to the last change."""
        code, (width, height), rate = (
            b.currentData() for b in (self._code, self._size, self._rate)
        )

        def agrees(f: CameraFormat) -> tuple[bool, bool, float]:
            same = f.code == code, (f.width, f.height) == (width, height)
            first, second = reversed(same) if box is self._size else same
            return first, second, -abs(f.rate_hz - rate)

        self.chosen.emit(max(self._offered, key=agrees))


def _fill(box: QComboBox, items: dict[str, object], current: object) -> None:
    """Offer items and select the current one, without emitting a signal."""
    if [box.itemText(row) for row in range(box.count())] != list(items):
        box.clear()
        for text, value in items.items():
            box.addItem(text, value)
    box.setCurrentIndex(list(items.values()).index(current))
    box.setEnabled(len(items) > 1)


class CameraDialog(Dialog):
    """Shows a camera and changes its settings. The camera is open while the dialog is visible.

    Parameters
    ----------
    manager : CameraManager
        Manages the cameras and their settings.
    camera : SharedCamera
        The camera to show.
    """

    def __init__(
        self, manager: CameraManager, camera: SharedCamera, parent: QWidget | None = None
    ) -> None:
        title = f"Camera settings: {camera.device.name}"
        super().__init__(parent, "camera", title, once=True)
        self._manager, self.camera = manager, camera
        self._stream: Stream | None = None
        self._tick = timer(self, 200, self._update)
        self.formats, self.controls = FormatRows(), ControlRows()
        close = "Close the camera settings"
        set_names(self.buttons.button(Kinds.Close), "camera.close", close)
        inside = set_names(QWidget(), "camera.panel", "Camera settings")
        hbox((self._build_settings(), 1), (self._build_verdicts(), 1), of=inside)
        self.fill((inside, 1))
        self.resize(860, 690)
        self.formats.chosen.connect(partial(manager.choose_format, camera))
        self.controls.changed.connect(lambda key, value: manager.set(camera, {key: value}))
        self._show_camera()

    def _build_settings(self) -> QWidget:
        formats, controls = QGroupBox("Image"), QGroupBox("Settings")
        vbox(self.formats, of=formats)
        vbox(self.controls, of=controls)
        inside = QWidget()
        vbox(formats, controls, None, of=inside)
        return set_names(scroll_area(inside), "camera.settings", "Format and settings")

    def _build_verdicts(self) -> QWidget:
        self.state = named_label("camera.state", "State of the camera")
        self.state.setMinimumHeight(3 * self.state.fontMetrics().height())
        self.state.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.image = named_label("camera.image", "Camera image", wrap=False)
        self.image.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.image.setFixedHeight(180)
        self.image.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.restore = push_button(
            "camera.restore",
            "&Restore",
            lambda: self._manager.restore_reference(self.camera),
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
        area = set_names(scroll_area(tables), "camera.verdicts", "Lock")
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
        set_text_role(self.state, role)

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


def show_camera_dialog(
    manager: CameraManager, camera: SharedCamera, parent: QWidget
) -> CameraDialog:
    """Show the settings of a camera in a non-modal window, and return the window."""
    for other in parent.window().findChildren(CameraDialog):
        if other.camera is camera and other.isVisible():
            other.raise_()
            other.activateWindow()
            return other
    dialog = CameraDialog(manager, camera, parent.window())
    dialog.show()
    return dialog
