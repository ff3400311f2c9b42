"""The form of the set-up: camera, sensor, boards and balls of a session."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from PySide6.QtCore import QStandardPaths, QUrl, Signal
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import (
    QFileDialog,
    QFormLayout,
    QFrame,
    QPushButton,
    QScrollArea,
    QWidget,
)

from app.calibrate.setup_values import (
    OTHER,
    PRESETS,
    SetupValues,
    new_session,
    preset_text,
    session_of,
    values_of,
)
from app.widgets.buttons import push_button
from app.widgets.forms import Form
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import make_bold, set_property, show_meaning
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.session.session import Session, serial_fault
from gelpolight_core.set_up import judge_set_up
from gelpolight_core.translation import tr


class SetupForm(QScrollArea):
    """A form for the description of a session. What it asks follows from the session.

    Signals
    -------
    accepted(object)
        The session with the entered values, in the folder of the session shown last.
    """

    accepted = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        named(self, "setup", tr("Set-up"))
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        inside, holder = QWidget(), QWidget(maximumWidth=640, minimumWidth=320)
        self.setWidget(inside)
        hbox(None, (holder, 20), None, of=inside)
        self._title, self._task = PlainLabel(), PlainLabel(wrap=True)
        make_bold(self._title, size=1.35)
        self.values = Form(SetupValues(), "setup", at_once=True)
        # Rows that wrap have no height of their own in a scroll area.
        self.values.rows.setRowWrapPolicy(QFormLayout.RowWrapPolicy.DontWrapRows)
        self.values.changed.connect(self._on_changed)
        self.serial = self.values.inputs["serial"]
        self.facts = named(PlainLabel(wrap=True), "setup.facts", tr("About this kind of sensor"))
        self._prints = QWidget()
        boards = ("lens", tr("Print the board of the lens…")), ("top", tr("Print the other board…"))
        tip = tr(
            "Save this board as an A4 page to print at 100 % scale; measure the squares "
            "after printing"
        )
        buttons = (
            push_button(f"setup.{name}_board.print", text, partial(self._save_board, k), tip=tip)
            for k, (name, text) in enumerate(boards)
        )
        vbox(*buttons, of=self._prints, margins=0, spacing=8)
        self.problem = named(PlainLabel(wrap=True), "setup.problem", tr("What is missing"))
        self.accept = push_button("setup.accept", "", lambda: self.accepted.emit(self.stated()))
        self.accept.setAccessibleName(tr("Start the calibration"))
        self.accept.setMinimumHeight(38)
        set_property(self.accept, "primary", True)
        sensor = named(QFrame(), "card", tr("Sensor"))
        vbox(self.values, self.facts, self._prints, of=sensor, margins=16, spacing=8)
        parts = self._title, self._task, self._build_camera(), sensor, self.problem, self.accept
        vbox(*parts, None, of=holder, margins=(0, 16, 0, 16), spacing=16)
        self.show_session(new_session(), new=True)

    def show_session(self, session: Session, *, new: bool) -> None:
        """Show the values of a session; `new`: the session is not on disk yet."""
        self.session = session
        values = values_of(session)
        title = tr("Sensor data") if values.optics else tr("Closed sensor")
        task = tr(
            "Enter the values from the drawing of the housing and the data sheets of the "
            "parts. Every length here scales the result. You can change the values later. "
            "Then click the button at the bottom."
        )
        if not values.optics:
            task = tr(
                "The sensor is calibrated from one image of the untouched membrane and some "
                "presses of a ball of known diameter. Use the same image size, crop and exposure "
                "for all images."
            )
        for label, words in ((self._title, title), (self._task, task)):
            label.setText(words)
            label.setVisible(new)
        self.values.show_value(values)
        self.accept.setText(tr("&Start the calibration") if new else tr("&Apply these values"))
        self._check()
        self._known = self.stated()

    @property
    def first(self) -> QWidget:
        """The first value of the sensor."""
        return self.values.inputs["led_height_mm" if self.values.value.optics else "preset"]

    def stated(self) -> Session:
        """Return the session with the values of the form.

        Raises
        ------
        InputError
            If a text is not what it should be.
        """
        return session_of(self.session, self.values.value)

    @property
    def edited(self) -> bool:
        """Whether the user has changed a value since the form was filled."""
        try:
            return bool(self.stated() != self._known)
        except InputError:
            return True

    def show_problem(self, sentence: str) -> None:
        """Show why the entered values were not applied."""
        self.problem.setText(sentence)
        show_meaning(self.problem, "fail")

    def _on_changed(self, name: str, value: object) -> None:
        """Fill in what is known about a kind of sensor."""
        preset = PRESETS.get(str(value))
        if name == "preset" and preset is not None:
            percent = 100.0 * preset.mm_per_px_sd / preset.mm_per_px
            self.values.change(scale=preset.mm_per_px, scale_y=0.0, scale_sd=percent)
        self._check()

    def _check(self) -> None:
        values, problem = self.values.value, ""
        self.facts.setText(preset_text(values.preset))
        known = values.preset != OTHER and not values.optics
        self.facts.setVisible(known or values.source == "stated")
        self._prints.setVisible(values.optics)
        try:
            sensor = session_of(self.session, values).sensor
            unusual = () if not values.optics else judge_set_up(sensor)
        except InputError as error:
            unusual = ()
            problem = f"{error.found}. {error.advice}."
        if fault := serial_fault(values.serial.strip()):
            problem = tr("The serial number {what}").format(what=fault) + "."
        self.problem.setText(problem or " ".join(found.sentence for found in unusual))
        show_meaning(self.problem, "fail" if problem else "warn")
        self.accept.setEnabled(not problem)

    def _build_camera(self) -> QFrame:
        box = named(QFrame(), "card", tr("Camera"))
        self.camera = named(PlainLabel(wrap=True), "setup.camera", tr("Camera state"))
        self.camera_settings = named(
            QPushButton(tr("&Set and lock…")),
            "setup.camera.settings",
            tr("Set and lock the camera"),
            tr("Format, exposure, gain, white balance, focus, and a test of the image stability"),
        )
        hbox((self.camera, 1), self.camera_settings, of=box, margins=16)
        self.show_camera(tr("No camera is selected."), "", settable=False)
        return box

    def show_camera(self, text: str, role: str, *, settable: bool) -> None:
        """Show how the camera is set; enable the settings button if it can be set."""
        self.camera.setText(text)
        show_meaning(self.camera, role)
        self.camera_settings.setEnabled(settable)

    def _save_board(self, place: int) -> None:
        """Save a page with the board where the user chooses, and open it."""
        from gelpolight_core.export.board_page import write_board  # slow to import

        board = self.values.value.boards[place]
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
