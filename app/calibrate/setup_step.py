"""The set-up step: a form for the sensor, the boards and the balls."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QUrl, Signal
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QFormLayout, QFrame, QWidget

from app.program.context import AppContext
from app.program.file_dialogs import ask_save
from app.source_ui.source_button import show_settings_of_source
from app.widgets.actions import push_button
from app.widgets.forms import Form
from app.widgets.inputs import refusal
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.text_roles import heading, named_label, set_property, set_text_role
from app.widgets.widget_names import set_names
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Finding
from gelpolight_core.session.session import Session, serial_fault
from gelpolight_core.stages.leds.setup_checks import judge_set_up

from .page_state import StepState
from .session_camera import camera_state
from .setup_values import (
    OTHER,
    PRESETS,
    SetupValues,
    new_session,
    preset_text,
    session_of,
    values_of,
)
from .step import Step


def unusual_numbers(session: Session) -> tuple[Finding, ...]:
    """Return what is unusual about the stated numbers; a closed sensor states no optics."""
    if session.in_place is not None:
        return ()
    return judge_set_up(session.sensor, session.ball_default_radius_mm)


class SetupForm(QWidget):
    """A form for the description of a session. What it asks follows from the session.

    Parameters
    ----------
    context : AppContext
        Context with the cameras and the selected source.
    camera_fault : callable, optional
        Returns why the selected camera is not that of the session, or an empty text.

    Signals
    -------
    accepted(object)
        The session with the entered values, in the folder of the session shown last.
    """

    accepted = Signal(object)

    def __init__(self, *, context: AppContext, camera_fault: Callable[[], str] = str) -> None:
        super().__init__()
        self._context, self._camera_fault = context, camera_fault
        set_names(self, "setup", "Set-up")
        # The foot is always visible, below the part that scrolls.
        holder, foot = (QWidget(maximumWidth=640, minimumWidth=320) for _ in range(2))
        inside = QWidget()
        hbox(None, (holder, 20), None, of=inside)
        below, area = hbox(None, (foot, 20), None), scroll_area(inside)
        bar = area.verticalScrollBar()  # the foot is in the middle of what it leaves
        bar.rangeChanged.connect(
            lambda _, end: below.setContentsMargins(0, 0, bar.sizeHint().width() if end else 0, 0)
        )
        vbox((area, 1), below, of=self, margins=0, spacing=0)
        self._title, self._task = heading("", size=1.35), PlainLabel(wrap=True)
        self.values = Form(SetupValues(), "setup")
        # Rows that wrap have no height of their own in a scroll area.
        self.values.rows.setRowWrapPolicy(QFormLayout.RowWrapPolicy.DontWrapRows)
        self.values.changed.connect(self._on_changed)
        self.serial = self.values.inputs["serial"]
        self.facts = named_label("setup.facts", "About this kind of sensor")
        self._prints = QWidget()
        lens = "lens", "Print the board of the lens…"
        top = "top", "Print the board of the top surface…"
        tip = "An A4 page with this board, to print at 100 %; measure the squares after printing"
        buttons = (
            push_button(f"setup.{name}_board.print", text, partial(self._save_board, k), tip=tip)
            for k, (name, text) in enumerate((lens, top))
        )
        vbox(*buttons, of=self._prints, margins=0, spacing=8)
        self.problem = named_label("setup.problem", "What is missing")
        self.accept = push_button("setup.accept", "", self._on_accept)
        self.accept.setAccessibleName("Start the calibration")
        self.accept.setMinimumHeight(38)
        sensor = set_names(QFrame(), "card", "Sensor")
        vbox(self.values, self.facts, self._prints, of=sensor, margins=16, spacing=8)
        cards = self._title, self._task, self._build_camera(), sensor
        vbox(*cards, None, of=holder, margins=(0, 16, 0, 16), spacing=16)
        vbox(self.problem, self.accept, of=foot, margins=(0, 0, 0, 8), spacing=8)
        self.show_session(new_session(), new=True)
        for changed in (context.source.changed, context.cameras.changed):
            changed.connect(self._show_camera)
        self._show_camera()

    def show_session(self, session: Session, *, new: bool) -> None:
        """Show the values of a session. `new`: it is not on disk yet."""
        self.session = session
        values = values_of(session)
        title = "Sensor data" if values.optics else "Closed sensor"
        task = (
            "Enter the values from the drawing of the housing and the data sheets of the parts. "
            "Every length here scales the result. You can change the values later."
        )
        if not values.optics:
            task = (
                "The sensor is calibrated from one image of the untouched membrane and some "
                "presses of a ball of known diameter. Use the same image size, crop and exposure "
                "for all images."
            )
        for label, text in ((self._title, title), (self._task, task)):
            label.setText(text)
            label.setVisible(new)
        self.values.show_value(values)
        self.accept.setText("&Start the calibration" if new else "&Apply these values")
        self._known, self._new = self.stated(), new
        self._check()

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
        set_text_role(self.problem, "fail")

    def _on_accept(self) -> None:
        if fault := refusal(self):
            self.show_problem(fault)
        else:
            self.accepted.emit(self.stated())

    def _on_changed(self, name: str, value: object) -> None:
        """Fill in what is known about a kind of sensor."""
        preset = PRESETS.get(str(value))
        if name == "preset" and preset is not None:
            percent = 100.0 * preset.mm_per_px_sd / preset.mm_per_px
            self.values.change(scale=preset.mm_per_px, scale_y=0.0, scale_sd=percent)
        self._check()

    def _check(self) -> None:
        values, problem = self.values.value, ""
        self.facts.setText(preset_text(values))
        is_preset = values.preset != OTHER and not values.optics
        self.facts.setVisible(is_preset or values.source == "stated")
        self._prints.setVisible(values.optics)
        try:
            unusual = unusual_numbers(session_of(self.session, values))
        except InputError as error:
            unusual = ()
            problem = f"{error.found}. {error.advice}."
        if fault := serial_fault(values.serial.strip()):
            problem = f"The serial number {fault}."
        self.problem.setText(problem or " ".join(finding.sentence for finding in unusual))
        role = "fail" if self.edited else "muted"  # nothing is wrong before something is typed
        set_text_role(self.problem, role if problem else "warn")
        is_due = not problem and (self._new or self.edited)
        self.accept.setEnabled(is_due)
        set_property(self.accept, "primary", is_due)

    def _build_camera(self) -> QFrame:
        box = set_names(QFrame(), "card", "Camera")
        self.camera = named_label("setup.camera", "Camera state")
        self.camera_settings = push_button(
            "setup.camera.settings",
            "&Set and lock…",
            lambda: show_settings_of_source(self._context, self),
            accessible="Set and lock the camera",
            tip="Format, exposure, gain, white balance, focus, and the lock",
        )
        hbox((self.camera, 1), self.camera_settings, of=box, margins=16)
        return box

    def _show_camera(self) -> None:
        """Show the state of the camera. Enable the settings button if it can be set."""
        text, role, settable = camera_state(self._context)
        if fault := self._camera_fault():
            text, role = fault, "warn"
        self.camera.setText(text)
        set_text_role(self.camera, role)
        self.camera_settings.setEnabled(settable)

    def _save_board(self, place: int) -> None:
        """Save a page with the board where the user chooses, and open it."""
        from gelpolight_core.output.board_page import write_board  # slow to import

        board = self.values.value.boards[place]
        columns, rows = board.inner_corners
        proposed_name = f"checkerboard-{columns}x{rows}-{board.square_mm:g}mm.pdf"
        title, patterns = "Save a checkerboard to print", "PDF (*.pdf)"
        path = ask_save(self, self._context.settings, "board", title, proposed_name, patterns)
        if path is None:
            return
        try:
            write_board(board, path)
        except InputError as error:
            self.show_problem(str(error))
            return
        is_open = QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))
        self.problem.setText("" if is_open else f"Saved as {path}")
        set_text_role(self.problem, "")


class SetupStep(Step):
    """Shows the form, and applies it."""

    key, title, stages = "setup", "Set-up", ("response",)
    guide = "guide/calibrate", "1-set-up"
    task = "Enter what you know about the sensor. Every length here scales the result."

    def build(self) -> None:
        """Create the form."""
        fault = partial(self.model.camera.fault, ask=False)
        self.form = SetupForm(context=self.context, camera_fault=fault)
        self.form.accepted.connect(self._on_stated)
        self.form.values.changed.connect(lambda *_: self.model.changed.emit())

    @property
    def centre(self) -> QWidget:
        """The form."""
        return self.form

    def state(self) -> StepState:
        """Return whether what is stated is usual: a session is created with all values."""
        state, text = super().state() if self.stages else ("pass", "Stated")
        unusual = unusual_numbers(self.session)
        return ("warn", unusual[0].sentence) if unusual and state == "pass" else (state, text)

    def explain(self, state: str, sentence: str) -> str:
        """Return the message about the state, unless the form shows it."""
        return "" if sentence in self.form.problem.text() else sentence

    def is_finished(self, state: str) -> bool:
        """Return whether all values are applied."""
        return super().is_finished(state) and not self.form.edited

    def focus(self) -> QWidget:
        """Return the first value."""
        values = self.form.values
        return values.inputs["led_height_mm" if values.value.optics else "preset"]

    def enter(self) -> None:
        """Show the values of the session, unless there are changes that are not applied."""
        super().enter()
        if not self.form.edited:
            self.form.show_session(self.session, new=False)

    def leave(self) -> None:
        """Warn about changes that are not applied."""
        if self.form.edited:
            text = "The set-up changes are not applied yet. Apply them in the set-up step."
            self.context.toasts.show(text, "warn")

    def close(self) -> None:
        """Warn about changes that are lost."""
        if self.form.edited:
            self.context.toasts.show("The set-up changes were not applied.", "warn")

    def _on_stated(self, entered: Session) -> None:
        before = self.session
        self.model.correct("Set-up", self.project.describe, entered, before, None)
        if self.session is before:
            return  # the error message is already shown
        self.form.show_session(self.session, new=False)
        self.model.changed.emit()
        text = "Applied. The stages that depend on these values are computed again."
        self.model.show_notice(text, "pass")
