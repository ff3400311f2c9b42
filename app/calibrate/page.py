"""The Calibrate page: the first question about a sensor, its form, or the wizard of a session."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QUndoStack
from PySide6.QtWidgets import QPushButton, QStackedWidget, QWidget

from app.program.context import AppContext
from app.program.session_entries import unfinished_sessions
from app.program.workspace import folder_name
from app.widgets.actions import Slot, push_button
from app.widgets.dialog import ask
from app.widgets.label import PlainLabel
from app.widgets.layout import vbox
from app.widgets.text_roles import heading, named_label
from app.widgets.widget_names import set_names
from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import Session

from .setup_step import SetupForm
from .setup_values import copy_images, in_place_offer, new_session
from .wizard import Wizard

WIDTH = 460


class RouteQuestionView(QWidget):
    """Asks which route the calibration takes, and says why a session was not opened.

    Parameters
    ----------
    page : CalibratePage
        Gets the answer.
    """

    def __init__(self, page: CalibratePage) -> None:
        super().__init__()
        set_names(self, "question", "Can the sensor be opened?")
        self.problem = named_label("question.problem", "Why it was not opened", role="fail")
        title = heading("Can the sensor be opened?", size=1.6)
        tip = "Start a new session with the background and the ball presses of this folder"
        use_folder = "Calibrate it as a &closed sensor"
        self.use_folder = _choice("question.use_folder", use_folder, page.begin_closed, tip)
        opens, closed = partial(page.begin_form, True), partial(page.begin_form, False)
        self.can = _choice("question.open", "&Yes, the membrane can be taken off", opens)
        opened = PlainLabel(
            "Lens, top surface, lights and membrane are measured one by one, in nine steps. This "
            "gives the most exact depth. You need two checkerboards, a mirror, a white board and "
            "balls.",
            wrap=True,
        )
        cannot = _choice("question.closed", "&No, the membrane is bonded", closed)
        bonded = PlainLabel(
            "For GelSight Mini, DIGIT, 9DTact and most home-made sensors. A few steps: one image "
            "of the untouched membrane and some presses of a ball of known diameter.",
            wrap=True,
        )
        sessions = _choice("question.sessions", "Continue a &session", page.show_sessions)
        sessions.setFlat(True)
        texts = self.problem, opened, bonded
        for part in (*texts, self.use_folder, self.can, cannot, sessions):
            part.setFixedWidth(WIDTH)
        refused = self.problem, self.use_folder
        parts = title, *refused, self.can, opened, 10, cannot, bonded, 10, sessions
        vbox(*parts, of=self, spacing=10).setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.show_problem("")

    def show_problem(self, sentence: str, *, closed: bool = False) -> None:
        """Show why a session was not opened. An empty text hides the message.

        With `closed`, offer to use the folder for a closed sensor.
        """
        self.use_folder.setVisible(closed)
        if closed:
            sentence += (
                " If the sensor cannot be opened, calibrate it from its background and ball "
                "presses alone."
            )
        self.problem.setText(sentence)
        self.problem.setVisible(bool(sentence))


def _choice(name: str, text: str, slot: Slot, tip: str = "") -> QPushButton:
    """Return a wide button."""
    button = push_button(name, text, slot, tip=tip)
    button.setMinimumHeight(40)
    return button


class CalibratePage(QWidget):
    """Shows the first question, the form for a new session, or the wizard.

    Parameters
    ----------
    context : AppContext
        Context of the application.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        set_names(self, "calibrate", "Calibrate")
        self.context = context
        self.wizard: Wizard | None = None
        self._shown = False
        self._stack = QStackedWidget()
        vbox(self._stack, of=self, margins=0)
        self._offer: Session | None = None
        self.question = RouteQuestionView(self)
        self.form = SetupForm(context=context)
        for view in (self.question, self.form):
            self._stack.addWidget(view)
        self.form.accepted.connect(self._begin)
        context.source.changed.connect(self._on_source)

    # Called by the main window

    def enter(self) -> None:
        """Update the page and open the camera."""
        self._shown = True
        if self.wizard is not None:
            self.wizard.enter()

    def leave(self) -> None:
        """Release the camera."""
        self._shown = False
        if self.wizard is not None:
            self.wizard.leave()

    @property
    def history(self) -> QUndoStack | None:
        """What the edit menu undoes: captures and corrections of the session."""
        return None if self.wizard is None else self.wizard.model.undo

    def can_close(self) -> bool:
        """Stop running work, and return True: all data is on disk."""
        self._close_wizard()
        return True

    def open_path(self, path: Path) -> None:
        """Open a session folder, or show why this failed."""
        try:
            project = self._project(path)
        except InputError as error:
            offer = in_place_offer(path)
            problem = str(error) if offer is None else f"{error.where}: {error.found}."
            self.leave_session(problem, offer)
            return
        self._show_wizard(project)

    # Starting a session

    def begin(self) -> None:
        """Ask the first question about a new sensor."""
        self.leave_session()
        self.question.can.setFocus()

    def begin_demo(self) -> None:
        """Start with the virtual sensor."""
        self.context.source.choose_virtual_sensor()
        self.begin()

    def begin_closed(self) -> None:
        """Show the form of a closed sensor for the folder that could not be opened."""
        self._show_form(self._offer)

    def begin_form(self, opens: bool) -> None:
        """Show the form for the sensor, and keep what was typed before."""
        typed = self.form.values.value
        edited = self.form.edited and self.context.source.virtual is None
        if edited and typed.optics == opens:
            self._show_form(None)
            return
        self._show_form(self._proposal(opens))
        if edited:
            self.form.values.change(serial=typed.serial)

    def _show_form(self, session: Session | None) -> None:
        """Show the form, with the values of a new session if one is given."""
        if session is not None:
            self.form.show_session(session, new=True)
        self._stack.setCurrentWidget(self.form)
        self.form.serial.setFocus()

    def show_sessions(self) -> None:
        """Leave the session, and show the list of all sessions."""
        self.leave_session()
        self.context.requests.page.emit("sensors")

    def _proposal(self, opens: bool) -> Session:
        """Return the default values of a new session, for the virtual sensor the true ones."""
        from app.source_ui.virtual_session import virtual_session

        is_virtual = self.context.source.virtual is not None
        return virtual_session(opens=opens) if is_virtual else new_session(optics=opens)

    def _on_source(self) -> None:
        """Fill in the known values of the virtual sensor when it is selected in a form."""
        if self._stack.currentWidget() is self.form and self.context.source.virtual is not None:
            proposal = self._proposal(self.form.values.value.optics)
            self.form.show_session(proposal, new=True)

    def _begin(self, session: Session) -> None:
        """Make a new session. Ask first if another one of this sensor is not finished."""
        workspace = self.context.workspace
        sessions = unfinished_sessions(workspace.sessions(), workspace.entries())
        earlier = next((s for s in sessions if s.serial == session.serial and s.images), None)
        if earlier is None:
            self._create(session)
            return
        text = (
            f"Sensor {earlier.serial} has a session that is not finished: {earlier.folder.name}, "
            f"{earlier.images} images. A new session starts without these images."
        )
        ask(
            self,
            "Unfinished session",
            text,
            ("Continue it", lambda: self.open_path(earlier.folder)),
            ("Make a new session", lambda: self._create(session)),
        )

    def _project(self, folder: Path) -> CalibrationProject:
        """Return a session to calibrate for the user's tolerance of heights."""
        limits = self.context.settings.limits
        return CalibrationProject(folder, tolerance_percent=limits.height_percent)

    def _create(self, session: Session) -> None:
        name = datetime.now().astimezone().strftime("%Y-%m-%d-%H%M%S")
        folder = self.context.workspace.sessions_folder(session.serial) / folder_name(name)
        try:
            create_session(replace(session, folder=folder, ball_radii_mm={}))
            project = self._project(folder)
            if session.in_place is not None and session.folder != Path():
                copy_images(session, project)
        except InputError as error:
            self.form.show_problem(str(error))
            return
        self._show_wizard(project)

    def _show_wizard(self, project: CalibrationProject, *, step: str = "") -> None:
        self._close_wizard()
        self.wizard = Wizard(project, context=self.context)
        self.wizard.left.connect(self.show_sessions)
        self.wizard.renewed.connect(lambda step: self._show_wizard(project, step=step))
        self._stack.addWidget(self.wizard)
        self._stack.setCurrentWidget(self.wizard)
        self.context.settings.add_recent("sessions", project.session.folder)
        keys = [offered.key for offered in self.wizard.steps]
        self.wizard.go_to(step if step in keys else self.wizard.first_open_step())
        if self._shown:
            self.wizard.enter()

    def leave_session(self, problem: str = "", offer: Session | None = None) -> None:
        """Ask the first question, with the reason why a folder could not be opened as it is."""
        self._close_wizard()
        self._offer = offer
        self.question.show_problem(problem, closed=offer is not None)
        self._stack.setCurrentWidget(self.question)

    def _close_wizard(self) -> None:
        if self.wizard is not None:
            self.wizard.close_session()
            self._stack.removeWidget(self.wizard)
            self.wizard.deleteLater()
            self.wizard = None
