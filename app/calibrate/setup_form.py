"""The set-up step: data of the sensor, its boards and its balls."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QStandardPaths, QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import (
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QSizePolicy,
    QToolButton,
    QWidget,
)

from app.calibrate.form_page import FormPage, length_box
from app.widgets.folding_row import FoldingRow
from app.widgets.inputs import DoubleSpinBox, SpinBox
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.session import DENSEST_INDEX, SensorData, Session
from gelpolight_core.translation import tr

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
    """Return the default description of a new session; it has no folder yet."""
    return Session(Path(), sensor, BoardSpec((9, 6), 3.0), BoardSpec((9, 6), 2.0), {}, 3.0)


class SetupForm(FormPage):
    """The form with the data of a sensor that can be opened."""

    def __init__(self) -> None:
        self._session = new_session()
        super().__init__(
            tr("Sensor data"),
            tr(
                "Enter the values from the drawing of the housing and the data sheets of the "
                "parts. Every length here scales the result. You can change the values later. "
                "Then click the button at the bottom."
            ),
        )
        self.first = self.led_height
        self.show_session(self._session, new=True)

    def groups(self) -> tuple[QWidget, ...]:
        """Create the groups of the form."""
        return self._build_sensor(), self._build_boards(), self._build_balls()

    def _build_sensor(self) -> QGroupBox:
        box = QGroupBox(tr("Sensor"))
        form = QFormLayout(box)
        self.led_height = length_box("setup.led_height", tr("LED height"), 0.1, 500.0)
        self.thickness = length_box("setup.thickness", tr("Elastomer thickness"), 0.0, 500.0)
        self.index = _plain("setup.index", tr("Refractive index of the elastomer"))
        self.window_thickness = length_box("setup.window", tr("Window thickness"), 0.0, 100.0)
        self.window_index = _plain("setup.window_index", tr("Refractive index of the window"))
        self.diameter = length_box("setup.diameter", tr("Working diameter"), 0.5, 1000.0)
        for label, widget, tip in (
            (tr("Serial number"), self.serial, tr("Identifies the sensor in every file")),
            (tr("Elastomer"), self.elastomer, self.elastomer.toolTip()),
            (
                tr("LED height"),
                self.led_height,
                tr(
                    "From the light-emitting points of the LEDs to the top surface; see the "
                    "drawing of the housing"
                ),
            ),
            (
                tr("Elastomer thickness"),
                self.thickness,
                tr("Layer of clear silicone below the membrane"),
            ),
            (tr("Elastomer refractive index"), self.index, tr("Silicone: about 1.41")),
            (
                tr("Window thickness"),
                self.window_thickness,
                tr("Rigid plate below the elastomer; 0 if there is none"),
            ),
            (tr("Window refractive index"), self.window_index, tr("Acrylic: about 1.49")),
            (
                tr("Working diameter"),
                self.diameter,
                tr("Diameter of the circle on the membrane in which the sensor measures"),
            ),
        ):
            widget.setToolTip(plain_tip(tip))
            form.addRow(label, widget)
        return box

    def _build_boards(self) -> QGroupBox:
        box = QGroupBox(tr("Checkerboards (count inner corners)"))
        form = QFormLayout(box)
        form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.WrapLongRows)
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
        self.ball = length_box("setup.ball", tr("Default ball diameter"), 0.1, 1000.0)
        self.ball.setToolTip(tr("Diameter measured with a calliper; each press can have its own"))
        form.addRow(tr("Default diameter"), self.ball)
        return box

    def fill(self, session: Session) -> None:
        """Show the values of a session."""
        self._session = session
        sensor = session.sensor
        self.serial.setText(sensor.serial)
        self.elastomer.setText(session.elastomer)
        self.led_height.setValue(sensor.led_height_mm)
        self.thickness.setValue(sensor.elastomer_thickness_mm)
        self.index.setValue(sensor.elastomer_refractive_index)
        self.window_thickness.setValue(sensor.window_thickness_mm)
        self.window_index.setValue(sensor.window_refractive_index)
        self.diameter.setValue(sensor.working_diameter_mm)
        self.lens_board.show_board(session.checkerboard)
        self.top_board.show_board(session.top_pose)
        self.ball.setValue(2.0 * (session.ball_default_radius_mm or 3.0))

    def stated(self) -> Session:
        """Return the session with the values of the form."""
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
            ball_default_radius_mm=0.5 * self.ball.value(),
            elastomer=self.elastomer.text().strip(),
        )

    def _save_board(self, board: BoardSpec) -> None:
        """Save a page with the board where the user chooses, and open it."""
        from gelpolight_core.export.board_page import write_board  # slow to import

        across, down = board.inner_corners
        usual = Path(f"checkerboard-{across}x{down}-{board.square_mm:g}mm.pdf")
        documents = QStandardPaths.StandardLocation.DocumentsLocation
        chosen, _ = QFileDialog.getSaveFileName(
            self,
            tr("Save a checkerboard to print"),
            str(Path(QStandardPaths.writableLocation(documents)) / usual),
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
        self.problem.setText("" if shown else tr("Saved as {path}").format(path=chosen))
        show_meaning(self.problem, "")


class _BoardRow(FoldingRow):
    """Corner counts and square size of one board."""

    def __init__(self, name: str, accessible: str) -> None:
        self.columns = named(
            SpinBox(),
            f"{name}.columns",
            tr("{b}: inner corners horizontally").format(b=accessible),
        )
        self.rows = named(
            SpinBox(), f"{name}.rows", tr("{b}: inner corners vertically").format(b=accessible)
        )
        for box in (self.columns, self.rows):
            box.setRange(3, 100)
            box.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.square = length_box(
            f"{name}.square", tr("{b}: square size").format(b=accessible), 0.05, 500.0
        )
        self.print = named(
            QToolButton(),
            f"{name}.print",
            tr("{b}: save this board as a page to print").format(b=accessible),
            tr(
                "Save this board as an A4 page to print at 100 % scale; measure the squares after "
                "printing"
            ),
        )
        self.print.setText(tr("Print…"))
        super().__init__(
            _beside(self.columns, PlainLabel("x"), self.rows),
            _beside(PlainLabel(tr("squares of")), self.square, self.print),
        )

    def show_board(self, board: BoardSpec) -> None:
        self.columns.setValue(board.inner_corners[0])
        self.rows.setValue(board.inner_corners[1])
        self.square.setValue(board.square_mm)

    def board(self) -> BoardSpec:
        return BoardSpec((self.columns.value(), self.rows.value()), self.square.value())


def _beside(*widgets: QWidget) -> QWidget:
    """Return widgets in a row; number fields use the remaining width."""
    part = QWidget()
    row = QHBoxLayout(part)
    row.setContentsMargins(0, 0, 0, 0)
    for widget in widgets:
        row.addWidget(widget, int(isinstance(widget, QDoubleSpinBox)))
    row.addStretch()
    return part


def _plain(name: str, accessible: str) -> QDoubleSpinBox:
    box = named(DoubleSpinBox(), name, accessible)
    box.setDecimals(4)
    box.setRange(1.0, DENSEST_INDEX)
    box.setSingleStep(0.01)
    return box
