"""The Calibrate page: the start view, or the wizard of the open session."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QStackedWidget, QWidget

from app.calibrate.in_place_offer import copy_images, in_place_offer
from app.calibrate.session_camera import SetupCamera
from app.calibrate.setup_form import SetupForm
from app.calibrate.setup_values import new_session
from app.calibrate.start_view import QuestionView, StartView
from app.calibrate.wizard import Wizard
from app.context.context import AppContext
from app.widgets.layout import vbox
from app.widgets.naming import named
from app.widgets.question import ask
from app.workspace.sessions import unfinished
from app.workspace.workspace import folder_name
from gelpolight_core.calibration.project import Project
from gelpolight_core.errors import InputError
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr


class CalibratePage(QWidget):
    """Shows the start view, the form for a new session, or the wizard.

    Parameters
    ----------
    context : AppContext
        Context of the application.
    """

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        named(self, "calibrate", tr("Calibrate"))
        self.context = context
        self.wizard: Wizard | None = None
        self._shown = False
        self._stack = QStackedWidget()
        vbox(self._stack, of=self, margins=0)
        self.start = StartView()
        self.question = QuestionView()
        self.form = SetupForm()
        for view in (self.start, self.question, self.form):
            self._stack.addWidget(view)
        self.form.accepted.connect(self._begin)
        self.setup_camera = SetupCamera(self.form, context=context)
        self.start.new.clicked.connect(self.begin)
        self.start.open.clicked.connect(self.choose_folder)
        self.start.demo.clicked.connect(self.begin_demo)
        self.start.recent_wanted.connect(lambda folder: self.open_path(Path(folder)))
        self._offer: Session | None = None
        self.start.closed.clicked.connect(self._begin_closed)
        self.question.answered.connect(self._on_answer)
        self.question.back.clicked.connect(self._leave_session)
        context.source.changed.connect(self._on_source)
        self.start.show_recent(context.settings.recent("sessions"))

    # Called by the main window

    def enter(self) -> None:
        """Update the page and open the camera."""
        self._shown = True
        self.start.show_recent(self.context.settings.recent("sessions"))
        if self.wizard is not None:
            self.wizard.enter()

    def leave(self) -> None:
        """Release the camera."""
        self._shown = False
        if self.wizard is not None:
            self.wizard.leave()

    def may_close(self) -> bool:
        """Return True: all data is on disk; running work is stopped."""
        self._close_wizard()
        return True

    def open_path(self, path: Path) -> None:
        """Open a session folder; if this fails, show the reason on the start view."""
        folder = path.parent if path.name == "session.toml" else path
        try:
            project = Project(folder)
        except InputError as error:
            self._leave_session()
            self._offer = in_place_offer(folder)
            if self._offer is None:
                self.start.show_problem(str(error))
            else:
                self.start.show_problem(f"{error.where}: {error.found}.", closed=True)
            return
        self._show_wizard(project)

    # Starting a session

    def begin(self) -> None:
        """Ask the first question about a new sensor."""
        self._close_wizard()
        self._stack.setCurrentWidget(self.question)
        self.question.can.setFocus()

    def _begin_closed(self) -> None:
        """Show the form of a closed sensor for the folder that could not be opened."""
        if self._offer is not None:
            self._show_form(self._offer)

    def begin_demo(self) -> None:
        """Start with the virtual sensor."""
        self.context.source.choose_virtual_sensor()
        self.begin()

    def _on_answer(self, opens: bool) -> None:
        """Show the form for the sensor; what was typed before is kept."""
        typed, edited = self.form.values.value, self.form.edited and not self._is_virtual
        if edited and typed.optics == opens:
            self._show_form(None)
            return
        self._show_form(self._proposal(opens))
        if edited:
            self.form.values.change(serial=typed.serial, elastomer=typed.elastomer)

    def _show_form(self, session: Session | None) -> None:
        """Show the form, with the values of a new session if one is given."""
        if session is not None:
            self.form.show_session(session, new=True)
        self._stack.setCurrentWidget(self.form)
        self.form.serial.setFocus()

    def choose_folder(self) -> None:
        """Let the user choose a session folder."""
        chosen = QFileDialog.getExistingDirectory(
            self, tr("Open a session folder"), str(self.context.settings.folder("session"))
        )
        if chosen:
            self.context.settings.keep_folder("session", Path(chosen).parent)
            self.open_path(Path(chosen))

    @property
    def _is_virtual(self) -> bool:
        info = self.context.source.info
        return info is not None and info.kind == "virtual"

    def _proposal(self, opens: bool) -> Session:
        """Return the default values of a new session; for the virtual sensor they are known."""
        from app.bench.virtual_session import virtual_session

        return virtual_session(opens=opens) if self._is_virtual else new_session(optics=opens)

    def _on_source(self) -> None:
        """Fill in the known values of the virtual sensor when it is selected in a form."""
        if self._stack.currentWidget() is self.form and self._is_virtual:
            proposal = self._proposal(self.form.values.value.optics)
            self.form.show_session(proposal, new=True)

    def _begin(self, stated: Session) -> None:
        """Make a new session. Ask first if another one of this sensor is not finished."""
        workspace = self.context.workspace
        sessions = unfinished(workspace.sessions(), workspace.entries())
        other = next((s for s in sessions if s.serial == stated.serial and s.images), None)
        if other is None:
            self._create(stated)
            return
        text = tr(
            "Sensor {serial} has a session that is not finished: {name}, {n} images. A new session "
            "starts without these images."
        )
        ask(
            self,
            tr("Unfinished session"),
            text.format(serial=other.serial, name=other.folder.name, n=other.images),
            (tr("Continue it"), lambda: self.open_path(other.folder)),
            (tr("Make a new session"), lambda: self._create(stated)),
        )

    def _create(self, stated: Session) -> None:
        name = datetime.now().astimezone().strftime("%Y-%m-%d-%H%M%S")
        folder = self.context.workspace.sessions_folder(stated.serial) / folder_name(name)
        try:
            create_session(replace(stated, folder=folder, ball_radii_mm={}))
            project = Project(folder)
            if stated.in_place is not None and stated.folder != Path():
                copy_images(stated, project)
        except InputError as error:
            self.form.show_problem(str(error))
            return
        self._show_wizard(project)

    def _show_wizard(self, project: Project, *, step: str = "") -> None:
        self._close_wizard()
        self.start.show_problem("")
        self.wizard = Wizard(project, context=self.context)
        self.wizard.left.connect(self._leave_session)
        self.wizard.renewed.connect(lambda step: self._show_wizard(project, step=step))
        self._stack.addWidget(self.wizard)
        self._stack.setCurrentWidget(self.wizard)
        self.context.settings.add_recent("sessions", project.session.folder)
        known = step in [one.step.key for one in self.wizard.presenters]
        self.wizard.go_to(step if known else self.wizard.first_open_step())
        if self._shown:
            self.wizard.enter()

    def _leave_session(self) -> None:
        self._close_wizard()
        self.start.show_problem("")
        self.start.show_recent(self.context.settings.recent("sessions"))
        self._stack.setCurrentWidget(self.start)

    def _close_wizard(self) -> None:
        if self.wizard is not None:
            self.wizard.close_session()
            self._stack.removeWidget(self.wizard)
            self.wizard.deleteLater()
            self.wizard = None
