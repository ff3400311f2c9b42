"""The page of a set-up form: camera, groups of values, and the button that applies them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QDoubleSpinBox,
    QFormLayout,
    QGroupBox,
    QPushButton,
    QScrollArea,
    QWidget,
)

from app.widgets.fields import text
from app.widgets.forms import Form
from app.widgets.inputs import DoubleSpinBox
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.calibration.manifest import REMARK_LENGTH
from gelpolight_core.translation import tr

USUAL_RADIUS_MM = 3.0


@dataclass(frozen=True)
class Values:
    """What is known about every sensor."""

    serial: str = text(
        "",
        tr("Serial number"),
        tr("Identifies the sensor in every file"),
        example=tr("for example A-001"),
    )
    elastomer: str = text(
        "",
        tr("Elastomer"),
        tr("Tells elastomers apart: the presses are counted for each. May be empty"),
        example=tr("for example gel 7"),
        length=REMARK_LENGTH,
    )


class FormPage(QScrollArea):
    """A form for the description of a session. A form supplies its values.

    Parameters
    ----------
    title, task : str
        Shown above the groups for a new session.
    session : Session
        The new session.
    values : Values
        With the fields of the form.
    *groups : QWidget
        Other groups.

    Signals
    -------
    accepted(object)
        The session with the entered values, in the folder of the session shown last.
    """

    accepted = Signal(object)

    def __init__(
        self, title: str, task: str, session: Any, values: Values, *groups: QWidget
    ) -> None:
        super().__init__()
        named(self, "setup", tr("Set-up"))
        self.setWidgetResizable(True)
        inside, holder = QWidget(), QWidget(maximumWidth=640, minimumWidth=320)
        self.setWidget(inside)
        hbox(None, holder, None, of=inside)
        self._title, self._task = PlainLabel(title), PlainLabel(task, wrap=True)
        make_bold(self._title, size=1.35)
        self.values = Form(values, "setup", at_once=True)
        self.values.changed.connect(self._check)
        self.serial = self.values.inputs["serial"]
        sensor, balls = QGroupBox(tr("Sensor")), QGroupBox(tr("Balls"))
        vbox(self.values, of=sensor)
        self.ball = length_box("setup.ball", tr("Default ball diameter"), 0.1, 1000.0)
        self.ball.setToolTip(tr("Diameter measured with a calliper; each press can have its own"))
        QFormLayout(balls).addRow(tr("Default diameter"), self.ball)
        self.problem = named(PlainLabel(wrap=True), "setup.problem", tr("What is missing"))
        self.accept = named(
            QPushButton(minimumHeight=38), "setup.accept", tr("Start the calibration")
        )
        self.accept.clicked.connect(lambda: self.accepted.emit(self.stated()))
        vbox(
            self._title,
            self._task,
            self._build_camera(),
            sensor,
            *groups,
            balls,
            self.problem,
            self.accept,
            None,
            of=holder,
        )
        self.show_session(session, new=True)

    # Supplied by the form

    def values_of(self, session: Any) -> Values:
        """Return the values of a session, and show those that are not in the form."""
        raise NotImplementedError

    def session_of(self, values: Any) -> Any:
        """Return the session shown last with other values."""
        raise NotImplementedError

    # The page

    def show_session(self, session: Any, *, new: bool) -> None:
        """Show the values of a session; `new`: the session is not on disk yet."""
        self._title.setVisible(new)
        self._task.setVisible(new)
        self.session = session
        self.values.show_value(self.values_of(session))
        self.ball.setValue(2.0 * (session.ball_default_radius_mm or USUAL_RADIUS_MM))
        self.accept.setText(tr("&Start the calibration") if new else tr("&Apply these values"))
        self._check()
        # The values of the fields, not of the session: the fields round them.
        self._known = self.stated()

    def stated(self) -> Any:
        """Return the session with the values of the form."""
        values = self.values.value
        serial, elastomer = values.serial.strip(), values.elastomer.strip()
        session = self.session_of(replace(values, serial=serial))
        radius = 0.5 * self.ball.value()
        return replace(session, ball_default_radius_mm=radius, elastomer=elastomer)

    @property
    def edited(self) -> bool:
        """Whether the user has changed a value since the form was filled."""
        return bool(self.stated() != self._known)

    def show_problem(self, sentence: str) -> None:
        """Show why the entered values were not applied."""
        self.problem.setText(sentence)
        show_meaning(self.problem, "fail")

    def _check(self) -> None:
        missing = not self.values.value.serial.strip()
        self.problem.setText(tr("Enter a serial number for the sensor.") if missing else "")
        self.accept.setEnabled(not missing)

    def _build_camera(self) -> QGroupBox:
        box = QGroupBox(tr("Camera"))
        self.camera = named(PlainLabel(wrap=True), "setup.camera", tr("Camera state"))
        self.camera_settings = named(
            QPushButton(tr("&Set and lock…")),
            "setup.camera.settings",
            tr("Set and lock the camera"),
            tr("Format, exposure, gain, white balance, focus, and a test of the image stability"),
        )
        self._camera_row = hbox((self.camera, 1), self.camera_settings, of=box)
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
    box = DoubleSpinBox(decimals=3, minimum=low, maximum=high, singleStep=0.1, suffix=tr(" mm"))
    return named(box, name, tr("{what} in mm").format(what=accessible))
