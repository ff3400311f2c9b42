"""The set-up step: data of the sensor, its boards and its balls."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
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

from app.calibrate.form_page import USUAL_RADIUS_MM, FormPage, Values, length_box
from app.widgets.fields import number
from app.widgets.folding_row import FoldingRow
from app.widgets.inputs import SpinBox
from app.widgets.label import PlainLabel
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.session import DENSEST_INDEX, SensorData, Session
from gelpolight_core.translation import tr

MM = tr(" mm")


@dataclass(frozen=True)
class SensorValues(Values):
    """What is known about a sensor that can be opened, as in :class:`SensorData`."""

    led_height_mm: float = number(
        14.0,
        tr("LED height"),
        0.1,
        500.0,
        MM,
        3,
        step=0.1,
        tip=tr(
            "From the light-emitting points of the LEDs to the top surface; see the drawing of the "
            "housing"
        ),
    )
    elastomer_thickness_mm: float = number(
        14.0,
        tr("Elastomer thickness"),
        0.0,
        500.0,
        MM,
        3,
        step=0.1,
        tip=tr("Layer of clear silicone below the membrane"),
    )
    elastomer_refractive_index: float = number(
        1.41,
        tr("Elastomer refractive index"),
        1.0,
        DENSEST_INDEX,
        decimals=4,
        step=0.01,
        tip=tr("Silicone: about 1.41"),
    )
    window_thickness_mm: float = number(
        0.0,
        tr("Window thickness"),
        0.0,
        100.0,
        MM,
        3,
        step=0.1,
        tip=tr("Rigid plate below the elastomer; 0 if there is none"),
    )
    window_refractive_index: float = number(
        1.49,
        tr("Window refractive index"),
        1.0,
        DENSEST_INDEX,
        decimals=4,
        step=0.01,
        tip=tr("Acrylic: about 1.49"),
    )
    working_diameter_mm: float = number(
        26.0,
        tr("Working diameter"),
        0.5,
        1000.0,
        MM,
        3,
        step=0.1,
        tip=tr("Diameter of the circle on the membrane in which the sensor measures"),
    )

    def sensor(self) -> SensorData:
        """Return the data of the sensor."""
        return SensorData(**{f.name: getattr(self, f.name) for f in fields(SensorData)})


def new_session(sensor: SensorData | None = None) -> Session:
    """Return the default description of a new session; it has no folder yet."""
    boards = BoardSpec((9, 6), 3.0), BoardSpec((9, 6), 2.0)
    return Session(Path(), sensor or SensorValues().sensor(), *boards, {}, USUAL_RADIUS_MM)


class SetupForm(FormPage):
    """The form with the data of a sensor that can be opened."""

    def __init__(self) -> None:
        boards = QGroupBox(tr("Checkerboards (count inner corners)"))
        form = QFormLayout(boards, rowWrapPolicy=QFormLayout.RowWrapPolicy.WrapLongRows)
        self.lens_board = _BoardRow("setup.lens_board", tr("Lens views"))
        self.top_board = _BoardRow("setup.top_board", tr("Top surface"))
        for row in (self.lens_board, self.top_board):
            row.print.clicked.connect(lambda _=False, row=row: self._save_board(row.board()))
        form.addRow(tr("Lens views"), self.lens_board)
        form.addRow(tr("Top surface"), self.top_board)
        super().__init__(
            tr("Sensor data"),
            tr(
                "Enter the values from the drawing of the housing and the data sheets of the "
                "parts. Every length here scales the result. You can change the values later. "
                "Then click the button at the bottom."
            ),
            new_session(),
            SensorValues(),
            boards,
        )
        self.first = self.values.inputs["led_height_mm"]

    def values_of(self, session: Session) -> SensorValues:
        """Return the data of the sensor, and show the boards."""
        self.lens_board.show_board(session.checkerboard)
        self.top_board.show_board(session.top_pose)
        return SensorValues(elastomer=session.elastomer, **asdict(session.sensor))

    def session_of(self, values: SensorValues) -> Session:
        """Return the session with this sensor and the boards."""
        lens, top = self.lens_board.board(), self.top_board.board()
        return replace(self.session, sensor=values.sensor(), checkerboard=lens, top_pose=top)

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
