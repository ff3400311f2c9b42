"""The page of a set-up form: camera, groups of values, and the button that applies them."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QDoubleSpinBox,
    QGroupBox,
    QLineEdit,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from app.widgets.inputs import DoubleSpinBox
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.calibration.manifest import REMARK_LENGTH
from gelpolight_core.translation import tr

FORM_WIDTH, LEAST_WIDTH = 640, 320


class FormPage(QScrollArea):
    """A form for the description of a session. A form supplies its groups and their values.

    Parameters
    ----------
    title, task : str
        Shown above the groups for a new session.

    Signals
    -------
    accepted(object)
        The session with the entered values, in the folder of the session shown last.
    """

    accepted = Signal(object)

    def __init__(self, title: str, task: str) -> None:
        super().__init__()
        named(self, "setup", tr("Set-up"))
        self.setWidgetResizable(True)
        inside = QWidget()
        self.setWidget(inside)
        column = QVBoxLayout()
        holder = QWidget()
        holder.setLayout(column)
        holder.setMaximumWidth(FORM_WIDTH)
        holder.setMinimumWidth(LEAST_WIDTH)
        hbox(None, holder, None, of=inside)
        self._title, self._task = PlainLabel(title), PlainLabel(task)
        make_bold(self._title, size=1.35)
        self._task.setWordWrap(True)
        column.addWidget(self._title)
        column.addWidget(self._task)
        column.addWidget(self._build_camera())
        self.serial = named(QLineEdit(), "setup.serial", tr("Serial number"))
        self.serial.setPlaceholderText(tr("for example A-001"))
        self.elastomer = named(
            QLineEdit(), "setup.elastomer", tr("Name or serial number of the elastomer"),
            tr("Tells elastomers apart: the presses are counted for each. May be empty"),
        )  # fmt: skip
        self.elastomer.setMaxLength(REMARK_LENGTH)
        self.elastomer.setPlaceholderText(tr("for example gel 7"))
        for group in self.groups():
            column.addWidget(group)
        self.serial.textChanged.connect(self._check)
        self.problem = named(PlainLabel(), "setup.problem", tr("What is missing"))
        self.problem.setWordWrap(True)
        column.addWidget(self.problem)
        self.accept = named(QPushButton(), "setup.accept", tr("Start the calibration"))
        self.accept.setMinimumHeight(38)
        self.accept.clicked.connect(lambda: self.accepted.emit(self.stated()))
        column.addWidget(self.accept)
        column.addStretch(1)

    # Supplied by the form

    def groups(self) -> tuple[QWidget, ...]:
        """Create the groups of the form."""
        raise NotImplementedError

    def fill(self, session: Any) -> None:
        """Show the values of a session."""
        raise NotImplementedError

    def stated(self) -> Any:
        """Return the session with the values of the form."""
        raise NotImplementedError

    # The page

    def show_session(self, session: Any, *, new: bool) -> None:
        """Show the values of a session; `new`: the session is not on disk yet."""
        self._title.setVisible(new)
        self._task.setVisible(new)
        self.fill(session)
        self.accept.setText(tr("&Start the calibration") if new else tr("&Apply these values"))
        self._check()
        # The values of the fields, not of the session: the fields round them.
        self._known = self.stated()

    @property
    def edited(self) -> bool:
        """Whether the user has changed a value since the form was filled."""
        return bool(self.stated() != self._known)

    def show_problem(self, sentence: str) -> None:
        """Show why the entered values were not applied."""
        self.problem.setText(sentence)
        show_meaning(self.problem, "fail")

    def _check(self) -> None:
        missing = not self.serial.text().strip()
        self.problem.setText(tr("Enter a serial number for the sensor.") if missing else "")
        self.accept.setEnabled(not missing)

    def _build_camera(self) -> QGroupBox:
        box = QGroupBox(tr("Camera"))
        self.camera = named(PlainLabel(), "setup.camera", tr("Camera state"))
        self.camera.setWordWrap(True)
        self.camera_settings = named(
            QPushButton(tr("&Set and lock…")),
            "setup.camera.settings",
            tr("Set and lock the camera"),
            tr("Format, exposure, gain, white balance, focus, and a test of the image stability"),
        )
        row = hbox((self.camera, 1), self.camera_settings, of=box)
        self._camera_row = row
        self.show_camera(tr("No camera is selected."), "", settable=False)
        return box

    def offer_cameras(self, button: QWidget) -> None:
        """Add the camera selection to the form, for pages without a bar that has one."""
        self._camera_row.insertWidget(1, button)

    def show_camera(self, text: str, role: str, *, settable: bool) -> None:
        """Show how the camera is set; enable the settings button if it can be set."""
        self.camera.setText(text)
        show_meaning(self.camera, role)
        self.camera_settings.setEnabled(settable)


def length_box(name: str, accessible: str, low: float, high: float) -> QDoubleSpinBox:
    """Return an input for a length in mm."""
    box = named(DoubleSpinBox(), name, tr("{what} in mm").format(what=accessible))
    box.setDecimals(3)
    box.setRange(low, high)
    box.setSingleStep(0.1)
    box.setSuffix(tr(" mm"))
    return box
