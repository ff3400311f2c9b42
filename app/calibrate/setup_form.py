"""The set-up step: what is stated of the sensor, its boards and its balls."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QStandardPaths, QUrl, Signal
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import (
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QScrollArea,
    QSpinBox,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.widgets.label import PlainLabel, plain_tip
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.optics.checkerboard import BoardSpec
from gelpolight_core.session.session import DENSEST_INDEX, SensorData, Session
from gelpolight_core.translation import tr

FORM_WIDTH = 560

DEFAULT_SENSOR = SensorData(
    serial="",
    led_height_mm=14.0,
    elastomer_thickness_mm=14.0,
    elastomer_refractive_index=1.41,
    window_thickness_mm=0.0,
    window_refractive_index=1.49,
    working_diameter_mm=26.0,
)


def new_session(sensor: SensorData = DEFAULT_SENSOR) -> Session:
    """Return the description that a new session starts from; it has no folder yet."""
    return Session(Path(), sensor, BoardSpec((9, 6), 3.0), BoardSpec((9, 6), 2.0), {}, 3.0)


class SetupForm(QScrollArea):
    """The form.

    Signals
    -------
    accepted(object)
        A Session with what is stated; its folder is that of the one shown last.
    camera_wanted()
        The camera shall be set and locked.
    """

    accepted = Signal(object)
    camera_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "setup", tr("Set-up"))
        self.setWidgetResizable(True)
        self._session = new_session()
        inside = QWidget()
        self.setWidget(inside)
        middle = QHBoxLayout(inside)
        column = QVBoxLayout()
        middle.addStretch(1)
        holder = QWidget()
        holder.setLayout(column)
        holder.setMaximumWidth(FORM_WIDTH)
        holder.setMinimumWidth(FORM_WIDTH - 120)
        middle.addWidget(holder)
        middle.addStretch(1)
        self.title = PlainLabel(tr("What is known of the sensor"))
        make_bold(self.title, size=1.35)
        self.task = PlainLabel(
            tr(
                "State it from the housing's drawing and the parts; every length here scales the"
                " result. It can be changed later. Then press the button at the foot."
            )
        )
        self.task.setWordWrap(True)
        column.addWidget(self.title)
        column.addWidget(self.task)
        column.addWidget(self._build_camera())
        column.addWidget(self._build_sensor())
        column.addWidget(self._build_boards())
        column.addWidget(self._build_balls())
        self.problem = named(PlainLabel(), "setup.problem", tr("What is missing"))
        self.problem.setWordWrap(True)
        column.addWidget(self.problem)
        self.accept = named(QPushButton(), "setup.accept", tr("Begin the calibration"))
        self.accept.setMinimumHeight(38)
        self.accept.clicked.connect(self._on_accept)
        column.addWidget(self.accept)
        column.addStretch(1)
        self.show_session(self._session, new=True)

    def _build_camera(self) -> QGroupBox:
        box = QGroupBox(tr("Camera"))
        row = QHBoxLayout(box)
        self.camera = named(PlainLabel(), "setup.camera", tr("How the camera is set"))
        self.camera.setWordWrap(True)
        self.camera_settings = named(
            QPushButton(tr("&Set and lock…")),
            "setup.camera.settings",
            tr("Set and lock the camera"),
            tr(
                "Format, exposure, gain, white balance, focus; and whether the picture stands still"
            ),
        )
        self.camera_settings.clicked.connect(self.camera_wanted)
        row.addWidget(self.camera, 1)
        row.addWidget(self.camera_settings)
        self._camera_row = row
        self.show_camera(tr("No camera is chosen."), "", settable=False)
        return box

    def offer_cameras(self, button: QWidget) -> None:
        """Have the cameras' button in the form, where there is no bar above it that has one."""
        self._camera_row.insertWidget(1, button)

    def show_camera(self, text: str, role: str, *, settable: bool) -> None:
        """Say how the camera is set, and offer to set it where it can be set."""
        self.camera.setText(text)
        show_meaning(self.camera, role)
        self.camera_settings.setEnabled(settable)

    def _build_sensor(self) -> QGroupBox:
        box = QGroupBox(tr("Sensor"))
        form = QFormLayout(box)
        self.serial = named(QLineEdit(), "setup.serial", tr("Serial number"))
        self.serial.setPlaceholderText(tr("such as A-001"))
        self.serial.textChanged.connect(self._check)
        self.led_height = _length("setup.led_height", tr("LED height"), 0.1, 500.0)
        self.thickness = _length("setup.thickness", tr("Elastomer thickness"), 0.0, 500.0)
        self.index = _plain("setup.index", tr("Refractive index of the elastomer"))
        self.window_thickness = _length("setup.window", tr("Window thickness"), 0.0, 100.0)
        self.window_index = _plain("setup.window_index", tr("Refractive index of the window"))
        self.diameter = _length("setup.diameter", tr("Working diameter"), 0.5, 1000.0)
        for label, widget, tip in (
            (tr("Serial number"), self.serial, tr("Names the sensor in every file")),
            (
                tr("LED height"),
                self.led_height,
                tr("From the light-emitting points to the top surface, from the housing's drawing"),
            ),
            (tr("Elastomer thickness"), self.thickness, tr("Clear silicone below the membrane")),
            (tr("Its refractive index"), self.index, tr("Silicone: about 1.41")),
            (
                tr("Window thickness"),
                self.window_thickness,
                tr("Rigid plate under the elastomer; 0 where there is none"),
            ),
            (tr("Its refractive index"), self.window_index, tr("Acrylic: about 1.49")),
            (
                tr("Working diameter"),
                self.diameter,
                tr("The circle on the membrane in which is measured"),
            ),
        ):
            widget.setToolTip(plain_tip(tip))
            form.addRow(label, widget)
        return box

    def _build_boards(self) -> QGroupBox:
        box = QGroupBox(tr("Checkerboards (inner corners: where four squares meet)"))
        form = QFormLayout(box)
        self.lens_board = _BoardRow("setup.lens_board", tr("Lens views"))
        self.top_board = _BoardRow("setup.top_board", tr("Top surface"))
        for row in (self.lens_board, self.top_board):
            row.print.clicked.connect(lambda _=False, row=row: self._save_board(row.board()))
        form.addRow(tr("Lens views"), self.lens_board)
        form.addRow(tr("Top surface"), self.top_board)
        return box

    def _build_balls(self) -> QGroupBox:
        box = QGroupBox(tr("Balls"))
        form = QFormLayout(box)
        self.ball = _length("setup.ball", tr("Radius of the usual ball"), 0.05, 500.0)
        self.ball.setToolTip(tr("The radius, not the diameter; each press can state its own"))
        form.addRow(tr("Usual radius"), self.ball)
        return box

    def show_problem(self, sentence: str) -> None:
        """Say why what is stated could not be taken."""
        self.problem.setText(sentence)
        show_meaning(self.problem, "fail")

    def show_session(self, session: Session, *, new: bool) -> None:
        """Show what is stated of a session; `new`: nothing of it is on disk yet."""
        self._session = session
        sensor = session.sensor
        self.title.setVisible(new)
        self.task.setVisible(new)
        self.serial.setText(sensor.serial)
        self.led_height.setValue(sensor.led_height_mm)
        self.thickness.setValue(sensor.elastomer_thickness_mm)
        self.index.setValue(sensor.elastomer_refractive_index)
        self.window_thickness.setValue(sensor.window_thickness_mm)
        self.window_index.setValue(sensor.window_refractive_index)
        self.diameter.setValue(sensor.working_diameter_mm)
        self.lens_board.show_board(session.checkerboard)
        self.top_board.show_board(session.top_pose)
        self.ball.setValue(session.ball_default_radius_mm or 3.0)
        self.accept.setText(tr("&Begin the calibration") if new else tr("&Take these values"))
        self._check()
        self._known = self.stated()

    @property
    def edited(self) -> bool:
        """Whether it states anything else than when it was filled."""
        return self.stated() != self._known  # not the session: the fields round what they show

    def stated(self) -> Session:
        """Return the session as the form states it."""
        sensor = SensorData(
            serial=self.serial.text().strip(),
            led_height_mm=self.led_height.value(),
            elastomer_thickness_mm=self.thickness.value(),
            elastomer_refractive_index=self.index.value(),
            window_thickness_mm=self.window_thickness.value(),
            window_refractive_index=self.window_index.value(),
            working_diameter_mm=self.diameter.value(),
        )
        return replace(
            self._session,
            sensor=sensor,
            checkerboard=self.lens_board.board(),
            top_pose=self.top_board.board(),
            ball_default_radius_mm=self.ball.value(),
        )

    def _check(self) -> None:
        missing = not self.serial.text().strip()
        self.problem.setText(tr("Give the sensor a serial number to begin.") if missing else "")
        self.accept.setEnabled(not missing)

    def _save_board(self, board: BoardSpec) -> None:
        """Write the page with the stated board where the person says, and show it."""
        from gelpolight_core.export.board_page import write_board  # heavy: it draws

        across, down = board.inner_corners
        usual = Path(f"checkerboard-{across}x{down}-{board.square_mm:g}mm.pdf")
        place = QStandardPaths.StandardLocation.DocumentsLocation
        chosen, _ = QFileDialog.getSaveFileName(
            self,
            tr("Save a checkerboard to print"),
            str(Path(QStandardPaths.writableLocation(place)) / usual),
            tr("PDF (*.pdf)"),
        )
        if not chosen:
            return
        try:
            write_board(board, Path(chosen))
        except InputError as error:
            self.show_problem(str(error))
            return
        shown = QDesktopServices.openUrl(QUrl.fromLocalFile(chosen))
        self.problem.setText("" if shown else tr("Written to {path}").format(path=chosen))
        show_meaning(self.problem, "")

    def _on_accept(self) -> None:
        self.accepted.emit(self.stated())


class _BoardRow(QWidget):
    """Corners and square size of one board."""

    def __init__(self, name: str, accessible: str) -> None:
        super().__init__()
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        self.columns = named(
            QSpinBox(), f"{name}.columns", tr("{b}: corners across").format(b=accessible)
        )
        self.rows = named(QSpinBox(), f"{name}.rows", tr("{b}: corners down").format(b=accessible))
        for box in (self.columns, self.rows):
            box.setRange(3, 100)
        self.square = _length(f"{name}.square", tr("{b}: square").format(b=accessible), 0.05, 500.0)
        row.addWidget(self.columns)
        row.addWidget(PlainLabel("x"))
        row.addWidget(self.rows)
        row.addWidget(PlainLabel(tr("squares of")))
        row.addWidget(self.square, 1)
        self.print = named(
            QToolButton(),
            f"{name}.print",
            tr("{b}: save this board as a page to print").format(b=accessible),
            tr("Save this board as a page to print, A4 at true size; measure it afterwards"),
        )
        self.print.setText(tr("Print…"))
        row.addWidget(self.print)

    def show_board(self, board: BoardSpec) -> None:
        self.columns.setValue(board.inner_corners[0])
        self.rows.setValue(board.inner_corners[1])
        self.square.setValue(board.square_mm)

    def board(self) -> BoardSpec:
        return BoardSpec((self.columns.value(), self.rows.value()), self.square.value())


def _length(name: str, accessible: str, low: float, high: float) -> QDoubleSpinBox:
    box = named(QDoubleSpinBox(), name, tr("{what} in mm").format(what=accessible))
    box.setDecimals(3)
    box.setRange(low, high)
    box.setSingleStep(0.1)
    box.setSuffix(tr(" mm"))
    return box


def _plain(name: str, accessible: str) -> QDoubleSpinBox:
    box = named(QDoubleSpinBox(), name, accessible)
    box.setDecimals(4)
    box.setRange(1.0, DENSEST_INDEX)
    box.setSingleStep(0.01)
    return box
