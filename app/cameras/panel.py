"""How a camera is set: format, settings, lock, and whether it stands still."""

from __future__ import annotations

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QImage, QPixmap
from PySide6.QtWidgets import (
    QFrame,
    QGroupBox,
    QHBoxLayout,
    QProgressBar,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from app.cameras.control_rows import ControlRows
from app.cameras.desk import CameraDesk
from app.cameras.format_rows import FormatRows
from app.sources.camera.applying import is_locked, lock_quality
from app.sources.camera.camera import Camera
from app.sources.camera.camera_source import CameraSource
from app.sources.camera.steadiness import SteadinessTest
from app.sources.source import Rgb, Setting
from app.sources.stream import Stream
from app.widgets.label import PlainLabel
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from app.widgets.quality_table import QualityTableWidget
from gelpolight_core.quality import QualityTable, Verdict
from gelpolight_core.translation import tr

LOOK_MS = 200
PICTURE_HEIGHT = 180


class CameraPanel(QWidget):
    """Shows a camera and sets it; keeps it open while it is watched.

    Parameters
    ----------
    desk : CameraDesk
        Sets cameras and remembers it.
    camera : Camera
        The one that is shown.
    """

    def __init__(self, desk: CameraDesk, camera: Camera, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "camera.panel", tr("Settings of the camera"))
        self._desk, self.camera = desk, camera
        self._stream: Stream | None = None
        self._test: SteadinessTest | None = None
        self._broken_off = False
        self._result, self._result_of = QualityTable(), tuple[Setting, ...]()
        self._tick = QTimer(self)
        self._tick.setInterval(LOOK_MS)
        self._tick.timeout.connect(self._look)
        self.formats, self.controls = FormatRows(), ControlRows()
        row = QHBoxLayout(self)
        row.addWidget(self._build_settings(), 1)
        row.addWidget(self._build_verdicts(), 1)
        self.formats.chosen.connect(lambda chosen: desk.choose_format(camera, chosen))
        self.controls.changed.connect(lambda key, value: desk.set(camera, {key: value}))
        self.lock.clicked.connect(lambda: desk.lock(camera))
        self.test.clicked.connect(self._begin_test)
        self.restore.clicked.connect(lambda: desk.restore(camera))
        self._show()

    def _build_settings(self) -> QWidget:
        formats, controls = QGroupBox(tr("Pictures")), QGroupBox(tr("Settings"))
        QVBoxLayout(formats).addWidget(self.formats)
        QVBoxLayout(controls).addWidget(self.controls)
        inside = QWidget()
        column = QVBoxLayout(inside)
        column.addWidget(formats)
        column.addWidget(controls)
        column.addStretch(1)
        area = named(QScrollArea(), "camera.settings", tr("Format and settings"))
        area.setWidgetResizable(True)
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setWidget(inside)
        return area

    def _build_verdicts(self) -> QWidget:
        self.said = named(PlainLabel(), "camera.said", tr("How the camera is"))
        self.said.setWordWrap(True)
        self.said.setMinimumHeight(3 * self.said.fontMetrics().height())
        self.said.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.picture = named(PlainLabel(), "camera.picture", tr("The camera's picture"))
        self.picture.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.picture.setFixedHeight(PICTURE_HEIGHT)
        self.picture.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.restore = named(
            QPushButton(tr("Set it &back")),
            "camera.restore",
            tr("Set it as it was for the calibration or the session"),
        )
        self.lock = named(
            QPushButton(tr("&Lock")),
            "camera.lock",
            tr("Lock the settings"),
            tr("Fix everything that the camera sets by itself, at what it is now"),
        )
        self.test = named(
            QPushButton(tr("&Test steadiness")),
            "camera.test",
            tr("Test whether the picture stands still"),
            tr("Watch the picture for some seconds; leave the sensor alone meanwhile"),
        )
        self.bar = named(QProgressBar(), "camera.test.progress", tr("Progress of the test"))
        self.bar.setTextVisible(False)
        buttons = QHBoxLayout()
        for button in (self.lock, self.test, self.restore):
            button.setAutoDefault(False)  # Enter in a field takes its value, and nothing else
            buttons.addWidget(button)
        self.locks = QualityTableWidget("camera.lock.quality", tr("What was locked"), narrow=True)
        self.steady = QualityTableWidget("camera.test.quality", tr("Steadiness"), narrow=True)
        tables = QWidget()
        column = QVBoxLayout(tables)
        column.setContentsMargins(0, 0, 0, 0)
        for title, table in ((tr("Lock"), self.locks), (tr("Steadiness"), self.steady)):
            heading = PlainLabel(title)
            make_bold(heading)
            column.addWidget(heading)
            column.addWidget(table)
        column.addStretch(1)
        area = named(QScrollArea(), "camera.verdicts", tr("Lock and steadiness"))
        area.setWidgetResizable(True)
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setWidget(tables)
        side = QWidget()
        whole = QVBoxLayout(side)
        whole.addWidget(self.picture)
        whole.addWidget(self.said)
        whole.addLayout(buttons)
        whole.addWidget(self.bar)
        whole.addWidget(area, 1)
        return side

    # The camera

    def watch(self, on: bool) -> None:
        """Keep the camera open, or let it go."""
        if on == (self._stream is not None):
            return
        if on:
            self._desk.changed.connect(self._show)
            self._stream = Stream(CameraSource(self.camera))
            self._stream.start()
            self._tick.start()
            return
        self._desk.changed.disconnect(self._show)
        self._tick.stop()
        assert self._stream is not None
        self._stream.stop()
        self._stream, self._test = None, None

    def _look(self) -> None:
        if self._stream is None:
            return
        frame = self._stream.newest.take()
        if frame is not None:
            self.picture.setPixmap(_small(frame.rgb, self.picture.height()))
        if self._test is not None:
            self._follow_test(self._test)
        self._say()

    def _begin_test(self) -> None:
        assert self._stream is not None
        got, self._broken_off = self.camera.state.format, False
        self._test = SteadinessTest(0.0 if got is None else got.rate_hz)
        self._stream.add_tap(self._test.take)
        self.test.setEnabled(False)

    def _follow_test(self, test: SteadinessTest) -> None:
        """Show how far the test is; one whose camera went away has come to nothing."""
        self.bar.setValue(round(100 * test.share))
        done = test.share >= 1.0
        if not done and not self.camera.trouble():
            return
        if self._stream is not None:
            self._stream.remove_tap(test.take)
        self._test, self._broken_off = None, not done
        self._result = test.result() if done else QualityTable()
        self._result_of = self.camera.state.controls
        self.bar.setValue(0)
        self._show()

    # What is shown

    def _show(self) -> None:
        state = self.camera.state
        live = state.phase == "live"
        self.formats.show_format(state.format if live else None, state.offered)
        self.controls.show_controls(state.controls)
        self.controls.setEnabled(live)
        self.lock.setEnabled(live and bool(state.controls))
        self.test.setEnabled(live and self._test is None)
        self.locks.set_table(lock_quality(state.applied, state.controls))
        if state.controls != self._result_of:
            self._result = QualityTable()  # of a camera that was set otherwise
        self.steady.set_table(self._result)
        differs = bool(self._desk.differs(self.camera)[1])
        self.restore.setEnabled(live and differs and self._desk.can_restore(self.camera))
        self._say()

    def _say(self) -> None:
        text, role = self._words()
        self.said.setText(text)
        show_meaning(self.said, role)

    def _words(self) -> tuple[str, str]:
        """Return how the camera is and what to do next, and in which colour."""
        state = self.camera.state
        if why := self.camera.trouble():
            return why, "fail"
        if state.phase != "live":
            return tr("The camera is being opened; some take ten seconds."), "text"
        what, clauses = self._desk.differs(self.camera)
        if clauses:
            text = tr("Not set as it was for {what}: {how}.")
            return text.format(what=what, how="; ".join(clauses)), "warn"
        if not state.controls:
            return tr(
                "The system lets no program set this camera: set it in its maker's program, then"
                " test whether it stands still."
            ), "warn"
        if not is_locked(state.controls):
            return tr(
                "The camera still sets some things by itself. With the LEDs on and nothing on the"
                " sensor, wait until the picture is right, then lock."
            ), "warn"
        if self._test is not None:
            return tr("The picture is being watched: leave the sensor alone."), "text"
        if self._broken_off:
            return tr("The test was broken off, as no pictures came. Test again."), "warn"
        if self._result.figures:
            return self._verdict_words()
        return tr("Locked. Test whether the picture stands still, then close this."), "pass"

    def _verdict_words(self) -> tuple[str, str]:
        verdict = self._result.verdict
        if verdict is Verdict.PASS:
            return tr("Locked, and the picture stands still: close this and calibrate."), "pass"
        text = tr("Not steady yet: {advice}.")
        return text.format(advice="; ".join(self._result.advice)), verdict.value


def _small(rgb: Rgb, height: int) -> QPixmap:
    """Return a picture made small enough to be looked at, without copying all of it."""
    step = max(1, rgb.shape[0] // height)
    part = rgb[::step, ::step]
    part = (part if part.dtype.itemsize == 1 else part >> 8).astype("uint8", order="C")
    image = QImage(
        part.data, part.shape[1], part.shape[0], 3 * part.shape[1], QImage.Format.Format_RGB888
    )
    kept = QPixmap.fromImage(image)
    return kept.scaledToHeight(height, Qt.TransformationMode.SmoothTransformation)
